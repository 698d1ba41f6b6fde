"""Recorders and programs whose columns are known: what their headers are called, and the units that they do not say.

A dialect is a mapping that is shipped. It is recognised by headers that stand together in no other; which of its
columns are there depends on the version and on what was recorded. Magnetic headings are left out: no course is
magnetic.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Dialect:
    """The columns of a recorder or a program.

    Attributes:
        name: of the recorder.
        headers: by which it is recognised, as `plain_header` returns them.
        columns: by the name of the quantity, the headers that it may have, the best first, each with its unit; an empty
            unit is found out.
        source: where the headers are described.
        instance: the header of a column that numbers several receivers, of which the first one is read; else empty.
    """

    name: str
    headers: frozenset[str]
    columns: Mapping[str, Sequence[tuple[str, str]]]
    source: str
    instance: str = ""


def plain_header(header: str) -> str:
    """Return a header in small letters, without its unit in brackets, with blanks for underscores."""
    base = header.partition("(")[0] if header.rstrip().endswith(")") else header
    base = base.partition("[")[0] if base.rstrip().endswith("]") else base
    return " ".join(base.replace("_", " ").lower().split())


def dialect_of(headers: Sequence[str]) -> Dialect | None:
    """Return the dialect that headers are of; None where they are of no known one."""
    there = {plain_header(header) for header in headers}
    return next((dialect for dialect in DIALECTS if dialect.headers <= there), None)


_ATTITUDE = {"roll": [("roll", "deg")], "pitch": [("pitch", "deg")]}
_DEGREES = {"latitude": [("latitude", "deg")], "longitude": [("longitude", "deg")]}
_PX4_QUALITY = {
    "fix_type": [("fix type", "mavlink")],
    "satellites": [("satellites used", "1")],
    "hdop": [("hdop", "1")],
    "vdop": [("vdop", "1")],
    "horizontal_accuracy": [("eph", "m")],
    "vertical_accuracy": [("epv", "m")],
}

DIALECTS = (
    Dialect(
        "Garmin G1000",
        frozenset(("lcl time", "latitude", "longitude", "altmsl")),
        {
            "time": [("lcl time", "clock")],
            "date": [("lcl date", "ymd")],
            "utc_offset": [("utcofst", "clock")],
            **_DEGREES,
            "altitude": [("altmsl", "ft"), ("altgps", "ft")],
            "ground_speed": [("gndspd", "kt")],
            "true_airspeed": [("tas", "kt")],
            "indicated_airspeed": [("ias", "kt")],
            **_ATTITUDE,
            "load_factor": [("normac", "g")],
            "fix_type": [("gpsfix", "")],
        },
        "Garmin, G1000 Pilot's Guide, flight data logging; units in the file's second line",
    ),
    Dialect(
        "Garmin G3X, G5",
        frozenset(("utc time", "latitude", "longitude", "gps altitude")),
        {
            "time": [("utc time", "clock")],
            "date": [("utc date", ""), ("date", "")],
            **_DEGREES,
            "altitude": [("gps altitude", "ft")],
            "ground_speed": [("gps ground speed", "kt")],
            "true_airspeed": [("true airspeed", "kt")],
            "indicated_airspeed": [("indicated airspeed", "kt")],
            **_ATTITUDE,
            "load_factor": [("normal acceleration", "g")],
            "fix_type": [("gps fix status", "")],
            "satellites": [("gps sats", "1")],
            "pdop": [("gps pdop", "1")],
        },
        "Garmin, G3X Touch Pilot's Guide, flight data logging; units in the headers",
    ),
    Dialect(
        "Dynon SkyView",
        frozenset(("session time", "latitude", "longitude", "gps altitude")),
        {
            "time": [("session time", "s")],
            **_DEGREES,
            "altitude": [("gps altitude", "ft")],
            "ground_speed": [("ground speed", "kt")],
            "true_airspeed": [("true airspeed", "kt")],
            "indicated_airspeed": [("indicated airspeed", "kt")],
            **_ATTITUDE,
            "load_factor": [("vertical acceleration", "g")],
            "fix_type": [("gps fix quality", "nmea")],
            "satellites": [("number of satellites", "1")],
        },
        "Dynon, SkyView Pilot's User Guide, user data logs; units in the headers",
    ),
    Dialect(
        "ForeFlight",
        frozenset(("timestamp", "latitude", "longitude", "course", "speed", "bank")),
        {
            "time": [("timestamp", "")],
            **_DEGREES,
            "altitude": [("altitude", "ft")],
            "ground_speed": [("speed", "kt")],
            "roll": [("bank", "deg")],
            "pitch": [("pitch", "deg")],
            "load_factor": [("g load", "g")],
            "horizontal_accuracy": [("horizontal error", "m")],
            "vertical_accuracy": [("vertical error", "m")],
        },
        "ForeFlight, track logs exported as CSV; feet, knots and milliseconds since 1970",
    ),
    Dialect(
        "FlightRadar24",
        frozenset(("timestamp", "position", "altitude", "speed", "direction")),
        {
            "time": [("timestamp", "unix")],
            "position": [("position", "lat lon")],
            "altitude": [("altitude", "ft")],
            "ground_speed": [("speed", "kt")],
        },
        "FlightRadar24, flight history as CSV; feet, knots and seconds since 1970",
    ),
    Dialect(
        "AiM",
        frozenset(("time", "gps latitude", "gps longitude")),
        {
            "time": [("time", "s")],
            "latitude": [("gps latitude", "deg")],
            "longitude": [("gps longitude", "deg")],
            "altitude": [("gps altitude", "")],
            "ground_speed": [("gps speed", "")],
            "satellites": [("gps nsat", "1")],
            "horizontal_accuracy": [("gps posaccuracy", "")],
        },
        "AiM, Race Studio 3, export as CSV; units in a row below the headers",
    ),
    Dialect(
        "RaceChrono",
        frozenset(("timestamp", "latitude", "longitude", "bearing", "altitude")),
        {
            "time": [("timestamp", "")],
            **_DEGREES,
            "altitude": [("altitude", "m")],
            "ground_speed": [("speed", "m/s")],
            "satellites": [("satellites", "1")],
            "horizontal_accuracy": [("accuracy", "m")],
        },
        "RaceChrono, CSV v2 and v3; v3 has rows of units and of sources below the headers",
    ),
    Dialect(
        "Racelogic VBO",
        frozenset(("sats", "time", "lat", "long", "velocity")),
        {
            "time": [("time", "hhmmss")],
            "latitude": [("lat", "arcmin")],
            "longitude": [("long", "arcmin west")],
            "altitude": [("height", "m")],
            "ground_speed": [("velocity", "km/h")],
            "satellites": [("sats", "1")],
            "fix_type": [("solution type", "racelogic")],
        },
        "Racelogic, VBO file format: minutes of arc, positive to the west; time since midnight UTC",
    ),
    Dialect(
        "PX4, vehicle_gps_position",
        frozenset(("timestamp", "time utc usec", "lat", "lon", "alt", "eph")),
        {
            "time": [("timestamp", "us")],
            "latitude": [("lat", "1e-7 deg")],
            "longitude": [("lon", "1e-7 deg")],
            "altitude": [("alt", "mm")],
            "ground_speed": [("vel m s", "m/s")],
            **_PX4_QUALITY,
        },
        "PX4, msg/SensorGps.msg up to 1.13; ulog2csv of pyulog",
    ),
    Dialect(
        "PX4, sensor_gps",
        frozenset(("timestamp", "latitude deg", "longitude deg", "altitude msl m")),
        {
            "time": [("timestamp", "us")],
            "latitude": [("latitude deg", "deg")],
            "longitude": [("longitude deg", "deg")],
            "altitude": [("altitude msl m", "m")],
            "ground_speed": [("vel m s", "m/s")],
            **_PX4_QUALITY,
        },
        "PX4, msg/SensorGps.msg from 1.14; ulog2csv of pyulog",
    ),
    Dialect(
        "PX4, vehicle_global_position",
        frozenset(("timestamp", "lat", "lon", "alt", "terrain alt")),
        {
            "time": [("timestamp", "us")],
            "latitude": [("lat", "deg")],
            "longitude": [("lon", "deg")],
            "altitude": [("alt", "m")],
            "horizontal_accuracy": [("eph", "m")],
            "vertical_accuracy": [("epv", "m")],
        },
        "PX4, msg/VehicleGlobalPosition.msg; ulog2csv of pyulog",
    ),
    Dialect(
        "ArduPilot",
        frozenset(("timeus", "lat", "lng", "alt")),
        {
            "time": [("timeus", "us")],
            "latitude": [("lat", "")],
            "longitude": [("lng", "")],
            "altitude": [("alt", "m")],
            "ground_speed": [("spd", "m/s")],
            "fix_type": [("status", "mavlink")],
            "satellites": [("nsats", "1")],
            "hdop": [("hdop", "1")],
        },
        "ArduPilot, log message GPS; mavlogdump.py --format csv --types GPS",
        instance="i",
    ),
    Dialect(
        "X-Plane",
        frozenset(("lat, deg", "lon, deg", "alt,ftmsl")),
        {
            "time": [("totl, time", "s"), ("missn, time", "s"), ("real, time", "s")],
            "latitude": [("lat, deg", "deg")],
            "longitude": [("lon, deg", "deg")],
            "altitude": [("alt,ftmsl", "ft")],
            "ground_speed": [("vtrue, ktgs", "kt")],
            "true_airspeed": [("vtrue, ktas", "kt")],
            "indicated_airspeed": [("vind, kias", "kt")],
            "roll": [("roll, deg", "deg")],
            "pitch": [("pitch, deg", "deg")],
            "heading": [("hding, true", "deg")],
            "load_factor": [("gload,norml", "g")],
        },
        "X-Plane, Data.txt of the data output; headers are padded with underscores",
    ),
)
"""The dialects, those with more headers of their own first where one could be taken for another."""
