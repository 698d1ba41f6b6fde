"""Logs as comma-separated values: their quantities, units and clocks, from a mapping or from recognised headers."""

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from datetime import datetime, tzinfo

from airrace.environment.atmosphere import g0
from airrace.logs.recording import Recording, SampleTable, enumerate_words, instant, iso_seconds, refuse, unwrap_days
from airrace.quantities import KNOT
from airrace.records import record

_ANGLE = {"deg": math.pi / 180.0, "rad": 1.0}
_LENGTH = {"m": 1.0, "ft": 0.3048, "km": 1000.0}
_SPEED = {"m/s": 1.0, "kt": KNOT, "km/h": 1.0 / 3.6, "mph": 0.44704}
_CLOCKS: dict[str, float] = dict.fromkeys(("auto", "s", "ms", "iso", "clock", "unix", "unix ms"), 1.0)
"""How a time may be written: seconds or milliseconds of any clock, ISO 8601, `hh:mm:ss.s`, since 1970."""


@record
class Field:
    """One quantity that a log may record.

    Attributes:
        name: in a mapping.
        history: the name of the history that it becomes; empty for the time.
        units: the units it may be recorded in, each with its factor to SI; the first one is taken where none is said.
        aliases: headers, in small letters and without their unit, by which it is known where there is no mapping.
    """

    name: str
    history: str
    units: Mapping[str, float]
    aliases: tuple[str, ...]


FIELDS = {
    one.name: one
    for one in (
        Field("time", "", _CLOCKS, ("time", "t", "timestamp", "utc", "gps time")),
        Field("latitude", "latitude", _ANGLE, ("latitude", "lat")),
        Field("longitude", "longitude", _ANGLE, ("longitude", "lon", "lng", "long")),
        Field("north", "x", _LENGTH, ("north", "x", "n")),
        Field("east", "y", _LENGTH, ("east", "y", "e")),
        Field("altitude", "altitude", _LENGTH, ("altitude", "alt", "elevation", "ele", "gps altitude")),
        Field("height", "height", _LENGTH, ("height",)),
        Field("ground_speed", "V_G", _SPEED, ("ground speed", "groundspeed", "gs")),
        Field("true_airspeed", "V_A", _SPEED, ("true airspeed", "tas", "v a")),
        Field("indicated_airspeed", "V_I", _SPEED, ("indicated airspeed", "ias", "v i")),
        Field("load_factor", "n_z", {"g": 1.0, "1": 1.0, "m/s2": 1.0 / g0}, ("load factor", "g", "n z", "nz")),
        Field("roll", "phi", _ANGLE, ("roll", "phi")),
        Field("pitch", "theta", _ANGLE, ("pitch", "theta")),
        Field("heading", "psi", _ANGLE, ("heading", "yaw", "psi")),
    )
}
"""The quantities that may be recorded, by name."""

_UNIT_ALIASES = {
    "deg": ("°", "degrees", "degree"),
    "rad": ("radians",),
    "ft": ("feet",),
    "m": ("metres", "meters"),
    "kt": ("kts", "knots"),
    "km/h": ("kmh", "kph"),
    "m/s": ("mps",),
    "s": ("sec", "seconds"),
}
_UNITS = {alias: unit for unit, aliases in _UNIT_ALIASES.items() for alias in aliases}
_BRACKETED = re.compile(r"^(?P<header>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
_SUFFIXED = re.compile(r"^(?P<header>.+?)[_ ](?P<unit>m_s|m/s|km_h|km/h|deg|rad|kts?|ft|m|s|ms|g)$", re.IGNORECASE)
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d*)?))?")


@record
class ColumnLayout:
    """The meaning of a log where it does not say so itself.

    Attributes:
        columns: the header and the unit (empty for the usual one) of every quantity, by its name in `FIELDS`; empty
            where headers are to be recognised.
        zone: the time zone of times that name none; None for UTC.
        delimiter: between the columns of a CSV file; empty where it is to be found out.
        decimal_comma: whether numbers are written as `1,5`.
    """

    columns: Mapping[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])
    zone: tzinfo | None = None
    delimiter: str = ""
    decimal_comma: bool = False


@record
class CsvColumn:
    """A column of the file: where it stands, what it records, and its unit."""

    index: int
    header: str
    field: Field
    unit: str


def parse_unit(field: Field, text: str) -> str | None:
    """Return the unit of a field that a text means; None if it has no such unit."""
    plain = " ".join(text.lower().replace("_", "/").split())
    plain = _UNITS.get(plain, plain)
    return plain if plain in field.units else None


def split_unit(text: str) -> tuple[str, str]:
    """Split `HEADER [UNIT]`; the unit is empty where there is none."""
    found = _BRACKETED.match(text)
    return (found["header"].strip(), found["unit"].strip()) if found else (text.strip(), "")


def recognise(header: str) -> tuple[Field, str] | None:
    """Return the field and the unit that a header without a mapping names; None if it is not known.

    A unit may follow in brackets or behind an underscore: `alt [ft]`, `height_m`, `Ground speed (kt)`.
    """
    base, unit = split_unit(header)
    readings = [(base, unit)] if unit else [(header, "")]
    if not unit and (suffixed := _SUFFIXED.match(header.strip())):
        readings.append((suffixed["header"], suffixed["unit"]))
    for base, unit in readings:
        plain = " ".join(base.lower().replace("_", " ").split())
        for one in FIELDS.values():
            known = parse_unit(one, unit) if unit else next(iter(one.units))
            if known is not None and plain in one.aliases:
                return one, known
    return None


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
    delimiter = layout.delimiter or max((",", ";", "\t", "|"), key=header.count)
    headers = [one.strip().lstrip("\ufeff") for one in next(csv.reader([header], delimiter=delimiter), list[str]())]
    columns = _columns(path, at, headers, layout)
    timed = next(one for one in columns if one.field.name == "time")
    others = [one for one in columns if one is not timed]
    samples, clock, zoned = SampleTable(path, 1 + len(others)), "", True

    def texts() -> Iterator[str]:
        nonlocal at
        for at, line in numbered:  # noqa: B007  # `at` is the line of the row that the reader yields
            yield line

    try:
        for row in csv.reader(texts(), delimiter=delimiter):
            when, *cells = [row[one.index].strip() if one.index < len(row) else "" for one in (timed, *others)]
            if layout.decimal_comma:
                when, *cells = [cell.replace(",", ".") for cell in (when, *cells)]
            clock = clock or (_guess_clock(when) if timed.unit == "auto" else timed.unit)
            try:
                seconds = _seconds(clock, when, layout.zone)
            except (ValueError, OverflowError):
                example = "12.35, 14:03:07.25 or 2016-03-12T14:03:07.25Z"
                refuse(path, at, f"`{when[:40]}` is no time; expected one such as {example}", timed.header)
            if not samples.lines and clock == "iso":
                zoned = datetime.fromisoformat(when).tzinfo is not None
            samples.append(at, seconds, *(_value(samples, at, *each) for each in zip(others, cells, strict=True)))
    except csv.Error as error:
        refuse(path, at, f"is no row of a table: {error}")
    numbers, (time, *values) = samples.arrays(
        "holds no samples; expected one row for every instant, below a row of headers"
    )
    time = unwrap_days(time) if clock == "clock" else time
    samples.ensure_rising(
        time,
        "time runs backwards: {after} after the first sample comes behind {before} of line {line}; "
        "a log must be in the order of its time",
        timed.header,
    )
    histories = dict(zip((one.field.history for one in others), values, strict=True))
    remarks = () if zoned or layout.zone is not None else ("times name no zone and are taken as UTC",)
    begins = instant(float(time[0])) if clock in ("iso", "unix", "unix ms") else None
    return Recording(path, "csv", time - time[0], histories, numbers, begins, remarks)


def _guess_clock(text: str) -> str:
    """Return how times are written, by the first one: numbers beyond March 1973 count from 1970, in s or ms."""
    if re.match(r"\d{4}-\d{2}-\d{2}", text):
        return "iso"
    if ":" in text:
        return "clock"
    try:
        value = abs(float(text))
    except ValueError:
        return "s"
    return "unix ms" if value > 1e11 else "unix" if value > 1e8 else "s"


def _seconds(clock: str, text: str, zone: tzinfo | None) -> float:
    """Return seconds of the clock; raise a ValueError where the text is no such time."""
    if clock == "iso":
        return iso_seconds(text, zone)
    if clock != "clock":
        value = float(text) / (1000.0 if clock.endswith("ms") else 1.0)
        if math.isfinite(value):
            return value
    elif found := _CLOCK.fullmatch(text):
        hours, minutes, seconds = int(found[1]), int(found[2]), float((found[3] or "0").replace(",", "."))
        if hours <= 24 and minutes <= 59 and seconds < 61.0:
            return 3600.0 * hours + 60.0 * minutes + seconds
    raise ValueError(text)


def _value(samples: SampleTable, line: int, column: CsvColumn, text: str) -> float:
    """Return what a cell says in SI units; NaN where it says nothing."""
    if not text:
        return math.nan
    hint = "; say `decimal: comma` in the mapping" if "," in text else ""
    value = samples.number(line, text, column.header, finite=False, hint=hint)
    return value * column.field.units[column.unit] if math.isfinite(value) else math.nan


def _columns(path: str, line: int, headers: Sequence[str], layout: ColumnLayout) -> list[CsvColumn]:
    """Return the columns that are read, refusing a log without those of the mapping, or without time and position."""
    found: dict[str, CsvColumn] = {}
    for name, (header, unit) in layout.columns.items():
        if header not in headers:
            refuse(path, line, f"has no column `{header[:60]}` for {name}; its columns are {enumerate_words(headers)}")
        known, own = FIELDS[name], recognise(header)
        if not unit and own is not None and own[0] is known:
            unit = own[1]
        unit = parse_unit(known, unit) or next(iter(known.units))
        found[name] = CsvColumn(headers.index(header), header, known, unit)
    if not layout.columns:
        for index, header in enumerate(headers):
            if (own := recognise(header)) is not None:
                found.setdefault(own[0].name, CsvColumn(index, header, *own))
    for there, lacks, advice in (
        ("time" in found, "column of time; its", "'time=TIME'"),
        (
            {"latitude", "longitude"} <= set(found) or {"north", "east"} <= set(found),
            "position: expected latitude and longitude, or north and east; its",
            "'latitude=LAT'",
        ),
        ("altitude" in found or "height" in found, "height; its", "'altitude=ALT [m]'"),
    ):
        if not there:
            words = enumerate_words(headers)
            refuse(path, line, f"has no {lacks} columns are {words}; name it with --column {advice} or in a mapping")
    return list(found.values())
