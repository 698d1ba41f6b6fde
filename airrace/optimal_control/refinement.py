"""A finer mesh where a solution asks for one, and the solution carried over to it."""

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import SAMPLES, Replay

Fractions = tuple[float, ...]


def bisect(
    problem: Problem, iterate: Iterate, flown: Replay, coarse: NDArray[np.bool_]
) -> tuple[list[Fractions], Iterate]:
    """Halve the intervals marked in `coarse`, shape (N,).

    Returns:
        The fractions of every phase, and the iterate on the new mesh: the new nodes lie on the replayed flight.
    """
    fractions: list[Fractions] = []
    for phase, first, last in zip(problem.phases, problem.first_node, problem.first_node[1:], strict=False):
        halves = [
            part
            for fraction, split in zip(phase.fractions, coarse[first:last], strict=True)
            for part in ([fraction / 2, fraction / 2] if split else [fraction])
        ]
        fractions.append(tuple(halves))
    split = np.flatnonzero(coarse)
    state = np.insert(iterate.state, split + 1, flown.state[:, split, SAMPLES // 2], axis=1)
    control = np.insert(iterate.control, split + 1, iterate.control[:, split], axis=1)
    return fractions, Iterate(iterate.durations, state, control)
