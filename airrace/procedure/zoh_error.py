"""The cost of holding controls over an interval, in seconds of race time, roughly and interval by interval.

Rates of commands enter the equations linearly, so the objective is curved in them by the regularisation alone: a
control that would vary by d about its mean is held at a price of about the integral of weight d^2. Summed over a race
that is a third to two thirds of what halving all intervals gains, and where it is large, that is gained.
"""

import numpy as np

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import Marks
from airrace.optimal_control.replay import interval_durations
from airrace.trajectory import Array


def foreseen(problem: Problem, iterate: Iterate) -> Array:
    """Estimate the price of every interval from how the controls of its neighbours vary, s; shape (N,).

    A control is taken to change by half of the larger jump at the ends of its interval.
    """
    weights, controls, steps = _scaled(problem, iterate)
    jumps = np.abs(np.diff(controls, axis=1))
    largest = np.zeros_like(controls)
    largest[:, 1:] = jumps
    largest[:, :-1] = np.maximum(largest[:, :-1], jumps)
    return steps * (weights @ (0.25 * largest) ** 2)


def measured(problem: Problem, iterate: Iterate, coarser: Marks) -> Array:
    """Measure the price of every interval of a coarser mesh, s; shape (coarser.sum() - 1,).

    The controls are those of a finer mesh.

    Args:
        coarser: which nodes belong to the coarser mesh, shape (N + 1,).
    """
    weights, controls, steps = _scaled(problem, iterate)
    group = np.cumsum(coarser[:-1]) - 1
    lengths = np.bincount(group, weights=steps)
    means = np.stack([np.bincount(group, weights=steps * row) for row in controls]) / lengths
    price: Array = steps * (weights @ (controls - means[:, group]) ** 2)
    return np.bincount(group, weights=price).astype(np.float64)


def _scaled(problem: Problem, iterate: Iterate) -> tuple[Array, Array, Array]:
    """Return the weights of the regularisation (n_u,), scaled controls (n_u, N), lengths of the intervals (N,)."""
    weights = [problem.objective.regularisation.get(quantity.name, 0.0) for quantity in problem.system.controls]
    scale = np.array([quantity.scale for quantity in problem.system.controls])[:, None]
    return np.array(weights), iterate.control / scale, interval_durations(problem, iterate.durations)
