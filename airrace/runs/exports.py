"""Flights written into files that other programs read."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from airrace.checkpoint.atomic import replace_file
from airrace.errors import UsageError
from airrace.export.formats import formats
from airrace.export.globe import BEGIN, on_globe
from airrace.runs.flight_sources import opened_flights
from airrace.runs.output import beside, ensure_free
from airrace.track.course import Origin

RATES = 1e-3, 1e4
"""Samples per second that may be asked for, Hz."""


def write_flights(
    format_name: str,
    names: Sequence[str],
    output: Path | None = None,
    *,
    stage: str | None = None,
    rate: float | None = None,
    origin: str | None = None,
    start: str | None = None,
    force: bool = False,
) -> None:
    """Write flights into a file, as `airrace export FORMAT` does.

    Args:
        format_name: one of `airrace.export.formats.formats()`.
        names: of the flights, as of `opened_flights`.
        output: the file; None for one beside the first run, with the suffix of the format.
        stage: of the runs that name none; None for their last ones.
        rate: samples per second; None for what suits the format.
        origin: where the courses lie, `LAT,LON` or `LAT,LON,ELEV` (degrees, m); None for what they say.
        start: when the clock starts, ISO 8601, UTC unless it says otherwise.
        force: whether an existing file is replaced.

    Raises:
        UsageError: the file exists or is that of a flight, an argument says nothing sensible, a course has no origin
            where the format needs one, or a library that it needs is not installed.
        StorageError: the system refused.
    """
    chosen, where = formats()[format_name], None if origin is None else origin_of(origin)
    path = output or output_of(format_name, names)
    ensure_free(path, force=force, sources=names)
    begin = BEGIN if start is None else begin_of(start)
    if rate is not None and not RATES[0] <= rate <= RATES[1]:
        raise UsageError(f"a rate of {rate:g} Hz cannot be exported: it must lie between {RATES[0]:g} and {RATES[1]:g}")
    flights = opened_flights(names, stage=stage)
    if chosen.globe or where is not None:
        flights = [on_globe(flight, where) for flight in flights]
    hertz = chosen.rate_hz if rate is None else rate
    if hertz is not None:
        flights = [flight.at_rate(hertz) for flight in flights]
    replace_file(path, chosen.write(flights, begin))


def output_of(format_name: str, names: Sequence[str]) -> Path:
    """Return the file into which flights are written unless another one is named."""
    return beside(names[0], formats()[format_name].suffix or format_name)


def origin_of(text: str) -> Origin:
    """Return the place that `LAT,LON,ELEV` names; without an elevation at the level of the sea.

    Raises:
        UsageError: it names none.
    """
    try:
        latitude, longitude, *rest = (float(one) for one in text.split(","))
        (elevation,) = rest or [0.0]
    except ValueError as error:
        raise UsageError(f"--origin {text}: expected LAT,LON,ELEV, e.g. 45.08,13.63,0") from error
    sensible = abs(latitude) < 90.0 and abs(longitude) <= 180.0 and -500.0 <= elevation <= 9000.0
    if not sensible:
        raise UsageError(f"--origin {text}: no place has this latitude, longitude (degrees) and elevation (m)")
    return Origin(math.radians(latitude), math.radians(longitude), elevation)


def begin_of(text: str) -> datetime:
    """Return the instant that an ISO 8601 text names, UTC unless it says otherwise.

    Raises:
        UsageError: it names none.
    """
    try:
        when = datetime.fromisoformat(text)
    except ValueError as error:
        raise UsageError(f"--start {text}: expected a time such as 2014-04-13T12:00:00Z") from error
    if not 1 < when.year < 9999:
        raise UsageError(f"--start {text}: expected a time such as 2014-04-13T12:00:00Z")
    return when if when.tzinfo is not None else when.replace(tzinfo=UTC)
