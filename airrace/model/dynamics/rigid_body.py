"""The attitude of a body in the flow, the rotation of a rigid body with a plane of symmetry, and linear derivatives.

    R_BKbar = R_y(alpha_K) R_z(-beta_K)        V_A,B = R_BKbar V_A,Kbar = (u, v, w)
    alpha_A = atan2(w, u)                      beta_A = asin(v / V_A)

The aerodynamic frame A is built from alpha_A and beta_A as Kbar is from alpha_K and beta_K.

    I omega' = M - omega x (I omega + h_P e_x),     I = [[I_x, 0, -I_xz], [0, I_y, 0], [-I_xz, 0, I_z]]

With `s = p cos(alpha) + r sin(alpha)`, the body rates in Kbar and what is left of them for the angles:

    w_x =  cos(beta) s + sin(beta) q      alpha_K' = (w_y - q_Kbar) / cos(beta)
    w_y = -sin(beta) s + cos(beta) q      beta_K'  = r_Kbar - w_z
    w_z = -p sin(alpha) + r cos(alpha)    p_Kbar   = w_x - alpha_K' sin(beta)

The derivatives of linear rotation in dimensional form, per rad and rad/s, and the constants of its modes of motion, at
the airspeed and density of the moment:

    M_x = qbar S cbar C_mx / I_y         Z_alpha = -qbar S (C_Lalpha + C_D) / m         Y_beta = qbar S C_Ybeta / m
    omega_z^2 = M_q Z_alpha / V - M_alpha,    2 D_z omega_z = -(M_q + M_alphadot + Z_alpha / V)      short period
    omega_y^2 = N_beta + N_r Y_beta / V,      2 D_y omega_y = -(N_r + Y_beta / V)                    Dutch roll
    tau_p = -1 / L_p                                                                                 roll

The modes leave the product of inertia out, the matrices of the lateral motion do not.
"""

import dataclasses

from airrace.model.aircraft import Aircraft, InnerLoopParameters, Mode, inner_loop_parameters
from airrace.model.dynamics.aerodynamics import Airflow, drag_coefficient
from airrace.model.elementary import atan2, cos, sin, sqrt
from airrace.model.environment import RHO_ISA, g0
from airrace.model.frames import Matrix
from airrace.optimal_control.quantities import Scalar

IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


@dataclasses.dataclass(frozen=True, eq=False)
class Incidence:
    """The direction of the flow relative to the body.

    Attributes:
        alpha_A, beta_A: angle of attack and of sideslip, rad.
        R_KbarA: from components in A to components in Kbar; the identity in still air.
    """

    alpha_A: Scalar
    beta_A: Scalar
    R_KbarA: Matrix


def rotation_to_body(alpha: Scalar, beta: Scalar) -> Matrix:
    """Return the rotation `R_y(alpha) R_z(-beta)`: `R_BKbar` of kinematic, `R_BA` of aerodynamic angles (rad)."""
    ca, sa, cb, sb = cos(alpha), sin(alpha), cos(beta), sin(beta)
    return [[ca * cb, -ca * sb, -sa], [sb, cb, 0.0], [sa * cb, -sa * sb, ca]]


def incidence(alpha_K: Scalar, beta_K: Scalar, flow: Airflow, *, windy: bool) -> Incidence:
    """Return the aerodynamic angles of a body at the kinematic angles `alpha_K, beta_K` (rad) in a flow.

    Args:
        windy: whether the flow may differ from the path; in still air the angles are the kinematic ones.
    """
    if not windy:
        return Incidence(alpha_K, beta_K, IDENTITY)
    R_BKbar = rotation_to_body(alpha_K, beta_K)
    u, v, w = (row[0] * flow.u + row[1] * flow.v + row[2] * flow.w for row in R_BKbar)
    alpha_A, beta_A = atan2(w, u), atan2(v, sqrt(u * u + w * w))
    R_BA = rotation_to_body(alpha_A, beta_A)
    R_KbarA = [[sum(R_BKbar[k][i] * R_BA[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return Incidence(alpha_A, beta_A, R_KbarA)


def body_axes(alpha: Scalar, p_s: Scalar, r_s: Scalar) -> tuple[Scalar, Scalar]:
    """Return roll and yaw rate in body axes, `(p, r) = T(alpha) (p_s, r_s)`; `alpha` in rad."""
    return cos(alpha) * p_s - sin(alpha) * r_s, sin(alpha) * p_s + cos(alpha) * r_s


def stability_axes(alpha: Scalar, p: Scalar, r: Scalar) -> tuple[Scalar, Scalar]:
    """Return roll and yaw rate in stability axes, `(p_s, r_s) = T(alpha)^T (p, r)`; `alpha` in rad."""
    return cos(alpha) * p + sin(alpha) * r, cos(alpha) * r - sin(alpha) * p


Triple = tuple[Scalar, Scalar, Scalar]


def angular_accelerations(rates: Triple, moments: Triple, aircraft: InnerLoopParameters[Scalar]) -> Triple:
    """Return the angular accelerations `(p', q', r')`, rad/s2.

    Args:
        rates: `(p, q, r)` in body axes, rad/s.
        moments: about the body axes, N m, without those of the turning propeller's angular momentum.
        aircraft: its inertia.
    """
    p, q, r = rates
    h_x = aircraft.I_x * p - aircraft.I_xz * r + aircraft.h_P
    h_y = aircraft.I_y * q
    h_z = aircraft.I_z * r - aircraft.I_xz * p
    roll = moments[0] - (q * h_z - r * h_y)
    pitch = moments[1] - (r * h_x - p * h_z)
    yaw = moments[2] - (p * h_y - q * h_x)
    p_dot, r_dot = roll_yaw_accelerations(roll, yaw, aircraft)
    return p_dot, pitch / aircraft.I_y, r_dot


def roll_yaw_accelerations(roll: Scalar, yaw: Scalar, aircraft: InnerLoopParameters[Scalar]) -> tuple[Scalar, Scalar]:
    """Return the accelerations `(p', r')` (rad/s2) that moments about x_B and z_B (N m) make.

    The product of inertia couples the two axes, so each moment makes both.
    """
    determinant = aircraft.I_x * aircraft.I_z - aircraft.I_xz * aircraft.I_xz
    return (
        (aircraft.I_z * roll + aircraft.I_xz * yaw) / determinant,
        (aircraft.I_xz * roll + aircraft.I_x * yaw) / determinant,
    )


def roll_yaw_moments(p_dot: Scalar, r_dot: Scalar, aircraft: InnerLoopParameters[Scalar]) -> tuple[Scalar, Scalar]:
    """Return the moments about x_B and z_B (N m) that make the accelerations (rad/s2)."""
    return aircraft.I_x * p_dot - aircraft.I_xz * r_dot, aircraft.I_z * r_dot - aircraft.I_xz * p_dot


def angle_rates(
    angles: tuple[Scalar, Scalar], rates: Triple, q_Kbar: Scalar, r_Kbar: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Return the rates of the angles and the roll rate about the velocity, `(alpha_K', beta_K', p_Kbar)`, rad/s.

    Args:
        angles: `(alpha_K, beta_K)`, rad; the sideslip off 90 degrees.
        rates: `(p, q, r)` in body axes, rad/s.
        q_Kbar, r_Kbar: how fast the flight path turns, rad/s.
    """
    alpha, beta = angles
    p, q, r = rates
    s, w_z = stability_axes(alpha, p, r)
    w_x = cos(beta) * s + sin(beta) * q
    w_y = cos(beta) * q - sin(beta) * s
    alpha_dot = (w_y - q_Kbar) / cos(beta)
    return alpha_dot, r_Kbar - w_z, w_x - alpha_dot * sin(beta)


Pair = tuple[Scalar, Scalar]


@dataclasses.dataclass(frozen=True)
class Lags:
    """The constants of the three modes: `stiffness` omega^2 (1/s2), `damping` 2 D omega (1/s), `roll` 1/tau_p (1/s)."""

    stiffness_z: Scalar
    damping_z: Scalar
    stiffness_y: Scalar
    damping_y: Scalar
    roll: Scalar


@dataclasses.dataclass(frozen=True)
class Pitching:
    """The pitch derivatives, rad/s2 per rad and rad/s.

    `q' = zero + alpha alpha_A + q q_K + alphadot alpha_K' + eta eta`
    """

    zero: Scalar
    alpha: Scalar
    q: Scalar
    alphadot: Scalar
    eta: Scalar


@dataclasses.dataclass(frozen=True)
class LateralMotion:
    """The lateral derivatives: `(p_s', r_s')` per unit of each cause, in stability axes.

    They are the columns of the matrices `A` and `B`, in rad/s2 per rad and rad/s.
    """

    beta: Pair
    p: Pair
    r: Pair
    xi: Pair
    zeta: Pair


def lags(V_A: Scalar, rho: Scalar, C_D: Scalar, aircraft: InnerLoopParameters[Scalar]) -> Lags:
    """Return the constants of the modes at airspeed `V_A` (m/s), density `rho` (kg/m3) and drag coefficient `C_D`."""
    qS = 0.5 * rho * V_A * V_A * aircraft.S
    M = pitching(V_A, rho, aircraft)
    Z_alpha, Y_beta = -qS * (aircraft.C_Lalpha + C_D) / aircraft.m, qS * aircraft.C_Ybeta / aircraft.m
    N = qS * aircraft.b / aircraft.I_z
    N_beta, N_r = N * aircraft.C_nbeta, N * aircraft.C_nr * aircraft.b / (2.0 * V_A)
    return Lags(
        stiffness_z=M.q * Z_alpha / V_A - M.alpha,
        damping_z=-(M.q + M.alphadot + Z_alpha / V_A),
        stiffness_y=N_beta + N_r * Y_beta / V_A,
        damping_y=-(N_r + Y_beta / V_A),
        roll=-qS * aircraft.b / aircraft.I_x * aircraft.C_lp * aircraft.b / (2.0 * V_A),
    )


def pitching(V_A: Scalar, rho: Scalar, aircraft: InnerLoopParameters[Scalar]) -> Pitching:
    """Return the pitch derivatives, over the moment of inertia, at airspeed `V_A` (m/s) and density `rho` (kg/m3)."""
    M = 0.5 * rho * V_A * V_A * aircraft.S * aircraft.cbar / aircraft.I_y
    dimensionless = aircraft.cbar / (2.0 * V_A)
    return Pitching(
        zero=M * aircraft.C_m0,
        alpha=M * aircraft.C_malpha,
        q=M * aircraft.C_mq * dimensionless,
        alphadot=M * aircraft.C_malphadot * dimensionless,
        eta=M * aircraft.C_meta,
    )


def lateral_motion(
    V_A: Scalar, rho: Scalar, alpha_K: Scalar, C_L: Scalar, aircraft: InnerLoopParameters[Scalar]
) -> LateralMotion:
    """Return the lateral matrices `T^T A_b T` and `T^T B_b`, column by column.

    They hold at angle of attack `alpha_K` (rad) and lift coefficient `C_L`; `V_A` in m/s, `rho` in kg/m3.
    """
    moment = 0.5 * rho * V_A * V_A * aircraft.S * aircraft.b
    dimensionless = aircraft.b / (2.0 * V_A)

    def column(C_l: Scalar, C_n: Scalar) -> Pair:
        return stability_axes(alpha_K, *roll_yaw_accelerations(moment * C_l, moment * C_n, aircraft))

    def rate_column(p_s: float, r_s: float) -> Pair:
        p, r = body_axes(alpha_K, p_s * dimensionless, r_s * dimensionless)
        return column(
            aircraft.C_lp * p + (aircraft.C_lr + aircraft.C_lr_per_C_L * C_L) * r,
            (aircraft.C_np + aircraft.C_np_per_C_L * C_L) * p + aircraft.C_nr * r,
        )

    return LateralMotion(
        beta=column(aircraft.C_lbeta, aircraft.C_nbeta),
        p=rate_column(1.0, 0.0),
        r=rate_column(0.0, 1.0),
        xi=column(aircraft.C_lxi, aircraft.C_nxi),
        zeta=column(aircraft.C_lzeta, aircraft.C_nzeta),
    )


def linear_parameters(aircraft: Aircraft) -> InnerLoopParameters[float]:
    """Return the numbers of an aircraft for the models with a linear inner loop.

    The corrections of the aircraft file are applied.
    """
    numbers, modes = inner_loop_parameters(aircraft), aircraft.linear
    if modes is None:
        return numbers
    if modes.short_period is not None:
        numbers = with_short_period(numbers, modes.V, modes.short_period)
    if modes.dutch_roll is not None:
        numbers = with_dutch_roll(numbers, modes.V, modes.dutch_roll)
    if modes.tau_p is not None:
        numbers = dataclasses.replace(numbers, C_lp=numbers.C_lp / (modes.tau_p * level_lags(numbers, modes.V).roll))
    return numbers


def level_lags(aircraft: InnerLoopParameters[float], V: float) -> Lags:
    """Return the constants of the modes in level flight at the speed `V` (m/s) at sea level."""
    C_L = aircraft.m * g0 / (0.5 * RHO_ISA * V * V * aircraft.S)
    return lags(V, RHO_ISA, drag_coefficient(C_L, 0.0, V, RHO_ISA, aircraft), aircraft)


def with_short_period(aircraft: InnerLoopParameters[float], V: float, mode: Mode) -> InnerLoopParameters[float]:
    """Return the numbers of an aircraft that has the wanted short period at `V` (m/s).

    Both pitch dampings are multiplied by one factor, then `C_malpha` is set. The factor is not positive where the lift
    alone damps more than is wanted.
    """
    M = pitching(V, RHO_ISA, aircraft)
    lift = level_lags(aircraft, V).damping_z + M.q + M.alphadot  # -Z_alpha / V
    factor = (lift - 2.0 * mode.D * mode.omega) / (M.q + M.alphadot)
    alpha = -factor * M.q * lift - mode.omega * mode.omega
    M_unit = 0.5 * RHO_ISA * V * V * aircraft.S * aircraft.cbar / aircraft.I_y
    return dataclasses.replace(
        aircraft,
        C_mq=aircraft.C_mq * factor,
        C_malphadot=aircraft.C_malphadot * factor,
        C_malpha=alpha / M_unit,
    )


def with_dutch_roll(aircraft: InnerLoopParameters[float], V: float, mode: Mode) -> InnerLoopParameters[float]:
    """Return the numbers of an aircraft that has the wanted Dutch roll at `V` (m/s).

    `C_nr` is set first, then `C_nbeta`.
    """
    side = 0.5 * RHO_ISA * V * aircraft.S * aircraft.C_Ybeta / aircraft.m  # Y_beta / V
    N_r = -2.0 * mode.D * mode.omega - side
    N_beta = mode.omega * mode.omega - N_r * side
    N_unit = 0.5 * RHO_ISA * V * V * aircraft.S * aircraft.b / aircraft.I_z
    return dataclasses.replace(aircraft, C_nr=N_r / (N_unit * aircraft.b / (2.0 * V)), C_nbeta=N_beta / N_unit)
