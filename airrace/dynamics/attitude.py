"""The attitude of the body in the flow: from the kinematic angles and the wind to the aerodynamic angles.

    R_BKbar = R_y(alpha_K) R_z(-beta_K)        V_A,B = R_BKbar V_A,Kbar = (u, v, w)
    alpha_A = atan2(w, u)                      beta_A = asin(v / V_A)

The aerodynamic frame A is built from alpha_A and beta_A as Kbar is from alpha_K and beta_K.
"""

from airrace.dynamics.aerodynamics import Airflow
from airrace.environment.elementary import atan2, cos, sin, sqrt
from airrace.frames import Matrix, Scalar
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
