"""Flights in pieces, one per phase, which are cut, joined and moved."""

from collections.abc import Sequence

import numpy as np

from airrace.optimal_control.problem import Iterate, Problem
from airrace.procedure.attitudes import ROWS, align_quaternions, turned

SHORTEST_SHARE = 0.2
"""The part of the planned duration (1) that a moved piece keeps at least."""


def phase_piece(whole: Iterate, problem: Problem, index: int) -> Iterate:
    """Return one phase of a flight."""
    first, last = problem.first_node[index], problem.first_node[index + 1]
    return Iterate(whole.durations[index : index + 1], whole.state[:, first : last + 1], whole.control[:, first:last])


def joined(pieces: Sequence[Iterate]) -> Iterate:
    """Return pieces as one flight; of two states at a gate the later is kept."""
    state = np.hstack([*(piece.state[:, :-1] for piece in pieces), pieces[-1].state[:, -1:]])
    align_quaternions(state)
    durations = np.concatenate([piece.durations for piece in pieces])
    return Iterate(durations, state, np.hstack([piece.control for piece in pieces]))


def moved(piece: Iterate, before: Iterate, after: Iterate) -> Iterate:
    """Return a solution moved by the difference between two planned flights."""
    state = piece.state + after.state - before.state
    state[ROWS] = turned(piece.state, before.state, after.state)
    return Iterate(
        np.maximum(piece.durations + after.durations - before.durations, SHORTEST_SHARE * after.durations),
        state,
        piece.control + after.control - before.control,
    )
