"""Flight with a linear inner loop, and the model `state-space` whose controls are the rates of the control surfaces.

Longitudinal and lateral motion are separate, lateral rates are in stability axes:

    alpha_K' = q_K - q_Kbar
    q_K'     = M_0 + M_alpha alpha_A + M_q q_K + M_alphadot alpha_K' + M_eta eta
    beta_K'  = r_Kbar - r_s,     p_Kbar = p_s
    (p_s', r_s') = T^T [A_b T (beta_A, p_s, r_s) + B_b (xi, zeta)],     T(alpha_K) from stability to body axes
    n_z = [qbar S (C_L0 + C_Lalpha alpha_A + C_Lq q* + C_Leta eta) + T alpha_A] / (m g0)
    n_y = [qbar S (C_Ybeta beta_A + C_Yp p* + C_Yr r* + C_Yxi xi + C_Yzeta zeta) - T beta_A] / (m g0)

The derivatives follow airspeed, density and angle of attack; `n_x` is the point mass's. What is missing against the
whole aircraft is the stall and what couples the two motions: products of rates above all.
"""

from dataclasses import dataclass

from airrace.model.aircraft import Aircraft, InnerLoopParameters
from airrace.model.dynamics.aerodynamics import (
    Airflow,
    LoadFactorPath,
    Sideways,
    airflow,
    axial_load_factor,
    lift_coefficient,
    moment_coefficients,
    side_force_coefficient,
    throttle_rate,
    thrust,
)
from airrace.model.dynamics.flight_model import FlightModel, assemble
from airrace.model.dynamics.limits import BodyPath, Deflected, SurfaceControl, body_bounds, brisk_rudder, surface_bounds
from airrace.model.dynamics.outer_loop import PoweredState, flight_path_rates, turn_rates
from airrace.model.dynamics.rigid_body import (
    Incidence,
    body_axes,
    incidence,
    linear_parameters,
    pitching,
    roll_yaw_accelerations,
    stability_axes,
)
from airrace.model.environment import Air, Weather, density, g0
from airrace.model.frames import Matrix, rotation
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Scalar, T, quantity, vector


@vector
class LinearFlightState(PoweredState[T]):
    """The flight path, the throttle, and the attitude and rotation of the body in the flight path."""

    alpha_K: T = quantity("rad", scale=0.2, text="kinematic angle of attack")
    beta_K: T = quantity("rad", scale=0.2, text="kinematic sideslip")
    p_s: T = quantity("rad/s", scale=3.0, text="roll rate in stability axes, about the velocity")
    q_K: T = quantity("rad/s", text="pitch rate about y_B")
    r_s: T = quantity("rad/s", text="yaw rate in stability axes")


BODY_MOTION = ("alpha_K", "beta_K", "p_s", "q_K", "r_s")
"""The states of the inner loop: the attitude and rotation of the body in the flight path."""


@dataclass(frozen=True, eq=False)
class Surrounding:
    """The conditions that the inner loop is scheduled with.

    Attributes:
        R: `R_OKbar`.
        rho: density, kg/m3.
        flow: the air that meets the aircraft, in Kbar.
        seen: where it comes from, seen from the body.
        load: `qbar S / (m g0)`, g per unit of a coefficient.
        pull: `T / (m g0)`, g.
    """

    R: Matrix
    rho: Scalar
    flow: Airflow
    seen: Incidence
    load: Scalar
    pull: Scalar


def surrounding(
    state: LinearFlightState[Scalar], *, aircraft: InnerLoopParameters[Scalar], weather: Weather
) -> Surrounding:
    """Return the conditions that an aircraft in a given state meets; arguments as of the models."""
    R, rho = rotation(state.q), density(state.z, weather.atmosphere)
    flow = airflow(state, R, weather)
    weight = aircraft.m * g0
    return Surrounding(
        R=R,
        rho=rho,
        flow=flow,
        seen=incidence(state.alpha_K, state.beta_K, flow, windy=weather.field.present),
        load=0.5 * rho * flow.V_A * flow.V_A * aircraft.S / weight,
        pull=thrust(state.delta_T, flow.V_A, rho, aircraft) / weight,
    )


def normal_load_factor(
    state: LinearFlightState[Scalar], eta: Scalar, around: Surrounding, aircraft: InnerLoopParameters[Scalar]
) -> tuple[Scalar, Scalar]:
    """Return `(n_z, C_L)` at the present angle of attack and pitch rate with the elevator at `eta` (rad)."""
    q = state.q_K * aircraft.cbar / (2.0 * around.flow.V_A)
    C_L = lift_coefficient(around.seen.alpha_A, q, eta, aircraft, stalling=False)
    return around.load * C_L + around.pull * around.seen.alpha_A, C_L


def sideways(
    state: LinearFlightState[Scalar],
    causes: tuple[Scalar, Scalar, Scalar],
    surfaces: tuple[Scalar, Scalar],
    around: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
) -> Sideways:
    """Return the arguments of the lateral coefficients.

    Args:
        state: its angle of attack turns the axes.
        causes: `(beta_A, p_s, r_s)`, rad and rad/s.
        surfaces: `(xi, zeta)`, rad.
        around: what surrounds the aircraft.
        aircraft: its numbers.
    """
    beta_A, p_s, r_s = causes
    dimensionless = aircraft.b / (2.0 * around.flow.V_A)
    p, r = body_axes(state.alpha_K, p_s * dimensionless, r_s * dimensionless)
    return Sideways(beta_A, p, r, *surfaces)


def lateral_load_factor(motion: Sideways, around: Surrounding, aircraft: InnerLoopParameters[Scalar]) -> Scalar:
    """Return `n_y` (g), which is linear in all arguments of the lateral coefficients."""
    return around.load * side_force_coefficient(motion, aircraft) - around.pull * motion.beta_A


def linear_flight(
    state: LinearFlightState[Scalar],
    surfaces: Deflected[Scalar],
    delta_T_cmd: Scalar,
    around: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
) -> tuple[LinearFlightState[Scalar], BodyPath[Scalar]]:
    """Return the time derivatives of flight path, throttle and body motion, and the path quantities."""
    alpha_A, beta_A = around.seen.alpha_A, around.seen.beta_A
    motion = sideways(state, (beta_A, state.p_s, state.r_s), (surfaces.xi, surfaces.zeta), around, aircraft)
    n_z, C_L = normal_load_factor(state, surfaces.eta, around, aircraft)
    n_y = lateral_load_factor(motion, around, aircraft)
    q_Kbar, r_Kbar = turn_rates(state.V_K, around.R, n_y=n_y, n_z=n_z)
    alpha_dot = state.q_K - q_Kbar
    M = pitching(around.flow.V_A, around.rho, aircraft)
    moment = around.load * aircraft.m * g0 * aircraft.b  # qbar S b
    C_l, C_n = moment_coefficients(motion, C_L, aircraft)
    p_dot, r_dot = stability_axes(state.alpha_K, *roll_yaw_accelerations(moment * C_l, moment * C_n, aircraft))
    coefficients = LoadFactorPath[Scalar](C_L=C_L, beta_A=beta_A)
    n_x = axial_load_factor(n_z, n_y, coefficients, state.delta_T, around.flow, around.rho, aircraft)
    rates = LinearFlightState[Scalar](
        **vars(flight_path_rates(state, around.R, n_x=n_x, n_y=n_y, n_z=n_z, p_Kbar=state.p_s)),
        delta_T=throttle_rate(state.delta_T, delta_T_cmd, aircraft),
        alpha_K=alpha_dot,
        beta_K=r_Kbar - state.r_s,
        p_s=p_dot,
        q_K=M.zero + M.alpha * alpha_A + M.q * state.q_K + M.alphadot * alpha_dot + M.eta * surfaces.eta,
        r_s=r_dot,
    )
    return rates, BodyPath(n_z=n_z, n_y=n_y, C_L=C_L, alpha_A=alpha_A, beta_A=beta_A)


@vector
class StateSpaceState(Deflected[T], LinearFlightState[T]):
    """The flight path, the throttle, the body motion and the control surfaces."""


def state_space(
    state: StateSpaceState[Scalar],
    control: SurfaceControl[Scalar],
    *,
    aircraft: InnerLoopParameters[Scalar],
    weather: Weather,
) -> tuple[StateSpaceState[Scalar], BodyPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities, by the numbers of `linear_parameters`."""
    around = surrounding(state, aircraft=aircraft, weather=weather)
    flight, path = linear_flight(state, state, control.delta_T_cmd, around, aircraft)
    rates = StateSpaceState[Scalar](**vars(flight), eta=control.eta_dot, xi=control.xi_dot, zeta=control.zeta_dot)
    return rates, path


def build_state_space(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the linear state space of an aircraft under the rules of a course in the air of the day.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    return assemble(
        "state-space",
        state_space,
        (StateSpaceState[Scalar], SurfaceControl[Scalar], BodyPath[Scalar]),
        {**body_bounds(aircraft, rules, "p_s"), **surface_bounds(aircraft)},
        roll_rate=lambda state, _: state.p_s,
        at_rest=BODY_MOTION,
        aircraft=linear_parameters(aircraft),
        air=air,
        counting=counting,
        brisk=brisk_rudder(aircraft),
    )
