"""Transfer functions: load factors follow their commands with second-order lags, the roll rate with a first-order one.

    n_z'' = omega_z^2 (n_z_cmd - n_z) - 2 D_z omega_z n_z'        (n_y likewise)
    p_Kbar' = (p_cmd - p_Kbar) / tau_p

Their constants are those of the aircraft's short period, Dutch roll and roll at the airspeed and density of the moment.
The rest is as for the point mass.
"""

from airrace.model.aircraft import Aircraft, InnerLoopParameters
from airrace.model.dynamics.aerodynamics import LoadFactorPath, drag_coefficient, throttle_rate
from airrace.model.dynamics.flight_model import FlightModel, assemble
from airrace.model.dynamics.limits import (
    BRISK_COMMANDS,
    CommandControl,
    Commanded,
    command_bounds,
    load_factor_bounds,
    symmetric,
)
from airrace.model.dynamics.outer_loop import PoweredState
from airrace.model.dynamics.point_mass import load_factor_flight
from airrace.model.dynamics.rigid_body import lags, linear_parameters
from airrace.model.environment import Air, Weather
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Scalar, T, quantity, vector


@vector
class LaggingState(PoweredState[T]):
    """The flight path, the throttle and the lags."""

    n_z: T = quantity("1", scale=5.0, text="load factor, 1 in level flight")
    n_z_dot: T = quantity("1/s", scale=20.0, text="rate of the load factor", rate_of="n_z")
    n_y: T = quantity("1", text="lateral load factor, to the right")
    n_y_dot: T = quantity("1/s", scale=5.0, text="rate of the lateral load factor", rate_of="n_y")
    p_Kbar: T = quantity("rad/s", scale=3.0, text="roll rate about the velocity")


@vector
class TransferFunctionState(Commanded[T], LaggingState[T]):
    """The flight path, the throttle, the lags and their commands."""


def transfer_functions(
    state: TransferFunctionState[Scalar],
    control: CommandControl[Scalar],
    *,
    aircraft: InnerLoopParameters[Scalar],
    weather: Weather,
) -> tuple[TransferFunctionState[Scalar], LoadFactorPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities, by the numbers of `linear_parameters`."""
    flight_path, path, flow, rho = load_factor_flight(
        state, state.n_z, state.n_y, state.p_Kbar, aircraft=aircraft, weather=weather
    )
    lag = lags(flow.V_A, rho, drag_coefficient(path.C_L, path.beta_A, flow.V_A, rho, aircraft), aircraft)
    rates = TransferFunctionState[Scalar](
        **vars(flight_path),
        delta_T=throttle_rate(state.delta_T, control.delta_T_cmd, aircraft),
        n_z=state.n_z_dot,
        n_z_dot=lag.stiffness_z * (state.n_z_cmd - state.n_z) - lag.damping_z * state.n_z_dot,
        n_y=state.n_y_dot,
        n_y_dot=lag.stiffness_y * (state.n_y_cmd - state.n_y) - lag.damping_y * state.n_y_dot,
        p_Kbar=lag.roll * (state.p_cmd - state.p_Kbar),
        n_z_cmd=control.n_z_cmd_dot,
        n_y_cmd=control.n_y_cmd_dot,
        p_cmd=control.p_cmd_dot,
    )
    return rates, path


def build_transfer_functions(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the transfer functions of an aircraft under the rules of a course in the air of the day.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    pilot = aircraft.point_mass
    rates = {"n_z_dot": symmetric(pilot.n_z_dot), "n_y_dot": symmetric(pilot.n_y_dot)}
    return assemble(
        "transfer-function",
        transfer_functions,
        (TransferFunctionState[Scalar], CommandControl[Scalar], LoadFactorPath[Scalar]),
        {**load_factor_bounds(aircraft, rules), **rates, **command_bounds(aircraft)},
        roll_rate=lambda state, _: state.p_Kbar,
        at_rest=("n_z", "n_z_dot", "n_y", "n_y_dot", "p_Kbar"),
        aircraft=linear_parameters(aircraft),
        air=air,
        counting=counting,
        brisk=BRISK_COMMANDS,
    )
