"""The model `state-space-inversion`: linear flight whose control surfaces are moved by a controller.

Its states include the commands. The deflections follow from state and commands at every instant, by the algebra of
`state_space_inverse.py`; their travels are limits along the path. The model without a controller is `state_space.py`.
"""

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.assembly import assemble
from airrace.dynamics.body_path import BodyPath, body_path_bounds
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.inner_loop_controls import (
    BRISK_COMMANDS,
    CommandControl,
    Commanded,
    Deflected,
    command_bounds,
    command_rate_bounds,
    deflection_bounds,
)
from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.dynamics.limits import bounded, flight_limits
from airrace.dynamics.linear_derivatives import linear_parameters
from airrace.dynamics.linear_flight import (
    BODY_MOTION,
    LinearFlightState,
    linear_flight_rates,
    linear_motion,
    surrounding,
)
from airrace.dynamics.state_space_inverse import Commands, deflections
from airrace.environment.air import Air
from airrace.environment.wind import Weather
from airrace.frames import Scalar
from airrace.quantities import T, vector
from airrace.track.course import Rules


@vector
class StateSpaceInversionState(Commanded[T], LinearFlightState[T]):
    """The flight path, the lever, the body motion and the commands."""


@vector
class StateSpaceInversionPath(Deflected[T], BodyPath[T]):
    """The path quantities of linear flight with a controller: `BodyPath` and the deflections."""


def state_space_inversion(
    state: StateSpaceInversionState[Scalar],
    control: CommandControl[Scalar],
    *,
    aircraft: InnerLoopParameters[Scalar],
    weather: Weather,
) -> tuple[StateSpaceInversionState[Scalar], StateSpaceInversionPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities.

    Args:
        state: see `StateSpaceInversionState`.
        control: see `CommandControl`.
        aircraft: its numbers, from `linear_parameters`.
        weather: of the day.
    """
    here = surrounding(state, aircraft=aircraft, weather=weather)
    surfaces = deflections(state, Commands(state.n_z_cmd, state.n_y_cmd, state.p_cmd), here, aircraft)
    motion = linear_motion(state, surfaces, here, aircraft)
    flight = linear_flight_rates(state, motion, control.delta_T_cmd, here, aircraft)
    rates = StateSpaceInversionState[Scalar](
        **vars(flight), n_z_cmd=control.n_z_cmd_dot, n_y_cmd=control.n_y_cmd_dot, p_cmd=control.p_cmd_dot
    )
    path = StateSpaceInversionPath[Scalar](
        n_z=motion.n_z,
        n_y=motion.n_y,
        C_L=motion.C_L,
        alpha_A=here.seen.alpha_A,
        beta_A=here.seen.beta_A,
        **vars(surfaces),
    )
    return rates, path


def build_state_space_inversion(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the linear state space with its inversion controller, under the rules of a course.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    limits = flight_limits(aircraft, rules)
    states = {"z": limits.z, "V_K": limits.V_K, "p_s": limits.p_Kbar, **command_bounds(aircraft)}
    path = {**body_path_bounds(aircraft, rules, limits), **deflection_bounds(aircraft)}
    return assemble(
        "state-space-inversion",
        state_space_inversion,
        (StateSpaceInversionState[Scalar], CommandControl[Scalar]),
        (
            bounded(StateSpaceInversionState.quantities(), states),
            bounded(CommandControl.quantities(), command_rate_bounds(aircraft)),
            bounded(StateSpaceInversionPath.quantities(), path),
        ),
        roll_rate=lambda state, _: state.p_s,
        at_rest=BODY_MOTION,
        aircraft=linear_parameters(aircraft),
        air=air,
        counting=counting,
        brisk=BRISK_COMMANDS,
    )
