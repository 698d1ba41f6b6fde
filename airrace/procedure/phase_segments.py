"""Flights in pieces, one per phase, which are cut, concatenated and shifted; their quaternions without jumps of sign.

The quaternions q and -q are the same attitude, but not the same numbers.
"""

from collections.abc import Sequence

import numpy as np

from airrace.dynamics.point_mass import PointMassState
from airrace.frames import product
from airrace.optimal_control.problem import Iterate, Problem
from airrace.trajectory import Array

QUATERNION = [PointMassState.names().index(name) for name in ("q0", "q1", "q2", "q3")]
"""The rows of the quaternion in a state history."""
SHORTEST_SHARE = 0.2
"""The part of the planned duration (1) that a shifted piece lasts at least."""


def align_quaternions(state: Array) -> None:
    """Flip signs, in place, so that neighbours in a state history (n_x, N) lie on the same side."""
    q = state[QUATERNION]
    q[:, 1:] *= np.cumprod(np.where((q[:, 1:] * q[:, :-1]).sum(axis=0) < 0.0, -1.0, 1.0))
    state[QUATERNION] = q


def rotate(state: Array, before: Array, after: Array) -> Array:
    """Return the quaternions of `state`, rotated as from `before` to `after`; shape (4, N)."""
    q, q_before, q_after = (list(one[QUATERNION]) for one in (state, before, after))
    inverse = [q_before[0], -q_before[1], -q_before[2], -q_before[3]]
    return np.array(product(product(q_after, inverse), q))


def phase_piece(whole: Iterate, problem: Problem, index: int) -> Iterate:
    """Return one phase of a flight."""
    first, last = problem.first_node[index], problem.first_node[index + 1]
    return Iterate(whole.durations[index : index + 1], whole.state[:, first : last + 1], whole.control[:, first:last])


def concatenate(pieces: Sequence[Iterate]) -> Iterate:
    """Return pieces as one flight; of two states at a gate the later one counts."""
    state = np.hstack([*(piece.state[:, :-1] for piece in pieces), pieces[-1].state[:, -1:]])
    align_quaternions(state)
    durations = np.concatenate([piece.durations for piece in pieces])
    return Iterate(durations, state, np.hstack([piece.control for piece in pieces]))


def shift(piece: Iterate, before: Iterate, after: Iterate) -> Iterate:
    """Return a solution shifted by the difference between two planned flights."""
    state = piece.state + after.state - before.state
    state[QUATERNION] = rotate(piece.state, before.state, after.state)
    return Iterate(
        np.maximum(piece.durations + after.durations - before.durations, SHORTEST_SHARE * after.durations),
        state,
        piece.control + after.control - before.control,
    )
