"""The point mass, a model without an inner loop: load factors and roll rate follow the commanded rates exactly."""

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.aerodynamics import (
    LoadFactorPath,
    airflow,
    axial_load_factor,
    lever_rate,
    load_factor_coefficients,
)
from airrace.dynamics.flight_model import FlightModel, assemble
from airrace.dynamics.limits import bounded, flight_limits, symmetric
from airrace.dynamics.outer_loop import PoweredState, flight_path_rates
from airrace.dynamics.parameters import AircraftParameters, aircraft_parameters
from airrace.environment.air import Air
from airrace.environment.atmosphere import density
from airrace.environment.wind import Weather
from airrace.frames import Scalar, rotation
from airrace.quantities import Quantity, T, Vector, quantity, vector
from airrace.track.course import Rules


@vector
class PointMassState(PoweredState[T]):
    """The flight path, the power lever and the pilot's commands.

    The commands are states so that they are continuous and piecewise linear.
    """

    n_z: T = quantity("1", scale=5.0, text="load factor, 1 in level flight")
    n_y: T = quantity("1", text="lateral load factor, to the right")
    p_Kbar: T = quantity("rad/s", scale=3.0, text="roll rate about the velocity")


@vector
class PointMassControl(Vector[T]):
    """The rates of the pilot's commands, and the commanded lever."""

    n_z_dot: T = quantity("1/s", scale=20.0, text="rate of the load factor", rate_of="n_z")
    n_y_dot: T = quantity("1/s", scale=5.0, text="rate of the lateral load factor", rate_of="n_y")
    p_Kbar_dot: T = quantity("rad/s2", scale=20.0, text="rate of the roll rate", rate_of="p_Kbar")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded power lever")


def point_mass(
    state: PointMassState[Scalar],
    control: PointMassControl[Scalar],
    *,
    aircraft: AircraftParameters[Scalar],
    weather: Weather,
) -> tuple[PointMassState[Scalar], LoadFactorPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities.

    Args:
        state: see `PointMassState`.
        control: see `PointMassControl`.
        aircraft: its numbers.
        weather: of the day.
    """
    R, rho = rotation(state.q), density(state.z, weather.atmosphere)
    flow = airflow((state.x, state.y, state.z), state.V_K, R, weather.field, weather.wind)
    C_L, beta_A = load_factor_coefficients(state.n_z, state.n_y, flow=flow, rho=rho, aircraft=aircraft)
    n_x = axial_load_factor(
        state.n_z, state.n_y, C_L=C_L, beta_A=beta_A, delta_T=state.delta_T, flow=flow, rho=rho, aircraft=aircraft
    )
    flight_path = flight_path_rates(state, R, n_x=n_x, n_y=state.n_y, n_z=state.n_z, p_Kbar=state.p_Kbar)
    rates = PointMassState[Scalar](
        **vars(flight_path),
        delta_T=lever_rate(state.delta_T, control.delta_T_cmd, aircraft),
        n_z=control.n_z_dot,
        n_y=control.n_y_dot,
        p_Kbar=control.p_Kbar_dot,
    )
    return rates, LoadFactorPath(C_L=C_L, beta_A=beta_A)


def build_point_mass(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the point mass of an aircraft under the rules of a course in the air of the day.

    The equations depend only on the structure of the wind and on `counting`, whether rolls are counted; numbers are
    parameters, limits are bounds.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    return assemble(
        "point-mass",
        point_mass,
        (PointMassState[Scalar], PointMassControl[Scalar]),
        _declarations(aircraft, rules),
        roll_rate=lambda state, _: state.p_Kbar,
        at_rest=(),
        aircraft=aircraft_parameters(aircraft),
        air=air,
        counting=counting,
    )


def _declarations(
    aircraft: Aircraft, rules: Rules
) -> tuple[tuple[Quantity, ...], tuple[Quantity, ...], tuple[Quantity, ...]]:
    """Return states, controls and path quantities with the bounds of aircraft and rules."""
    limits, pilot = flight_limits(aircraft, rules), aircraft.point_mass
    states = bounded(
        PointMassState.quantities(),
        {
            "z": limits.z,
            "V_K": limits.V_K,
            "n_z": limits.n_z,
            "n_y": symmetric(pilot.n_y),
            "p_Kbar": limits.p_Kbar,
        },
    )
    controls = bounded(
        PointMassControl.quantities(),
        {
            "n_z_dot": symmetric(pilot.n_z_dot),
            "n_y_dot": symmetric(pilot.n_y_dot),
            "p_Kbar_dot": symmetric(pilot.p_dot),
        },
    )
    path = bounded(LoadFactorPath.quantities(), {"C_L": limits.C_L, "beta_A": limits.beta_A})
    return states, controls, path
