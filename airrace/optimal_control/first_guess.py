"""Guesses that are made from the conditions of a problem alone, and from what is known of single quantities."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from airrace.optimal_control.layout import narrow_range
from airrace.optimal_control.problem import Boundary, Iterate, Problem, interpolate
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.trajectory import Array


def initial_guess(problem: Problem, durations: Sequence[float] | None = None, **values: ArrayLike) -> Iterate:
    """Make a guess: states straight between what boundaries ask of them, controls in the middle of their ranges.

    Args:
        problem: on whose mesh the guess is.
        durations: of the phases, s; by default the geometric mean of the ends of their ranges.
        values: what is known better, by name of a state or control: one number; for a state n + 1 values, at the start
            and at the ends of the n phases; or values at all nodes (a state's) or on all intervals (a control's).

    Raises:
        ValueError: a name is unknown, or has another number of values.
    """
    system, phases = problem.system, problem.phases
    names = [quantity.name for quantity in (*system.states, *system.controls)]
    if unknown := values.keys() - set(names):
        raise ValueError(f"no states or controls are called {', '.join(sorted(unknown))}; there are {', '.join(names)}")
    seconds = [_duration(phase.duration, problem.time_scale) for phase in phases] if durations is None else durations
    if len(seconds) != len(phases):
        raise ValueError(f"{len(seconds)} durations are given, and the problem has {len(phases)} phases")
    elapsed = np.concatenate([[0.0], np.cumsum(seconds)])
    corners = [_at_corners(problem.boundaries, state, elapsed) for state in system.states]
    controls = [_middle(Interval(control.lower, control.upper)) for control in system.controls]
    guess = interpolate(problem, seconds, corners, controls)
    for row, control in enumerate(system.controls):
        for phase, (first, last) in zip(phases, pairwise(problem.first_node), strict=True):
            guess.control[row, first:last] = _middle(narrow_range(control, phase.bounds))
    along: Array = np.concatenate([[0.0], np.cumsum(np.concatenate([np.array(phase.fractions) for phase in phases]))])
    for name, given in values.items():
        row, array = names.index(name), np.asarray(given, dtype=np.float64)
        history = guess.state[row] if row < len(system.states) else guess.control[row - len(system.states)]
        if array.shape not in ((), (len(phases) + 1,), history.shape) or (
            row >= len(system.states) and array.shape not in ((), history.shape)
        ):
            raise ValueError(f"{array.size} values of {name} are given; one is asked for, or {len(history)}")
        at_ends = array.shape == (len(phases) + 1,) and array.shape != history.shape
        history[:] = np.interp(along, np.arange(len(phases) + 1.0), array) if at_ends else array
    return guess


def _duration(allowed: Interval, typical: float) -> float:
    """Return a duration within its range, s."""
    if math.isfinite(allowed.upper):
        return math.sqrt(allowed.lower * allowed.upper) if allowed.lower > 0.0 else 0.5 * allowed.upper
    return max(2.0 * allowed.lower, typical)


def _at_corners(boundaries: Sequence[Boundary], state: Quantity, elapsed: Array) -> Array:
    """Return a state at the ends of the phases, straight in time between those where something is asked of it."""
    asked = np.array([_asked(boundary.bounds.get(state.name, Interval())) for boundary in boundaries])
    known = np.isfinite(asked)
    if not known.any():
        return np.full(len(asked), _middle(Interval(state.lower, state.upper)))
    return np.interp(elapsed, elapsed[known], asked[known]).astype(np.float64)


def _asked(bounds: Interval) -> float:
    """Return a value that is asked for; NaN where none is."""
    return _middle(bounds) if bounds.constrained else math.nan


def _middle(bounds: Interval) -> float:
    """Return the middle of a range; where an end is absent, the value nearest to zero."""
    if math.isfinite(bounds.lower) and math.isfinite(bounds.upper):
        return 0.5 * (bounds.lower + bounds.upper)
    return min(max(0.0, bounds.lower), bounds.upper)
