"""Recorders are known by their headers: a flight as each of them writes it is read as it was, without a mapping."""

import io
import random
import re
import struct
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path

import aerofiles.igc
import gpxpy
import numpy as np
import pytest
from synthetic import BEGIN, assert_same_flight, fixes, gpx_text, igc_text, known, on_globe, race

from airrace.errors import InputError
from airrace.files.inputs.log_columns import read_layout, with_columns
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.dialects import DIALECTS, dialect_of
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.plausibility import plausible
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.recorders import read_fit
from airrace.flights.logs.recording import Recording
from airrace.flights.logs.smoothing import smooth

EXACT = fixes(20.0, noise=0.02, gap=(0.0, 0.0))
LATITUDE, LONGITUDE, ALTITUDE = on_globe(EXACT)
FEET = ALTITUDE / 0.3048
CLOCK = [BEGIN + timedelta(seconds=float(one)) for one in EXACT.time]
TIMES = [one.strftime("%H:%M:%S.%f")[:-3] for one in CLOCK]
UNIX = [one.timestamp() for one in CLOCK]
SINCE = EXACT.time - EXACT.time[0]
ROLL, PITCH = (
    np.degrees(np.interp(EXACT.time, known().time, np.unwrap(known().histories[name]))) for name in ("mu", "gamma")
)
LOAD = np.interp(EXACT.time, known().time, known().histories["n_z"])
SPEED = np.full(len(SINCE), 100.0)


def lines(head: Sequence[str], *columns: Sequence[object], delimiter: str = ",") -> str:
    def cell(one: object) -> str:
        return f"{one:.8f}" if isinstance(one, float) else str(one)

    rows = (delimiter.join(map(cell, row)) for row in zip(*columns, strict=True))
    return "\n".join([*head, *rows]) + "\n"


def micros(since: float) -> list[str]:
    return [f"{1e6 * one:.0f}" for one in SINCE + since]


def scaled(values: np.ndarray, factor: float) -> list[str]:
    return [f"{factor * one:.0f}" for one in values]


KNOTS = SPEED / 0.514444
DATES = [one.strftime("%Y-%m-%d") for one in CLOCK]
LOCAL = [(one + timedelta(hours=2)).strftime("%H:%M:%S.%f")[:-3] for one in CLOCK]
HHMMSS = [one.strftime("%H%M%S.%f")[:-3] for one in CLOCK]
ZERO, BLANK = [0] * len(SINCE), [""] * len(SINCE)
PLACE = LATITUDE, LONGITUDE
PAIRS = [f'"{lat:.8f},{lon:.8f}"' for lat, lon in zip(LATITUDE, LONGITUDE, strict=True)]
TEN_MILLIONTHS = scaled(LATITUDE, 1e7), scaled(LONGITUDE, 1e7)

RECORDERS: dict[str, tuple[str, str, Sequence[Sequence[object]]]] = {
    "Garmin G1000": (
        """#airframe_info, log_version="1.00", mode=NORMAL
#yyy-mm-dd, hh:mm:ss, hh:mm, ident, degrees, degrees, ft msl, kt, deg, deg, G, deg
  Lcl Date, Lcl Time, UTCOfst, AtvWpt, Latitude, Longitude, AltMSL, GndSpd, Pitch, Roll, NormAc, HDG
          ,         ,        ,       ,         ,          ,       ,       ,      ,     ,       ,    """,
        ",",
        (DATES, TIMES, BLANK, BLANK, *PLACE, FEET, SPEED, PITCH, ROLL, LOAD - 1.0, BLANK),
    ),
    "Garmin G3X, G5": (
        """#airframe_info,log_version="1.00",product="GDU 460"
Date (yyyy-mm-dd),Time (hh:mm:ss),UTC Time (hh:mm:ss),Latitude (deg),Longitude (deg),GPS Altitude (ft),Roll (deg)
Lcl Date,Lcl Time,UTC Time,Latitude,Longitude,AltGPS,Roll""",
        ",",
        (DATES, LOCAL, TIMES, *PLACE, FEET, ROLL),
    ),
    "Dynon SkyView": (
        "Session Time,System Time,GPS Date & Time,Latitude (deg),Longitude (deg),GPS Altitude (feet),"
        "Ground Speed (knots),Pitch (deg),Roll (deg),Vertical Acceleration (G)",
        ",",
        (SINCE + 500.0, TIMES, TIMES, *PLACE, FEET, KNOTS, PITCH, ROLL, LOAD),
    ),
    "ForeFlight": (
        """Pilot,Tail Number,Derived Origin,Start Latitude,Start Longitude,Start Time
Ada L.,N123,KXYZ,45.1,13.6,1397397598000
Timestamp,Latitude,Longitude,Altitude,Course,Speed,Bank,Pitch,Horizontal Error,Vertical Error,g Load""",
        ",",
        (scaled(np.array(UNIX), 1e3), *PLACE, FEET, ZERO, KNOTS, ROLL, PITCH, ZERO, ZERO, LOAD),
    ),
    "FlightRadar24": (
        "\nTimestamp,UTC,Callsign,Position,Altitude,Speed,Direction",
        ",",
        (UNIX, TIMES, BLANK, PAIRS, FEET, KNOTS, ZERO),
    ),
    "AiM": (
        """"Format","AiM CSV File"
"Sample Rate","20"

"Time","GPS Speed","GPS Latitude","GPS Longitude","GPS Altitude"
"sec","km/h","deg","deg","ft"
""",
        ",",
        (SINCE, 3.6 * SPEED, *PLACE, FEET),
    ),
    "RaceChrono": (
        """This file is created using RaceChrono v7
Format,3

timestamp,fragment_id,lap_number,elapsed_time,altitude,bearing,latitude,longitude,speed
unix time,,,s,m,deg,deg,deg,m/s
,,,,100: gps,100: gps,100: gps,100: gps,100: gps""",
        ",",
        (UNIX, ZERO, ZERO, SINCE, ALTITUDE, ZERO, *PLACE, SPEED),
    ),
    "Racelogic VBO": (
        """File created on 13/04/2014 at 13:59

[header]
satellites
time
latitude
longitude
velocity kmh
height

[column names]
sats time lat long velocity heading height

[data]""",
        " ",
        (["012"] * len(SINCE), HHMMSS, LATITUDE * 60.0, -LONGITUDE * 60.0, 3.6 * SPEED, ZERO, ALTITUDE),
    ),
    "PX4, vehicle_gps_position": (
        "timestamp,time_utc_usec,lat,lon,alt,alt_ellipsoid,eph",
        ",",
        (micros(106.5), ZERO, *TEN_MILLIONTHS, scaled(ALTITUDE, 1e3), scaled(ALTITUDE, 1e3), ZERO),
    ),
    "PX4, sensor_gps": (
        "timestamp,time_utc_usec,latitude_deg,longitude_deg,altitude_msl_m,vel_m_s",
        ",",
        (micros(106.5), micros(106.5), *PLACE, ALTITUDE, SPEED),
    ),
    "ArduPilot": ("TimeUS,Status,NSats,Lat,Lng,Alt,Spd", ",", (micros(30.0), ZERO, ZERO, *PLACE, ALTITUDE, SPEED)),
    "ArduPilot, raw": (
        "TimeUS,Status,NSats,Lat,Lng,Alt,Spd",
        ",",
        (micros(30.0), ZERO, ZERO, *TEN_MILLIONTHS, ALTITUDE, SPEED),
    ),
    "X-Plane": (
        "   _real,_time |    _totl,_time |    Vtrue,_ktas |  Gload,norml |     pitch,__deg |    _roll,__deg | "
        "  __lat,__deg |   __lon,__deg |   _alt,ftmsl |",
        " | ",
        (SINCE, SINCE + 20.0, KNOTS, LOAD, PITCH, ROLL, *PLACE, FEET, BLANK),
    ),
}
"""What every recorder writes above its samples, what stands between its cells, and the columns of the flight."""


def written(name: str) -> str:
    head, delimiter, columns = RECORDERS[name]
    return lines([head], *columns, delimiter=delimiter)


def flight_of(path: Path, content: str, layout: ColumnLayout | None = None) -> LogFlight:
    path.write_text(content)
    return flight_from_log(read_log(path, layout), race(), label="log")


@pytest.mark.parametrize("name", RECORDERS)
def test_a_flight_in_a_dialect_is_read_without_a_mapping(tmp_path: Path, name: str) -> None:
    found = flight_of(tmp_path / "log.txt", written(name))
    assert_same_flight(found, near=0.003)
    if "n_z" in found.flight.histories and found.flight.basis("n_z").value == "measured":
        n_z = np.interp(known().time - known().passings["0:g0"], found.flight.time, found.flight.values("n_z"))
        assert np.median(np.abs(n_z - known().histories["n_z"])) < 0.05


def test_a_row_of_units_counts_more_than_the_dialect_and_a_column_more_than_both(tmp_path: Path) -> None:
    metres = written("Garmin G1000").replace("ft msl", "m").splitlines()
    path = tmp_path / "log.csv"
    path.write_text("\n".join(metres) + "\n")
    assert read_log(path).columns["altitude"] == pytest.approx(FEET, abs=1e-6)
    other = with_columns(ColumnLayout(), ["pitch=Roll [deg]"])
    found = read_log(path, other)
    assert found.columns["theta"] == pytest.approx(np.radians(ROLL), abs=1e-8)
    assert len(found.time) == len(SINCE)


def test_every_dialect_is_the_first_that_its_own_headers_are_of() -> None:
    for one in DIALECTS:
        headers = {candidates[0][0] for candidates in one.columns.values()} | one.headers
        assert dialect_of(sorted(headers)) is one


def test_scale_and_offset_of_a_mapping_are_applied_in_the_unit_of_the_column(tmp_path: Path) -> None:
    mapping = tmp_path / "mapping.yaml"
    columns = "{time: 'T [s]', latitude: A, longitude: O, altitude: 'H [ft]', load_factor: N}"
    numbers = "scale: {load_factor: -1}\noffset: {altitude: 100, load_factor: 1}"
    mapping.write_text(f"schema: airrace/log/1\ncolumns: {columns}\n{numbers}\n")
    layout, _ = read_layout(mapping)
    content = lines(["T,A,O,H,N"], SINCE, LATITUDE, LONGITUDE, FEET - 100.0, 1.0 - LOAD)
    (tmp_path / "log.csv").write_text(content)
    found = read_log(tmp_path / "log.csv", layout)
    assert found.columns["altitude"] == pytest.approx(ALTITUDE, abs=1e-6)
    assert found.columns["n_z"] == pytest.approx(LOAD, abs=1e-6)
    mapping.write_text(f"schema: airrace/log/1\ncolumns: {columns}\noffset: {{g_load: 1}}\n")
    with pytest.raises(InputError) as refused:
        read_layout(mapping)
    assert "`g_load` is nothing that is read as a number; known are" in str(refused.value.findings[0])


def test_a_fit_file_is_read_where_its_library_is_there(tmp_path: Path) -> None:
    path = tmp_path / "ride.fit"
    path.write_bytes(fit_file(SINCE[::20], LATITUDE[::20], LONGITUDE[::20], ALTITUDE[::20]))
    found = read_log(path)
    assert found.format == "fit"
    assert found.time == pytest.approx(np.round(SINCE[::20]), abs=1e-9)
    assert np.degrees(found.columns["latitude"]) == pytest.approx(LATITUDE[::20], abs=1e-6)
    assert found.columns["altitude"] == pytest.approx(ALTITUDE[::20], abs=0.11)
    path.write_bytes(path.read_bytes()[:30])
    with pytest.raises(InputError, match=r"FIT|no records"):
        read_log(path)


def test_a_damaged_fit_file_is_read_as_far_as_it_goes_or_refused() -> None:
    whole = fit_file(SINCE[::20], LATITUDE[::20], LONGITUDE[::20], ALTITUDE[::20])
    rng, lengths, refusals = random.Random(5), list[int](), list[str]()
    for trial in range(400):
        damaged = bytearray(whole)
        for _ in range(1 + trial % 4):
            damaged[rng.randrange(len(damaged) if trial % 2 else 60)] = rng.randrange(256)
        try:
            found = read_fit("ride.fit", io.BytesIO(damaged[: rng.randrange(20, len(damaged) + 1)]))
            lengths.append(len(found.time))
        except InputError as refusal:
            refusals.append(str(refusal.findings[0]))
    assert max(lengths) > 0.8 * len(SINCE[::20])
    assert refusals
    assert all(re.search("damaged FIT file|no records|without a place", one) for one in refusals)


def fit_file(time: np.ndarray, latitude: np.ndarray, longitude: np.ndarray, altitude: np.ndarray) -> bytes:
    """Records of timestamp, place and altitude, as FIT 1.0 packs them."""
    definition = struct.pack("<BBBHB", 0x40, 0, 0, 20, 4)
    definition += bytes((253, 4, 0x86, 0, 4, 0x85, 1, 4, 0x85, 2, 2, 0x84))
    body = definition
    for when, lat, lon, up in zip(time, latitude, longitude, altitude, strict=True):
        places = (round(one / 180.0 * 2**31) for one in (lat, lon))
        body += struct.pack("<BIiiH", 0, 765_000_000 + round(when), *places, round((up + 500.0) * 5.0))
    return struct.pack("<BBHI4sH", 14, 0x10, 2132, len(body), b".FIT", 0) + body + b"\0\0"


def test_other_readers_find_in_our_synthetic_logs_what_we_do(tmp_path: Path) -> None:
    gpx, igc = tmp_path / "log.gpx", tmp_path / "log.igc"
    gpx.write_text(gpx_text(EXACT))
    igc.write_text(igc_text(EXACT))
    (track,) = gpxpy.parse(gpx.read_text()).tracks
    points, ours = track.segments[0].points, read_log(gpx)
    assert np.radians([one.latitude for one in points]) == pytest.approx(ours.columns["latitude"], abs=1e-12)
    assert [one.elevation for one in points] == pytest.approx(ours.columns["altitude"].tolist(), abs=1e-9)
    seconds = np.array([(one.time - points[0].time).total_seconds() for one in points if one.time and points[0].time])
    assert seconds == pytest.approx(ours.time, abs=1e-6)
    with igc.open() as file:
        _, fix_records = aerofiles.igc.Reader().read(file)["fix_records"]
    theirs = np.radians([one["lat"] for one in fix_records])
    minute = np.radians(1.0 / 60.0)
    assert theirs == pytest.approx(read_log(igc).columns["latitude"], abs=1e-3 * minute)  # without our further decimals


def test_of_several_receivers_the_first_is_read(tmp_path: Path) -> None:
    path = tmp_path / "drone.csv"
    rows = ["TimeUS,I,Status,Lat,Lng,Alt,Spd"]
    for when, lat, lon, up in zip(SINCE, LATITUDE, LONGITUDE, ALTITUDE, strict=True):
        for receiver, north in ((0, 0.0), (1, 1e-4)):
            rows.append(f"{when * 1e6 + 5:.0f},{receiver},4,{lat + north:.7f},{lon:.7f},{up:.2f},90")
    path.write_text("\n".join(rows) + "\n")
    found = read_log(path)
    assert np.degrees(found.columns["latitude"]) == pytest.approx(LATITUDE, abs=1e-6)
    assert any("of another receiver than 0" in one for one in found.remarks)


@pytest.mark.parametrize("text", ["scale: {load_factor: .nan}", "offset: {altitude: 1e308}", "time_zone: '+02:99'"])
def test_numbers_and_zones_of_a_mapping_are_possible_ones(tmp_path: Path, text: str) -> None:
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(f"schema: airrace/log/1\n{text}\n")
    with pytest.raises(InputError) as refused:
        read_layout(mapping)
    assert refused.value.findings[0].line == 2


def test_a_load_factor_that_stands_still_or_is_mapped_is_left_as_it_is() -> None:
    """What never moves has no zero to be found out, and what a mapping says counts."""
    places = np.stack([EXACT.north, EXACT.east, EXACT.height])
    path, count = smooth(EXACT.time, places), np.arange(len(EXACT.time))
    for recorded, mapped in ((np.zeros(len(count)), ()), (LOAD - 1.0, ("n_z",))):
        part = Recording("log", "csv", EXACT.time, {"n_z": recorded}, count, mapped=mapped)
        found = plausible(part, path, race())
        assert not any("1 g" in one for one in found.remarks)
    whole = plausible(Recording("log", "csv", EXACT.time, {"n_z": LOAD - 1.0}, count), path, race())
    assert any("1 g" in one for one in whole.remarks)
