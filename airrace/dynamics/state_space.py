"""The model `state-space`: linear flight whose controls are the rates of the control surfaces.

Its equations are those of `linear_flight.py`. The model that moves the same surfaces by commands is in
`state_space_inversion.py`, and the algebra that turns commands into deflections in `state_space_inverse.py`.
"""

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.assembly import assemble
from airrace.dynamics.body_path import BodyPath, body_path_bounds
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.inner_loop_controls import (
    Deflected,
    SurfaceControl,
    deflection_bounds,
    deflection_rate_bounds,
)
from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.dynamics.limits import bounded, flight_limits
from airrace.dynamics.linear_derivatives import linear_parameters
from airrace.dynamics.linear_flight import (
    BODY_MOTION,
    Deflections,
    LinearFlightState,
    linear_flight_rates,
    linear_motion,
    surrounding,
)
from airrace.environment.air import Air
from airrace.environment.wind import Weather
from airrace.frames import Scalar
from airrace.quantities import T, vector
from airrace.track.course import Rules


@vector
class StateSpaceState(Deflected[T], LinearFlightState[T]):
    """The flight path, the lever, the body motion and the control surfaces."""


def state_space(
    state: StateSpaceState[Scalar],
    control: SurfaceControl[Scalar],
    *,
    aircraft: InnerLoopParameters[Scalar],
    weather: Weather,
) -> tuple[StateSpaceState[Scalar], BodyPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities.

    Args:
        state: see `StateSpaceState`.
        control: see `SurfaceControl`.
        aircraft: its numbers, from `linear_parameters`.
        weather: of the day.
    """
    here = surrounding(state, aircraft=aircraft, weather=weather)
    motion = linear_motion(state, Deflections(state.eta, state.xi, state.zeta), here, aircraft)
    flight = linear_flight_rates(state, motion, control.delta_T_cmd, here, aircraft)
    rates = StateSpaceState[Scalar](**vars(flight), eta=control.eta_dot, xi=control.xi_dot, zeta=control.zeta_dot)
    path = BodyPath[Scalar](
        n_z=motion.n_z, n_y=motion.n_y, C_L=motion.C_L, alpha_A=here.seen.alpha_A, beta_A=here.seen.beta_A
    )
    return rates, path


def build_state_space(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the linear state space of an aircraft under the rules of a course in the air of the day.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    limits = flight_limits(aircraft, rules)
    states = {"z": limits.z, "V_K": limits.V_K, "p_s": limits.p_Kbar, **deflection_bounds(aircraft)}
    return assemble(
        "state-space",
        state_space,
        (StateSpaceState[Scalar], SurfaceControl[Scalar]),
        (
            bounded(StateSpaceState.quantities(), states),
            bounded(SurfaceControl.quantities(), deflection_rate_bounds(aircraft)),
            bounded(BodyPath.quantities(), body_path_bounds(aircraft, rules, limits)),
        ),
        roll_rate=lambda state, _: state.p_s,
        at_rest=BODY_MOTION,
        aircraft=linear_parameters(aircraft),
        air=air,
        counting=counting,
    )
