"""The numbers that a stored flight cannot have, whoever wrote the file."""

import numpy as np

from airrace.errors import CheckpointError
from airrace.procedure.result import StageResult
from airrace.trajectory import Array, Trajectory

ROUNDED = 1e-9
"""The largest difference between the durations of the phases and the times of their nodes, as a fraction of the race
time: both are sums of the same numbers in another order."""


def ensure_possible(result: StageResult, path: str) -> None:
    """Refuse a stage whose flight nobody can have flown.

    Where no flight was found the numbers are those at which the solver gave up, and anything goes.

    Args:
        result: the stage as it was read.
        path: its place in the file.

    Raises:
        CheckpointError: histories, times or multipliers are not finite; time runs backwards, does not begin at 0, or
            does not pass as the durations of the phases have it.
    """
    if not result.is_flight:
        return
    flown = result.trajectory
    for name, values in (
        ("durations", flown.durations),
        ("time", flown.time),
        ("states", flown.state),
        ("controls", flown.control),
        ("constraint_multipliers", result.constraint_multipliers),
        ("bound_multipliers", result.bound_multipliers),
    ):
        if not np.isfinite(values).all():
            raise CheckpointError(f"{path}/{name}: holds numbers that are not finite")
    _ensure_time_passes(flown, path)


def _ensure_time_passes(flown: Trajectory, path: str) -> None:
    if not (flown.durations > 0.0).all():
        raise CheckpointError(f"{path}/durations: a phase takes no time")
    if flown.time[0] != 0.0 or not (np.diff(flown.time) > 0.0).all():
        raise CheckpointError(f"{path}/time: does not run forwards from 0")
    passed: Array = np.diff(flown.time[flown.first_node])
    if not (np.abs(passed - flown.durations) <= ROUNDED * flown.race_time).all():
        raise CheckpointError(f"{path}/time: does not pass as the durations of the phases have it")
