"""An aircraft of JSBSim in terms of airrace: derivatives and tables of its coefficients, and what was not taken over.

Lift, drag and pitching moment come from a sweep of the angle of attack at the speed at which `C_L_CRUISE` carries the
aircraft at sea level, with everything else neutral. Derivatives are central differences at that lift; those that change
with lift are fitted by lines over the linear part of the lift curve.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from airrace.files.inputs.jsbsim.aerodynamics import C_D, C_L, C_Y, C_l, C_m, C_n, FlowState, JsbsimAerodynamics
from airrace.files.inputs.jsbsim.airframe import SURFACES, Surface, read_airframe, read_travels
from airrace.files.inputs.jsbsim.document import read_jsbsim
from airrace.files.inputs.jsbsim.propulsion import PropellerEngine, read_engines, thrust_table
from airrace.model.aircraft import (
    AerodynamicTables,
    Aircraft,
    Drag,
    Lift,
    PitchMoment,
    Propulsion,
    RollMoment,
    SideForce,
    YawMoment,
)
from airrace.model.dynamics.flight_manual import Relations, stall_speed
from airrace.model.environment import RHO_ISA, g0
from airrace.model.splines import Table
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Array, Indices

C_L_CRUISE = 0.3
SWEEP = np.radians(np.arange(-25.0, 35.25, 0.25))
"""The angles of attack within which the stall is looked for, rad."""
BEYOND = 20
"""Points of the sweep that the table of lift has beyond the stall."""
KNOTS = 30
"""The largest number of knots of a table."""
LINEAR_PART = 0.6
"""The share of `C_L_max` and `C_L_min` within which lift counts as linear."""
BETA_STEP, RATE_STEP, DEFLECTION_SHARE = math.radians(2.0), 0.01, 0.25
"""Half of the differences: sideslip (rad), dimensionless rates, share of a surface's travel."""
NEGLIGIBLE = 1e-4
"""A coefficient below this is not worth a remark."""
SPEEDS, DENSITIES = tuple(map(float, range(0, 131, 10))), (0.9, 1.0, 1.1, RHO_ISA)
"""Airspeeds (m/s) and densities (kg/m3) of the table of thrust."""
SET = "JSBSim"
"""The relation of a number that comes from the file."""
GROUPS = ("airframe", "lift", "drag", "side_force", "roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class JsbsimAircraft:
    """An aircraft that is read from JSBSim's file.

    Attributes:
        aircraft: what it is in airrace.
        aerodynamics: the functions that it was made from.
        engines: its engines, empty where they were not taken over.
        relations: where each of its numbers comes from; what has none is the template's.
        remarks: what was not taken over, and why.
    """

    aircraft: Aircraft
    aerodynamics: JsbsimAerodynamics
    engines: Sequence[PropellerEngine]
    relations: Relations
    remarks: Sequence[str]


def read_jsbsim_aircraft(path: Path, template: Aircraft) -> JsbsimAircraft:
    """Read an aircraft of JSBSim; what its file does not have is the template's.

    Raises:
        InputError: it is no aircraft of JSBSim, or holds no lift that grows with the angle of attack.
    """
    document = read_jsbsim(path)
    root = document.root
    if root.tag != "fdm_config":
        document.refuse(root, f"is no aircraft of JSBSim: its root is <{root.tag}>, not <fdm_config>")
    airframe, arm = read_airframe(document)
    surfaces: Mapping[Surface, Interval] = {name: getattr(template.surfaces, name) for name in SURFACES}
    travels, remarks = read_travels(document, {name: travel.upper for name, travel in surfaces.items()})
    aerodynamics = JsbsimAerodynamics(document, airframe, arm, travels)
    V = math.sqrt(2.0 * airframe.m * g0 / (RHO_ISA * airframe.S * C_L_CRUISE))
    derivation = _Derivation(aerodynamics, V, travels)
    attached, linear = derivation.lift_range()
    if len(attached) < 3:
        document.refuse(root, "has no lift that grows with the angle of attack")
    engines, no_engine = read_engines(document)
    lift, lift_table = derivation.lift(attached, linear)
    of_template = {"beta_A_max"}
    for name, edge, place in (("C_L_max", len(SWEEP) - 1, -1), ("C_L_min", 0, 0)):
        if attached[place] == edge:
            lift = dataclasses.replace(lift, **{name: getattr(template.lift, name)})
            of_template.add(name)
            remarks.append(f"{name}: no stall within {math.degrees(SWEEP[edge]):.0f} deg; it is the template's")
    drag, drag_table = derivation.drag(attached, template.drag.beta_A_max)
    propulsion, thrust = template.propulsion, template.tables and template.tables.thrust
    if engines:
        thrust = thrust_table(engines, SPEEDS, DENSITIES)
        propulsion = _fitted_propulsion(engines, thrust, template)
    else:
        remarks.append(
            f"propulsion, {no_engine}: the template's is in its place, as only piston and electric engines "
            "with propellers are read"
        )
    aircraft = dataclasses.replace(
        template,
        name=root.get("name", path.stem),
        airframe=airframe,
        lift=lift,
        drag=drag,
        pitch=derivation.pitch(linear),
        **derivation.lateral(linear),
        propulsion=propulsion,
        surfaces=dataclasses.replace(
            template.surfaces, **{name: Interval(-travel, travel) for name, travel in travels.items()}
        ),
        linear=None,
        tables=AerodynamicTables(lift_table, drag_table, thrust, airframe.cbar),
    )
    aircraft = _with_roll_limits(aircraft, template)
    relations: dict[tuple[str, str], str] = {}
    for group in GROUPS:
        numbers: object = getattr(aircraft, group)
        relations |= {(group, name): SET for name in vars(numbers) if name not in of_template}
    relations |= {("surfaces", f"{name.removeprefix('left-')}_travel_deg"): SET for name in SURFACES.values()}
    relations |= {("propulsion", name): SET for name in ("P_max", "eta_p", "T_static") if engines}
    relations |= {("point_mass", name): "full ailerons at V_A, at most the template's" for name in ("p", "p_dot")}
    remarks += [*aerodynamics.left_out, *derivation.remarks(), *_left_out(root, engines)]
    return JsbsimAircraft(aircraft, aerodynamics, engines, relations, remarks)


def _left_out(root: Element, engines: Sequence[PropellerEngine]) -> list[str]:
    remarks = ["ground effect, slipstream, flaps, gear and stall hysteresis: the flow is free, still and clean"]
    if root.find("mass_balance/pointmass/form") is not None:
        remarks.append("forms of point masses: they have no inertia of their own here")
    if any(engine.piston for engine in engines):
        remarks.append("piston engines: power is maxhp in proportion to rpm and density, without mixture and manifold")
    for name in ("external_reactions", "buoyant_forces", "aerodynamics/aero_ref_pt_shift_x"):
        if root.find(name) is not None:
            remarks.append(f"<{name.rpartition('/')[2]}>: airrace has nothing of the kind")
    return [*remarks, "limits of speed and load factor: JSBSim has none; they are the template's, so set your own"]


def _fitted_propulsion(engines: Sequence[PropellerEngine], table: Table, template: Aircraft) -> Propulsion:
    """Return the formula that fits the thrust at sea level best within the envelope."""
    P_max, speeds = sum(engine.P_max for engine in engines), np.array(SPEEDS)
    T = np.array(table.values)[:, -1]
    flown = (speeds <= template.envelope.V.upper) & (T > 0.0)
    efficiencies, factors = np.meshgrid(np.linspace(0.2, 0.99, 80), np.linspace(0.5, 3.0, 101), indexing="ij")
    P, T_static = efficiencies * P_max, factors * T.max()
    formulas = P / np.hypot(speeds[flown, None, None], P / T_static)
    best = np.unravel_index(np.argmin(np.sum((formulas - T[flown, None, None]) ** 2, axis=0)), P.shape)
    return Propulsion(P_max, float(efficiencies[best]), float(T_static[best]), template.propulsion.tau_T)


def _with_roll_limits(aircraft: Aircraft, template: Aircraft) -> Aircraft:
    """Return an aircraft that rolls as fast as its ailerons make it at V_A, but no faster than the template may."""
    airframe, roll, limits = aircraft.airframe, aircraft.roll, template.point_mass
    V = min(stall_speed(aircraft) * math.sqrt(template.envelope.n_z.upper), template.envelope.V.upper)
    C_l = abs(roll.C_lxi) * aircraft.surfaces.xi.upper
    p = C_l / max(-roll.C_lp, 1e-9) * 2.0 * V / airframe.b
    p_dot = 0.5 * RHO_ISA * V**2 * airframe.S * airframe.b * C_l / airframe.I_x
    point_mass = dataclasses.replace(limits, p=min(p, limits.p), p_dot=min(p_dot, limits.p_dot))
    return dataclasses.replace(aircraft, point_mass=point_mass)


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Return slope and value at 0 of the line through points."""
    line: Array = np.polyfit(x, y, 1)
    return float(line[0]), float(line[1])


class _Derivation:
    """Coefficients and derivatives of one aircraft at one speed (m/s)."""

    def __init__(self, aerodynamics: JsbsimAerodynamics, V: float, travels: Mapping[Surface, float]) -> None:
        self._aerodynamics, self._V = aerodynamics, V
        self._steps = {"beta": BETA_STEP} | dict.fromkeys(("p", "q", "r", "alphadot"), RATE_STEP)
        self._steps |= {surface: DEFLECTION_SHARE * travel for surface, travel in travels.items()}
        self.sweep = np.array([self._at(alpha) for alpha in SWEEP.tolist()]).T
        self._cruise = float(SWEEP[int(np.argmin(np.abs(self.sweep[C_L] - C_L_CRUISE)))])
        self.by = {variable: self._derivatives(variable, self._cruise) for variable in self._steps}

    def lift_range(self) -> tuple[Indices, Indices]:
        """Return the places of the sweep from stall to stall, and those where lift is linear."""
        lift, middle = self.sweep[C_L], int(np.argmin(np.abs(SWEEP)))
        top = middle + int(np.argmax(lift[middle:]))
        bottom = int(np.flatnonzero(lift[: middle + 1] == lift[: middle + 1].min())[-1])
        attached = np.arange(bottom, top + 1)
        most, least = LINEAR_PART * lift[top], LINEAR_PART * min(lift[bottom], 0.0)
        linear = attached[(lift[attached] >= least) & (lift[attached] <= most)]
        return attached, linear if len(linear) > 2 else attached

    def lift(self, attached: Indices, linear: Indices) -> tuple[Lift, Table]:
        C_Lalpha, C_L0 = _line(SWEEP[linear], self.sweep[C_L, linear])
        C_L_max, C_L_min = self.sweep[C_L, attached[[-1, 0]]].tolist()
        first, last = max(0, int(attached[0]) - BEYOND), min(len(SWEEP) - 1, int(attached[-1]) + BEYOND)
        knots = np.unique(np.linspace(first, last, KNOTS).round().astype(int))
        table = Table((tuple(SWEEP[knots].tolist()),), tuple((value,) for value in self.sweep[C_L, knots].tolist()))
        C_Lq, C_Leta = self.by["q"][C_L], self.by["eta"][C_L]
        return Lift(C_L0, C_Lalpha, float(C_Lq), float(C_Leta), C_L_max, C_L_min), table

    def drag(self, attached: Indices, beta_max: float) -> tuple[Drag, Table]:
        """Return the table over the lift coefficient, and a parabola with its vertex for estimates beside it."""
        lift, drag = self.sweep[C_L, attached], self.sweep[C_D, attached]
        vertex = int(np.argmin(drag))
        squares = (lift - lift[vertex]) ** 2
        k = float(squares @ (drag - drag[vertex]) / (squares @ squares))
        betas = np.linspace(-beta_max, beta_max, 9)
        added = np.array([self._at(self._cruise, beta=beta)[C_D] for beta in betas.tolist()])
        added -= self._at(self._cruise)[C_D]
        C_Dbeta2 = max(0.0, float(added @ betas**2 / (betas**2 @ betas**2)))
        places = [0]
        for place in range(1, len(lift)):
            if lift[place] - lift[places[-1]] >= (lift[-1] - lift[0]) / KNOTS:
                places.append(place)
        Re = self._aerodynamics.properties(FlowState(self._V))["aero/Re"]
        table = Table((tuple(lift[places].tolist()), (Re,)), tuple((value,) for value in drag[places].tolist()))
        return Drag(float(drag[vertex]), k, float(lift[vertex]), C_Dbeta2, beta_max), table

    def pitch(self, linear: Indices) -> PitchMoment:
        C_malpha, C_m0 = _line(SWEEP[linear], self.sweep[C_m, linear])
        return PitchMoment(C_m0, C_malpha, *(float(self.by[name][C_m]) for name in ("q", "alphadot", "eta")))

    def lateral(self, linear: Indices) -> dict[str, SideForce | RollMoment | YawMoment]:
        places = linear[:: max(1, len(linear) // 8)]
        lift, alphas = self.sweep[C_L, places], SWEEP[places].tolist()
        C_lr_per_C_L, C_lr = _line(lift, np.array([self._derivatives("r", alpha)[C_l] for alpha in alphas]))
        C_np_per_C_L, C_np = _line(lift, np.array([self._derivatives("p", alpha)[C_n] for alpha in alphas]))
        # a positive deflection makes a negative moment about its own axis
        xi, zeta = -np.sign(self.by["xi"][C_l]) * self.by["xi"], -np.sign(self.by["zeta"][C_n]) * self.by["zeta"]
        causes = np.array([self.by["beta"], self.by["p"], self.by["r"], xi, zeta]).T
        (Y_beta, Y_p, Y_r, Y_xi, Y_zeta), (l_beta, l_p, _, l_xi, l_zeta) = causes[[C_Y, C_l]].tolist()
        n_beta, _, n_r, n_xi, n_zeta = causes[C_n].tolist()
        return {
            "side_force": SideForce(Y_beta, Y_p, Y_r, Y_xi, Y_zeta),
            "roll": RollMoment(l_beta, l_p, C_lr, C_lr_per_C_L, l_xi, l_zeta),
            "yaw": YawMoment(n_beta, C_np, C_np_per_C_L, n_r, n_xi, n_zeta),
        }

    def remarks(self) -> list[str]:
        """Return what of the coefficients has no place in an aircraft."""
        remarks: list[str] = []
        if abs(rate := self.by["alphadot"][C_L]) > NEGLIGIBLE:
            remarks.append(f"lift due to the rate of the angle of attack, {rate:.3g} per rad: airrace has none")
        deflected = self._at(self._cruise, eta=self._steps["eta"])
        if abs(deflected[C_D] - self._at(self._cruise)[C_D]) > NEGLIGIBLE:
            remarks.append("drag due to deflections of the controls: airrace has none")
        assumed = sorted(self._aerodynamics.functions.assumed - {"aero/cl-squared"})
        return [*remarks, *([f"properties without a value, counted as 0: {', '.join(assumed)}"] if assumed else [])]

    def _at(self, alpha: float, **motion: float) -> Array:
        return self._aerodynamics.coefficients(dataclasses.replace(FlowState(self._V, alpha), **motion))

    def _derivatives(self, variable: str, alpha: float) -> Array:
        step = self._steps[variable]
        above, below = self._at(alpha, **{variable: step}), self._at(alpha, **{variable: -step})
        return (above - below) / (2.0 * step)
