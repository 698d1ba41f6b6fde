"""A log as recorded: its samples, and how they are collected from a file that nobody vouches for."""

import contextlib
import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, tzinfo
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
    """

    size: int = 1024**3
    gpx_size: int = 256 * 1024**2
    line: int = 1_000_000
    samples: int = 6_000_000


LIMITS = LogLimits()


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
    """

    path: str
    format: str
    time: Array
    columns: Mapping[str, Array]
    lines: NDArray[np.int64]
    begins: datetime | None = None
    remarks: tuple[str, ...] = ()

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


def count_of(number: int, what: str) -> str:
    """Return a number of things with their verb, `1 outlier is` or `3 outliers are`."""
    return f"1 {what} is" if number == 1 else f"{number} {what}s are"


def enumerate_words(words: Sequence[str], most: int = 12) -> str:
    """Return words for a message, shortened and in quotes, at most so many of them."""
    return ", ".join([f"`{word[:60]}`" for word in words[:most]] + ["..."] * (len(words) > most))


class SampleTable:
    """Samples of a log as they are read: the line of each, and the values of its columns.

    Args:
        path: of the file, for messages.
        columns: their number.
        what: the word for samples in messages.
    """

    def __init__(self, path: str, columns: int, what: str = "samples") -> None:
        self.path, self._what = path, what
        self.lines = array("q")
        self.columns = [array("d") for _ in range(columns)]

    def append(self, line: int, *values: float) -> None:
        """Add a sample; refuse it where there are too many."""
        if len(self.lines) >= LIMITS.samples:
            refuse(self.path, line, f"holds more than {LIMITS.samples} {self._what}; cut the log to the flight")
        self.lines.append(line)
        for column, value in zip(self.columns, values, strict=True):
            column.append(value)

    def number(self, line: int, text: str, key: str, *, finite: bool = True, hint: str = "") -> float:
        """Return the number that a text holds; refuse the log where it holds none."""
        with contextlib.suppress(ValueError):
            value = float(text)
            if math.isfinite(value) or not finite:
                return value
        refuse(self.path, line, f"`{text[:40]}` is no number{hint}", key)

    def arrays(self, missing: str) -> tuple[NDArray[np.int64], list[Array]]:
        """Return the lines and the columns; refuse the log with the words `missing` where there are not two samples."""
        if len(self.lines) < 2:
            refuse(self.path, 0, missing)
        return np.array(self.lines, np.int64), [np.array(one, np.float64) for one in self.columns]

    def ensure_rising(self, time: Array, message: str, key: str = "") -> None:
        """Refuse the log where time runs backwards; `{before}`, `{after}` and `{line}` in the message tell where."""
        rows = np.flatnonzero(np.diff(time) < 0.0)
        if len(rows):
            row = int(rows[0])
            before, after = (f"{one:.3f} s" for one in (time[row : row + 2] - time[0]).tolist())
            message = message.format(before=before, after=after, line=self.lines[row])
            refuse(self.path, self.lines[row + 1], message, key)


def unwrap_days(seconds: Array) -> Array:
    """Return times of a clock that begins again at midnight, s, without these jumps."""
    day = 86400.0
    return seconds + day * np.concatenate(([0.0], np.cumsum(np.diff(seconds) < -0.5 * day)))


def iso_seconds(text: str, zone: tzinfo | None) -> float:
    """Return the seconds since 1970 of an ISO 8601 time; where it names no zone, in the given one or UTC.

    Raises:
        ValueError: it is no such time.
    """
    when = datetime.fromisoformat(text)
    return (when if when.tzinfo is not None else when.replace(tzinfo=zone or UTC)).timestamp()


def instant(seconds: float) -> datetime | None:
    """Return the instant so many seconds after 1970; None where no calendar reaches."""
    with contextlib.suppress(OverflowError, OSError, ValueError):
        return datetime.fromtimestamp(seconds, UTC)
