"""The states between the nodes, each flown from the node before the wanted time.

Every sample is flown in one step of order 7 and in two, then in twice as many until they agree. Nothing here certifies
a flight, so no independent integrator has to be loaded: that takes longer than all samples of a race.
"""

from dataclasses import replace

import numpy as np

from airrace.optimal_control.point_functions import function_at_points
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.rows import Indices
from airrace.optimal_control.runge_kutta import VERNER_7
from airrace.system import System
from airrace.trajectory import Array

AGREEMENT = 1e-8
"""The largest difference, in the states' scales, between a sample and the same in half as many steps.

Its own error is then a hundred times smaller: on the shipped races samples differ by 5e-10 at most from those of
scipy's DOP853 at a tolerance of 1e-10.
"""
STEPS_MAX = 256
"""The largest number of steps to a sample; a flight that needs more of them between two nodes is none."""


def sample(system: System, parameters: Array, iterate: Iterate, *, time: Array, times: Array) -> Array:
    """Compute the states at any times of a flight.

    Args:
        system: what flies.
        parameters: its parameters, shape (n_p,).
        iterate: states at nodes and controls on intervals.
        time: of the nodes, s; shape (N + 1,).
        times: wanted, s, within the flight; shape (n,).

    Returns:
        The states, in their units; at the instant of a jump between phases the state after it. Shape (n_x, n). NaN
        where the rates cannot be integrated.
    """
    interval = np.clip(np.searchsorted(time, times, side="right") - 1, 0, len(time) - 2)
    start, control, lengths = iterate.state[:, interval], iterate.control[:, interval], times - time[interval]
    scale = np.array([quantity.scale for quantity in system.states])[:, None]

    def flown(wanted: Indices, steps: int) -> Array:
        rates = function_at_points(system.rates, control[:, wanted], parameters)

        def held(x: Array, _: None, __: None) -> Array:
            return rates(x)

        with np.errstate(over="ignore", invalid="ignore"):  # of flights that are none
            return replace(VERNER_7, steps=steps).advance(held, start[:, wanted], None, None, lengths[wanted])

    apart, steps = np.arange(len(times)), 1
    samples = flown(apart, steps)
    while len(apart) and steps < STEPS_MAX:
        steps *= 2
        finer = flown(apart, steps)
        agreeing = (np.abs(finer - samples[:, apart]) <= AGREEMENT * scale).all(axis=0)
        lost = ~np.isfinite(finer).all(axis=0)
        samples[:, apart] = np.where(lost, np.nan, finer)
        apart = apart[~agreeing & ~lost]
    samples[:, apart] = np.nan
    return samples
