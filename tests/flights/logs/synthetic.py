"""A log of a flight that is known.

It is the optimum of Rovinj 2014, recorded by a receiver with noise, a gap and a clock of its own.
"""

import csv
import functools
import math
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from airrace.files.inputs import load_inputs
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.flights.results.penalties import NONE_KNOWN, Penalties
from airrace.model.track.course import geodetic
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

HERE = Path(__file__).parent
BEGIN = datetime(2014, 4, 13, 13, 59, 58, tzinfo=UTC)
LEAD = 4.0
"""s, of straight flight before the start and behind the finish."""
GAP = (20.0, 20.3)
"""s after the start, in which nothing was received."""


@dataclass(frozen=True)
class InitialPoint:
    """The flight as it was: histories by name over its time, SI and radians, and when it made its passings."""

    histories: Mapping[str, Array]
    passings: Mapping[str, float]

    @property
    def time(self) -> Array:
        return self.histories["time"]

    def at(self, name: str, times: Array) -> Array:
        values = self.histories[name]
        return np.interp(times, self.time, np.unwrap(values) if name in ("mu", "chi") else values)


@dataclass(frozen=True)
class Fixes:
    """What a receiver has recorded: times after the start of the race, and places in the track's frame, m."""

    time: Array
    north: Array
    east: Array
    height: Array


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


@functools.cache
def race() -> Race:
    return load_inputs("rovinj_2014").race


@functools.cache
def known() -> InitialPoint:
    table = _rows(HERE / "rovinj_2014.csv")
    columns = {name: np.array([float(row[name]) for row in table]) for name in table[0]}
    names = {"time_s": "time", "x_m": "x", "y_m": "y", "height_m": "height", "V_K_m_s": "V_K", "n_z": "n_z"}
    angles = {"mu_deg": "mu", "gamma_deg": "gamma", "chi_deg": "chi", "p_Kbar_deg_s": "p_Kbar"}
    histories = {names[name]: columns[name] for name in names}
    histories |= {angles[name]: np.radians(columns[name]) for name in angles}
    return InitialPoint(
        histories, {row["passing"]: float(row["time_s"]) for row in _rows(HERE / "rovinj_2014.splits.csv")}
    )


def fixes(hz: float, *, noise: float = 1.5, seed: int = 1, gap: tuple[float, float] = GAP) -> Fixes:
    """The flight sampled at a rate, with a lead-in and a lead-out, white noise and a gap."""
    flight, last = known(), float(known().time[-1])
    time = np.arange(-LEAD + 0.013, last + LEAD, 1.0 / hz)
    random = np.random.default_rng(seed)
    places: list[Array] = []
    for name in ("x", "y", "height"):
        values = flight.histories[name]
        slopes = [(values[i + 1] - values[i]) / (flight.time[i + 1] - flight.time[i]) for i in (0, -2)]
        inside = np.interp(time, flight.time, values)
        inside += np.where(time < 0.0, slopes[0] * time, 0.0) + np.where(time > last, slopes[1] * (time - last), 0.0)
        places.append(inside + noise * random.standard_normal(len(time)))
    received = ~((time > gap[0]) & (time < gap[1]))
    return Fixes(time[received], *(one[received] for one in places))


def banks(times: Array, rate: float) -> Array:
    """The bank, deg, with a full roll at a rate (deg/s) where the flight itself hardly rolls."""
    return np.degrees(known().at("mu", times)) + np.clip(rate * (times - 0.5), 0.0, 360.0)


def on_globe(seen: Fixes) -> tuple[Array, Array, Array]:
    """Latitude and longitude, deg, and height above the sea, m."""
    origin = race().course.origin
    latitude, longitude = geodetic(seen.north, seen.east, origin)
    return np.degrees(latitude), np.degrees(longitude), seen.height + origin.elevation


def table(header: str, rows: Iterable[Iterable[object]]) -> str:
    return "\n".join([header, *(",".join(str(one) for one in row) for row in rows)]) + "\n"


def csv_text(seen: Fixes, *, offset: float = 52_000.0, digits: int = 4) -> str:
    """A CSV file in metres, by a clock that is ahead."""
    rows = zip(seen.time + offset, seen.north, seen.east, seen.height, strict=True)
    return table("time [s],north [m],east [m],height [m]", ([f"{one:.{digits}f}" for one in row] for row in rows))


def gpx_text(seen: Fixes) -> str:
    """GPX 1.1 as receivers write it."""
    points = "\n".join(
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><ele>{up:.4f}</ele><time>{_iso(when)}</time></trkpt>'
        for lat, lon, up, when in zip(*on_globe(seen), seen.time, strict=True)
    )
    namespace = "http://www.topografix.com/GPX/1/1"
    head = f'<?xml version="1.0"?>\n<gpx version="1.1" xmlns="{namespace}"><trk><trkseg>'
    return f"{head}\n{points}\n</trkseg></trk></gpx>\n"


def acmi_text(seen: Fixes) -> str:
    """Tacview's ACMI 2.2; longitudes and latitudes are told from a reference, and what has not changed is left out."""
    lines = ["FileType=text/acmi/tacview", "FileVersion=2.2", f"0,ReferenceTime={_iso(0.0)}"]
    lines += ["0,ReferenceLongitude=13,ReferenceLatitude=45", "3000,Name=Ground,Type=Ground+Vehicle,T=0|0|0"]
    lines += ["a1,Name=Edge 540,Type=Air+FixedWing,Pilot=Ada\\, L."]
    for lat, lon, up, when in zip(*on_globe(seen), seen.time, strict=True):
        lines += [f"#{when + 10.0:.4f}", f"a1,T={lon - 13.0:.9f}|{lat - 45.0:.9f}|{up:.4f}|||"]
    return "\n".join(lines) + "\n"


def igc_text(seen: Fixes) -> str:
    """An IGC file with thousandths of seconds and further decimals of the minutes."""
    lines = ["AXXXABC", "HFDTE130414", "I033638LAD3941LOD4244TDS"]
    for lat, lon, up, when in zip(*on_globe(seen), seen.time, strict=True):
        clock = BEGIN + timedelta(seconds=when)
        south, lad = _minutes(lat, 2)
        east, lod = _minutes(lon, 3)
        fix = f"B{clock:%H%M%S}{south}N{east}EA{round(up):05d}{round(up):05d}"
        lines.append(f"{fix}{lad}{lod}{clock.microsecond // 1000:03d}")
    return "\n".join(lines) + "\n"


def _minutes(degrees: float, digits: int) -> tuple[str, str]:
    """Degrees and thousandths of minutes, and three further decimals."""
    whole = math.floor(degrees)
    millionths = round((degrees - whole) * 60.0 * 1e6)
    return f"{whole:0{digits}d}{millionths // 1000:05d}", f"{millionths % 1000:03d}"


def _iso(seconds: float) -> str:
    return (BEGIN + timedelta(seconds=float(seconds))).isoformat().replace("+00:00", "Z")


@functools.cache
def flown(hz: float, seed: int, noise: float = 1.5) -> LogFlight:
    return imported(csv_text(fixes(hz, seed=seed, noise=noise)))


def imported(text: str, penalties: Penalties = NONE_KNOWN, accuracy: float | None = None) -> LogFlight:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(text)
        return flight_from_log(
            read_log(path, ColumnLayout(accuracy=accuracy)), race(), label="log", penalties=penalties
        )


def assert_same_flight(log: LogFlight, near: float = 0.002) -> None:
    """The passings of the optimum, none of them missing, and no rule broken for certain."""
    begin = known().passings["0:g0"]
    assert {crossing.name for crossing in log.flight.crossings if crossing.found} == set(known().passings)
    for crossing in log.flight.crossings:
        assert abs(crossing.time - known().passings[crossing.name] + begin) <= near, crossing.name
    assert [breach for breach in log.violations if breach.certain] == []
