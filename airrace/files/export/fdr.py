"""X-Plane's flight data recorder, version 4: one flight, with a mark in the replay at every passing.

The first seven columns of a row are prescribed: time of day, longitude, latitude (degrees), altitude (feet), heading,
pitch and roll (degrees). Further columns are declared before by `DREF` lines, in their order.
"""

import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from airrace.errors import UsageError
from airrace.files.export.globe import compass, printable, stamp
from airrace.flights.results import Flight
from airrace.optimal_control.quantities import DEGREE, FOOT, KNOT

AIRCRAFT = "Aircraft/Laminar Research/Cessna 172 SP/Cessna_172SP.acf"
"""X-Plane shows the flight with this aircraft, which every installation has, unless another one is named."""
COLUMNS: tuple[tuple[str, str, float, int], ...] = (
    ("sim/cockpit2/gauges/indicators/airspeed_kts_pilot", "V_I", KNOT, 2),
    ("sim/cockpit2/gauges/indicators/true_airspeed_kts_pilot", "V_A", KNOT, 2),
    ("sim/cockpit2/gauges/indicators/ground_speed_kt", "V_K", KNOT, 2),
    ("sim/flightmodel/forces/g_nrml", "n_z", 1.0, 3),
    ("sim/flightmodel/forces/g_side", "n_y", 1.0, 3),
    ("sim/flightmodel/position/alpha", "alpha_A", DEGREE, 3),
    ("sim/flightmodel/position/beta", "beta_A", DEGREE, 3),
    ("sim/cockpit2/engine/actuators/throttle_ratio_all", "delta_T", 1.0, 4),
)
"""Datarefs of X-Plane, the histories they show, their units in SI, and decimals."""


def fdr(flights: Sequence[Flight], begin: datetime, model: str = AIRCRAFT) -> bytes:
    """Return the recording of one flight; X-Plane shows it with the aircraft in a file `model` below its folder.

    Raises:
        UsageError: there are several flights, or the model is no file of an aircraft.
    """
    if not model.lower().endswith(".acf") or model != _plain(model):
        raise UsageError(f"{model[:80]!r} is no aircraft of X-Plane; expected a path such as {AIRCRAFT}")
    if len(flights) != 1:
        raise UsageError(f"an fdr file holds one flight, not {len(flights)}; write a file for each")
    return ("\n".join(_lines(flights[0], begin, model)) + "\n").encode()


def _lines(flight: Flight, begin: datetime, model: str) -> Iterator[str]:
    when, first = begin.astimezone(UTC), float(flight.time[0])
    columns = [column for column in COLUMNS if column[1] in flight]
    yield from ("A", "4", "")
    yield f"COMM, {_plain(flight.course.name)} flown by {_plain(flight.aircraft.name)}: {_plain(flight.label)}"
    yield f"COMM, {_plain(flight.stamp.text)}"
    yield "COMM, headings are true; altitudes are the course's heights above mean sea level"
    yield f"ACFT, {model}"
    yield "TAIL, AIRRACE"
    yield f"TIME, {when:%H:%M:%S}"
    yield f"DATE, {when:%m/%d/%Y}"
    if flight.air.wind is not None:
        yield f"WIND, {compass(flight.air.wind.origin):.0f},{flight.air.wind.speed / KNOT:.0f}"
    yield ""
    for crossing in flight.crossings:
        if crossing.found:
            yield f"MARK, {crossing.time - first:.3f},{_plain(crossing.name)}"
    yield ""
    for dataref, history, _, _ in columns:
        yield f"DREF, {dataref}\t1.0\t// {history}"
    yield ""
    histories = ", ".join(history for _, history, _, _ in columns)
    yield f"COMM, time, longitude, latitude, altitude, heading, pitch, roll, {histories}"
    values = [(flight[history] / unit, digits) for _, history, unit, digits in columns]
    names = ("longitude", "latitude", "altitude", "psi", "theta", "phi")
    rows = zip(*(np.nan_to_num(flight.values(name)).tolist() for name in names), strict=True)  # the columns are a must
    for row, (time, (east, north, up, psi, theta, phi)) in enumerate(zip(flight.time.tolist(), rows, strict=True)):
        place = f"{math.degrees(east):.8f}, {math.degrees(north):.8f}, {up / FOOT:.2f}"
        angles = f"{compass(psi):.3f}, {math.degrees(theta):.3f}, {math.degrees(phi):.3f}"
        rest = "".join(f", {column[row]:.{digits}f}" for column, digits in values)
        yield f"{stamp(begin, time)[11:23]}, {place}, {angles}{rest}"


def _plain(text: str) -> str:
    """Return a text without commas, which separate fields."""
    return printable(text).replace(",", ";")
