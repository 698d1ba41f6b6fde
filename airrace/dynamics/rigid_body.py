"""The rotation of a rigid body with a plane of symmetry, and of that body relative to the flight-path frame.

    I omega' = M - omega x (I omega + h_P e_x),     I = [[I_x, 0, -I_xz], [0, I_y, 0], [-I_xz, 0, I_z]]

With `s = p cos(alpha) + r sin(alpha)`, the body rates in Kbar and what is left of them for the angles:

    w_x =  cos(beta) s + sin(beta) q      alpha_K' = (w_y - q_Kbar) / cos(beta)
    w_y = -sin(beta) s + cos(beta) q      beta_K'  = r_Kbar - w_z
    w_z = -p sin(alpha) + r cos(alpha)    p_Kbar   = w_x - alpha_K' sin(beta)
"""

from airrace.dynamics.attitude import stability_axes
from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.environment.elementary import cos, sin
from airrace.frames import Scalar

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
    p_dot, r_dot = uncoupled(roll, yaw, aircraft)
    return p_dot, pitch / aircraft.I_y, r_dot


def uncoupled(roll: Scalar, yaw: Scalar, aircraft: InnerLoopParameters[Scalar]) -> tuple[Scalar, Scalar]:
    """Return the accelerations `(p', r')` (rad/s2) that moments about x_B and z_B (N m) make.

    The product of inertia couples the two axes, so each moment makes both.
    """
    determinant = aircraft.I_x * aircraft.I_z - aircraft.I_xz * aircraft.I_xz
    return (
        (aircraft.I_z * roll + aircraft.I_xz * yaw) / determinant,
        (aircraft.I_xz * roll + aircraft.I_x * yaw) / determinant,
    )


def coupled(p_dot: Scalar, r_dot: Scalar, aircraft: InnerLoopParameters[Scalar]) -> tuple[Scalar, Scalar]:
    """Return the moments about x_B and z_B (N m) that make the accelerations (rad/s2): the inverse of `uncoupled`."""
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
