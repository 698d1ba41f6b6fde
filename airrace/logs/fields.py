"""The quantities that a log may record: their names in mappings, their units, and the histories that they become."""

import math
import re
from collections.abc import Mapping

from airrace.environment.atmosphere import g0
from airrace.quantities import KNOT
from airrace.records import record

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
    for base, unit in _readings(header):
        plain = " ".join(base.lower().replace("_", " ").split())
        for field in FIELDS.values():
            known = unit_named(field, unit) if unit else next(iter(field.units))
            if known is not None and plain in field.aliases:
                return field, known
    return None


def _readings(header: str) -> list[tuple[str, str]]:
    bracketed = split_unit(header)
    if bracketed[1]:
        return [bracketed]
    suffixed = _SUFFIXED.match(header.strip())
    return [(header, ""), *([(suffixed["header"], suffixed["unit"])] if suffixed else [])]
