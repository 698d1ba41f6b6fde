"""The flow relative to the aircraft, coefficients of force and moment, thrust, and forces of models without angles.

An aircraft that rotates has the coefficients

    C_L = C_L(alpha_A) + C_Lq q* + C_Leta eta                     C_L(alpha_A) rounded off at C_L_max and C_L_min
    C_Y = C_Ybeta beta_A + C_Yp p* + C_Yr r* + C_Yxi xi + C_Yzeta zeta
    C_l = C_lbeta beta_A + C_lp p* + C_lr r* + C_lxi xi + C_lzeta zeta
    C_m = C_m0 + C_malpha alpha_A + C_mq q* + C_malphadot alpha_K_dot* + C_meta eta
    C_n = C_nbeta beta_A + C_np p* + C_nr r* + C_nxi xi + C_nzeta zeta

Starred rates are dimensionless: `b / (2 V_A)` times p and r, `cbar / (2 V_A)` times q and alpha_K_dot. `C_lr` and
`C_np` grow with the lift coefficient. A positive deflection makes a negative moment about its own axis.

The thrust is that of a piston engine with propeller [Gagg & Ferrar 1934], whose power lever lags:

    T = delta_T P sigma_P(rho) / sqrt(V_A^2 + V_s^2),   sigma_P = 1.132 rho/rho_0 - 0.132
    delta_T_dot = (delta_T_cmd - delta_T) / tau_T

Models without angles are given load factors. With `a` the direction of `V_A` in Kbar, force balance gives the axial
one; in wind, lift has a part along V_K:

    C_L = m g0 n_z / (qbar S sqrt(1 - a_z^2))        beta_A = m g0 n_y / (qbar S C_Y,trim)
    n_x = [(T - D) / (m g0) - a_y n_y + a_z n_z] / a_x
"""

from collections.abc import Sequence

from airrace.aircraft.aircraft import Lift
from airrace.dynamics.parameters import AircraftParameters, InnerLoopParameters
from airrace.environment.atmosphere import RHO_ISA, g0
from airrace.environment.elementary import smooth_clip, sqrt
from airrace.environment.wind import WindField
from airrace.frames import Matrix, Scalar
from airrace.quantities import T, Vector, quantity, vector
from airrace.records import record

STALL_BLEND = 0.05
"""The width, in C_L, of the transition from the linear lift curve to its limits (1)."""


@record
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


def still_airflow(V_K: Scalar) -> Airflow:
    """Return the flow without wind: the air meets the aircraft along the flight path at `V_K` (m/s)."""
    return Airflow(V_K, V_K, 0.0, 0.0)


def wind_airflow(V_K: Scalar, R: Matrix, V_W: Sequence[Scalar]) -> Airflow:
    """Return the flow of the wind triangle `V_A a = V_K e_x - R_OKbar^T V_W,O`.

    Args:
        V_K: kinematic speed, m/s.
        R: `R_OKbar`.
        V_W: wind in O, `[W_N, W_E, W_D]`, m/s.
    """
    W_N, W_E, W_D = V_W
    u = V_K - (R[0][0] * W_N + R[1][0] * W_E + R[2][0] * W_D)
    v = -(R[0][1] * W_N + R[1][1] * W_E + R[2][1] * W_D)
    w = -(R[0][2] * W_N + R[1][2] * W_E + R[2][2] * W_D)
    return Airflow(sqrt(u * u + v * v + w * w), u, v, w)


def airflow(
    position: tuple[Scalar, Scalar, Scalar], V_K: Scalar, R: Matrix, field: WindField, wind: Sequence[Scalar]
) -> Airflow:
    """Return the flow that an aircraft at `position` (x, y, z in O, m) meets.

    A field without wind adds no operation to the equations.
    """
    if not field.present:
        return still_airflow(V_K)
    return wind_airflow(V_K, R, field.velocity(*position, wind))


def drag_coefficient(C_L: Scalar, beta_A: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the drag coefficient `C_D = C_D0 + k (C_L - C_L_minD)^2 + C_Dbeta2 beta_A^2`."""
    excess = C_L - aircraft.C_L_minD
    return aircraft.C_D0 + aircraft.k * (excess * excess) + aircraft.C_Dbeta2 * (beta_A * beta_A)


def lift_curve(alpha_A: Scalar, lift: Lift) -> Scalar:
    """Return the lift coefficient at `alpha_A` (rad) with neutral controls and without rotation.

    It is linear in `alpha_A`, rounded off smoothly at `C_L_max` and `C_L_min`.
    """
    return smooth_clip(lift.C_L0 + lift.C_Lalpha * alpha_A, lift.C_L_min, lift.C_L_max, STALL_BLEND)


def power_ratio(rho: Scalar) -> Scalar:
    """Return `sigma_P`, the power of an unsupercharged engine at density `rho` (kg/m3) over that at sea level.

    Sea level is that of the standard atmosphere.
    """
    return (1.132 / RHO_ISA) * rho - 0.132


def thrust(delta_T: Scalar, V_A: Scalar, rho: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the thrust (N) at lever position `delta_T` (0 to 1), airspeed `V_A` (m/s) and density `rho` (kg/m3)."""
    return delta_T * aircraft.P * power_ratio(rho) / sqrt(V_A * V_A + aircraft.V_s * aircraft.V_s)


def lever_rate(delta_T: Scalar, delta_T_cmd: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the rate of the power lever `delta_T_dot`, 1/s."""
    return (delta_T_cmd - delta_T) / aircraft.tau_T


@vector
class LoadFactorPath(Vector[T]):
    """The quantities that are limited along the path of a model without angles, (16) of the paper.

    States and controls have bounds of their own.
    """

    C_L: T = quantity("1", text="lift coefficient")
    beta_A: T = quantity("rad", scale=0.2, text="sideslip")


def load_factor_coefficients(
    n_z: Scalar, n_y: Scalar, *, flow: Airflow, rho: Scalar, aircraft: AircraftParameters[Scalar]
) -> tuple[Scalar, Scalar]:
    """Return `(C_L, beta_A)`: the lift coefficient and the sideslip (rad) that make the load factors (g)."""
    V_A2 = flow.V_A * flow.V_A
    load = aircraft.m * g0 / (0.5 * rho * V_A2 * aircraft.S)
    across = flow.u * flow.u + flow.v * flow.v  # V_A^2 (1 - a_z^2)
    return load * n_z * sqrt(V_A2 / across), load * n_y / aircraft.C_Y_trim


def axial_load_factor(
    n_z: Scalar,
    n_y: Scalar,
    *,
    C_L: Scalar,
    beta_A: Scalar,
    delta_T: Scalar,
    flow: Airflow,
    rho: Scalar,
    aircraft: AircraftParameters[Scalar],
) -> Scalar:
    """Return `n_x` (g) from the balance of thrust, drag, lift and side force along V_K."""
    D = 0.5 * rho * (flow.V_A * flow.V_A) * aircraft.S * drag_coefficient(C_L, beta_A, aircraft)
    T_minus_D = thrust(delta_T, flow.V_A, rho, aircraft) - D
    # the equation above, numerator and denominator times V_A
    return (T_minus_D / (aircraft.m * g0) * flow.V_A - flow.v * n_y + flow.w * n_z) / flow.u


@record
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
    """Return `C_L` of wing, pitch rate and elevator.

    Args:
        alpha_A: angle of attack, rad.
        q: dimensionless pitch rate.
        eta: elevator, rad.
        stalling: whether the wing's lift ends at its limits, else it is linear.
    """
    wing = aircraft.C_L0 + aircraft.C_Lalpha * alpha_A
    if stalling:
        wing = smooth_clip(wing, aircraft.C_L_min, aircraft.C_L_max, STALL_BLEND)
    return wing + aircraft.C_Lq * q + aircraft.C_Leta * eta


def side_force_coefficient(motion: Sideways, aircraft: InnerLoopParameters[Scalar]) -> Scalar:
    """Return `C_Y`, positive to the right."""
    return (
        aircraft.C_Ybeta * motion.beta_A
        + aircraft.C_Yp * motion.p
        + aircraft.C_Yr * motion.r
        + aircraft.C_Yxi * motion.xi
        + aircraft.C_Yzeta * motion.zeta
    )


def rolling_moment_coefficient(motion: Sideways, C_L: Scalar, aircraft: InnerLoopParameters[Scalar]) -> Scalar:
    """Return `C_l`, positive right wing down."""
    return (
        aircraft.C_lbeta * motion.beta_A
        + aircraft.C_lp * motion.p
        + (aircraft.C_lr + aircraft.C_lr_per_C_L * C_L) * motion.r
        + aircraft.C_lxi * motion.xi
        + aircraft.C_lzeta * motion.zeta
    )


def pitching_moment_coefficient(
    alpha_A: Scalar, q: Scalar, alpha_dot: Scalar, eta: Scalar, aircraft: InnerLoopParameters[Scalar]
) -> Scalar:
    """Return `C_m`, positive nose up; `q` and `alpha_dot` are dimensionless."""
    return (
        aircraft.C_m0
        + aircraft.C_malpha * alpha_A
        + aircraft.C_mq * q
        + aircraft.C_malphadot * alpha_dot
        + aircraft.C_meta * eta
    )


def yawing_moment_coefficient(motion: Sideways, C_L: Scalar, aircraft: InnerLoopParameters[Scalar]) -> Scalar:
    """Return `C_n`, positive nose right."""
    return (
        aircraft.C_nbeta * motion.beta_A
        + (aircraft.C_np + aircraft.C_np_per_C_L * C_L) * motion.p
        + aircraft.C_nr * motion.r
        + aircraft.C_nxi * motion.xi
        + aircraft.C_nzeta * motion.zeta
    )
