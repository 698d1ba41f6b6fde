"""A comparison of JSBSim with our own equations in the same states: what accelerometers and gyroscopes would read."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from airrace.crosscheck.flown import Accelerations, Flown
from airrace.dynamics.attitude import rotation_to_body
from airrace.dynamics.inner_loop_controls import SurfaceControl
from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.dynamics.six_dof import SixDofState, six_dof
from airrace.environment.air import Air
from airrace.environment.atmosphere import AtmosphereParameters, g0
from airrace.environment.weather import Weather
from airrace.environment.wind import WindField
from airrace.frames import rotation
from airrace.records import record
from airrace.trajectory import Array

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
    flown: Flown,
    aircraft: InnerLoopParameters[float],
    theirs: Iterable[SixDofState[float]],
    ours: Iterable[SixDofState[float]],
) -> Differences:
    """Return JSBSim's accelerations in the one state minus ours in the other, pair by pair."""
    pairs: list[tuple[Accelerations, Accelerations]] = []
    for one, other in zip(theirs, ours, strict=True):
        flown.start(one)
        pairs.append((flown.accelerations(), own_accelerations(other, aircraft, flown.atmosphere)))
    return Differences(
        _stacked(pairs, lambda one: one.specific_force / g0),
        _stacked(pairs, lambda one: one.angular),
    )


def _stacked(pairs: Sequence[tuple[Accelerations, Accelerations]], read: Callable[[Accelerations], Array]) -> Array:
    return np.array([read(theirs) - read(ours) for theirs, ours in pairs])
