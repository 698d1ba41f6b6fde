"""OpenAir: airspace as points, arcs and circles, as authorities and pilots exchange it.

The records are those of the OpenAir format by Winpilot: `AC` class, `AN` name, `AL` and `AH` floor and ceiling, `DP` a
point, `V` a variable, `DA`, `DB` arcs and `DC` circles about the last centre. Arcs become chords.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from airrace.flights.logs.angles import parse_pair
from airrace.flights.logs.recording import EARTH_RADIUS, refuse

NAUTICAL_MILE = 1852.0
"""The unit of radii, m."""
CHORD = math.radians(10.0)
"""The largest angle of an arc that becomes one chord, rad: it lies within 0.4 % of the radius."""
JOINT = 50.0
"""The distance up to which an arc begins in the point before it, m: radii are rounded to 0.01 nautical miles or so."""
_RECORD = re.compile(r"([A-Z]{1,2})\s+(.*)")
_DIRECTION = re.compile(r"D\s*=\s*([+-])")
_CENTRE = re.compile(r"X\s*=\s*(.*)", re.DOTALL)


@dataclass
class Airspace:
    """An airspace.

    Attributes:
        line: where it begins.
        kind: its class, as `R` or `CTR`.
        name, floor, ceiling: as they are written.
        corners: latitude and longitude, degrees, of its outline.
    """

    line: int
    kind: str
    name: str = ""
    floor: str = ""
    ceiling: str = ""
    corners: list[tuple[float, float]] = field(default_factory=list[tuple[float, float]])


def read_openair(path: str, text: str) -> list[Airspace]:
    """Return the airspaces of a file; of one that is drawn by several circles, the last one counts.

    Raises:
        InputError: a record cannot be read; it names the line.
    """
    airspaces: list[Airspace] = []
    centre: tuple[float, float] | None = None
    turn = 1.0  # 1 clockwise, -1 counterclockwise
    for number, line in enumerate(text.splitlines(), start=1):
        record = _RECORD.fullmatch(line.partition("*")[0].strip())
        if record is None:
            continue
        kind, content = record.groups()
        if kind == "AC":
            airspaces.append(Airspace(number, content.strip()))
            turn, centre = 1.0, None
            continue
        if not airspaces or kind not in _EXPECTED:
            continue
        airspace = airspaces[-1]
        try:
            match kind:
                case "AN":
                    airspace.name = content.strip()
                case "AL":
                    airspace.floor = content.strip()
                case "AH":
                    airspace.ceiling = content.strip()
                case "V":
                    if direction := _DIRECTION.match(content):
                        turn = 1.0 if direction[1] == "+" else -1.0
                    elif variable := _CENTRE.match(content):
                        centre = parse_pair(variable[1])
                case "DP":
                    airspace.corners.append(parse_pair(content))
                case _:
                    numbers = [] if kind == "DB" else [float(text) for text in content.split(",")]
                    if centre is None:
                        refuse(path, number, f"`{line.strip()[:60]}` has no centre: expected `V X=` before it")
                    arc = list(_ends_arc(content, centre, turn) if kind == "DB" else _arc(kind, numbers, centre, turn))
                    if kind == "DC":
                        airspace.corners.clear()
                    elif airspace.corners and _polar(arc[0], airspace.corners[-1])[1] < JOINT:
                        arc = arc[1:]
                    airspace.corners += arc
        except ValueError:
            refuse(path, number, f"`{line.strip()[:60]}` is not OpenAir: expected `{kind} {_EXPECTED[kind]}`")
    return airspaces


_POINT = "45:04:54 N 013:37:36 E"
_EXPECTED = {
    "AN": "NAME",
    "AL": "FLOOR",
    "AH": "CEILING",
    "V": f"D=+, V D=- or V X={_POINT}",
    "DP": _POINT,
    "DA": "RADIUS_NM, BEGIN_DEG, END_DEG",
    "DB": f"{_POINT}, 45:05:46 N 013:38:31 E",
    "DC": "RADIUS_NM",
}
"""What stands behind the records that are read."""


def _ends_arc(content: str, centre: tuple[float, float], turn: float) -> Iterator[tuple[float, float]]:
    """Yield the corners of an arc between two places, which are kept as they are.

    Raises:
        ValueError: it is none.
    """
    first, last = (parse_pair(place) for place in content.split(","))
    (begin, near), (end, far) = _polar(first, centre), _polar(last, centre)
    _, *between, _ = _chords(begin, turn * (turn * (end - begin) % (2.0 * math.pi)), near, far, centre)
    yield from (first, *between, last)


def _arc(kind: str, numbers: list[float], centre: tuple[float, float], turn: float) -> Iterator[tuple[float, float]]:
    """Yield the corners of a circle (`DC`) or of an arc between two azimuths (`DA`).

    Raises:
        ValueError: it is none.
    """
    if kind == "DC":
        (radius,), begin, angle = numbers, 0.0, 2.0 * math.pi
    else:
        radius, begin, end = numbers
        angle = turn * (turn * math.radians(end - begin) % (2.0 * math.pi))
    if not 0.0 < radius < 1000.0:
        raise ValueError(radius)
    distance = radius * NAUTICAL_MILE
    return _chords(math.radians(begin), angle, distance, distance, centre)


def _chords(
    begin: float, angle: float, near: float, far: float, centre: tuple[float, float]
) -> Iterator[tuple[float, float]]:
    """Yield corners from an azimuth on, rad, while the distance grows from the near to the far one, m."""
    count = max(1, math.ceil(abs(angle) / CHORD - 1e-9))
    for step in range(count + 1):
        share = step / count
        yield _place(begin + share * angle, near + share * (far - near), centre)


def _polar(place: tuple[float, float], centre: tuple[float, float]) -> tuple[float, float]:
    """Return the azimuth of a place from a centre, rad, and its distance, m."""
    north = math.radians(place[0] - centre[0])
    east = math.radians(place[1] - centre[1]) * math.cos(math.radians(centre[0]))
    return math.atan2(east, north), EARTH_RADIUS * math.hypot(north, east)


def _place(azimuth: float, distance: float, centre: tuple[float, float]) -> tuple[float, float]:
    """Return the place at an azimuth, rad, and a distance, m, from a centre."""
    arc = math.degrees(distance / EARTH_RADIUS)
    return centre[0] + arc * math.cos(azimuth), centre[1] + arc * math.sin(azimuth) / math.cos(math.radians(centre[0]))
