"""Our aircraft in JSBSim: single motions, an optimum put back onto its path every second, and random accelerations.

    R_OB = R_OKbar R_BKbar^T        V_B = R_BKbar V_K e_x

O is the local frame where the flight begins; JSBSim measures the way from there in the plane that touches its sea
level.

Between the nodes deflections are linear, and the throttle follows its command:
`delta_T_dot = (delta_T_cmd - delta_T) / tau_T`.

What is left is mostly JSBSim's rate of alpha, which lags by one step: in a hard pull-up 8 mm after a second, half of
that with half the step, and 0.5 mm for an aircraft without `C_malphadot`.

Accelerations in random states are compared at the same geopotential height. The density of both is ISA. Ours falls with
the height h itself; JSBSim's with the geopotential height `R h / (R + h)`, for the standard was written for a gravity
that weakens with height. At 1000 m that is 0.16 m, or 1.5e-5 of the density. The rest, 2.7e-6, is in the digits of the
gas constant.
"""

import dataclasses
import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from airrace.errors import UsageError
from airrace.model.aircraft import InnerLoopParameters
from airrace.model.dynamics.limits import SurfaceControl
from airrace.model.dynamics.rigid_body import rotation_to_body
from airrace.model.dynamics.six_dof import SixDofState, six_dof
from airrace.model.environment import T_ISA, Air, AtmosphereParameters, Weather, WindField, density, g0
from airrace.model.frames import angles, rotation
from airrace.optimal_control.quantities import DEGREE, FOOT
from airrace.optimal_control.trajectory import Array, Trajectory
from jsbsim_aircraft.aircraft_xml import (
    DENSITY,
    MOVED,
    NAME,
    POUND_FORCE,
    PRESSURE,
    RANKINE,
    SLUG,
    Planet,
    write_model,
)

ADAMS_BASHFORTH_3, BUSS_2 = 4.0, 7.0
"""JSBSim's numbers of its integrators: third order with a memory; second order on the sphere of the quaternions."""
INTEGRATORS = {
    "rate/rotational": ADAMS_BASHFORTH_3,
    "rate/translational": ADAMS_BASHFORTH_3,
    "position/rotational": BUSS_2,
    "position/translational": ADAMS_BASHFORTH_3,
}


STEP = 1e-3
"""The step of JSBSim's integration, s."""
EARTH_RADIUS = 6356766.0
"""The Earth's radius in the definition of the geopotential height, m [ISO 2533]."""


@dataclasses.dataclass(frozen=True, eq=False)
class Accelerations:
    """The specific force (what accelerometers read, m/s2) and the angular acceleration (rad/s2).

    Both are in body axes, shape (3,).
    """

    specific_force: Array
    angular: Array


def body_attitude(state: SixDofState[float]) -> Array:
    """Return the attitude `R_OB` of a state, shape (3, 3)."""
    return np.array(rotation(state.q)) @ np.array(rotation_to_body(state.alpha_K, state.beta_K), dtype=np.float64).T


class SimulatedAircraft:
    """An aircraft simulated by JSBSim in still air."""

    def __init__(
        self, folder: Path, atmosphere: AtmosphereParameters[float], planet: Planet, *, own_density: bool = True
    ) -> None:
        """Load the model that `write_model` wrote.

        Args:
            folder: holds the model.
            atmosphere: the atmosphere of the day.
            planet: what it flies over.
            own_density: whether JSBSim's atmosphere makes the density; else it is ours where the flight starts, and
                stays.

        Raises:
            UsageError: JSBSim is not installed, or does not take the model.
        """
        try:
            import jsbsim
        except ImportError as error:
            raise UsageError("JSBSim is not installed: pip install jsbsim") from error
        self.atmosphere, self._own_density = atmosphere, own_density
        jsbsim.FGJSBBase().debug_lvl = 0
        self._jsbsim = jsbsim.FGFDMExec(None)
        self._jsbsim.set_debug_level(0)
        if not self._jsbsim.load_model_with_paths(NAME, str(folder), str(folder), str(folder)):
            raise UsageError(f"JSBSim does not take the model in {folder}")
        self._jsbsim.set_dt(STEP)
        for name, kind in INTEGRATORS.items():
            self._jsbsim[f"simulation/integrator/{name}"] = kind
        self._jsbsim["atmosphere/delta-T"] = (atmosphere.T_0 - T_ISA) / RANKINE
        self._jsbsim["atmosphere/P-sl-psf"] = atmosphere.p_0 / PRESSURE
        self._jsbsim["ic/lat-geod-rad"] = planet.latitude

    def start(self, state: SixDofState[float]) -> None:
        """Put the aircraft into a state, deflections and throttle included; its north and east are ignored."""
        self.control({name: getattr(state, name) for name in MOVED})
        if not self._own_density:
            self._jsbsim["atmosphere/override/density"] = density(state.z, self.atmosphere) / DENSITY
        psi, theta, phi = angles(body_attitude(state).tolist())
        u, v, w = state.V_K * np.array(rotation_to_body(state.alpha_K, state.beta_K), dtype=np.float64)[:, 0]
        initial = [("h-sl-ft", (self.atmosphere.elevation - state.z) / FOOT)]
        # JSBSim reads the other angles back from the attitude, so the one that may be vertical comes last
        initial += [("theta-rad", 0.0), ("phi-rad", phi), ("psi-true-rad", psi), ("theta-rad", theta)]
        initial += [("u-fps", u / FOOT), ("v-fps", v / FOOT), ("w-fps", w / FOOT)]
        initial += [("p-rad_sec", state.p_K), ("q-rad_sec", state.q_K), ("r-rad_sec", state.r_K)]
        for name, value in initial:
            self._jsbsim[f"ic/{name}"] = float(value)
        self._jsbsim.run_ic()

    def control(self, moved: Mapping[str, float]) -> None:
        """Set deflections (rad) and throttle by name."""
        for name, value in moved.items():
            self._jsbsim[f"{NAME}/{name}"] = value

    def advance(self) -> None:
        """Advance by one step: first the state with the earlier rates, then the rates with the present controls."""
        self._jsbsim.run()

    def accelerations(self) -> Accelerations:
        """Return the accelerations that the present forces and moments cause."""
        mass = self._jsbsim["inertia/mass-slugs"] * SLUG
        force = np.array([self._jsbsim[f"forces/fb{axis}-total-lbs"] for axis in "xyz"]) * POUND_FORCE
        angular = np.array([self._jsbsim[f"accelerations/{axis}dot-rad_sec2"] for axis in "pqr"])
        return Accelerations(force / mass, angular)

    def density(self) -> float:
        """Return the density of the air, kg/m3."""
        return self._jsbsim["atmosphere/rho-slugs_ft3"] * DENSITY

    def position(self) -> Array:
        """Return north and east of the start and down from the track's origin, m; shape (3,)."""
        north, east, up = (self._jsbsim[f"position/from-start-neu-{axis}-ft"] * FOOT for axis in "neu")
        return np.array([north, east, self.atmosphere.elevation - up])

    def attitude(self) -> Array:
        """Return the attitude `R_OB`, shape (3, 3)."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PendingDeprecationWarning)  # JSBSim's own use of numpy.matrix
            return np.asarray(self._jsbsim.get_propagate().get_Tl2b(), dtype=np.float64).T


def simulate(
    folder: Path,
    aircraft: InnerLoopParameters[float],
    atmosphere: AtmosphereParameters[float],
    planet: Planet,
    *,
    own_density: bool = True,
) -> SimulatedAircraft:
    """Write the model of an aircraft into the folder and load it; see `SimulatedAircraft`."""
    write_model(folder, aircraft, planet)
    return SimulatedAircraft(folder, atmosphere, planet, own_density=own_density)


@dataclasses.dataclass(frozen=True)
class Miss:
    """The distance from the optimum at which a piece of a flight by JSBSim ends.

    Attributes:
        start, end: the ends of the piece, s from the start of the race.
        distance: the distance between the positions at its end, m.
        angle: the angle between the attitudes of the body there, rad.
    """

    start: float
    end: float
    distance: float
    angle: float


def fly_course(
    simulation: SimulatedAircraft, optimum: Trajectory, at: Callable[[Array], Mapping[str, Array]], tau_T: float
) -> tuple[Miss, ...]:
    """Fly every piece of the optimum by JSBSim with the optimum's controls; the last piece may be shorter.

    Args:
        simulation: the aircraft in the air of the day.
        optimum: an optimum of the six-dof model, in still air.
        at: states of the optimum at any times (s, shape (n,)), by name.
        tau_T: the time constant of the throttle, s.
    """
    steps = round(1.0 / STEP)  # s, which JSBSim flies without being put back onto the optimum
    last = math.floor(optimum.race_time / STEP + 1e-6)  # a race of whole steps is simulated to its end
    first = np.arange(0, last, steps)
    ends = np.minimum(first + steps, last)
    starts, goals = (_states(at(count.astype(np.float64) * STEP)) for count in (first, ends))
    misses: list[Miss] = []
    for start, goal, begin, end in zip(starts, goals, first.tolist(), ends.tolist(), strict=True):
        simulation.start(start)
        below = np.array([start.x, start.y, 0.0])
        for moved in _controls(optimum, np.arange(begin + 1.0, end + 1.0) * STEP, tau_T):
            simulation.control(moved)
            simulation.advance()
        distance = np.linalg.norm(below + simulation.position() - np.array([goal.x, goal.y, goal.z]))
        # of the rotation between two attitudes: |R_1 - R_2| = 2 sqrt(2) sin(angle / 2)
        turned = np.linalg.norm(simulation.attitude() - body_attitude(goal)) / np.sqrt(8.0)
        angle = float(2.0 * np.arcsin(min(1.0, turned)))
        misses.append(Miss(begin * STEP, end * STEP, float(distance), angle))
    return tuple(misses)


def _states(histories: Mapping[str, Array]) -> list[SixDofState[float]]:
    rows = [histories[name].tolist() for name in SixDofState.names()]
    return [SixDofState[float].split(column) for column in zip(*rows, strict=True)]


def _controls(optimum: Trajectory, times: Array, tau_T: float) -> list[dict[str, float]]:
    """Return deflections (rad) and throttle at given times."""
    interval = np.clip(np.searchsorted(optimum.time, times, side="right") - 1, 0, len(optimum.time) - 2)
    since = times - optimum.time[interval]
    histories = {
        rate.rate_of: optimum[rate.rate_of][interval] + optimum[rate.name][interval] * since
        for rate in SurfaceControl.quantities()
        if rate.rate_of
    }
    commanded = optimum["delta_T_cmd"][interval]
    histories["delta_T"] = commanded + (optimum["delta_T"][interval] - commanded) * np.exp(-since / tau_T)
    rows = zip(*(values.tolist() for values in histories.values()), strict=True)
    return [dict(zip(histories, row, strict=True)) for row in rows]


def geopotential_height(h: float) -> float:
    """Return the height (m) at which constant gravity gives the potential that h (m above sea level) has."""
    return EARTH_RADIUS * h / (EARTH_RADIUS + h)


def at_geopotential_height(state: SixDofState[float], air: AtmosphereParameters[float]) -> SixDofState[float]:
    """Return the state moved down to where our density is that of JSBSim."""
    return dataclasses.replace(state, z=air.elevation - geopotential_height(air.elevation - state.z))


RANGES = {
    "V_K": (45.0, 130.0),
    "alpha_K": (-10.0 * DEGREE, 20.0 * DEGREE),
    "beta_K": (-12.0 * DEGREE, 12.0 * DEGREE),
    "p_K": (-7.0, 7.0),
    "q_K": (-2.0, 2.0),
    "r_K": (-2.0, 2.0),
    "eta": (-25.0 * DEGREE, 25.0 * DEGREE),
    "xi": (-25.0 * DEGREE, 25.0 * DEGREE),
    "zeta": (-25.0 * DEGREE, 25.0 * DEGREE),
    "delta_T": (0.0, 1.0),
    "z": (-1000.0, 0.0),
}
"""The ranges from which the quantities are drawn evenly; SI and radians. Attitudes are drawn from all there are."""


def random_states(count: int, seed: int) -> list[SixDofState[float]]:
    """Return `count` random states; they are the same for the same seed."""
    generator = np.random.default_rng(seed)
    states: list[SixDofState[float]] = []
    for _ in range(count):
        values = {name: float(generator.uniform(low, high)) for name, (low, high) in RANGES.items()}
        q = generator.normal(size=4)
        q0, q1, q2, q3 = (q / np.linalg.norm(q)).tolist()
        states.append(SixDofState[float](x=0.0, y=0.0, q0=q0, q1=q1, q2=q2, q3=q3, **values))
    return states


def mirror(state: SixDofState[float]) -> SixDofState[float]:
    """Return the state in a mirror that exchanges left and right."""
    odd = ("y", "q1", "q3", "beta_K", "p_K", "r_K", "xi", "zeta")
    return SixDofState[float](**{name: -value if name in odd else value for name, value in vars(state).items()})


AT_REST = SurfaceControl[float](eta_dot=0.0, xi_dot=0.0, zeta_dot=0.0, delta_T_cmd=0.0)
STILL = WindField.from_air(Air())


@dataclasses.dataclass(frozen=True, eq=False)
class Differences:
    """The differences of JSBSim from our equations at many states.

    Specific force is in g and angular acceleration in rad/s2, shape (n, 3) each.
    """

    specific_force: Array
    angular: Array

    @property
    def worst(self) -> tuple[float, float]:
        """The largest magnitude of a component of each, in g and rad/s2."""
        return float(np.abs(self.specific_force).max()), float(np.abs(self.angular).max())


def own_accelerations(
    state: SixDofState[float], aircraft: InnerLoopParameters[float], atmosphere: AtmosphereParameters[float]
) -> Accelerations:
    """Return the accelerations by the six-dof equations in still air.

    `f_B = R_BKbar g0 (n_x, n_y, -n_z)`, with `n_x = V_K_dot / g0 - R31`.
    """
    rates, path = six_dof(state, AT_REST, aircraft=aircraft, weather=Weather(atmosphere, STILL))
    n = np.array([rates.V_K / g0 - rotation(state.q)[2][0], path.n_y, -path.n_z], dtype=np.float64)
    R_BKbar = np.array(rotation_to_body(state.alpha_K, state.beta_K), dtype=np.float64)
    return Accelerations(g0 * R_BKbar @ n, np.array([rates.p_K, rates.q_K, rates.r_K], dtype=np.float64))


def differences(
    simulation: SimulatedAircraft,
    aircraft: InnerLoopParameters[float],
    theirs: Iterable[SixDofState[float]],
    ours: Iterable[SixDofState[float]],
) -> Differences:
    """Return JSBSim's accelerations in the one state minus ours in the other, pair by pair."""
    pairs: list[tuple[Accelerations, Accelerations]] = []
    for simulated, own in zip(theirs, ours, strict=True):
        simulation.start(simulated)
        pairs.append((simulation.accelerations(), own_accelerations(own, aircraft, simulation.atmosphere)))
    return Differences(
        np.array([theirs.specific_force / g0 - ours.specific_force / g0 for theirs, ours in pairs]),
        np.array([theirs.angular - ours.angular for theirs, ours in pairs]),
    )
