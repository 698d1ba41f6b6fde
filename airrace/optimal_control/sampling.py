"""The states between the nodes, each by one independent integration from the node before the wanted time."""

import numpy as np

from airrace.optimal_control.interpreted_rates import interpreted
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.reference_integration import integrate
from airrace.system import System
from airrace.trajectory import Array


def sample(system: System, parameters: Array, iterate: Iterate, *, time: Array, times: Array) -> Array:
    """Compute the states at any times of a flight.

    Args:
        system: what flies.
        parameters: its parameters, shape (n_p,).
        iterate: states at nodes and controls on intervals.
        time: of the nodes, s; shape (N + 1,).
        times: wanted, s, within the flight; shape (n,).

    Returns:
        The states, in their units; at the instant of a jump between phases the state after it. Shape (n_x, n).
    """
    interval = np.clip(np.searchsorted(time, times, side="right") - 1, 0, len(time) - 2)
    lengths = times - time[interval]
    start, control = iterate.state[:, interval], iterate.control[:, interval]
    n_x, n = start.shape
    rates = interpreted(system.rates, control, parameters)
    scale = np.array([quantity.scale for quantity in system.states])[:, None]

    def side_by_side(_: float, flat: Array) -> Array:
        return (rates(flat.reshape(n_x, n) * scale) * lengths / scale).ravel()

    ends = integrate(side_by_side, (start / scale).ravel(), np.array([0.0, 1.0]), relative=1e-10, absolute=1e-10)
    return ends[:, -1].reshape(n_x, n) * scale
