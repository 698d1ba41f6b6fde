"""The attitude of the body in the flow, and the rotation of a rigid body with a plane of symmetry.

    R_BKbar = R_y(alpha_K) R_z(-beta_K)        V_A,B = R_BKbar V_A,Kbar = (u, v, w)
    alpha_A = atan2(w, u)                      beta_A = asin(v / V_A)

The aerodynamic frame A is built from alpha_A and beta_A as Kbar is from alpha_K and beta_K.

    I omega' = M - omega x (I omega + h_P e_x),     I = [[I_x, 0, -I_xz], [0, I_y, 0], [-I_xz, 0, I_z]]

With `s = p cos(alpha) + r sin(alpha)`, the body rates in Kbar and what is left of them for the angles:

    w_x =  cos(beta) s + sin(beta) q      alpha_K' = (w_y - q_Kbar) / cos(beta)
    w_y = -sin(beta) s + cos(beta) q      beta_K'  = r_Kbar - w_z
    w_z = -p sin(alpha) + r cos(alpha)    p_Kbar   = w_x - alpha_K' sin(beta)
"""

from airrace.aircraft import InnerLoopParameters
from airrace.dynamics.aerodynamics import Airflow
from airrace.frames import Matrix, Scalar, atan2, cos, sin, sqrt
from airrace.records import record

IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


@record
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
