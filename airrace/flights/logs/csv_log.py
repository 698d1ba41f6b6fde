"""Logs as comma-separated values: their quantities, units and clocks, from a mapping or from recognised headers.

The headers stand in the first line that holds those of the mapping, or time and place in words that are recognised;
what comes before is a preamble. A row of units above or below them is understood, a second row of headers passed over.
"""

import contextlib
import csv
import dataclasses
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import tzinfo

import numpy as np

from airrace.flights.logs.angles import parse_angle, parse_pair
from airrace.flights.logs.clocks import (
    DATE_ORDERS,
    SINCE_1970_MIN,
    TICKS,
    date_seconds,
    find_tick,
    guess_notation,
    instant,
    names_zone,
    offset_seconds,
    parse_time,
    unwrap_days,
)
from airrace.flights.logs.dialects import Dialect, dialect_of, plain_header
from airrace.flights.logs.quality import CODES, fix_type
from airrace.flights.logs.recording import IDLE_MAX, Recording, SampleTable, enumerate_words, ground, refuse
from airrace.model.environment import g0
from airrace.optimal_control.quantities import DEGREE, FOOT, KNOT
from airrace.optimal_control.trajectory import Array

_ANGLE = {"deg": DEGREE, "rad": 1.0}
_PLACE = {**_ANGLE, "arcmin": math.pi / 10800.0, "arcmin west": -math.pi / 10800.0, "1e-7 deg": 1e-7 * math.pi / 180.0}
_LENGTH = {"m": 1.0, "ft": FOOT, "km": 1000.0, "mm": 1e-3}
_NUMBER = {"1": 1.0}
_SPEED = {"m/s": 1.0, "kt": KNOT, "km/h": 1.0 / 3.6, "mph": 0.44704}
_TIMES: dict[str, float] = {"auto": 1.0, **TICKS, **dict.fromkeys(("iso", "clock", "hhmmss", "unix", "unix ms"), 1.0)}
"""How a time may be written: a number of any clock or since 1970, ISO 8601, `hh:mm:ss.s`."""
_ORDERS = {"lat lon": DEGREE, "lon lat": DEGREE}
"""The orders of latitude and longitude in one column."""
_NUMBERS = {"unix": "s", "unix ms": "ms", **{tick: tick for tick in TICKS}}


def _words(*words: str) -> tuple[str, ...]:
    """Return headers, each also with `gps` before it, as receivers write them."""
    return (*words, *(f"gps {word}" for word in words))


@dataclass(frozen=True)
class Field:
    """One quantity that a log may record.

    Attributes:
        name: in a mapping.
        history: the name of the history that it becomes; empty for what is no number of its own.
        units: the units it may be recorded in, each with its factor to SI; the first one is the default.
        aliases: headers, in small letters and without their unit, by which it is known where there is no mapping.
    """

    name: str
    history: str
    units: Mapping[str, float]
    aliases: tuple[str, ...]


FIELDS = {
    field.name: field
    for field in (
        Field(
            "time", "", _TIMES, _words("time", "t", "timestamp", "utc", "utc time", "zeit", "uhrzeit", "heure", "hora")
        ),
        Field("date", "", dict.fromkeys(DATE_ORDERS, 1.0), _words("date", "utc date", "datum", "fecha")),
        Field("utc_offset", "", {"clock": 1.0}, _words("utcofst", "utc offset")),
        Field("position", "", _ORDERS, _words("position", "lat lon", "lat/lon", "latlon", "latlng", "coordinates")),
        Field(
            "latitude", "latitude", _PLACE, _words("latitude", "lat", "breite", "breitengrad", "latitud", "latitudine")
        ),
        Field(
            "longitude",
            "longitude",
            _PLACE,
            _words("longitude", "lon", "lng", "long", "länge", "laenge", "längengrad", "longitud", "longitudine"),
        ),
        Field("north", "x", _LENGTH, ("north", "x", "n")),
        Field("east", "y", _LENGTH, ("east", "y", "e")),
        Field(
            "altitude",
            "altitude",
            _LENGTH,
            _words(
                "altitude", "alt", "elevation", "ele", "alt msl", "altitude msl", "altmsl", "höhe", "hoehe", "altitud"
            ),
        ),
        Field("height", "height", _LENGTH, ("height",)),
        Field(
            "ground_speed",
            "V_G",
            _SPEED,
            _words("ground speed", "groundspeed", "gs", "speed", "geschwindigkeit", "vitesse", "velocidad"),
        ),
        Field("true_airspeed", "V_A", _SPEED, ("true airspeed", "tas", "v a")),
        Field("indicated_airspeed", "V_I", _SPEED, ("indicated airspeed", "ias", "v i")),
        Field(
            "load_factor", "n_z", {"g": 1.0, "1": 1.0, "m/s2": 1.0 / g0}, ("load factor", "g", "n z", "nz", "g load")
        ),
        Field("roll", "phi", _ANGLE, ("roll", "phi")),
        Field("pitch", "theta", _ANGLE, ("pitch", "theta")),
        Field("heading", "psi", _ANGLE, ("heading", "yaw", "psi")),
        Field("satellites", "satellites", _NUMBER, ("satellites", "sats", "numsv", "nsats", "satellites used")),
        Field("hdop", "hdop", _NUMBER, ("hdop",)),
        Field("vdop", "vdop", _NUMBER, ("vdop",)),
        Field("pdop", "pdop", _NUMBER, ("pdop",)),
        Field("horizontal_accuracy", "h_acc", _LENGTH, ("hacc", "h acc", "horizontal accuracy", "accuracy", "eph")),
        Field("vertical_accuracy", "v_acc", _LENGTH, ("vacc", "v acc", "vertical accuracy", "epv")),
        Field("fix_type", "fix_type", dict.fromkeys(CODES, 1.0), ("fix type", "fixtype", "gps fix", "fix")),
    )
}
"""The quantities that may be recorded, by name."""

_UNIT_ALIASES = {
    "deg": ("°", "degrees", "degree"),
    "rad": ("radians", "radian"),
    "ft": ("feet", "foot", "ft msl", "ft amsl", "ft baro", "ft wgs"),
    "m": ("metres", "meters", "metre", "meter", "m msl"),
    "kt": ("kts", "knots", "knot"),
    "km/h": ("kmh", "kph"),
    "m/s": ("mps", "m s"),
    "m/s2": ("m/s^2", "m/s²"),
    "s": ("sec", "secs", "second", "seconds"),
    "ms": ("msec", "milliseconds", "millis"),
    "us": ("µs", "μs", "usec", "microseconds", "micros"),
    "ns": ("nsec", "nanoseconds", "nanos"),
    "clock": ("hh:mm:ss", "h:m:s", "hhmmss"),
    "auto": ("utc", "gmt", "z"),
    "ymd": ("yyyy-mm-dd", "yyyy/mm/dd", "yyyymmdd"),
    "dmy": ("dd.mm.yyyy", "dd/mm/yyyy", "dd-mm-yyyy", "ddmmyy"),
    "mdy": ("mm/dd/yyyy",),
    "g": ("gs",),
}
_UNITS = {alias: unit for unit, aliases in _UNIT_ALIASES.items() for alias in aliases}
_FOREIGN = frozenset(("kg", "lb", "lbs", "%", "v", "a", "hz", "rpm", "c", "f", "pa", "hpa", "inhg", "l", "gal", "w"))
"""Units of quantities that are not read: a text that ends in one is no header of ours."""
_BRACKETED = re.compile(r"^(?P<header>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
_SUFFIXED = re.compile(
    r"^(?P<header>.+?)[_ ](?P<unit>m_s|m/s|km_h|km/h|deg|rad|kts?|ft|m|s|ms|us|usec|ns|g)$", re.IGNORECASE
)
_DELIMITERS = (",", ";", "\t", "|")


PREAMBLE_LINES = 200
"""The number of lines that may come before the headers."""
HEADER_LETTERS = 20_000
"""The letters of the longest line of headers."""
FULL_TURN = 360.0
"""A full turn, deg, beyond which the numbers of a place are no degrees."""
ROWS_BELOW = 3
"""The number of rows of units, sources and the like that may stand between the headers and the first sample."""
_ESSENTIAL = ("time", "position", "latitude", "longitude", "north", "east", "altitude", "height")
_ALTERNATIVES = (("position", "latitude", "north"), ("position", "longitude", "east"), ("altitude", "height"))
"""Quantities that say the same: a column that is named for one of them replaces what is recognised of the others."""


@dataclass(frozen=True)
class ColumnLayout:
    """The meaning of a log where it does not say so itself.

    Attributes:
        columns: the header of every quantity as a person gives it, `HEADER` or `HEADER [UNIT]`, by its name in
            `FIELDS`; on top of those that are recognised.
        scales, offsets: by the same names, what recorded numbers are multiplied by, and what is added then, in the
            column's unit.
        zone: the time zone of times that name none; None for UTC.
        delimiter: between the columns of a CSV file; empty where it is to be found out.
        decimal_comma: whether numbers are written as `1,5`.
        accuracy: of the positions, see `Recording`; it counts for logs of every format.
    """

    columns: Mapping[str, str] = dataclasses.field(default_factory=dict[str, str])
    scales: Mapping[str, float] = dataclasses.field(default_factory=dict[str, float])
    offsets: Mapping[str, float] = dataclasses.field(default_factory=dict[str, float])
    zone: tzinfo | None = None
    delimiter: str = ""
    decimal_comma: bool = False
    accuracy: float | None = None

    def correct(self, name: str, numbers: Array) -> Array:
        """Return recorded numbers of a quantity, scaled and shifted."""
        return self.scales.get(name, 1.0) * numbers + self.offsets.get(name, 0.0)


@dataclass(frozen=True)
class CsvColumn:
    """A column of the file: where it stands, what it records, and its unit; empty where none is stated.

    `usual` is the unit that its dialect has where the file states none, `part` says which number of a pair it is.
    """

    index: int
    header: str
    field: Field
    unit: str
    usual: str = ""
    part: int | None = None

    @property
    def halves(self) -> tuple["CsvColumn", "CsvColumn"]:
        """Latitude and longitude of a column of both."""
        parts = (1, 0) if self.unit == "lon lat" else (0, 1)
        latitude, longitude = (
            replace(self, field=FIELDS[name], unit="deg", part=part)
            for name, part in zip(("latitude", "longitude"), parts, strict=True)
        )
        return latitude, longitude

    def number(self, samples: SampleTable, line: int, cell: str) -> float:
        """Return the number in a cell; NaN where it holds none, which is counted."""
        if self.field.name == "fix_type":
            return fix_type(cell, self.unit or "mavlink")
        if self.field.units is _PLACE:
            with contextlib.suppress(ValueError):
                return parse_angle(cell) if self.part is None else parse_pair(cell)[self.part]
        return samples.number(line, cell, self.header)

    def factor(self, numbers: Array) -> float:
        """Return the factor to SI; an angle of a place that no degrees can be is taken in ten millionths of them."""
        unit = self.unit
        if not unit and self.field.units is _PLACE and np.nanmedian(np.abs(numbers)) > FULL_TURN:
            unit = "1e-7 deg"
        return self.field.units[unit or next(iter(self.field.units))]


def parse_unit(field: Field, text: str) -> str | None:
    """Return the unit of a field that a text means; None if it has no such unit."""
    plain = " ".join(text.lower().split())
    for spelling in (plain, plain.replace("_", "/")):
        unit = _UNITS.get(spelling, spelling)
        if unit in field.units:
            return unit
    return None


def split_unit(text: str) -> tuple[str, str]:
    """Split `HEADER [UNIT]`; the unit is empty where there is none."""
    match = _BRACKETED.match(text)
    return (match["header"].strip(), match["unit"].strip()) if match else (text.strip(), "")


def is_foreign_unit(field: Field, text: str) -> bool:
    """Return whether a text in brackets is a unit, but none of a field."""
    plain = " ".join(text.lower().split())
    named = any(parse_unit(candidate, plain) is not None for candidate in FIELDS.values())
    return parse_unit(field, plain) is None and (named or plain in _FOREIGN)


def recognise(header: str) -> tuple[Field, str] | None:
    """Return the field and the unit that a header without a mapping names; None if it is not known.

    A unit may follow in brackets or behind an underscore: `alt [ft]`, `height_m`, `Ground speed (kt)`; it is empty
    where there is none.
    """
    base, unit = split_unit(header)
    readings = [(base, unit)] if unit else [(header, "")]
    if not unit and (suffixed := _SUFFIXED.match(header.strip())):
        readings.append((suffixed["header"], suffixed["unit"]))
    for base, unit in readings:
        plain = " ".join(base.lower().replace("_", " ").split())
        for field in FIELDS.values():
            named = parse_unit(field, unit) if unit else ""
            if named is not None and plain in field.aliases and base != "Phi":  # in our tables an angle that adds up
                return field, named
    return None


def read_csv(path: str, lines: Iterable[str], layout: ColumnLayout) -> Recording:
    """Return what a CSV file records.

    Lines that begin with `#` and empty ones are passed over. An empty cell is a value that is not known; a cell that
    cannot be read is counted, and a row without a time is left out.

    Args:
        path: of the file, for messages.
        lines: of the file, with their ends.
        layout: the mapping of its columns; headers are recognised where that is empty.

    Raises:
        InputError: a column is missing or unknown, most cells of the time or of a place cannot be read, or the unit of
            the time cannot be true.
    """
    numbered = enumerate(lines, 1)
    delimiter, columns, instance, unread = _find_headers(path, numbered, layout)
    named = {column.field.name: column for column in columns}
    timed, measured = named["time"], list[CsvColumn]()
    for column in columns:
        if column.field.name == "position":
            measured += column.halves
        elif column.field.history:
            measured.append(column)
    samples, zoned = SampleTable(path, 1 + len(measured)), True
    stated = timed.unit if timed.unit in ("iso", "clock", "hhmmss") else "number" if timed.unit in _NUMBERS else ""
    notation = stated
    indices, commas = [column.index for column in (timed, *measured)], layout.decimal_comma
    garbled = 0  # unreadable times
    day = ""  # what the first sample says of its date
    offset = ""  # and of its zone
    receiver = ""  # the first of several
    for at, line in _rows(samples, itertools.chain(unread, numbered)):
        row = _cells(line, delimiter)
        if len(row) <= max(indices) and not line.endswith("\n"):
            row = row[:-1]  # the file was cut in this cell
        if 0 <= instance < len(row):
            receiver = receiver or row[instance].strip()
            if row[instance].strip() != receiver:
                samples.leave_out(at, f"is of another receiver than {receiver}", "receiver")
                continue
        when, *cells = [row[index].strip() if index < len(row) else "" for index in indices]
        joined = "".join(cells)
        if commas or (delimiter != "," and "." not in joined and "," in joined):
            when, *cells = [cell.replace(",", ".") for cell in (when, *cells)]
        if not notation and when:
            notation = guess_notation(when)
        try:
            seconds = parse_time(notation or "number", when, layout.zone)
        except (ValueError, OverflowError):
            example = "12.35, 14:03:07.25 or 2016-03-12T14:03:07.25Z"
            samples.leave_out(at, f"`{when[:40]}` is no time; expected one such as {example}", timed.header)
            notation, garbled = notation if samples.lines else stated, garbled + bool(when)
            continue
        if not samples.lines and notation == "iso":
            zoned = names_zone(when)
        if not samples.lines:
            day, offset = (_cell(row, named.get(name)) for name in ("date", "utc_offset"))
        values = [math.nan] * len(measured)
        for place, (column, cell) in enumerate(zip(measured, cells, strict=True)):
            if cell:
                values[place] = column.number(samples, at, cell)
        samples.append(at, seconds, *values)
    if len(samples.lines) < 2 or len(samples.lines) <= garbled:
        samples.refuse_first_fault()
    numbers, (time, *values) = samples.arrays(
        "holds no samples; expected one row for every instant, below a row of headers"
    )
    for column in measured:
        fault = samples.faults.get(column.header)
        if column.field.name in _ESSENTIAL and fault is not None and 2 * fault.count >= len(time):
            samples.refuse_first_fault(column.header)
    histories = {
        column.field.history: layout.correct(column.field.name, cells) * column.factor(cells)
        for column, cells in zip(measured, values, strict=True)
    }
    remarks = [*samples.remarks]
    if notation == "number":
        tick, tick_remarks = find_tick(
            path, time, ground(histories), _NUMBERS.get(timed.unit, ""), split_unit(timed.header)[0]
        )
        time = time * tick
        remarks += tick_remarks
    dated = notation in ("iso", "dated") or (notation == "number" and float(np.median(time)) > SINCE_1970_MIN)
    if notation in ("clock", "hhmmss"):
        time = unwrap_days(time)
        if day:
            begins_day, day_remarks = _day(day, named["date"], offset, layout.zone)
            dated, time, remarks = begins_day is not None, time + (begins_day or 0.0), [*remarks, *day_remarks]
            zoned = bool(offset) or any("utc" in named[name].header.lower() for name in ("time", "date"))
    if dated and not zoned and layout.zone is None:
        remarks.append("times name no zone and are taken as UTC")
    guessed = tuple(column.field.history for column in measured if not column.unit)
    mapped = tuple(FIELDS[name].history for name in {**layout.scales, **layout.offsets})
    begins = instant(float(time[0])) if dated else None
    return Recording(path, "csv", time - time[0], histories, numbers, begins, tuple(remarks), (), guessed, mapped)


def _cell(row: Sequence[str], column: CsvColumn | None) -> str:
    """Return the cell of a column; empty where there is none."""
    return row[column.index].strip() if column is not None and column.index < len(row) else ""


def _day(text: str, column: CsvColumn, offset: str, zone: tzinfo | None) -> tuple[float | None, list[str]]:
    """Return the seconds since 1970 at which the day of a clock begins, None where the text is no date, and remarks."""
    try:
        begin = date_seconds(text, column.unit, zone)
        if offset and zone is None:
            begin -= offset_seconds(offset)
    except (ValueError, OverflowError, OSError):
        return None, [f"the date `{text[:40]}` is none that is understood, and not used"]
    numbers = re.findall(r"\d+", text)
    if not column.unit and "/" in text and len(numbers[0]) < 3 and int(numbers[0]) <= 12 and int(numbers[1]) <= 12:
        return begin, [
            f"the date `{text[:40]}` is taken as day/month/year; if it is not, say --column 'date="
            f"{split_unit(column.header)[0]} [mdy]'"
        ]
    return begin, []


def _rows(samples: SampleTable, numbered: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield the lines that hold something, refusing a file that goes on without any."""
    for at, line in numbered:
        if line.strip() and not line.startswith("#"):
            yield at, line
        if at - len(samples.lines) > IDLE_MAX:
            refuse(samples.path, at, f"has more than {IDLE_MAX} lines without a sample; cut the log to the flight")


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; quotes that do not end belong to their cell."""
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return line.rstrip("\n").split(delimiter)
    try:
        return next(csv.reader([line.rstrip("\n")], delimiter=delimiter))
    except csv.Error:
        return line.rstrip("\n").replace('"', "").split(delimiter)


def _find_headers(
    path: str, numbered: Iterator[tuple[int, str]], layout: ColumnLayout
) -> tuple[str, list[CsvColumn], int, list[tuple[int, str]]]:
    """Return the delimiter, the columns that are read, and lines below the headers that were looked at already.

    Before these lines stands the place of the column that distinguishes receivers, -1 where there is none.
    """
    best = (-1, 0, list[str]())
    above: tuple[str, list[str]] = ("", [])
    for at, line in itertools.islice(numbered, PREAMBLE_LINES):
        plain = line.strip().lstrip("\ufeff#%").strip()
        if not plain or len(plain) > HEADER_LETTERS:
            continue
        delimiter, headers = _split_headers(plain, layout)
        columns = _match(headers, layout)
        lacking = _lacking(columns, layout)
        if not lacking[0]:
            units, lines_below = above[1] if above[0].startswith("#") else [], list[tuple[int, str]]()
            for number in range(ROWS_BELOW):
                lines_below = list(itertools.islice(numbered, 1))
                below = lines_below[0][1] if lines_below else ""
                cells = _cells(below, delimiter)
                complete = len(cells) > max(column.index for column in columns)
                if complete and any(_is_number(cells, column.index) for column in columns):
                    break
                units = cells if below.strip() and not number else units  # else sources, or headers once more
                lines_below = []
            dialect, plain = dialect_of(headers), [plain_header(header) for header in headers]
            instance = plain.index(dialect.instance) if dialect and dialect.instance in plain else -1
            return delimiter, [_with_unit(column, units) for column in columns], instance, lines_below
        if not line.startswith("#") and len(columns) > best[0]:
            best = len(columns), at, headers
        above = line, headers
    _, at, headers = best
    if not headers:
        refuse(path, 0, "has no column of time: it holds no row of headers")
    present = {column.field.name for column in _match(headers, layout)}
    words = enumerate_words(headers)
    if missing := next((name for name in layout.columns if name not in present), None):
        refuse(path, at, f"has no column `{layout.columns[missing][:60]}` for {missing}; its columns are {words}")
    lacks, advice = _lacking(_match(headers, layout), layout)
    return refuse(path, at, f"has no {lacks} columns are {words}; name it with --column {advice} or in a mapping")


def _split_headers(line: str, layout: ColumnLayout) -> tuple[str, list[str]]:
    likely = [layout.delimiter]
    if not layout.delimiter:
        present = [delimiter for delimiter in _DELIMITERS if delimiter in line]
        likely = sorted(present, key=line.count, reverse=True) or [" "]
    readings = [(mark, [cell.strip() for cell in _cells(line, mark)]) for mark in likely]
    return next((reading for reading in readings if dialect_of(reading[1]) is not None), readings[0])


def _is_number(cells: Sequence[str], index: int) -> bool:
    text = cells[index].strip().replace(",", ".") if index < len(cells) else ""
    try:
        parse_time(guess_notation(text), text, None)
    except (ValueError, OverflowError):
        return not text  # an empty cell is one of a sample
    return True


def _with_unit(column: CsvColumn, units: Sequence[str]) -> CsvColumn:
    """Return a column with the unit of a row of units, else that of its dialect, where its header names none."""
    text = units[column.index] if column.index < len(units) else ""
    unit = column.unit or parse_unit(column.field, text.strip()) or column.usual
    return CsvColumn(column.index, column.header, column.field, unit)


def _match(headers: Sequence[str], layout: ColumnLayout) -> list[CsvColumn]:
    """Return the columns that are recognised, and those that the mapping names in their place or on top of them."""
    columns: dict[str, CsvColumn] = {}
    if (dialect := dialect_of(headers)) is not None:
        columns = {column.field.name: column for column in _columns_of(dialect, headers)}
    else:
        for index, header in enumerate(headers):
            if (recognised := recognise(header)) is not None:
                columns.setdefault(recognised[0].name, CsvColumn(index, header, *recognised))
    for name in layout.columns:
        for alternatives in _ALTERNATIVES:
            if name in alternatives:
                columns = {known: column for known, column in columns.items() if known not in alternatives}
    plain = [" ".join(header.split()) for header in headers]
    bases = [split_unit(header)[0] for header in plain]
    for name, text in layout.columns.items():
        field, (base, unit) = FIELDS[name], split_unit(text)
        title = " ".join(text.split())
        header = title if title in plain else base
        if header not in plain:
            if base not in bases:
                continue
            header = plain[bases.index(base)]
        stated = "" if header == title and base != title and parse_unit(field, unit) is None else unit
        recognised = recognise(header)
        if not stated and recognised is not None and recognised[0] is field:
            stated = recognised[1]
        index = plain.index(header)
        columns = {known: column for known, column in columns.items() if column.index != index}
        columns[name] = CsvColumn(index, header, field, parse_unit(field, stated) or "")
    return list(columns.values())


def _columns_of(dialect: Dialect, headers: Sequence[str]) -> list[CsvColumn]:
    """Return the columns of a dialect that are there; a unit in a header counts more than that of the dialect."""
    plain, columns = [plain_header(header) for header in headers], list[CsvColumn]()
    for name, candidates in dialect.columns.items():
        if present := next(((header, unit) for header, unit in candidates if header in plain), None):
            index, field = plain.index(present[0]), FIELDS[name]
            stated = parse_unit(field, split_unit(headers[index])[1])
            columns.append(CsvColumn(index, headers[index], field, stated or "", present[1]))
    return columns


def _lacking(columns: Sequence[CsvColumn], layout: ColumnLayout) -> tuple[str, str]:
    """Return what columns lack for a log, and how to name it; both empty where nothing is lacking."""
    names = {column.field.name for column in columns}
    if "time" not in names:
        return "column of time; its", "'time=TIME'"
    if "position" not in names and not ({"latitude", "longitude"} <= names or {"north", "east"} <= names):
        return "position: expected latitude and longitude, or north and east; its", "'latitude=LAT'"
    if "altitude" not in names and "height" not in names:
        return "height; its", "'altitude=ALT [m]'"
    return ("columns", "'time=TIME'") if layout.columns.keys() - names else ("", "")
