"""The point mass: no inner loop; load factors and roll rate follow the commanded rates exactly.

With `a` the direction of `V_A` in Kbar, force balance gives the axial load factor; in wind, lift has a part along V_K:

    C_L = m g0 n_z / (qbar S sqrt(1 - a_z^2))        beta_A = m g0 n_y / (qbar S C_Y,trim)
    n_x = [(T - D) / (m g0) - a_y n_y + a_z n_z] / a_x
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.aerodynamics import Airflow, drag_coefficient, still_airflow, wind_airflow
from airrace.dynamics.aircraft_parameters import AircraftParameters, aircraft_parameters
from airrace.dynamics.flight_model import FlightModel, attitude_projection, column, named_symbols
from airrace.dynamics.limits import bounded, flight_limits, symmetric
from airrace.dynamics.outer_loop import FlightPathState, flight_path_rates
from airrace.dynamics.propulsion import lever_rate, thrust
from airrace.dynamics.roll_counter import RollCounter, RollReset, counter_rates
from airrace.environment.air import Air
from airrace.environment.atmosphere import AtmosphereParameters, atmosphere_parameters, density, g0
from airrace.environment.elementary import sqrt
from airrace.environment.wind import WindField
from airrace.frames import Scalar, rotation
from airrace.quantities import Quantity, T, Vector, quantity, vector
from airrace.system import System
from airrace.track.course import Rules


@vector
class PointMassState(FlightPathState[T]):
    """The flight path, the power lever and what the pilot commands; the latter are states to be piecewise linear."""

    delta_T: T = quantity("1", lower=0.0, upper=1.0, text="power lever")
    n_z: T = quantity("1", scale=5.0, text="load factor, 1 in level flight")
    n_y: T = quantity("1", text="lateral load factor, to the right")
    p_Kbar: T = quantity("rad/s", scale=3.0, text="roll rate about the velocity")


@vector
class PointMassControl(Vector[T]):
    """Rates of the pilot's commands, and the commanded lever."""

    n_z_dot: T = quantity("1/s", scale=20.0, text="rate of the load factor")
    n_y_dot: T = quantity("1/s", scale=5.0, text="rate of the lateral load factor")
    p_Kbar_dot: T = quantity("rad/s2", scale=20.0, text="rate of the roll rate")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded power lever")


@vector
class PointMassPath(Vector[T]):
    """What is limited along the path besides states and controls."""

    C_L: T = quantity("1", text="lift coefficient")
    beta_A: T = quantity("rad", scale=0.2, text="sideslip")


def load_factor_coefficients(
    state: PointMassState[Scalar], flow: Airflow, rho: Scalar, aircraft: AircraftParameters[Scalar]
) -> PointMassPath[Scalar]:
    """The lift coefficient and sideslip that make the load factors `n_z` and `n_y`."""
    V_A2 = flow.V_A * flow.V_A
    load = aircraft.m * g0 / (0.5 * rho * V_A2 * aircraft.S)
    across = flow.u * flow.u + flow.v * flow.v  # V_A^2 (1 - a_z^2)
    return PointMassPath(
        C_L=load * state.n_z * sqrt(V_A2 / across),
        beta_A=load * state.n_y / aircraft.C_Y_trim,
    )


def axial_load_factor(
    state: PointMassState[Scalar],
    path: PointMassPath[Scalar],
    flow: Airflow,
    rho: Scalar,
    aircraft: AircraftParameters[Scalar],
) -> Scalar:
    """`n_x` (g) from the balance of thrust, drag, lift and side force along V_K."""
    D = 0.5 * rho * (flow.V_A * flow.V_A) * aircraft.S * drag_coefficient(path.C_L, path.beta_A, aircraft)
    T_minus_D = thrust(state.delta_T, flow.V_A, rho, aircraft) - D
    # the equation above, numerator and denominator times V_A
    return (T_minus_D / (aircraft.m * g0) * flow.V_A - flow.v * state.n_y + flow.w * state.n_z) / flow.u


def point_mass(
    state: PointMassState[Scalar],
    control: PointMassControl[Scalar],
    *,
    aircraft: AircraftParameters[Scalar],
    atmosphere: AtmosphereParameters[Scalar],
    field: WindField,
    wind: Sequence[Scalar],
) -> tuple[PointMassState[Scalar], PointMassPath[Scalar]]:
    """Time derivatives of the state, and the path quantities.

    Args:
        state: see `PointMassState`.
        control: see `PointMassControl`.
        aircraft: its numbers.
        atmosphere: the day's numbers.
        field: the structure of the wind.
        wind: values of `field.parameters`.
    """
    R = rotation(state.q)
    rho = density(state.z, atmosphere)
    if field.present:
        flow = wind_airflow(state.V_K, R, field.velocity(state.x, state.y, state.z, wind))
    else:
        flow = still_airflow(state.V_K)
    path = load_factor_coefficients(state, flow, rho, aircraft)
    n_x = axial_load_factor(state, path, flow, rho, aircraft)
    flight_path = flight_path_rates(state, R, n_x=n_x, n_y=state.n_y, n_z=state.n_z, p_Kbar=state.p_Kbar)
    rates = PointMassState[Scalar](
        **vars(flight_path),
        delta_T=lever_rate(state.delta_T, control.delta_T_cmd, aircraft),
        n_z=control.n_z_dot,
        n_y=control.n_y_dot,
        p_Kbar=control.p_Kbar_dot,
    )
    return rates, path


def build_point_mass(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """The point mass of an aircraft under the rules of a course in the air of the day.

    The equations depend only on the structure of the wind and on `counting`, whether rolls are counted; numbers are
    parameters, limits are bounds.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    field = WindField.of(air)
    own_states, own_controls, path = _declarations(aircraft, rules)
    states = (*own_states, *(RollCounter.quantities() if counting else ()))
    controls = (*own_controls, *(RollReset.quantities() if counting else ()))
    parameters = (*AircraftParameters.quantities(), *AtmosphereParameters.quantities(), *field.parameters)
    x, u, p = named_symbols(states), named_symbols(controls), named_symbols(parameters)
    rates, path_values = point_mass(
        PointMassState(**{one.name: x[one.name] for one in own_states}),
        PointMassControl(**{one.name: u[one.name] for one in own_controls}),
        aircraft=AircraftParameters(**{name: p[name] for name in AircraftParameters.names()}),
        atmosphere=AtmosphereParameters(**{name: p[name] for name in AtmosphereParameters.names()}),
        field=field,
        wind=[p[one.name] for one in field.parameters],
    )
    all_rates = list(rates.join())
    if counting:
        reset = RollReset(**{name: u[name] for name in RollReset.names()})
        all_rates += counter_rates(x["p_Kbar"], rates.z, reset).join()
    arguments = [column(symbols.values()) for symbols in (x, u, p)]
    system = System(
        name="+".join(part for part in ("point-mass", field.label, "rolls" if counting else "") if part),
        states=states,
        controls=controls,
        parameters=parameters,
        rates=ca.Function("rates", arguments, [column(all_rates)], {"cse": True}),
        path=path,
        path_values=ca.Function("path_values", arguments, [column(path_values.join())], {"cse": True}),
        projection=attitude_projection(states),
    )
    values = [*aircraft_parameters(aircraft).join(), *atmosphere_parameters(air).join(), *field.values(air)]
    return FlightModel(system, np.array(values))


def _declarations(
    aircraft: Aircraft, rules: Rules
) -> tuple[tuple[Quantity, ...], tuple[Quantity, ...], tuple[Quantity, ...]]:
    """States, controls and path quantities with the bounds of aircraft and rules."""
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
    path = bounded(PointMassPath.quantities(), {"C_L": limits.C_L, "beta_A": limits.beta_A})
    return states, controls, path
