"""The attitude of the body in space, from the flight path and the angles of the flow.

Models with angles know it: `R_OB = R_OKbar R_BKbar(alpha_K, beta_K)^T`. For the others the body is turned into the air
that meets it, as their load factors are: x_A along the velocity relative to the air, z_A in the plane of that and of
z_Kbar, the body at the angle of attack that the lift takes and at the sideslip of the side force.
"""

import numpy as np

from airrace.model.aircraft import Lift
from airrace.model.frames import rotation
from airrace.optimal_control.quantities import Scalar
from airrace.optimal_control.trajectory import Array

Axes = Array
"""Rotation matrices over time, shape (3, 3, n)."""


def path_axes(q: list[Array]) -> Axes:
    """Return `R_OKbar` over time, from the rows of its quaternion, each of shape (n,)."""
    return _stack(rotation(q), q[0])


def body_axes(R_OKbar: Axes, alpha_K: Array, beta_K: Array) -> Axes:
    """Return `R_OB` over time of a body at kinematic angles, rad, each of shape (n,)."""
    return np.einsum("ijn,kjn->ikn", R_OKbar, _to_body(alpha_K, beta_K))


def air_axes(R_OKbar: Axes, V_O: Array) -> Axes:
    """Return `R_OA` over time, from the axes of the flow that meets an aircraft.

    Args:
        R_OKbar: of the flight path.
        V_O: velocity relative to the air, components in O, m/s, shape (3, n).
    """
    x = _unit(V_O)
    z_Kbar = np.asarray(R_OKbar[:, 2], np.float64)
    z = _unit(z_Kbar - np.sum(z_Kbar * x, axis=0) * x)
    return np.stack([x, np.cross(z, x, axis=0), z], axis=1)


def angle_of_attack(C_L: Array, lift: Lift) -> Array:
    """Return the angle of attack that a lift coefficient takes on the linear lift curve, controls neutral, rad."""
    return (C_L - lift.C_L0) / lift.C_Lalpha


def quaternions(R: Axes) -> list[Array]:
    """Return the rows of the quaternions of rotation matrices, scalar first, without jumps of sign; four of shape (n,).

    The largest of the four components is computed from the diagonal and divides the others, so nothing is divided by a
    small number.
    """
    traces = np.stack(
        [
            1.0 + R[0, 0] + R[1, 1] + R[2, 2],
            1.0 + R[0, 0] - R[1, 1] - R[2, 2],
            1.0 - R[0, 0] + R[1, 1] - R[2, 2],
            1.0 - R[0, 0] - R[1, 1] + R[2, 2],
        ]
    )
    a, b, c = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    # products[i, j] is four times component i times component j
    products = np.array([[traces[0], a, b, c], [a, traces[1], d, e], [b, d, traces[2], f], [c, e, f, traces[3]]])
    largest = np.argmax(traces, axis=0)
    q = np.take_along_axis(products, largest[None, None, :], axis=0)[0]
    return list(without_sign_flips(q / np.linalg.norm(q, axis=0)))


def without_sign_flips(q: Array) -> Array:
    """Return the same attitudes, shape (4, n), each quaternion in the hemisphere of the one before.

    A quaternion and its negative are one attitude.
    """
    flips = np.sum(q[:, 1:] * q[:, :-1], axis=0) < 0.0
    return q * np.concatenate(([1.0], np.cumprod(np.where(flips, -1.0, 1.0))))


def interpolate_attitude(time: Array, q: Array, times: Array) -> Array:
    """Return quaternions, shape (4, m), between those at some times, shape (4, n), along the shorter way.

    Their components are interpolated linearly and scaled to length one.
    """
    rows: list[Array] = list(without_sign_flips(q))
    between = np.array([np.interp(times, time, row) for row in rows], np.float64)
    return between / np.linalg.norm(between, axis=0)


def euler_angles(R: Axes) -> tuple[Array, Array, Array]:
    """Return heading, pitch and roll (or course, climb and bank) of rotation matrices, rad, shape (n,)."""
    theta = -np.arcsin(np.clip(R[2, 0], -1.0, 1.0))
    return np.arctan2(R[1, 0], R[0, 0]), theta, np.arctan2(R[2, 1], R[2, 2])


def _to_body(alpha: Array, beta: Array) -> Axes:
    """Return `R_BKbar` of kinematic angles, or `R_BA` of aerodynamic ones, rad, shape (n,) [theory/model.md]."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    return _stack([[ca * cb, -ca * sb, -sa], [sb, cb, 0.0], [sa * cb, -sa * sb, ca]], alpha)


def _stack(rows: list[list[Scalar]], like: Array) -> Axes:
    return np.array([[np.broadcast_to(entry, like.shape) for entry in row] for row in rows])


def _unit(vectors: Array) -> Array:
    """Return the columns scaled to length one, shape (3, n)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0), np.float64)
