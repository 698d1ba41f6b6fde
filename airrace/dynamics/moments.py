"""The coefficients of force and moment of an aircraft that rotates.

    C_L = C_L(alpha_A) + C_Lq q* + C_Leta eta                     C_L(alpha_A) rounded off at C_L_max and C_L_min
    C_Y = C_Ybeta beta_A + C_Yp p* + C_Yr r* + C_Yxi xi + C_Yzeta zeta
    C_l = C_lbeta beta_A + C_lp p* + C_lr r* + C_lxi xi + C_lzeta zeta
    C_m = C_m0 + C_malpha alpha_A + C_mq q* + C_malphadot alpha_K_dot* + C_meta eta
    C_n = C_nbeta beta_A + C_np p* + C_nr r* + C_nxi xi + C_nzeta zeta

Starred rates are dimensionless: `b / (2 V_A)` times p and r, `cbar / (2 V_A)` times q and alpha_K_dot. `C_lr` and
`C_np` grow with the lift coefficient. A positive deflection makes a negative moment about its own axis.
"""

from airrace.dynamics.aerodynamics import STALL_BLEND
from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.environment.elementary import smooth_clip
from airrace.frames import Scalar
from airrace.records import record


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
