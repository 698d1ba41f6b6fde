"""The point mass, a model without an inner loop: load factors and roll rate follow the commanded rates exactly."""

from airrace.model.aircraft import Aircraft, AircraftParameters, aircraft_parameters
from airrace.model.dynamics.aerodynamics import (
    Airflow,
    LoadFactorPath,
    airflow,
    axial_load_factor,
    load_factor_coefficients,
    throttle_rate,
)
from airrace.model.dynamics.flight_model import FlightModel, assemble
from airrace.model.dynamics.limits import load_factor_bounds, symmetric
from airrace.model.dynamics.outer_loop import FlightPathState, PoweredState, flight_path_rates
from airrace.model.environment import Air, Weather, density
from airrace.model.frames import rotation
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Scalar, T, Vector, quantity, vector


@vector
class PointMassState(PoweredState[T]):
    """The flight path, the throttle and the pilot's commands.

    The commands are states so that they are continuous and piecewise linear.
    """

    n_z: T = quantity("1", scale=5.0, text="load factor, 1 in level flight")
    n_y: T = quantity("1", text="lateral load factor, to the right")
    p_Kbar: T = quantity("rad/s", scale=3.0, text="roll rate about the velocity")


@vector
class PointMassControl(Vector[T]):
    """The rates of the pilot's commands, and the commanded throttle."""

    n_z_dot: T = quantity("1/s", scale=20.0, text="rate of the load factor", rate_of="n_z")
    n_y_dot: T = quantity("1/s", scale=5.0, text="rate of the lateral load factor", rate_of="n_y")
    p_Kbar_dot: T = quantity("rad/s2", scale=20.0, text="rate of the roll rate", rate_of="p_Kbar")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded throttle")


def load_factor_flight(
    state: PoweredState[Scalar],
    n_z: Scalar,
    n_y: Scalar,
    p_Kbar: Scalar,
    *,
    aircraft: AircraftParameters[Scalar],
    weather: Weather,
) -> tuple[FlightPathState[Scalar], LoadFactorPath[Scalar], Airflow, Scalar]:
    """Return the rates of the flight path at load factors (g) and a roll rate (rad/s), and what they come with.

    Those are the path quantities, the flow, and the density, kg/m3.
    """
    R, rho = rotation(state.q), density(state.z, weather.atmosphere)
    flow = airflow(state, R, weather)
    path = load_factor_coefficients(n_z, n_y, flow, rho, aircraft)
    n_x = axial_load_factor(n_z, n_y, path, state.delta_T, flow, rho, aircraft)
    return flight_path_rates(state, R, n_x=n_x, n_y=n_y, n_z=n_z, p_Kbar=p_Kbar), path, flow, rho


def point_mass(
    state: PointMassState[Scalar],
    control: PointMassControl[Scalar],
    *,
    aircraft: AircraftParameters[Scalar],
    weather: Weather,
) -> tuple[PointMassState[Scalar], LoadFactorPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities, by an aircraft's numbers in the weather."""
    flight_path, path, _, _ = load_factor_flight(
        state, state.n_z, state.n_y, state.p_Kbar, aircraft=aircraft, weather=weather
    )
    rates = PointMassState[Scalar](
        **vars(flight_path),
        delta_T=throttle_rate(state.delta_T, control.delta_T_cmd, aircraft),
        n_z=control.n_z_dot,
        n_y=control.n_y_dot,
        p_Kbar=control.p_Kbar_dot,
    )
    return rates, path


def build_point_mass(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the point mass of an aircraft under the rules of a course in the air of the day.

    The equations depend only on the structure of the wind and on `counting`, whether rolls are counted; numbers are
    parameters, limits are bounds.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    pilot = aircraft.point_mass
    rates = {"n_z_dot": pilot.n_z_dot, "n_y_dot": pilot.n_y_dot, "p_Kbar_dot": pilot.p_dot}
    return assemble(
        "point-mass",
        point_mass,
        (PointMassState[Scalar], PointMassControl[Scalar], LoadFactorPath[Scalar]),
        {**load_factor_bounds(aircraft, rules), **{name: symmetric(rate) for name, rate in rates.items()}},
        roll_rate=lambda state, _: state.p_Kbar,
        at_rest=(),
        aircraft=aircraft_parameters(aircraft),
        air=air,
        counting=counting,
    )
