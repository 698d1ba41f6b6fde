"""The air's forces and moments on an aircraft of JSBSim, as coefficients in the axes of airrace.

The functions of an axis add up: DRAG, SIDE and LIFT in wind axes; ROLL, PITCH and YAW about the aerodynamic reference
point, whose arm `r` from the centre of mass makes moments of the forces: `M = M_aero + r x F`. The flow is that of
still air at sea level, without ground effect, flaps, slipstream and gear.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from airrace.files.inputs.jsbsim.airframe import SURFACES, Surface
from airrace.files.inputs.jsbsim.document import SLUG, JsbsimDocument
from airrace.files.inputs.jsbsim.functions import Functions, NotEvaluated
from airrace.model.aircraft import Airframe
from airrace.model.dynamics.aerodynamics import VISCOSITY
from airrace.model.dynamics.rigid_body import rotation_to_body
from airrace.model.environment import KAPPA, P_ISA, RHO_ISA
from airrace.optimal_control.quantities import FOOT
from airrace.optimal_control.trajectory import Array

POSITIONS: tuple[tuple[str, Surface, float], ...] = (
    *((name, surface, 1.0) for surface, name in SURFACES.items()),
    ("aileron", "xi", 1.0),
    ("right-aileron", "xi", -1.0),
)
"""JSBSim's names of what moves with the surfaces, and which way."""
AXES = ("DRAG", "SIDE", "LIFT", "ROLL", "PITCH", "YAW")


C_L, C_D, C_Y, C_l, C_m, C_n = range(6)
"""The coefficients of force in wind axes and of moment in body axes about the centre of mass, by their places."""


@dataclass(frozen=True)
class FlowState:
    """A state of flow and controls: airspeed (m/s), angles (rad), and rates made dimensionless with `b/(2V)` (p, r) and
    `cbar/(2V)` (q, alphadot)."""

    V: float
    alpha: float = 0.0
    beta: float = 0.0
    p: float = 0.0
    q: float = 0.0
    r: float = 0.0
    alphadot: float = 0.0
    eta: float = 0.0
    xi: float = 0.0
    zeta: float = 0.0


class JsbsimAerodynamics:
    """The aerodynamics of an aircraft; `left_out` says which functions were not evaluated, and why."""

    def __init__(
        self, document: JsbsimDocument, airframe: Airframe, arm: Array, travels: Mapping[Surface, float]
    ) -> None:
        section = document.section("aerodynamics")
        self.functions = Functions(section, document)
        self.left_out: list[str] = []
        self._airframe, self._arm, self._travels = airframe, arm, travels
        self._axes: dict[str, list[Element]] = {name: [] for name in AXES}
        for axis in section.root.findall("axis"):
            name = axis.get("name", "").upper()
            if name not in AXES or axis.get("frame") or axis.get("unit", "LBS") != "LBS":
                section.refuse(axis, f"is the axis {name!r} of another kind; read are {', '.join(AXES)} in pounds")
            self._axes[name] += axis.findall("function")
        self._leave_out_unknown()

    def properties(self, state: FlowState) -> dict[str, float]:
        """Return the values of JSBSim's properties in a state."""
        S, b, cbar = self._airframe.S / FOOT**2, self._airframe.b / FOOT, self._airframe.cbar / FOOT
        V, rho = state.V / FOOT, RHO_ISA / SLUG * FOOT**3
        per_span, per_chord, qbar = b / (2.0 * V), cbar / (2.0 * V), 0.5 * rho * V**2
        u, v, w = (V * row[0] for row in rotation_to_body(state.alpha, state.beta))
        values = {
            "metrics/Sw-sqft": S,
            "metrics/bw-ft": b,
            "metrics/cbarw-ft": cbar,
            "aero/alpha-wing-rad": state.alpha,
            "aero/alphadot-rad_sec": state.alphadot / per_chord,
            "aero/qbar-psf": qbar,
            "aero/qbar-area": qbar * S,
            "aero/bi2vel": per_span,
            "aero/ci2vel": per_chord,
            "aero/Re": RHO_ISA * state.V * self._airframe.cbar / VISCOSITY,
            "aero/h_b-mac-ft": 1e6,
            "aero/h_b-cg-ft": 1e6,
            "velocities/vt-fps": V,
            "velocities/mach": state.V / math.sqrt(KAPPA * P_ISA / RHO_ISA),
            "velocities/u-aero-fps": u,
            "velocities/v-aero-fps": v,
            "velocities/w-aero-fps": w,
            "atmosphere/rho-slugs_ft3": rho,
        }
        for name, angle in (("alpha", state.alpha), ("beta", state.beta)):
            values |= {f"aero/{name}-rad": angle, f"aero/{name}-deg": math.degrees(angle)}
            values |= {f"aero/mag-{name}-rad": abs(angle), f"aero/mag-{name}-deg": abs(math.degrees(angle))}
        for axis, rate in (("p", state.p / per_span), ("q", state.q / per_chord), ("r", state.r / per_span)):
            values[f"velocities/{axis}-aero-rad_sec"] = values[f"velocities/{axis}-rad_sec"] = rate
        for name, surface, sign in POSITIONS:
            angle: float = sign * getattr(state, surface)
            share = angle / self._travels[surface]
            units = {"pos-rad": angle, "pos-deg": math.degrees(angle), "pos-norm": share, "cmd-norm": share}
            values |= {f"fcs/{name}-{unit}": value for unit, value in units.items()}
            values |= {f"fcs/mag-{name}-{unit}": abs(value) for unit, value in units.items()}
        return values

    def coefficients(self, state: FlowState, properties: Mapping[str, float] | None = None) -> Array:
        """Return the six coefficients in a state, in the order above.

        Args:
            state: of which alpha and beta turn forces between body and wind axes.
            properties: values of JSBSim's properties; None for those of the state.
        """
        values = dict(self.properties(state) if properties is None else properties)
        load = values["aero/qbar-psf"] * values["metrics/Sw-sqft"]
        values["aero/cl-squared"] = (self._total("LIFT", values) / load) ** 2
        drag, side, lift, *moments = (self._total(axis, values) / load for axis in AXES)
        R_BA = np.array(rotation_to_body(state.alpha, state.beta), dtype=np.float64)
        shifted = np.array(moments) * FOOT + np.cross(self._arm, R_BA @ np.array([-drag, side, -lift]))
        b, cbar = self._airframe.b, self._airframe.cbar
        return np.array([lift, drag, side, *(shifted / [b, cbar, b])])

    def _total(self, axis: str, values: Mapping[str, float]) -> float:
        total = 0.0
        for function in self._axes[axis]:
            try:
                total += self.functions.value(function, values)
            except NotEvaluated as reason:
                self.functions.section.refuse(function, str(reason))
            if not math.isfinite(total):
                self.functions.section.refuse(function, "is not finite at some angle of attack")
        return total

    def _leave_out_unknown(self) -> None:
        values = self.properties(FlowState(50.0, alpha=0.02, beta=0.01)) | {"aero/cl-squared": 0.04}
        for axis, functions in self._axes.items():
            for function in list(functions):
                try:
                    self.functions.value(function, values)
                except RecursionError:
                    self.functions.section.refuse(function, "depends on itself")
                except NotEvaluated as reason:
                    functions.remove(function)
                    self.left_out.append(f"{axis}: the function {function.get('name', '')}: {reason}")
