"""A recording as it was read: named columns over time, in SI units, with the lines that they come from."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from datetime import datetime, tzinfo
from typing import Never

import numpy as np
from numpy.typing import NDArray

from airrace.errors import Finding, InputError
from airrace.records import record
from airrace.trajectory import Array


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

    def kept(self, rows: NDArray[np.bool_] | NDArray[np.int64], *remarks: str) -> "Recording":
        """Return the recording with some of its samples only, and further remarks."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        told = (*self.remarks, *remarks)
        return Recording(self.path, self.format, self.time[rows], columns, self.lines[rows], self.begins, told)


@record
class Layout:
    """The meaning of a log where it does not say so itself.

    Attributes:
        columns: the header and the unit (empty for the usual one) of every quantity, by its name in
            `airrace.logs.fields`; empty where headers are to be recognised.
        zone: the time zone of times that name none; None for UTC.
        delimiter: between the columns of a CSV file; empty where it is to be found out.
        decimal_comma: whether numbers are written as `1,5`.
    """

    columns: Mapping[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])
    zone: tzinfo | None = None
    delimiter: str = ""
    decimal_comma: bool = False


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


def counted(number: int, what: str) -> str:
    """Return a number of things with their verb, `1 outlier is` or `3 outliers are`."""
    return f"1 {what} is" if number == 1 else f"{number} {what}s are"


def listed(words: Sequence[str], most: int = 12) -> str:
    """Return words for a message, shortened and in quotes, at most so many of them."""
    shown = [f"`{word[:60]}`" for word in words[:most]]
    return ", ".join(shown) + (", ..." if len(words) > most else "")
