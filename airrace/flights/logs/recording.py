"""A log as recorded: its samples, how they are collected from an untrusted file, and which are fresh.

A recorder that writes rows faster than a sensor measures repeats the last measurement. Numbers that are written in
steps of `q` are off by up to half of it, `q / sqrt(12)` by standard deviation, however many of them are averaged.
"""

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Never

import numpy as np
from numpy.typing import NDArray

from airrace.errors import Finding, InputError
from airrace.optimal_control.trajectory import Array

SIZE_MAX = 1024**3
"""The largest file, unpacked, bytes."""
GPX_SIZE_MAX = 256 * 1024**2
"""The largest GPX file, which is held in memory, bytes."""
LINE_MAX = 1_000_000
"""The longest line, bytes."""
SAMPLES_MAX = 6_000_000
"""The greatest number of samples: 83 hours at 20 Hz."""
IDLE_MAX = 1_000_000
"""The greatest number of lines that hold no sample."""
OBJECTS_MAX = 10_000
"""The greatest number of objects of an ACMI recording."""
TEXT_MAX = 200
"""The letters of each property of an object of an ACMI recording, at most."""
DEPTH_MAX = 200
"""The depth of elements within elements of an XML document, at most."""
EARTH_RADIUS = 6.371e6
"""Near enough for speeds and deviations, m."""
LARGEST = 1e18
"""Beyond all numbers that a log records."""


@dataclass(frozen=True, eq=False)
class Recording:
    """The samples of a log, as it records them.

    Attributes:
        path: the file.
        format: `csv`, `gpx`, `igc` or `acmi`.
        time: s after the first sample, shape (n,).
        columns: by the names of histories, SI and radians, each of shape (n,); NaN where a sample does not say.
        lines: of the file, shape (n,); they count from 1.
        begins: when the first sample was taken; None where the log knows no date.
        remarks: for the user of the recording, as sentences.
        others: further aircraft or tracks of the same file, one of which may pass the course.
        unsaid: columns whose units the log does not say.
        mapped: columns with a scale or zero from a mapping.
        barometric: whether its heights are those of a barometer.
        accuracy: standard deviation of all that positions are off by together, or for seconds, m, as it is stated; None
            for what the log says itself, see `quality`.
        label: of the aircraft or track, where there are others.
        cut: the step to which its times are cut off, s; 0 where they are not. How well they are known once they are
            repaired is its column `clock_deviation`, s.
    """

    path: str
    format: str
    time: Array
    columns: Mapping[str, Array]
    lines: NDArray[np.int64]
    begins: datetime | None = None
    remarks: tuple[str, ...] = ()
    others: tuple["Recording", ...] = ()
    unsaid: tuple[str, ...] = ()
    mapped: tuple[str, ...] = ()
    barometric: bool = False
    accuracy: float | None = None
    label: str = ""
    cut: float = 0.0

    def raised(self, offset: float) -> "Recording":
        """Return the recording with an offset of all heights, m, and a remark on it."""
        if offset == 0.0:
            return self
        heights = {name: self.columns[name] + offset for name in ("altitude", "height") if name in self.columns}
        remark = f"{offset:+g} m are added to all heights, as stated"
        return replace(self, columns={**self.columns, **heights}, remarks=(*self.remarks, remark))

    def select(self, rows: NDArray[np.bool_], *remarks: str) -> "Recording":
        """Return the recording with some of its samples only, and further remarks."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        remarks = (*self.remarks, *remarks)
        return replace(self, time=self.time[rows], columns=columns, lines=self.lines[rows], remarks=remarks)


def ground(columns: Mapping[str, Array]) -> Array:
    """Return north and east, m, near enough for a speed, shape (2, n)."""
    if "x" in columns and "y" in columns:
        return np.stack([columns["x"], columns["y"]])
    north, east = columns["latitude"], columns["longitude"]
    return EARTH_RADIUS * np.stack([north, east * np.cos(north)])


def refuse(path: str, line: int, message: str, key: str = "") -> Never:
    """Refuse a log.

    Args:
        path: the file.
        line: where the fault is; 0 for the file as a whole.
        message: what is wrong, and what would be right.
        key: the column, if it is one's.

    Raises:
        InputError: always.
    """
    raise InputError([Finding(path, line, 0 if line == 0 else 1, key, message)])


def count_of(number: int, what: str, more: str = "") -> str:
    """Return a number of things with their verb, `1 outlier is` or `3 fixes of ... are`."""
    several = f"{what}es" if what.endswith("x") else f"{what}s"
    return f"1 {what}{more} is" if number == 1 else f"{number} {several}{more} are"


def enumerate_words(words: Sequence[str]) -> str:
    """Return words for a message, shortened and in quotes, at most twelve of them."""
    return ", ".join([f"`{word[:60]}`" for word in words[:12]] + ["..."] * (len(words) > 12))


class SampleTable:
    """Samples of a log as they are read: the line of each, and the values of its columns.

    What cannot be read is left out, counted, and reported with the first place where it happened.

    Args:
        path: of the file, for messages.
        columns: their number.
        what: the word for samples in messages.
    """

    def __init__(self, path: str, columns: int, what: str = "sample") -> None:
        self.path, self._what = path, what
        self.lines = array("q")
        self.columns = [array("d") for _ in range(columns)]
        self.faults: dict[str, LogFault] = {}

    def append(self, line: int, *values: float) -> None:
        """Add a sample; refuse it where there are too many."""
        if len(self.lines) >= SAMPLES_MAX:
            refuse(self.path, line, f"holds more than {SAMPLES_MAX} {self._what}s; cut the log to the flight")
        self.lines.append(line)
        for column, value in zip(self.columns, values, strict=True):
            column.append(value)

    def leave_out(self, line: int, message: str, key: str = "", *, whole: bool = True) -> None:
        """Count something that cannot be read: a whole sample, or only its value of a column."""
        if key not in self.faults:
            printable = "".join(letter if letter.isprintable() else "\ufffd" for letter in message)
            self.faults[key] = LogFault(key, line, printable, whole)
        self.faults[key].count += 1

    def number(self, line: int, text: str, key: str) -> float:
        """Return the number that a text holds; NaN where it holds none, which is counted."""
        try:
            value = float(text)
        except ValueError:
            value = math.inf
        if not abs(value) >= LARGEST:
            return value
        hint = "; say `decimal: comma` in the mapping" if "," in text else ""
        self.leave_out(line, f"`{text[:40]}` is no number{hint}", key, whole=False)
        return math.nan

    def arrays(self, missing: str) -> tuple[NDArray[np.int64], list[Array]]:
        """Return the lines and the columns.

        Raises:
            InputError: there are not two samples; it names the first fault, or is `missing` where there is none.
        """
        if len(self.lines) < 2:
            self.refuse_first_fault()
            refuse(self.path, 0, missing)
        return np.frombuffer(self.lines, np.int64), [np.frombuffer(column, np.float64) for column in self.columns]

    def refuse_first_fault(self, *keys: str) -> None:
        """Refuse the log for the first thing that could not be read, if there is any; of some columns where named."""
        faults = [fault for fault in self.faults.values() if not keys or fault.key in keys]
        if faults:
            first = min(faults, key=lambda fault: fault.line)
            refuse(self.path, first.line, first.message, first.key)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on what was left out."""
        return tuple(fault.sentence(self._what) for fault in self.faults.values())


@dataclass
class LogFault:
    """What could not be read: how often, and where and why for the first time.

    Attributes:
        key: the column, if it is one's.
        line, message: of the first time.
        whole: whether the whole sample is left out, or only the value.
        count: how often.
    """

    key: str
    line: int
    message: str
    whole: bool
    count: int = 0

    def sentence(self, what: str) -> str:
        """Return what is reported of it; `what` is the word for a sample."""
        thing = what if self.whole else "value"
        column = f" of `{self.key[:60]}`" if self.key and not self.whole else ""
        counted = count_of(self.count, thing, column)
        return f"{counted} left out, the first one in line {self.line}: {self.message.partition(';')[0]}"


VALUES_MAX = 200_000
"""The number of values that are looked at for repeated ones."""
REPEATED_SHARE = 0.05
"""The share of measurements that fill more than one row from which on repeated numbers are no chance."""
GAP_FACTOR = 1.5
"""The multiple of the usual step between rows beyond which rows are missing."""
LEAP = 3.0
"""The steps by which a held number leaps when it changes; one that is written coarsely moves by one or two."""


def resolution(values: Array) -> float:
    """Return the step that all values are multiples of but for a common offset; 0 where there is none.

    A step that is much finer than the values are apart is not found; it does not matter.

    Args:
        values: shape (n,); NaN where nothing is known.
    """
    every = max(1, len(values) // VALUES_MAX)
    distinct = np.unique(values[::every][np.isfinite(values[::every])])
    if len(distinct) < 10:
        return 0.0
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 4.0 * np.spacing(np.abs(distinct).max())]
    if not len(gaps):
        return 0.0
    step, far = float(gaps.min()), distinct - distinct[0]
    for reach in (30.0, 1000.0, 3e4, 1e6):  # the step is known the better, the farther the values that it explains
        leaps = far[far < reach * step]
        counts = np.rint(leaps / step)
        if len(leaps) > 1 and counts[-1] > 0:
            step = float(leaps[-1] / counts[-1])
    counts = far / step
    return step if np.mean(np.abs(counts - np.rint(counts)) < 0.05) > 0.99 else 0.0


def rounding(values: Array) -> float:
    """Return the standard deviation of rounding to the resolution of the values."""
    return resolution(values) / math.sqrt(12.0)


def repeats(values: Array, time: Array) -> NDArray[np.bool_]:
    """Return which samples only repeat the measurement before, shape (n,).

    Args:
        values: of one or several columns that are measured together, all finite, shape (k, n).
        time: of the samples, s, shape (n,).
    """
    count = int(values.shape[1])
    starts = np.flatnonzero(np.any(np.diff(values, axis=1, prepend=np.inf) != 0.0, axis=0))
    runs = np.diff(starts, append=count)
    if len(runs) < 10 or np.mean(runs > 1) < REPEATED_SHARE:
        return np.zeros(count, bool)
    leaps = np.abs(np.diff(values[:, starts], axis=1))
    steps = np.array([resolution(value) for value in values])
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.nanmax(np.where(leaps > 0.0, leaps / steps[:, None], 0.0), axis=0)
    if np.median(relative) < LEAP:
        return np.zeros(count, bool)
    usual = int(np.percentile(runs, 99.0, method="lower"))
    place = np.arange(count) - np.repeat(starts, runs)
    took = np.diff(time, prepend=time[0])
    resumed = (took[starts] > GAP_FACTOR * np.median(took)) & (runs != usual)
    place[np.repeat(resumed, runs)] = 1  # behind a gap the age of the first one is unknown
    return np.asarray(place % usual != 0, np.bool_)
