"""Frames, rotation matrices and quaternions.

O is the local north-east-down frame, K the kinematic flight-path frame, Kbar the frame K rolled about the velocity by
the kinematic bank angle `mu_K`. `R_OKbar` takes components in Kbar to components in O. Quaternions `(q0, q1, q2, q3)`
have their scalar first. The functions take and return plain lists, so they serve casadi symbols and floats alike.
"""

import math
from collections.abc import Sequence

from airrace.optimal_control.quantities import Scalar

Matrix = list[list[Scalar]]

QUATERNION = ("q0", "q1", "q2", "q3")
"""The names of the states and histories that make up the attitude of Kbar."""


def rotation(q: Sequence[Scalar]) -> Matrix:
    """Return `R_OKbar`, shape (3, 3), of a quaternion of any length.

    It is built from `q / |q|`, so it is always orthonormal.

    Args:
        q: `(q0, q1, q2, q3)`, not all zero.
    """
    q0, q1, q2, q3 = q
    s = 2.0 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    return [
        [1.0 - s * (q2 * q2 + q3 * q3), s * (q1 * q2 - q0 * q3), s * (q1 * q3 + q0 * q2)],
        [s * (q1 * q2 + q0 * q3), 1.0 - s * (q1 * q1 + q3 * q3), s * (q2 * q3 - q0 * q1)],
        [s * (q1 * q3 - q0 * q2), s * (q2 * q3 + q0 * q1), 1.0 - s * (q1 * q1 + q2 * q2)],
    ]


def right_wing(R: Sequence[Sequence[Scalar]], sin_beta_K: Scalar, cos_beta_K: Scalar) -> list[Scalar]:
    """Return the direction of the right wing, three components in O.

    It is the body's y axis, which lies in the plane of x_Kbar and y_Kbar at any angle of attack. Models without
    angles have none: their wing is y_Kbar, that of no sideslip. Whatever keeps a wing clear of something, measures it
    or shows where it is takes it from here.

    Args:
        R: `R_OKbar`, shape (3, 3).
        sin_beta_K, cos_beta_K: of the body's kinematic sideslip.
    """
    return [sin_beta_K * row[0] + cos_beta_K * row[1] for row in R]


def normalise(q: Sequence[Scalar]) -> list[Scalar]:
    """Return `q / |q|`, the unit quaternion of the same rotation."""
    q0, q1, q2, q3 = q
    # a power, not math.sqrt: it serves symbols, too
    length = (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3) ** 0.5
    return [q0 / length, q1 / length, q2 / length, q3 / length]


def product(p: Sequence[Scalar], q: Sequence[Scalar]) -> list[Scalar]:
    """Return the Hamilton product `p o q`, four components."""
    p0, p1, p2, p3 = p
    q0, q1, q2, q3 = q
    return [
        p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3,
        p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2,
        p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1,
        p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0,
    ]


def quaternion_rates(q: Sequence[Scalar], p: Scalar, q_rate: Scalar, r: Scalar) -> list[Scalar]:
    """Return `q_dot = 1/2 q o (0, p, q, r)` in 1/s, with the angular rates in the rotated frame in rad/s."""
    q0, q1, q2, q3 = q
    return [
        0.5 * (-q1 * p - q2 * q_rate - q3 * r),
        0.5 * (q0 * p + q2 * r - q3 * q_rate),
        0.5 * (q0 * q_rate - q1 * r + q3 * p),
        0.5 * (q0 * r + q1 * q_rate - q2 * p),
    ]


def quaternion(chi: float, gamma: float, mu: float) -> list[float]:
    """Return the attitude of Kbar as a unit quaternion, from course, climb and bank angle (rad).

    The rotations are about z, y and x in this order.
    """
    cz, sz = math.cos(chi / 2), math.sin(chi / 2)
    cy, sy = math.cos(gamma / 2), math.sin(gamma / 2)
    cx, sx = math.cos(mu / 2), math.sin(mu / 2)
    return product(product([cz, 0.0, 0.0, sz], [cy, 0.0, sy, 0.0]), [cx, sx, 0.0, 0.0])


def angles(R: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Return `(chi_K, gamma_K, mu_K)` of a rotation matrix `R_OKbar`, rad.

    At the vertical chi and mu are not unique.
    """
    gamma = -math.asin(max(-1.0, min(1.0, R[2][0])))
    return math.atan2(R[1][0], R[0][0]), gamma, math.atan2(R[2][1], R[2][2])


def angle_between(a: float, b: float) -> float:
    """Return `a - b` wrapped to [-pi, pi], rad."""
    return math.remainder(a - b, 2.0 * math.pi)
