"""Which numbers of a log are fresh, and how finely they are written.

A recorder that writes rows faster than a sensor measures repeats the last measurement. Numbers that are written in
steps of `q` are off by up to half of it, `q / sqrt(12)` by standard deviation, however many of them are averaged.
"""

import math

import numpy as np
from numpy.typing import NDArray

from airrace.records import record
from airrace.trajectory import Array


@record
class FreshnessSettings:
    """When numbers of a log are repeated ones.

    Attributes:
        values_max: values that are looked at.
        repeated: share of measurements that fill more than one row, from which on repeated numbers are no chance.
        gap: times the usual step between rows, beyond which rows are missing.
        leap: steps by which a held number leaps when it changes; one that is written coarsely moves by one or two.
    """

    values_max: int = 200_000
    repeated: float = 0.05
    gap: float = 1.5
    leap: float = 3.0


FRESHNESS = FreshnessSettings()


def resolution(values: Array) -> float:
    """Return the step that all values are multiples of but for a common offset; 0 where there is none.

    A step that is much finer than the values are apart is not found; it does not matter.

    Args:
        values: shape (n,); NaN where nothing is known.
    """
    every = max(1, len(values) // FRESHNESS.values_max)
    found = np.unique(values[::every][np.isfinite(values[::every])])
    if len(found) < 10:
        return 0.0
    gaps = np.diff(found)
    gaps = gaps[gaps > 4.0 * np.spacing(np.abs(found).max())]
    if not len(gaps):
        return 0.0
    step, far = float(gaps.min()), found - found[0]
    for reach in (30.0, 1000.0, 3e4, 1e6):  # the step is known the better, the farther the values that it explains
        near = far[far < reach * step]
        counts = np.rint(near / step)
        if len(near) > 1 and counts[-1] > 0:
            step = float(near[-1] / counts[-1])
    counts = far / step
    return step if np.mean(np.abs(counts - np.rint(counts)) < 0.05) > 0.99 else 0.0


def rounding(values: Array) -> float:
    """Return the standard deviation of rounding to the resolution of the values."""
    return resolution(values) / math.sqrt(12.0)


def held(values: Array, time: Array) -> NDArray[np.bool_]:
    """Return which samples only repeat the measurement before, shape (n,).

    Args:
        values: of one or several columns that are measured together, all finite, shape (k, n).
        time: of the samples, s, shape (n,).
    """
    count = int(values.shape[1])
    starts = np.flatnonzero(np.any(np.diff(values, axis=1, prepend=np.inf) != 0.0, axis=0))
    runs = np.diff(starts, append=count)
    if len(runs) < 10 or np.mean(runs > 1) < FRESHNESS.repeated:
        return np.zeros(count, bool)
    leaps = np.abs(np.diff(values[:, starts], axis=1))
    steps = np.array([resolution(one) for one in values])
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.nanmax(np.where(leaps > 0.0, leaps / steps[:, None], 0.0), axis=0)
    if np.median(relative) < FRESHNESS.leap:
        return np.zeros(count, bool)
    usual = int(np.percentile(runs, 99.0, method="lower"))
    place = np.arange(count) - np.repeat(starts, runs)
    took = np.diff(time, prepend=time[0])
    resumed = (took[starts] > FRESHNESS.gap * np.median(took)) & (runs != usual)
    place[np.repeat(resumed, runs)] = 1  # behind a gap nobody knows how old the first one is
    return np.asarray(place % usual != 0, np.bool_)
