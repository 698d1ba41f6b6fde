"""The flow relative to the aircraft, coefficients of force and moment, thrust, and forces of models without angles.

An aircraft that rotates has the coefficients

    C_L = C_L(alpha_A) + C_Lq q* + C_Leta eta                     C_L(alpha_A) rounded off at C_L_max and C_L_min
    C_Y = C_Ybeta beta_A + C_Yp p* + C_Yr r* + C_Yxi xi + C_Yzeta zeta
    C_l = C_lbeta beta_A + C_lp p* + C_lr r* + C_lxi xi + C_lzeta zeta
    C_m = C_m0 + C_malpha alpha_A + C_mq q* + C_malphadot alpha_K_dot* + C_meta eta
    C_n = C_nbeta beta_A + C_np p* + C_nr r* + C_nxi xi + C_nzeta zeta

Starred rates are dimensionless: `b / (2 V_A)` times p and r, `cbar / (2 V_A)` times q and alpha_K_dot. `C_lr` and
`C_np` grow with the lift coefficient. A positive deflection makes a negative moment about its own axis.

The thrust is that of a piston engine with propeller [Gagg & Ferrar 1934], whose throttle lags:

    T = delta_T P sigma_P(rho) / sqrt(V_A^2 + V_s^2),   sigma_P = 1.132 rho/rho_0 - 0.132
    delta_T_dot = (delta_T_cmd - delta_T) / tau_T

Models without angles are given load factors. With `a` the direction of `V_A` in Kbar, force balance gives the axial
one; in wind, lift has a part along V_K:

    C_L = m g0 n_z / (qbar S sqrt(1 - a_z^2))        beta_A = m g0 n_y / (qbar S C_Y,trim)
    n_x = [(T - D) / (m g0) - a_y n_y + a_z n_z] / a_x
"""

from collections.abc import Sequence
from dataclasses import dataclass

from airrace.model.aircraft import AircraftParameters, InnerLoopParameters, Lift
from airrace.model.dynamics.outer_loop import FlightPathState
from airrace.model.elementary import smooth_clip, sqrt
from airrace.model.environment import RHO_ISA, Weather, g0
from airrace.model.frames import Matrix
from airrace.optimal_control.quantities import Scalar, T, Vector, quantity, vector

VISCOSITY = 1.789e-5
"""The dynamic viscosity of air at 15 degrees, kg/(m s)."""
STALL_BLEND = 0.05
"""The width, in C_L, of the transition from the linear lift curve to its limits (1)."""


@dataclass(frozen=True)
class Airflow:
    """The velocity relative to the air in Kbar, m/s: `V_A a = (u, v, w)` with the unit vector `a`.

    Attributes:
        V_A: airspeed.
        u, v, w: forward along V_K, to the right, down.
    """

    V_A: Scalar
    u: Scalar
    v: Scalar
    w: Scalar


def airflow(state: FlightPathState[Scalar], R: Matrix, weather: Weather) -> Airflow:
    """Return the flow that an aircraft with the attitude `R_OKbar` meets.

    Without wind it is the flight path's, and no operation is added to the equations.
    """
    if not weather.field.present:
        return Airflow(state.V_K, state.V_K, 0.0, 0.0)
    return wind_airflow(state.V_K, R, weather.field.velocity(state.x, state.y, state.z, weather.wind))


def wind_airflow(V_K: Scalar, R: Matrix, V_W: Sequence[Scalar]) -> Airflow:
    """Return the flow of the wind triangle `V_A a = V_K e_x - R_OKbar^T V_W,O`; the wind is `[W_N, W_E, W_D]`, m/s."""
    W_N, W_E, W_D = V_W
    u = V_K - (R[0][0] * W_N + R[1][0] * W_E + R[2][0] * W_D)
    v = -(R[0][1] * W_N + R[1][1] * W_E + R[2][1] * W_D)
    w = -(R[0][2] * W_N + R[1][2] * W_E + R[2][2] * W_D)
    return Airflow(sqrt(u * u + v * v + w * w), u, v, w)


def drag_coefficient(
    C_L: Scalar, beta_A: Scalar, V_A: Scalar, rho: Scalar, aircraft: AircraftParameters[Scalar]
) -> Scalar:
    """Return the drag coefficient `C_D = C_D0 + k (C_L - C_L_minD)^2 + C_Dbeta2 beta_A^2`.

    Airspeed (m/s) and density (kg/m3) count where a table of the aircraft takes the place of the first two terms.
    """
    if aircraft.tables is not None and aircraft.tables.drag is not None:
        Re = rho * V_A * aircraft.tables.chord / VISCOSITY
        return aircraft.tables.drag(C_L, Re) + aircraft.C_Dbeta2 * (beta_A * beta_A)
    excess = C_L - aircraft.C_L_minD
    return aircraft.C_D0 + aircraft.k * (excess * excess) + aircraft.C_Dbeta2 * (beta_A * beta_A)


def lift_curve(alpha_A: Scalar, lift: Lift | InnerLoopParameters[Scalar]) -> Scalar:
    """Return the lift coefficient at `alpha_A` (rad) with neutral controls and without rotation.

    It is linear in `alpha_A`, rounded off smoothly at `C_L_max` and `C_L_min`, if the aircraft has no table of it.
    """
    if isinstance(lift, InnerLoopParameters) and lift.tables is not None and lift.tables.lift is not None:
        return lift.tables.lift(alpha_A)
    return smooth_clip(lift.C_L0 + lift.C_Lalpha * alpha_A, lift.C_L_min, lift.C_L_max, STALL_BLEND)


def power_ratio(rho: Scalar) -> Scalar:
    """Return `sigma_P`, the power of an unsupercharged engine at density `rho` (kg/m3) over that at sea level, ISA."""
    return (1.132 / RHO_ISA) * rho - 0.132


def thrust(delta_T: Scalar, V_A: Scalar, rho: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the thrust (N) at throttle position `delta_T` (0 to 1), airspeed `V_A` (m/s) and density `rho` (kg/m3)."""
    if aircraft.tables is not None and aircraft.tables.thrust is not None:
        return delta_T * aircraft.tables.thrust(V_A, rho)
    return delta_T * aircraft.P * power_ratio(rho) / sqrt(V_A * V_A + aircraft.V_s * aircraft.V_s)


def throttle_rate(delta_T: Scalar, delta_T_cmd: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the rate of the throttle `delta_T_dot`, 1/s."""
    return (delta_T_cmd - delta_T) / aircraft.tau_T


@vector
class LoadFactorPath(Vector[T]):
    """The quantities that are limited along the path of a model without angles, equation (16).

    States and controls have bounds of their own.
    """

    C_L: T = quantity("1", text="lift coefficient")
    beta_A: T = quantity("rad", scale=0.2, text="sideslip")


def load_factor_coefficients(
    n_z: Scalar, n_y: Scalar, flow: Airflow, rho: Scalar, aircraft: AircraftParameters[Scalar]
) -> LoadFactorPath[Scalar]:
    """Return the lift coefficient and the sideslip (rad) that make the load factors (g)."""
    V_A2 = flow.V_A * flow.V_A
    load = aircraft.m * g0 / (0.5 * rho * V_A2 * aircraft.S)
    across = flow.u * flow.u + flow.v * flow.v  # V_A^2 (1 - a_z^2)
    return LoadFactorPath(C_L=load * n_z * sqrt(V_A2 / across), beta_A=load * n_y / aircraft.C_Y_trim)


def axial_load_factor(
    n_z: Scalar,
    n_y: Scalar,
    coefficients: LoadFactorPath[Scalar],
    delta_T: Scalar,
    flow: Airflow,
    rho: Scalar,
    aircraft: AircraftParameters[Scalar],
) -> Scalar:
    """Return `n_x` (g) from the balance of thrust, drag, lift and side force along V_K."""
    C_D = drag_coefficient(coefficients.C_L, coefficients.beta_A, flow.V_A, rho, aircraft)
    D = 0.5 * rho * (flow.V_A * flow.V_A) * aircraft.S * C_D
    T_minus_D = thrust(delta_T, flow.V_A, rho, aircraft) - D
    # the equation above, numerator and denominator times V_A
    return (T_minus_D / (aircraft.m * g0) * flow.V_A - flow.v * n_y + flow.w * n_z) / flow.u


@dataclass(frozen=True)
class Sideways:
    """The arguments of the lateral coefficients: sideslip, dimensionless rates, ailerons and rudder (rad)."""

    beta_A: Scalar
    p: Scalar
    r: Scalar
    xi: Scalar
    zeta: Scalar


def lift_coefficient(
    alpha_A: Scalar, q: Scalar, eta: Scalar, aircraft: InnerLoopParameters[Scalar], *, stalling: bool
) -> Scalar:
    """Return `C_L` of wing, pitch rate (dimensionless) and elevator (rad); without stall the wing's lift is linear."""
    wing = lift_curve(alpha_A, aircraft) if stalling else aircraft.C_L0 + aircraft.C_Lalpha * alpha_A
    return wing + aircraft.C_Lq * q + aircraft.C_Leta * eta


def side_force_coefficient(motion: Sideways, a: InnerLoopParameters[Scalar]) -> Scalar:
    """Return `C_Y`, positive to the right, of an aircraft `a`."""
    damping = a.C_Ybeta * motion.beta_A + a.C_Yp * motion.p + a.C_Yr * motion.r
    return damping + a.C_Yxi * motion.xi + a.C_Yzeta * motion.zeta


def moment_coefficients(motion: Sideways, C_L: Scalar, a: InnerLoopParameters[Scalar]) -> tuple[Scalar, Scalar]:
    """Return `(C_l, C_n)`, positive right wing down and nose right, of an aircraft `a`."""
    C_lr, C_np = a.C_lr + a.C_lr_per_C_L * C_L, a.C_np + a.C_np_per_C_L * C_L
    roll = a.C_lbeta * motion.beta_A + a.C_lp * motion.p + C_lr * motion.r
    yaw = a.C_nbeta * motion.beta_A + C_np * motion.p + a.C_nr * motion.r
    return (
        roll + a.C_lxi * motion.xi + a.C_lzeta * motion.zeta,
        yaw + a.C_nxi * motion.xi + a.C_nzeta * motion.zeta,
    )


def pitching_moment_coefficient(
    alpha_A: Scalar, q: Scalar, alpha_dot: Scalar, eta: Scalar, a: InnerLoopParameters[Scalar]
) -> Scalar:
    """Return `C_m`, positive nose up, of an aircraft `a`; `q` and `alpha_dot` are dimensionless."""
    return a.C_m0 + a.C_malpha * alpha_A + a.C_mq * q + a.C_malphadot * alpha_dot + a.C_meta * eta
