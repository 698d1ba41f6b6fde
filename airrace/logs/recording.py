"""A flown log as recorded: its samples, its clock, and the fields that its columns are recognised as."""

import contextlib
import math
import re
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from datetime import UTC, datetime, tzinfo
from typing import Never

import numpy as np
from numpy.typing import NDArray

from airrace.environment.atmosphere import g0
from airrace.errors import Finding, InputError
from airrace.quantities import KNOT
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

    def select(self, rows: NDArray[np.bool_] | NDArray[np.int64], *remarks: str) -> "Recording":
        """Return the recording with some of its samples only, and further remarks."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        remarks = (*self.remarks, *remarks)
        return replace(self, time=self.time[rows], columns=columns, lines=self.lines[rows], remarks=remarks)


@record
class ColumnLayout:
    """The meaning of a log where it does not say so itself.

    Attributes:
        columns: the header and the unit (empty for the usual one) of every quantity, by its name in
            `airrace.logs.recording`; empty where headers are to be recognised.
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


SAMPLES_MAX = 6_000_000
"""The largest number of samples that are read: 83 hours at 20 Hz."""


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
        if len(self.lines) >= SAMPLES_MAX:
            refuse(self.path, line, f"holds more than {SAMPLES_MAX} {self._what}; cut the log to the flight")
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
            told = message.format(before=before, after=after, line=self.lines[row])
            refuse(self.path, self.lines[row + 1], told, key)


DAY = 86400.0
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d*)?))?")
_SINCE_1970 = 1e8
"""The time beyond which a number counts from 1970, not from the beginning of a flight, s; this is March 1973."""
_IN_MILLISECONDS = 1e11
"""The number beyond which milliseconds are counted from 1970; as seconds it would be the year 5138."""


@record
class Clock:
    """A way to write times.

    Attributes:
        seconds: from a text to seconds; it raises a ValueError where the text is no such time.
        dated: whether the seconds count from 1970 (UTC).
        wraps: whether the clock begins again at midnight.
        zoned: whether times that name no zone need one.
    """

    seconds: Callable[[str], float]
    dated: bool = False
    wraps: bool = False
    zoned: bool = False


def clock_for(unit: str, sample: str, zone: tzinfo | None) -> Clock:
    """Return the clock of a unit of `airrace.logs.recording.CLOCK_UNITS`, or for `auto` that of a sample.

    Args:
        unit: see above.
        sample: the first time of the log.
        zone: of times that name none; None for UTC.
    """
    match unit if unit != "auto" else _guessed(sample):
        case "iso":
            with contextlib.suppress(ValueError):
                naive = datetime.fromisoformat(sample.strip()).tzinfo is None
                return Clock(lambda text: _iso(text, zone), dated=True, zoned=naive)
            return Clock(lambda text: _iso(text, zone), dated=True)
        case "clock":
            return Clock(clock_seconds, wraps=True)
        case ("s" | "unix") as counted:
            return Clock(_finite, dated=counted == "unix")
        case milliseconds:
            return Clock(lambda text: _finite(text) / 1000.0, dated=milliseconds == "unix ms")


def clock_seconds(text: str) -> float:
    """Return the seconds since midnight of `hh:mm`, `hh:mm:ss` or `hh:mm:ss.s`.

    Raises:
        ValueError: it is no such time.
    """
    found = _CLOCK.fullmatch(text.strip())
    if not found:
        raise ValueError(text)
    hours, minutes, seconds = int(found[1]), int(found[2]), float((found[3] or "0").replace(",", "."))
    if hours > 24 or minutes > 59 or seconds >= 61.0:
        raise ValueError(text)
    return 3600.0 * hours + 60.0 * minutes + seconds


def unwrapped(seconds: Array) -> Array:
    """Return times of a clock that begins again at midnight, without these jumps."""
    jumps = np.diff(seconds) < -0.5 * DAY
    return seconds + DAY * np.concatenate(([0.0], np.cumsum(jumps)))


def instant(seconds: float) -> datetime | None:
    """Return the instant so many seconds after 1970; None where no calendar reaches."""
    try:
        return datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, OSError, ValueError):
        return None


def _guessed(sample: str) -> str:
    text = sample.strip()
    if re.match(r"\d{4}-\d{2}-\d{2}", text):
        return "iso"
    if ":" in text:
        return "clock"
    try:
        value = abs(float(text))
    except ValueError:
        return "s"
    return "unix ms" if value > _IN_MILLISECONDS else "unix" if value > _SINCE_1970 else "s"


def _iso(text: str, zone: tzinfo | None) -> float:
    when = datetime.fromisoformat(text.strip())
    return (when if when.tzinfo is not None else when.replace(tzinfo=zone or UTC)).timestamp()


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


FOOT = 0.3048
"""The foot, m, exactly."""
_ANGLE = {"deg": math.pi / 180.0, "rad": 1.0}
_LENGTH = {"m": 1.0, "ft": FOOT, "km": 1000.0}
_SPEED = {"m/s": 1.0, "kt": KNOT, "km/h": 1.0 / 3.6, "mph": 0.44704}
CLOCK_UNITS = ("s", "ms", "iso", "clock", "unix", "unix ms")
"""The ways in which a time may be written: seconds or milliseconds of any clock, ISO 8601, `hh:mm:ss.s`, since 1970."""


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
        Field("time", "", dict.fromkeys(("auto", *CLOCK_UNITS), 1.0), ("time", "t", "timestamp", "utc", "gps time")),
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

_UNITS = {
    "°": "deg",
    "degrees": "deg",
    "degree": "deg",
    "radians": "rad",
    "feet": "ft",
    "metres": "m",
    "meters": "m",
    "kts": "kt",
    "knots": "kt",
    "kmh": "km/h",
    "kph": "km/h",
    "mps": "m/s",
    "sec": "s",
    "seconds": "s",
}
_BRACKETED = re.compile(r"^(?P<header>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
_SUFFIXED = re.compile(r"^(?P<header>.+?)[_ ](?P<unit>m_s|m/s|km_h|km/h|deg|rad|kts?|ft|m|s|ms|g)$", re.IGNORECASE)


def unit_named(field: Field, unit: str) -> str | None:
    """Return the unit of a field that a text means; None if it has no such unit."""
    plain = " ".join(unit.lower().replace("_", "/").split())
    plain = _UNITS.get(plain, plain)
    return plain if plain in field.units else None


def split_unit(text: str) -> tuple[str, str]:
    """Split `HEADER [UNIT]`; the unit is empty where there is none."""
    found = _BRACKETED.match(text)
    return (found["header"].strip(), found["unit"].strip()) if found else (text.strip(), "")


def recognised(header: str) -> tuple[Field, str] | None:
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
            known = unit_named(one, unit) if unit else next(iter(one.units))
            if known is not None and plain in one.aliases:
                return one, known
    return None
