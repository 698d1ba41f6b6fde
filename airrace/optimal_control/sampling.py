"""States between the nodes: one independent integration from the node before each wanted time."""

import numpy as np

from airrace.optimal_control.compiled_rates import PointFunctions
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.reference_integration import integrate
from airrace.trajectory import Array


def sample(problem: Problem, iterate: Iterate, time: Array, times: Array) -> Array:
    """States at any times of a flight.

    Args:
        problem: whose system flies.
        iterate: states at nodes and controls on intervals.
        time: of the nodes, s; shape (N + 1,).
        times: wanted, s, within the flight; shape (n,).

    Returns:
        At the instant of a jump between phases the state after it. Shape (n_x, n).
    """
    interval = np.clip(np.searchsorted(time, times, side="right") - 1, 0, len(time) - 2)
    lengths = times - time[interval]
    start, control = iterate.state[:, interval], iterate.control[:, interval]
    n_x, n = start.shape
    rates = PointFunctions(problem).rates(control)
    scale = np.array([quantity.scale for quantity in problem.system.states])[:, None]

    def side_by_side(_: float, flat: Array) -> Array:
        return (rates(flat.reshape(n_x, n) * scale) * lengths / scale).ravel()

    ends = integrate(side_by_side, (start / scale).ravel(), np.array([0.0, 1.0]), relative=1e-10, absolute=1e-10)
    return ends[:, -1].reshape(n_x, n) * scale
