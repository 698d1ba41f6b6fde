"""A log as recorded: its samples, and how they are collected from a file that nobody vouches for."""

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Never

import numpy as np
from numpy.typing import NDArray

from airrace.errors import Finding, InputError
from airrace.records import record
from airrace.trajectory import Array


@record
class LogLimits:
    """The largest logs that are read.

    Attributes:
        size: bytes of a file, unpacked.
        gpx_size: bytes of a GPX file, which is held in memory.
        line: bytes of a line.
        samples: their number; 83 hours at 20 Hz.
        idle: lines that hold no sample.
        objects: of an ACMI recording.
        text: letters of what an ACMI recording tells of an object.
        depth: of elements within elements of an XML document.
    """

    size: int = 1024**3
    gpx_size: int = 256 * 1024**2
    line: int = 1_000_000
    samples: int = 6_000_000
    idle: int = 1_000_000
    objects: int = 10_000
    text: int = 200
    depth: int = 200


LIMITS = LogLimits()
EARTH_RADIUS = 6.371e6
"""Near enough for speeds and deviations, m."""
LARGEST = 1e18
"""Beyond all numbers that a log records."""


@record
class Recording:
    """The samples of a log, as it records them.

    Attributes:
        path: the file.
        format: `csv`, `gpx`, `igc` or `acmi`.
        time: s after the first sample, shape (n,).
        columns: by the names of histories, SI and radians, each of shape (n,); NaN where a sample does not say.
        lines: of the file, shape (n,); they count from 1.
        begins: when the first sample was taken; None where the log knows no date.
        remarks: what whoever uses the recording should know, as sentences.
        others: further aircraft or tracks of the same file, one of which may pass the course.
        unsaid: columns whose units the log does not say.
        mapped: columns whose scale or zero a mapping says.
        barometric: whether its heights are those of a barometer.
        accuracy: standard deviation of an error that all positions share, or that wanders for seconds, m.
        label: of the aircraft or track, where there are others.
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
    accuracy: float = 0.0
    label: str = ""

    def select(self, rows: NDArray[np.bool_], *remarks: str) -> "Recording":
        """Return the recording with some of its samples only, and further remarks."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        remarks = (*self.remarks, *remarks)
        return replace(self, time=self.time[rows], columns=columns, lines=self.lines[rows], remarks=remarks)


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


def enumerate_words(words: Sequence[str], most: int = 12) -> str:
    """Return words for a message, shortened and in quotes, at most so many of them."""
    return ", ".join([f"`{word[:60]}`" for word in words[:most]] + ["..."] * (len(words) > most))


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
        if len(self.lines) >= LIMITS.samples:
            refuse(self.path, line, f"holds more than {LIMITS.samples} {self._what}s; cut the log to the flight")
        self.lines.append(line)
        for column, value in zip(self.columns, values, strict=True):
            column.append(value)

    def leave_out(self, line: int, message: str, key: str = "", *, whole: bool = True) -> None:
        """Count something that cannot be read: a whole sample, or only its value of a column."""
        if key not in self.faults:
            printable = "".join(one if one.isprintable() else "\ufffd" for one in message)
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
            InputError: there are not two samples; it names the first fault, or says `missing` where there is none.
        """
        if len(self.lines) < 2:
            self.refuse_first_fault()
            refuse(self.path, 0, missing)
        return np.frombuffer(self.lines, np.int64), [np.frombuffer(one, np.float64) for one in self.columns]

    def refuse_first_fault(self, *keys: str) -> None:
        """Refuse the log for the first thing that could not be read, if there is any; of some columns where named."""
        faults = [one for one in self.faults.values() if not keys or one.key in keys]
        if faults:
            first = min(faults, key=lambda one: one.line)
            refuse(self.path, first.line, first.message, first.key)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on what was left out."""
        return tuple(one.sentence(self._what) for one in self.faults.values())


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
