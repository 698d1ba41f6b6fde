"""Accelerations of JSBSim and of the six-dof model in random states, at the same geopotential height.

Both are ISA. Ours falls with the height h itself; JSBSim's with the geopotential height `R h / (R + h)`, for the
standard was written for a gravity that weakens with height. At 1000 m that is 0.16 m, or 1.5e-5 of the density. The
rest, 2.7e-6, is in the digits of the gas constant.
"""

import dataclasses
from collections.abc import Iterable

import numpy as np

from airrace.dynamics.limits import SurfaceControl
from airrace.dynamics.parameters import InnerLoopParameters
from airrace.dynamics.rigid_body import rotation_to_body
from airrace.dynamics.six_dof import SixDofState, six_dof
from airrace.environment.air import Air
from airrace.environment.atmosphere import AtmosphereParameters, g0
from airrace.environment.wind import Weather, WindField
from airrace.frames import rotation
from airrace.jsbsim.simulation import Accelerations, SimulatedAircraft
from airrace.quantities import DEGREE
from airrace.records import record
from airrace.trajectory import Array

EARTH_RADIUS = 6356766.0
"""The Earth's radius in the definition of the geopotential height, m [ISO 2533]."""


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
        drawn = {name: float(generator.uniform(low, high)) for name, (low, high) in RANGES.items()}
        q = generator.normal(size=4)
        q0, q1, q2, q3 = (q / np.linalg.norm(q)).tolist()
        states.append(SixDofState[float](x=0.0, y=0.0, q0=q0, q1=q1, q2=q2, q3=q3, **drawn))
    return states


def mirror(state: SixDofState[float]) -> SixDofState[float]:
    """Return the state in a mirror that exchanges left and right."""
    odd = ("y", "q1", "q3", "beta_K", "p_K", "r_K", "xi", "zeta")
    return SixDofState[float](**{name: -value if name in odd else value for name, value in vars(state).items()})


AT_REST = SurfaceControl[float](eta_dot=0.0, xi_dot=0.0, zeta_dot=0.0, delta_T_cmd=0.0)
STILL = WindField.of(Air())


@record
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
    for one, other in zip(theirs, ours, strict=True):
        simulation.start(one)
        pairs.append((simulation.accelerations(), own_accelerations(other, aircraft, simulation.atmosphere)))
    return Differences(
        np.array([theirs.specific_force / g0 - ours.specific_force / g0 for theirs, ours in pairs]),
        np.array([theirs.angular - ours.angular for theirs, ours in pairs]),
    )
