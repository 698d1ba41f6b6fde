"""A flight sampled at given times."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from airrace.errors import UsageError
from airrace.records import record
from airrace.trajectory import Array, Trajectory

# Returns named histories at given times (s, shape (n,)), at least of all states, e.g. by integration between nodes.
Sampler = Callable[[Array], Mapping[str, Array]]

QUATERNION = ("q0", "q1", "q2", "q3")
ROWS_MAX = 10_000_000
"""The largest number of rows that are sampled at a fixed rate."""


@record
class Samples:
    """The histories of a flight at the times of the rows.

    Attributes:
        time: s; shape (n,).
        histories: every state and control by name; each of shape (n,).
        phase: index of the phase each row lies in; a gate belongs to the phase it begins. Shape (n,).
    """

    time: Array
    histories: Mapping[str, Array]
    phase: NDArray[np.int64]


def at_nodes(trajectory: Trajectory) -> Samples:
    """Return the samples of a flight, one row per node; the last node repeats the controls of the last interval."""
    intervals = np.minimum(np.arange(len(trajectory.time)), trajectory.control.shape[1] - 1)
    return Samples(
        trajectory.time,
        {**_states(trajectory, trajectory.state), **_controls(trajectory, intervals)},
        _phases(trajectory, intervals),
    )


def at_rate(trajectory: Trajectory, rate: float, sampler: Sampler | None = None) -> Samples:
    """Return rows at a fixed rate from the start, and a last one at the very end.

    Controls are those of the interval the time lies in. States come from the sampler; without one they are interpolated
    linearly between the nodes (which cuts corners by up to `a dt^2 / 8`, e.g. 0.35 m at 10 g and intervals of 0.17 s),
    quaternions along the shorter way and renormalised.

    Args:
        trajectory: the flight.
        rate: rows per second, Hz.
        sampler: gives states, and perhaps controls, at given times.

    Raises:
        UsageError: the rate is not positive or gives more than ten million rows, or the flight has no finite duration.
    """
    return at_times(trajectory, times_at_rate(trajectory, rate), sampler)


def at_times(trajectory: Trajectory, time: Array, sampler: Sampler | None = None) -> Samples:
    """Return rows at any times of a flight; see `at_rate`."""
    intervals = np.searchsorted(trajectory.time, time, side="right") - 1
    intervals = np.clip(intervals, 0, trajectory.control.shape[1] - 1)
    states = _interpolated(trajectory, time) if sampler is None else sampler(time)
    return Samples(time, {**_controls(trajectory, intervals), **states}, _phases(trajectory, intervals))


def times_at_rate(trajectory: Trajectory, rate: float) -> Array:
    """Return the times of rows at a fixed rate, s; errors as of `at_rate`."""
    start, end = float(trajectory.time[0]), float(trajectory.time[-1])
    if not np.all(np.isfinite(trajectory.time)):
        raise UsageError("this flight has no finite duration: it can only be exported on its mesh")
    if not 0.0 < rate < float("inf") or (end - start) * rate > ROWS_MAX:
        raise UsageError(
            f"a rate of {rate:g} Hz cannot be exported: it must be positive and give at most {ROWS_MAX} rows"
        )
    # A last step shorter than a millionth of a step is the end itself, met up to rounding.
    steps = int(np.ceil((end - start) * rate - 1e-6))
    return np.append(start + np.arange(steps) / rate, end)


def _states(trajectory: Trajectory, values: Array) -> dict[str, Array]:
    return {quantity.name: row for quantity, row in zip(trajectory.states, values, strict=True)}


def _controls(trajectory: Trajectory, intervals: NDArray[np.int64]) -> dict[str, Array]:
    values = trajectory.control[:, intervals]
    return {quantity.name: row for quantity, row in zip(trajectory.controls, values, strict=True)}


def _phases(trajectory: Trajectory, intervals: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.searchsorted(trajectory.first_node[1:-1], intervals, side="right")


def _interpolated(trajectory: Trajectory, time: Array) -> dict[str, Array]:
    nodes = _states(trajectory, trajectory.state)
    if all(name in nodes for name in QUATERNION):
        q = _without_sign_flips(np.array([nodes[name] for name in QUATERNION]))
        nodes.update(zip(QUATERNION, q, strict=True))
    histories = {name: np.interp(time, trajectory.time, values) for name, values in nodes.items()}
    if all(name in histories for name in QUATERNION):
        q = np.array([histories[name] for name in QUATERNION])
        histories.update(zip(QUATERNION, q / np.linalg.norm(q, axis=0), strict=True))
    return histories


def _without_sign_flips(q: Array) -> Array:
    """Return the same attitudes, shape (4, n), each quaternion in the hemisphere of the one before.

    A quaternion and its negative are one attitude.
    """
    flips = np.sum(q[:, 1:] * q[:, :-1], axis=0) < 0.0
    signs = np.cumprod(np.where(flips, -1.0, 1.0))
    return q * np.concatenate(([1.0], signs))
