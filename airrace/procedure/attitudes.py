"""Histories of attitudes, in which the quaternions q and -q are the same attitude, but not the same numbers."""

import numpy as np

from airrace.dynamics.point_mass import PointMassState
from airrace.frames import product
from airrace.trajectory import Array

ROWS = [PointMassState.names().index(name) for name in ("q0", "q1", "q2", "q3")]
"""The rows of the quaternion in a state history."""


def align_quaternions(state: Array) -> None:
    """Flip signs, in place, so that neighbours in a state history (n_x, N) lie on the same side."""
    q = state[ROWS]
    q[:, 1:] *= np.cumprod(np.where((q[:, 1:] * q[:, :-1]).sum(axis=0) < 0.0, -1.0, 1.0))
    state[ROWS] = q


def turned(state: Array, before: Array, after: Array) -> Array:
    """Return the quaternions of `state`, turned by the rotations from `before` to `after`; shape (4, N)."""
    q, q_before, q_after = (list(one[ROWS]) for one in (state, before, after))
    inverse = [q_before[0], -q_before[1], -q_before[2], -q_before[3]]
    return np.array(product(product(q_after, inverse), q))
