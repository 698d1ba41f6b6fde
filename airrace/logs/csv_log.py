"""Logs as comma-separated values, with a mapping of columns or with headers that are recognised."""

import csv
import math
from collections.abc import Iterable, Iterator, Sequence

from airrace.logs.recording import (
    FIELDS,
    Clock,
    ColumnLayout,
    Field,
    Recording,
    SampleTable,
    clock_for,
    instant,
    listed,
    recognised,
    refuse,
    unit_named,
    unwrapped,
)
from airrace.records import record

DELIMITERS = (",", ";", "\t", "|")


@record
class Column:
    """A column of the file: where it stands, what it records, and its unit."""

    index: int
    header: str
    field: Field
    unit: str


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
    numbered = ((number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#"))
    at, header = next(numbered, (0, ""))
    delimiter = layout.delimiter or max(DELIMITERS, key=header.count)
    headers = [one.strip().lstrip("\ufeff") for one in next(csv.reader([header], delimiter=delimiter), list[str]())]
    columns = _columns(path, at, headers, layout)
    timed = next(one for one in columns if one.field.name == "time")
    others = [one for one in columns if one is not timed]
    samples, clock = SampleTable(path, 1 + len(others)), None

    def texts() -> Iterator[str]:
        nonlocal at
        for at, line in numbered:  # noqa: B007  # `at` is the line of the row that the reader yields
            yield line

    try:
        for row in csv.reader(texts(), delimiter=delimiter):
            cells = [row[one.index].strip() if one.index < len(row) else "" for one in (timed, *others)]
            clock = clock or clock_for(timed.unit, cells[0], layout.zone)
            if layout.decimal_comma:
                cells = [cell.replace(",", ".") for cell in cells]
            values = (_value(samples, at, one, cell) for one, cell in zip(others, cells[1:], strict=True))
            samples.append(at, _seconds(path, at, timed, clock, cells[0]), *values)
    except csv.Error as error:
        refuse(path, at, f"is no row of a table: {error}")
    numbers, (seconds, *values) = samples.arrays(
        "holds no samples; expected one row for every instant, below a row of headers"
    )
    assert clock is not None  # there are rows
    time = unwrapped(seconds) if clock.wraps else seconds
    samples.ensure_rising(
        time,
        "time runs backwards: {after} after the first sample comes behind {before} of line {line}; "
        "a log must be in the order of its time",
        timed.header,
    )
    histories = dict(zip((one.field.history for one in others), values, strict=True))
    remarks = ("times name no zone and are taken as UTC",) if clock.zoned and layout.zone is None else ()
    begins = instant(float(time[0])) if clock.dated else None
    return Recording(path, "csv", time - time[0], histories, numbers, begins, remarks)


def _seconds(path: str, line: int, column: Column, clock: Clock, text: str) -> float:
    try:
        return clock.seconds(text)
    except (ValueError, OverflowError):
        example = "12.35, 14:03:07.25 or 2016-03-12T14:03:07.25Z"
        refuse(path, line, f"`{text[:40]}` is no time; expected one such as {example}", column.header)


def _value(samples: SampleTable, line: int, column: Column, text: str) -> float:
    """Return what a cell says in SI units; NaN where it says nothing."""
    if not text:
        return math.nan
    hint = "; say `decimal: comma` in the mapping" if "," in text else ""
    value = samples.number(line, text, column.header, finite=False, hint=hint)
    return value * column.field.units[column.unit] if math.isfinite(value) else math.nan


def _columns(path: str, line: int, headers: Sequence[str], layout: ColumnLayout) -> list[Column]:
    """Return the columns that are read; those that nobody asks for are left out.

    Raises:
        InputError: a column of the mapping is not there, or time or position are missing.
    """
    if layout.columns:
        found = [_mapped(path, line, headers, name, *column) for name, column in layout.columns.items()]
    else:
        known = {one[0].name: Column(index, header, *one) for index, header, one in reversed(_recognised(headers))}
        found = list(reversed(known.values()))
    names = {one.field.name for one in found}
    position = {"latitude", "longitude"} <= names or {"north", "east"} <= names
    for there, lacks, advice in (
        ("time" in names, "column of time; its", "'time=TIME'"),
        (position, "position: expected latitude and longitude, or north and east; its", "'latitude=LAT'"),
        (bool(names & {"altitude", "height"}), "height; its", "'altitude=ALT [m]'"),
    ):
        if not there:
            told = f"has no {lacks} columns are {listed(headers)}; name it with --column {advice} or in a mapping"
            refuse(path, line, told)
    return found


def _mapped(path: str, line: int, headers: Sequence[str], name: str, header: str, unit: str) -> Column:
    """Return the column of a mapping; where that names no unit, the unit that the header names."""
    if header not in headers:
        refuse(path, line, f"has no column `{header[:60]}` for {name}; its columns are {listed(headers)}")
    field, own = FIELDS[name], recognised(header)
    said = own[1] if not unit and own is not None and own[0] is field else unit
    known = unit_named(field, said) if said else next(iter(field.units))
    assert known is not None  # the mapping was checked
    return Column(headers.index(header), header, field, known)


def _recognised(headers: Sequence[str]) -> list[tuple[int, str, tuple[Field, str]]]:
    return [(index, header, known) for index, header in enumerate(headers) if (known := recognised(header)) is not None]
