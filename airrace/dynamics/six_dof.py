"""Six degrees of freedom: moments turn the body, and the load factors are the sum of all forces but the weight.

With `s = p cos(alpha) + r sin(alpha)` and aerodynamic force `qbar S (-C_D, C_Y, -C_L)` in A, thrust along x_B:

    (n_x, n_y, -n_z) = [R_KbarA qbar S (-C_D, C_Y, -C_L) + R_KbarB (T, 0, 0)] / (m g0)
    I omega' = M - omega x (I omega + h_P e_x)

Nothing is linear and nothing left out: this is the aircraft that the other models simplify.
"""

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.aerodynamics import (
    Sideways,
    airflow,
    drag_coefficient,
    lever_rate,
    lift_coefficient,
    pitching_moment_coefficient,
    power_ratio,
    rolling_moment_coefficient,
    side_force_coefficient,
    thrust,
    yawing_moment_coefficient,
)
from airrace.dynamics.flight_model import FlightModel, assemble
from airrace.dynamics.inner_loop_controls import (
    Deflected,
    SurfaceControl,
    deflection_bounds,
    deflection_rate_bounds,
)
from airrace.dynamics.limits import BodyPath, body_path_bounds, bounded, flight_limits
from airrace.dynamics.outer_loop import PoweredState, flight_path_rates, turn_rates
from airrace.dynamics.parameters import InnerLoopParameters, inner_loop_parameters
from airrace.dynamics.rigid_body import Incidence, angle_rates, angular_accelerations, incidence, rotation_to_body
from airrace.environment.air import Air
from airrace.environment.atmosphere import density, g0
from airrace.environment.wind import Weather
from airrace.frames import Scalar, rotation
from airrace.quantities import T, quantity, vector
from airrace.records import record
from airrace.track.course import Rules


@vector
class BodyState(PoweredState[T]):
    """The flight path, the power lever, and the attitude and rotation of the body in it: (11) of the paper."""

    alpha_K: T = quantity("rad", scale=0.2, text="kinematic angle of attack")
    beta_K: T = quantity("rad", scale=0.2, text="kinematic sideslip")
    p_K: T = quantity("rad/s", scale=3.0, text="roll rate about x_B")
    q_K: T = quantity("rad/s", text="pitch rate about y_B")
    r_K: T = quantity("rad/s", text="yaw rate about z_B")


@vector
class SixDofState(Deflected[T], BodyState[T]):
    """The state (11) of the paper, and the control surfaces, which are states so that they are continuous."""


@vector
class SixDofPath(BodyPath[T]):
    """The path quantities of six degrees of freedom: `BodyPath`, and the roll rate about the velocity."""

    p_Kbar: T = quantity("rad/s", scale=3.0, text="roll rate about the velocity")


@record
class Forces:
    """The load factors in Kbar (g) and the lift coefficient that they come with."""

    n_x: Scalar
    n_y: Scalar
    n_z: Scalar
    C_L: Scalar


def forces(
    state: SixDofState[Scalar], seen: Incidence, V_A: Scalar, rho: Scalar, aircraft: InnerLoopParameters[Scalar]
) -> Forces:
    """Return aerodynamic force and thrust over the weight.

    Args:
        state: see `SixDofState`.
        seen: where the air comes from.
        V_A: airspeed, m/s.
        rho: density, kg/m3.
        aircraft: its numbers.
    """
    C_L = lift_coefficient(seen.alpha_A, _pitch(state.q_K, V_A, aircraft), state.eta, aircraft, stalling=True)
    C_Y = side_force_coefficient(_sideways(state, seen, V_A, aircraft), aircraft)
    load = 0.5 * rho * V_A * V_A * aircraft.S / (aircraft.m * g0)
    air = (-load * drag_coefficient(C_L, seen.beta_A, aircraft), load * C_Y, -load * C_L)
    pull = thrust(state.delta_T, V_A, rho, aircraft) / (aircraft.m * g0)
    x_B = rotation_to_body(state.alpha_K, state.beta_K)[0]
    n_x, n_y, down = (
        sum(entry * one for entry, one in zip(row, air, strict=True)) + pull * along
        for row, along in zip(seen.R_KbarA, x_B, strict=True)
    )
    return Forces(n_x, n_y, -down, C_L)


def moments(
    state: SixDofState[Scalar],
    seen: Incidence,
    C_L: Scalar,
    alpha_dot: Scalar,
    V_A: Scalar,
    rho: Scalar,
    aircraft: InnerLoopParameters[Scalar],
) -> tuple[Scalar, Scalar, Scalar]:
    """Return the moments of air and engine about the body axes, N m; `alpha_dot` is `alpha_K'`, rad/s."""
    qS = 0.5 * rho * V_A * V_A * aircraft.S
    motion = _sideways(state, seen, V_A, aircraft)
    q, rate = _pitch(state.q_K, V_A, aircraft), _pitch(alpha_dot, V_A, aircraft)
    engine = -state.delta_T * power_ratio(rho) * aircraft.Q_P
    return (
        qS * aircraft.b * rolling_moment_coefficient(motion, C_L, aircraft) + engine,
        qS * aircraft.cbar * pitching_moment_coefficient(seen.alpha_A, q, rate, state.eta, aircraft),
        qS * aircraft.b * yawing_moment_coefficient(motion, C_L, aircraft),
    )


def six_dof(
    state: SixDofState[Scalar],
    control: SurfaceControl[Scalar],
    *,
    aircraft: InnerLoopParameters[Scalar],
    weather: Weather,
) -> tuple[SixDofState[Scalar], SixDofPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities.

    Args:
        state: see `SixDofState`.
        control: see `SurfaceControl`.
        aircraft: its numbers.
        weather: of the day.
    """
    R, rho = rotation(state.q), density(state.z, weather.atmosphere)
    flow = airflow((state.x, state.y, state.z), state.V_K, R, weather.field, weather.wind)
    seen = incidence(state.alpha_K, state.beta_K, flow, windy=weather.field.present)
    n = forces(state, seen, flow.V_A, rho, aircraft)
    q_Kbar, r_Kbar = turn_rates(state.V_K, R, n_y=n.n_y, n_z=n.n_z)
    body_rates = (state.p_K, state.q_K, state.r_K)
    alpha_dot, beta_dot, p_Kbar = angle_rates((state.alpha_K, state.beta_K), body_rates, q_Kbar, r_Kbar)
    turning = moments(state, seen, n.C_L, alpha_dot, flow.V_A, rho, aircraft)
    p_dot, q_dot, r_dot = angular_accelerations(body_rates, turning, aircraft)
    flight_path = flight_path_rates(state, R, n_x=n.n_x, n_y=n.n_y, n_z=n.n_z, p_Kbar=p_Kbar)
    rates = SixDofState[Scalar](
        **vars(flight_path),
        delta_T=lever_rate(state.delta_T, control.delta_T_cmd, aircraft),
        alpha_K=alpha_dot,
        beta_K=beta_dot,
        p_K=p_dot,
        q_K=q_dot,
        r_K=r_dot,
        eta=control.eta_dot,
        xi=control.xi_dot,
        zeta=control.zeta_dot,
    )
    path = SixDofPath[Scalar](n_z=n.n_z, n_y=n.n_y, p_Kbar=p_Kbar, C_L=n.C_L, alpha_A=seen.alpha_A, beta_A=seen.beta_A)
    return rates, path


def build_six_dof(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the aircraft with six degrees of freedom under the rules of a course in the air of the day.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    limits = flight_limits(aircraft, rules)
    path = {**body_path_bounds(aircraft, rules, limits), "p_Kbar": limits.p_Kbar}
    return assemble(
        "six-dof",
        six_dof,
        (SixDofState[Scalar], SurfaceControl[Scalar]),
        (
            bounded(SixDofState.quantities(), {"z": limits.z, "V_K": limits.V_K, **deflection_bounds(aircraft)}),
            bounded(SurfaceControl.quantities(), deflection_rate_bounds(aircraft)),
            bounded(SixDofPath.quantities(), path),
        ),
        roll_rate=lambda _, seen: seen.p_Kbar,
        at_rest=("alpha_K", "beta_K", "p_K", "q_K", "r_K"),
        aircraft=inner_loop_parameters(aircraft),
        air=air,
        counting=counting,
    )


def _pitch(rate: Scalar, V_A: Scalar, aircraft: InnerLoopParameters[Scalar]) -> Scalar:
    """Return a rate in pitch (rad/s) made dimensionless."""
    return rate * aircraft.cbar / (2.0 * V_A)


def _sideways(
    state: SixDofState[Scalar], seen: Incidence, V_A: Scalar, aircraft: InnerLoopParameters[Scalar]
) -> Sideways:
    dimensionless = aircraft.b / (2.0 * V_A)
    return Sideways(seen.beta_A, state.p_K * dimensionless, state.r_K * dimensionless, state.xi, state.zeta)
