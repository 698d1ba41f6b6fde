"""The linear covariance of a closed loop: what thousands of flights would scatter, from one sweep along the line.

The errors, the decisions that wait, the states of the gusts, what is off for the whole flight, the lateness of the
ailerons and the time lost are one vector z, and a sample maps it linearly and adds noise:

    z[k+1] = A[k] z[k] + w[k],   P[k+1] = A[k] P[k] A[k]^T + W[k]

Limits of stick and stall are not in it: it holds for small disturbances, and is an underestimate for large ones.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from airrace.flights.safety.closed_loop import ClosedLoop, course
from airrace.flights.safety.disturbances import Gusts, Scatter
from airrace.flights.safety.nominal import ERRORS, instants
from airrace.flights.safety.plant import CONTROLS, DISTURBANCES, GUST_STATES, STATIONARY_GUSTS
from airrace.optimal_control.trajectory import Array

SIZE = len(ERRORS)


def closed_loop_matrix(F: Array, G: Array, L: Array, waiting: int) -> Array:
    """Return the matrix of one sample of (e, the decisions that wait), shape (n + d n_u, n + d n_u).

    Args:
        F, G: of the sample, shapes (n, n), (n, n_u).
        L: the feedback, shape (n_u, n + d n_u).
        waiting: d, how many samples a decision waits.
    """
    n, m = G.shape
    if not waiting:
        return F + G @ L
    A = np.zeros((n + waiting * m, n + waiting * m))
    A[:n, :n], A[:n, n : n + m] = F, G
    A[n:-m, n + m :] = np.eye((waiting - 1) * m)
    A[-m:] = L
    return A


def propagate(start: Array, steps: Iterator[tuple[Array, Array]]) -> Iterator[Array]:
    """Yield the covariance at every sample, the start's first, from (A, W) of every sample."""
    now = start
    yield now
    for A, W in steps:
        now = A @ now @ A.T + W
        yield now


def covariance(loop: ClosedLoop, scatter: Scatter) -> Array:
    """Return the covariances of (e, the disturbances of a sample, the time lost) on the samples of the clock.

    Args:
        loop: aircraft, line and pilot.
        scatter: the disturbances.

    Returns:
        Shape (N + 1, 16 + 6 + 1, 16 + 6 + 1); the time lost is in s, positive where a flight is late.
    """
    linear, pilot, nominal = loop.linear, loop.pilot, loop.nominal
    waiting, count, sample = pilot.waiting, linear.count, pilot.sample
    own = SIZE + waiting * CONTROLS
    gust, constant = own, own + GUST_STATES
    late = constant + DISTURBANCES  # of the ailerons in the middles of two legs
    size = late + 2 + 1
    clock = instants(sample, count + 1)
    line = nominal.at(clock)
    filters = None if scatter.gusts is Gusts.NONE else loop.gust_filter(scatter.gusts, count + 1)
    into_ned = _turn(line)
    weights, leg = _timing(loop, count + 1)
    # how far ailerons are off where they are late by a second, by differences as wide as they are late
    width = max(scatter.timing, 1e-3)
    off = (nominal.moved_to(clock - width)[1] - nominal.moved_to(clock + width)[1]) / (2.0 * width)

    start = np.zeros((size, size))
    start[gust:constant, gust:constant] = STATIONARY_GUSTS
    start[constant:late, constant:late] = np.diag(np.array(scatter.constant) ** 2)
    start[late : late + 2, late : late + 2] = np.eye(2) * scatter.timing**2

    def disturbances(k: int) -> Array:
        """Return the map from z to the disturbances of a sample, shape (6, size)."""
        D = np.zeros((DISTURBANCES, size))
        D[:, constant:late] = np.eye(DISTURBANCES)
        if filters is not None:
            D[:3, gust:constant] = into_ned[k] @ filters.output[k]
        return D

    def steps() -> Iterator[tuple[Array, Array]]:
        for k in range(count):
            A, W = np.eye(size), np.zeros((size, size))
            D = disturbances(k)
            A[:own, :own] = closed_loop_matrix(linear.F[k], linear.G[k], loop.gains.L[k], waiting)
            A[:SIZE] += linear.E[k] @ D
            moved = (off[k + 1] * weights[k + 1] - off[k] * weights[k]) / sample
            A[:SIZE, late : late + 2] += np.outer(linear.G[k][:, 1], moved)
            A[-1, :SIZE] -= linear.slip[k, :SIZE]
            A[-1] -= linear.slip[k, SIZE + CONTROLS :] @ D
            if waiting:
                A[-1, SIZE : SIZE + CONTROLS] -= linear.slip[k, SIZE : SIZE + CONTROLS]
            if filters is not None:
                A[gust:constant, gust:constant] = filters.step[k]
                W[gust:constant, gust:constant] = filters.noise[k] @ filters.noise[k].T
            if leg[k + 1] != leg[k]:  # the leg behind is the next one before, and another comes
                A[late] = A[late + 1]
                A[late + 1] = 0.0
                W[late + 1, late + 1] = scatter.timing**2
            yield A, W

    output = np.zeros((SIZE + DISTURBANCES + 1, size))
    output[:SIZE, :SIZE], output[-1, -1] = np.eye(SIZE), 1.0
    covariances = np.empty((count + 1, *[SIZE + DISTURBANCES + 1] * 2))
    for k, P in enumerate(propagate(start, steps())):
        output[SIZE:-1] = disturbances(k)
        covariances[k] = output @ P @ output.T
    return covariances


def _turn(line: Array) -> Array:
    """Return the rotations from (u, v, w) of gusts to north, east, down, shape (N, 3, 3)."""
    east, north = course(line)
    zero, unit = np.zeros_like(east), np.ones_like(east)
    rows = [[north, -east, zero], [east, north, zero], [zero, zero, unit]]
    return np.moveaxis(np.array(rows), 2, 0)


def _timing(loop: ClosedLoop, samples: int) -> tuple[Array, NDArray[np.int64]]:
    """Return the weights of two legs in the lateness of the ailerons, shape (N, 2), and the number of the first."""
    middles, clock = loop.leg_middles, instants(loop.pilot.sample, samples)
    if len(middles) < 2:
        return np.tile([1.0, 0.0], (samples, 1)), np.zeros(samples, np.int64)
    leg = np.clip(np.searchsorted(middles, clock, side="right") - 1, 0, len(middles) - 2).astype(np.int64)
    share = np.clip((clock - middles[leg]) / (middles[leg + 1] - middles[leg]), 0.0, 1.0)
    return np.stack([1.0 - share, share], axis=1), leg
