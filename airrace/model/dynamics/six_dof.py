"""Six degrees of freedom: moments turn the body, and the load factors are the sum of all forces but the weight.

With `s = p cos(alpha) + r sin(alpha)` and aerodynamic force `qbar S (-C_D, C_Y, -C_L)` in A, thrust along x_B:

    (n_x, n_y, -n_z) = [R_KbarA qbar S (-C_D, C_Y, -C_L) + R_KbarB (T, 0, 0)] / (m g0)
    I omega' = M - omega x (I omega + h_P e_x)

Nothing is linear and nothing left out: this is the aircraft that the other models simplify.
"""

from airrace.model.aircraft import Aircraft, InnerLoopParameters, inner_loop_parameters
from airrace.model.dynamics.aerodynamics import (
    Sideways,
    airflow,
    drag_coefficient,
    lift_coefficient,
    moment_coefficients,
    pitching_moment_coefficient,
    power_ratio,
    side_force_coefficient,
    throttle_rate,
    thrust,
)
from airrace.model.dynamics.flight_model import FlightModel, assemble
from airrace.model.dynamics.limits import BodyPath, Deflected, SurfaceControl, body_bounds, brisk_rudder, surface_bounds
from airrace.model.dynamics.outer_loop import PoweredState, flight_path_rates, turn_rates
from airrace.model.dynamics.rigid_body import angle_rates, angular_accelerations, incidence, rotation_to_body
from airrace.model.environment import Air, Weather, density, g0
from airrace.model.frames import rotation
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Scalar, T, quantity, vector


@vector
class BodyState(PoweredState[T]):
    """The flight path, the throttle, and the attitude and rotation of the body in it: equation (11)."""

    alpha_K: T = quantity("rad", scale=0.2, text="kinematic angle of attack")
    beta_K: T = quantity("rad", scale=0.2, text="kinematic sideslip")
    p_K: T = quantity("rad/s", scale=3.0, text="roll rate about x_B")
    q_K: T = quantity("rad/s", text="pitch rate about y_B")
    r_K: T = quantity("rad/s", text="yaw rate about z_B")


@vector
class SixDofState(Deflected[T], BodyState[T]):
    """The state of equation (11), and the control surfaces, which are states so that they are continuous."""


@vector
class SixDofPath(BodyPath[T]):
    """The path quantities of six degrees of freedom: `BodyPath`, and the roll rate about the velocity."""

    p_Kbar: T = quantity("rad/s", scale=3.0, text="roll rate about the velocity")


def six_dof(
    state: SixDofState[Scalar],
    control: SurfaceControl[Scalar],
    *,
    aircraft: InnerLoopParameters[Scalar],
    weather: Weather,
) -> tuple[SixDofState[Scalar], SixDofPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities, by an aircraft's numbers in the weather."""
    R, rho = rotation(state.q), density(state.z, weather.atmosphere)
    flow = airflow(state, R, weather)
    angles = incidence(state.alpha_K, state.beta_K, flow, windy=weather.field.present)
    V_A, alpha_A, beta_A = flow.V_A, angles.alpha_A, angles.beta_A
    per_span, per_chord = aircraft.b / (2.0 * V_A), 2.0 * V_A  # that make rates dimensionless
    motion = Sideways(beta_A, state.p_K * per_span, state.r_K * per_span, state.xi, state.zeta)
    q = state.q_K * aircraft.cbar / per_chord

    # Aerodynamic force and thrust over the weight, in Kbar.
    C_L = lift_coefficient(alpha_A, q, state.eta, aircraft, stalling=True)
    C_Y = side_force_coefficient(motion, aircraft)
    load = 0.5 * rho * V_A * V_A * aircraft.S / (aircraft.m * g0)
    force = (-load * drag_coefficient(C_L, beta_A, V_A, rho, aircraft), load * C_Y, -load * C_L)
    pull = thrust(state.delta_T, V_A, rho, aircraft) / (aircraft.m * g0)
    x_B = rotation_to_body(state.alpha_K, state.beta_K)[0]
    n_x, n_y, down = (
        sum(entry * component for entry, component in zip(row, force, strict=True)) + pull * along
        for row, along in zip(angles.R_KbarA, x_B, strict=True)
    )
    n_z = -down
    q_Kbar, r_Kbar = turn_rates(state.V_K, R, n_y=n_y, n_z=n_z)
    body_rates = (state.p_K, state.q_K, state.r_K)
    alpha_dot, beta_dot, p_Kbar = angle_rates((state.alpha_K, state.beta_K), body_rates, q_Kbar, r_Kbar)

    # The moments of air and engine about the body axes.
    qS = 0.5 * rho * V_A * V_A * aircraft.S
    C_l, C_n = moment_coefficients(motion, C_L, aircraft)
    rate = alpha_dot * aircraft.cbar / per_chord
    C_m = pitching_moment_coefficient(alpha_A, q, rate, state.eta, aircraft)
    engine = -state.delta_T * power_ratio(rho) * aircraft.Q_P
    moments = (qS * aircraft.b * C_l + engine, qS * aircraft.cbar * C_m, qS * aircraft.b * C_n)
    p_dot, q_dot, r_dot = angular_accelerations(body_rates, moments, aircraft)
    rates = SixDofState[Scalar](
        **vars(flight_path_rates(state, R, n_x=n_x, n_y=n_y, n_z=n_z, p_Kbar=p_Kbar)),
        delta_T=throttle_rate(state.delta_T, control.delta_T_cmd, aircraft),
        alpha_K=alpha_dot,
        beta_K=beta_dot,
        p_K=p_dot,
        q_K=q_dot,
        r_K=r_dot,
        eta=control.eta_dot,
        xi=control.xi_dot,
        zeta=control.zeta_dot,
    )
    return rates, SixDofPath(n_z=n_z, n_y=n_y, p_Kbar=p_Kbar, C_L=C_L, alpha_A=alpha_A, beta_A=beta_A)


def build_six_dof(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the aircraft with six degrees of freedom under the rules of a course in the air of the day.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    return assemble(
        "six-dof",
        six_dof,
        (SixDofState[Scalar], SurfaceControl[Scalar], SixDofPath[Scalar]),
        {**body_bounds(aircraft, rules, "p_Kbar"), **surface_bounds(aircraft)},
        roll_rate=lambda _, path: path.p_Kbar,
        at_rest=("alpha_K", "beta_K", "p_K", "q_K", "r_K"),
        aircraft=inner_loop_parameters(aircraft),
        air=air,
        counting=counting,
        brisk=brisk_rudder(aircraft),
    )
