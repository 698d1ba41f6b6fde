"""Logs as comma-separated values, with a mapping of columns or with headers that are recognised."""

import csv
import math
from array import array
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from airrace.logs.recording import (
    FIELDS,
    Clock,
    ColumnLayout,
    Field,
    Recording,
    clock_for,
    first_backwards,
    instant,
    listed,
    recognised,
    refuse,
    unit_named,
    unwrapped,
)
from airrace.records import record
from airrace.trajectory import Array

ROWS_MAX = 6_000_000
"""The largest number of samples that are read: 83 hours at 20 Hz."""
DELIMITERS = (",", ";", "\t", "|")
_POSITIONS = (("latitude", "longitude"), ("north", "east"))


@record
class Column:
    """A column of the file: where it stands, what it records, and the factor of its unit to SI."""

    index: int
    header: str
    field: Field
    unit: str

    @property
    def factor(self) -> float:
        """The factor of its unit to SI."""
        return self.field.units[self.unit]


def read_csv(path: str, lines: Iterable[str], layout: ColumnLayout) -> Recording:
    """Return what a CSV file records.

    Lines that begin with `#` and empty ones are passed over; the first other one holds the headers. An empty cell is a
    value that is not known.

    Args:
        path: of the file, for messages.
        lines: of the file, with their ends.
        layout: the mapping of its columns; headers are recognised where that is empty.

    Raises:
        InputError: a column is missing or unknown, a cell holds no number or no time, or time runs backwards.
    """
    numbered = _told(lines)
    line, header = next(numbered, (0, ""))
    delimiter = layout.delimiter or max(DELIMITERS, key=header.count)
    empty: list[str] = []
    headers = [one.strip().lstrip("\ufeff") for one in next(csv.reader([header], delimiter=delimiter), empty)]
    columns = _columns(path, line, headers, layout)
    rows = _Rows(path, columns, layout)
    rows.read(numbered, delimiter)
    return rows.recording()


def _told(lines: Iterable[str]) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(lines, start=1):
        if line.strip() and not line.startswith("#"):
            yield number, line


class _Rows:
    """The samples of a file, read line by line into one plain array a column."""

    def __init__(self, path: str, columns: Sequence[Column], layout: ColumnLayout) -> None:
        self._path, self._layout = path, layout
        self._time = next(one for one in columns if one.field.name == "time")
        self._others = [one for one in columns if one is not self._time]
        self._clock: Clock | None = None
        self._seconds, self._lines = array("d"), array("q")
        self._values = [array("d") for _ in self._others]

    def read(self, numbered: Iterable[tuple[int, str]], delimiter: str) -> None:
        """Read all lines behind the headers."""
        at = 0

        def texts() -> Iterator[str]:
            nonlocal at
            for at, line in numbered:  # noqa: B007  # `at` tells the line of the row that the reader yields
                yield line

        try:
            for row in csv.reader(texts(), delimiter=delimiter):
                if len(self._lines) >= ROWS_MAX:
                    refuse(self._path, at, f"holds more than {ROWS_MAX} samples; cut the log to the flight")
                self._take(at, row)
        except csv.Error as error:
            refuse(self._path, at, f"is no row of a table: {error}")

    def _take(self, line: int, row: Sequence[str]) -> None:
        self._seconds.append(self._when(line, row))
        self._lines.append(line)
        for column, values in zip(self._others, self._values, strict=True):
            text = row[column.index].strip() if column.index < len(row) else ""
            values.append(self._number(line, column, text) if text else math.nan)

    def _when(self, line: int, row: Sequence[str]) -> float:
        text = row[self._time.index].strip() if self._time.index < len(row) else ""
        if self._clock is None:
            self._clock = clock_for(self._time.unit, text, self._layout.zone)
        try:
            return self._clock.seconds(text.replace(",", ".") if self._layout.decimal_comma else text)
        except (ValueError, OverflowError):
            example = "12.35, 14:03:07.25 or 2016-03-12T14:03:07.25Z"
            refuse(self._path, line, f"`{text[:40]}` is no time; expected one such as {example}", self._time.header)

    def _number(self, line: int, column: Column, text: str) -> float:
        try:
            value = float(text.replace(",", ".") if self._layout.decimal_comma else text)
        except ValueError:
            hint = "; say `decimal: comma` in the mapping" if "," in text else ""
            refuse(self._path, line, f"`{text[:40]}` is no number{hint}", column.header)
        return value * column.factor if math.isfinite(value) else math.nan

    def recording(self) -> Recording:
        """Return all of it.

        Raises:
            InputError: there are no samples, or time runs backwards.
        """
        if len(self._lines) < 2:
            refuse(self._path, 0, "holds no samples; expected one row for every instant, below a row of headers")
        assert self._clock is not None  # there are rows
        lines, seconds = np.array(self._lines, np.int64), np.array(self._seconds, np.float64)
        time = unwrapped(seconds) if self._clock.wraps else seconds
        if (row := first_backwards(time)) is not None:
            before, after = (f"{one:.3f} s" for one in (time[row - 1] - time[0], time[row] - time[0]))
            refuse(
                self._path,
                int(lines[row]),
                f"time runs backwards: {after} after the first sample comes behind {before} of line {lines[row - 1]}; "
                "a log must be in the order of its time",
                self._time.header,
            )
        columns = {
            column.field.history: np.array(values, np.float64)
            for column, values in zip(self._others, self._values, strict=True)
        }
        zone = "times name no zone and are taken as UTC" if self._clock.zoned and self._layout.zone is None else ""
        begins = instant(float(time[0])) if self._clock.dated else None
        return Recording(self._path, "csv", _since(time), columns, lines, begins, tuple(filter(None, [zone])))


def _since(time: Array) -> Array:
    return np.asarray(time - time[0], np.float64)


def _columns(path: str, line: int, headers: Sequence[str], layout: ColumnLayout) -> list[Column]:
    """Return the columns that are read; those that nobody asks for are left out.

    Raises:
        InputError: a column of the mapping is not there, or time or position are missing.
    """
    found = _mapped(path, line, headers, layout) if layout.columns else _recognised(headers)
    names = {one.field.name for one in found}
    if "time" not in names:
        refuse(path, line, f"has no column of time; its columns are {listed(headers)}; {_advice('time', 'TIME')}")
    if not any(set(pair) <= names for pair in _POSITIONS):
        refuse(
            path,
            line,
            f"has no position: expected latitude and longitude, or north and east; its columns are {listed(headers)}; "
            f"{_advice('latitude', 'LAT')}",
        )
    if not names & {"altitude", "height"}:
        refuse(path, line, f"has no height; its columns are {listed(headers)}; {_advice('altitude', 'ALT [m]')}")
    return found


def _advice(name: str, header: str) -> str:
    return f"name it with --column '{name}={header}' or in a mapping"


def _mapped(path: str, line: int, headers: Sequence[str], layout: ColumnLayout) -> list[Column]:
    found: list[Column] = []
    for name, (header, unit) in layout.columns.items():
        if header not in headers:
            refuse(path, line, f"has no column `{header[:60]}` for {name}; its columns are {listed(headers)}")
        field = FIELDS[name]
        own = recognised(header)
        said = own[1] if not unit and own is not None and own[0] is field else unit
        known = unit_named(field, said) if said else next(iter(field.units))
        assert known is not None  # the mapping was checked
        found.append(Column(headers.index(header), header, field, known))
    return found


def _recognised(headers: Sequence[str]) -> list[Column]:
    found: dict[str, Column] = {}
    for index, header in enumerate(headers):
        known = recognised(header)
        if known is not None and known[0].name not in found:
            found[known[0].name] = Column(index, header, *known)
    return list(found.values())
