"""The linear rotation of the aircraft: derivatives in dimensional form, and the constants of its modes of motion.

They are per rad and rad/s, at the airspeed and density of the moment:

    M_x = qbar S cbar C_mx / I_y         Z_alpha = -qbar S (C_Lalpha + C_D) / m         Y_beta = qbar S C_Ybeta / m
    omega_z^2 = M_q Z_alpha / V - M_alpha,    2 D_z omega_z = -(M_q + M_alphadot + Z_alpha / V)      short period
    omega_y^2 = N_beta + N_r Y_beta / V,      2 D_y omega_y = -(N_r + Y_beta / V)                    Dutch roll
    tau_p = -1 / L_p                                                                                 roll

The modes leave the product of inertia out, the matrices of the lateral motion do not.
"""

import dataclasses

from airrace.aircraft import Aircraft, InnerLoopParameters, Mode, inner_loop_parameters
from airrace.dynamics.aerodynamics import drag_coefficient
from airrace.dynamics.rigid_body import body_axes, roll_yaw_accelerations, stability_axes
from airrace.environment import RHO_ISA, g0
from airrace.frames import Scalar
from airrace.records import record

Pair = tuple[Scalar, Scalar]


@record
class Lags:
    """The constants of the three modes: `stiffness` omega^2 (1/s2), `damping` 2 D omega (1/s), `roll` 1/tau_p (1/s)."""

    stiffness_z: Scalar
    damping_z: Scalar
    stiffness_y: Scalar
    damping_y: Scalar
    roll: Scalar


@record
class Pitching:
    """The pitch derivatives, rad/s2 per rad and rad/s.

    `q' = zero + alpha alpha_A + q q_K + alphadot alpha_K' + eta eta`
    """

    zero: Scalar
    alpha: Scalar
    q: Scalar
    alphadot: Scalar
    eta: Scalar


@record
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
    numbers, given = inner_loop_parameters(aircraft), aircraft.linear
    if given is None:
        return numbers
    if given.short_period is not None:
        numbers = with_short_period(numbers, given.V, given.short_period)
    if given.dutch_roll is not None:
        numbers = with_dutch_roll(numbers, given.V, given.dutch_roll)
    if given.tau_p is not None:
        numbers = dataclasses.replace(numbers, C_lp=numbers.C_lp / (given.tau_p * level_lags(numbers, given.V).roll))
    return numbers


def level_lags(aircraft: InnerLoopParameters[float], V: float) -> Lags:
    """Return the constants of the modes in level flight at the speed `V` (m/s) at sea level."""
    C_L = aircraft.m * g0 / (0.5 * RHO_ISA * V * V * aircraft.S)
    return lags(V, RHO_ISA, drag_coefficient(C_L, 0.0, aircraft), aircraft)


def with_short_period(aircraft: InnerLoopParameters[float], V: float, wanted: Mode) -> InnerLoopParameters[float]:
    """Return the numbers of an aircraft that has the wanted short period at `V` (m/s).

    Both pitch dampings are multiplied by one factor, then `C_malpha` is set. The factor is not positive where the lift
    alone damps more than is wanted.
    """
    M = pitching(V, RHO_ISA, aircraft)
    lift = level_lags(aircraft, V).damping_z + M.q + M.alphadot  # -Z_alpha / V
    factor = (lift - 2.0 * wanted.D * wanted.omega) / (M.q + M.alphadot)
    alpha = -factor * M.q * lift - wanted.omega * wanted.omega
    M_unit = 0.5 * RHO_ISA * V * V * aircraft.S * aircraft.cbar / aircraft.I_y
    return dataclasses.replace(
        aircraft,
        C_mq=aircraft.C_mq * factor,
        C_malphadot=aircraft.C_malphadot * factor,
        C_malpha=alpha / M_unit,
    )


def with_dutch_roll(aircraft: InnerLoopParameters[float], V: float, wanted: Mode) -> InnerLoopParameters[float]:
    """Return the numbers of an aircraft that has the wanted Dutch roll at `V` (m/s).

    `C_nr` is set first, then `C_nbeta`.
    """
    side = 0.5 * RHO_ISA * V * aircraft.S * aircraft.C_Ybeta / aircraft.m  # Y_beta / V
    N_r = -2.0 * wanted.D * wanted.omega - side
    N_beta = wanted.omega * wanted.omega - N_r * side
    N_unit = 0.5 * RHO_ISA * V * V * aircraft.S * aircraft.b / aircraft.I_z
    return dataclasses.replace(aircraft, C_nr=N_r / (N_unit * aircraft.b / (2.0 * V)), C_nbeta=N_beta / N_unit)
