"""Times as logs write them, as seconds: of an own clock, of a day, since 1970, or as ISO 8601."""

import math
import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, tzinfo

import numpy as np

from airrace.records import record
from airrace.trajectory import Array

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
    """Return the clock of a unit of `airrace.logs.fields.CLOCK_UNITS`, or for `auto` that of a sample.

    Args:
        unit: see above.
        sample: the first time of the log.
        zone: of times that name none; None for UTC.
    """
    match unit if unit != "auto" else _guessed(sample):
        case "iso":
            naive = bool(sample) and _naive(sample)
            return Clock(lambda text: _iso(text, zone), dated=True, zoned=naive)
        case "clock":
            return Clock(clock_seconds, wraps=True)
        case "unix":
            return Clock(_number, dated=True)
        case "unix ms":
            return Clock(lambda text: _number(text) / 1000.0, dated=True)
        case "ms":
            return Clock(lambda text: _number(text) / 1000.0)
        case _:
            return Clock(_number)


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


def first_backwards(time: Array) -> int | None:
    """Return the index of the first time that lies before the one ahead of it; None if there is none."""
    rows: Sequence[int] = np.flatnonzero(np.diff(time) < 0.0).tolist()
    return rows[0] + 1 if rows else None


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


def _naive(text: str) -> bool:
    try:
        return datetime.fromisoformat(text.strip()).tzinfo is None
    except ValueError:
        return False


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value
