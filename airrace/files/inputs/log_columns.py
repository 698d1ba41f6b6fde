"""The language `airrace/log/1` of a mapping: what the columns of a log mean, and how its numbers are written."""

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, timedelta, timezone, tzinfo
from pathlib import Path
from typing import Annotated, ClassVar, Literal
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.errors import Finding, InputError, UsageError
from airrace.files.inputs.document import read_document
from airrace.files.inputs.schema import Schema, optional, read_entry
from airrace.flights.logs.csv_log import FIELDS, ColumnLayout, is_foreign_unit, split_unit

_OFFSET = re.compile(r"([+-])(\d{2}):?([0-5]\d)")
_DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|"}


_Number = Annotated[float, Ge(-1e9), Le(1e9)]


class LogEntry(Schema):
    """A whole mapping."""

    what: ClassVar[str] = "a mapping of a log"
    schema_: Literal["airrace/log/1"] = Field(alias="schema", description="the language of this file and its version")
    notes: str = Field(default="", description="whatever a reader should know")
    columns: dict[str, str] = Field(
        default_factory=dict[str, str],
        description="the header of every quantity, with its unit in brackets: `altitude: GPS alt [ft]`",
    )
    scale: dict[str, _Number] = Field(
        default_factory=dict[str, float],
        description="what recorded numbers are multiplied by: `load_factor: -1` where it counts downward",
    )
    offset: dict[str, _Number] = Field(
        default_factory=dict[str, float],
        description="what is added then, in the column's unit: `load_factor: 1` where it is recorded without the 1 g",
    )
    time_zone: str | None = optional("of times that name none: `+02:00` or a name such as `Europe/Zagreb`; else UTC")
    delimiter: Literal["comma", "semicolon", "tab", "bar"] | None = optional(
        "what stands between the columns; found out by default"
    )
    decimal: Literal["point", "comma"] = Field(default="point", description="what stands before the decimals")
    position_noise_m: Annotated[float, Gt(0), Le(100)] | None = optional(
        "standard deviation of the positions; estimated from them by default"
    )
    position_accuracy_m: Annotated[float, Gt(0), Le(100)] | None = optional(
        "standard deviation of all that positions are off by together, or for seconds; by default what the log says, "
        "else 2.5 m"
    )


def read_layout(path: Path) -> tuple[ColumnLayout, float | None]:
    """Return the layout of a mapping file, and the noise of the positions that it names, m.

    Raises:
        InputError: the file is no mapping; it carries all findings.
    """
    findings: list[Finding] = []
    document = read_document(path, findings)
    if document is None:
        raise InputError(findings)
    entry, reporter = read_entry(LogEntry, document)
    zone = None
    if entry.time_zone is not None and (zone := _zone(entry.time_zone)) is None:
        reporter.value(("time_zone",), f"`{entry.time_zone}` is no time zone; expected +02:00 or Europe/Zagreb")
    for name, text in entry.columns.items():
        if problem := _problem(name, text):
            reporter.value(("columns", name), problem)
    for key, numbers in (("scale", entry.scale), ("offset", entry.offset)):
        for name in numbers:
            if name not in FIELDS or not FIELDS[name].history:
                numeric = ", ".join(field.name for field in FIELDS.values() if field.history)
                reporter.value((key, name), f"`{name}` is nothing that is read as a number; known are {numeric}")
    if reporter.findings:
        raise InputError(reporter.findings)
    delimiter = "" if entry.delimiter is None else _DELIMITERS[entry.delimiter]
    comma, accuracy = entry.decimal == "comma", entry.position_accuracy_m
    layout = ColumnLayout(entry.columns, entry.scale, entry.offset, zone, delimiter, comma, accuracy)
    return layout, entry.position_noise_m


def with_columns(layout: ColumnLayout, texts: Sequence[str]) -> ColumnLayout:
    """Return a layout with columns on top, as `--column NAME=HEADER[UNIT]` gives them.

    Raises:
        UsageError: one of them is not understood.
    """
    columns = dict(layout.columns)
    for text in texts:
        name, equals, header = (part.strip() for part in text.partition("="))
        problem = _problem(name, header) if equals and header else "expected NAME=HEADER [UNIT]"
        if problem:
            raise UsageError(f"--column {text}: {problem}")
        columns[name] = header
    return replace(layout, columns=columns)


def with_zone(layout: ColumnLayout, text: str) -> ColumnLayout:
    """Return a layout with another time zone.

    Raises:
        UsageError: there is no such zone.
    """
    zone = _zone(text)
    if zone is None:
        raise UsageError(f"--time-zone {text}: expected an offset such as +02:00, or a name such as Europe/Zagreb")
    return replace(layout, zone=zone)


def _problem(name: str, text: str) -> str:
    """Return why a column is not understood; empty where it is."""
    if name not in FIELDS:
        return f"`{name}` is nothing that is read from a log; known are {', '.join(FIELDS)}"
    header, unit = split_unit(text)
    if not header:
        return "names no header"
    if text.endswith("]") and is_foreign_unit(FIELDS[name], unit):  # other brackets belong to the header
        return f"`{unit}` is no unit of {name}; known are {', '.join(FIELDS[name].units)}"
    return ""


def _zone(text: str) -> tzinfo | None:
    if text.upper() in ("UTC", "Z"):
        return UTC
    if match := _OFFSET.fullmatch(text):
        offset = timedelta(hours=int(match[2]), minutes=int(match[3]))
        return timezone(-offset if match[1] == "-" else offset) if offset < timedelta(hours=15) else None
    try:
        return ZoneInfo(text)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        return None
