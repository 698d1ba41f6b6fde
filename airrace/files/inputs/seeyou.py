"""SeeYou CUP: waypoints of glider and other pilots as comma-separated values, with tasks behind them."""

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass

from airrace.flights.logs.angles import packed_degrees
from airrace.flights.logs.recording import refuse
from airrace.optimal_control.quantities import FOOT

_TASKS = "-----related tasks-----"
_STYLES = {
    "2": "airfield",
    "3": "outlanding",
    "4": "airfield",
    "5": "airfield",
    "8": "mast",
    "11": "tower",
    "14": "bridge",
}
_NEEDED = ("name", "lat", "lon")


@dataclass(frozen=True)
class Waypoint:
    """A waypoint.

    Attributes:
        name, note: as they are written.
        latitude, longitude: degrees.
        elevation: m; NaN where it is not stated.
        style: what stands there, a word; empty for a plain waypoint.
    """

    name: str
    latitude: float
    longitude: float
    elevation: float = math.nan
    style: str = ""
    note: str = ""


def read_cup(path: str, text: str) -> list[Waypoint]:
    """Return the waypoints of a file, those of its first task first and in its order.

    Raises:
        InputError: a waypoint cannot be read; it names the line.
    """
    lines = text.splitlines()
    ends = [row for row, line in enumerate(lines) if line.strip().lower() == _TASKS]
    end = ends[0] if ends else len(lines)
    reader = csv.DictReader(lines[:end], skipinitialspace=True)
    reader.fieldnames = [name.strip().lower() for name in reader.fieldnames or ()]
    if missing := next((name for name in _NEEDED if name not in reader.fieldnames), None):
        refuse(path, 1, f"is no SeeYou CUP: it has no column `{missing}`")
    waypoints = [_waypoint(path, reader.line_num, row) for row in reader if any(row.values())]
    tasks = [
        row[1:] for row in csv.reader(lines[end + 1 :]) if row and not row[0].lower().startswith(("options", "obszone"))
    ]
    order = list(dict.fromkeys(tasks[0])) if tasks else []
    named = {waypoint.name: waypoint for waypoint in reversed(waypoints)}
    flown = [named[name] for name in order if name in named]
    return [*flown, *(waypoint for waypoint in waypoints if waypoint not in flown)]


def _waypoint(path: str, line: int, row: Mapping[str, str | None]) -> Waypoint:
    values = {key: (value or "").strip() for key, value in row.items() if isinstance(value, str)}
    degrees: list[float] = []
    for key, sides in (("lat", "NS"), ("lon", "EW")):
        text = values.get(key, "")
        try:
            if text[-1:].upper() not in tuple(sides):
                raise ValueError(text)
            degrees.append(packed_degrees(text[:-1]) * (1.0 if text[-1].upper() == sides[0] else -1.0))
        except ValueError:
            example = "4505.047N" if key == "lat" else "01337.414E"
            refuse(path, line, f"`{text[:40]}` is no {key} of SeeYou: expected one such as {example}", key)
    style, (latitude, longitude) = _STYLES.get(values.get("style", ""), ""), degrees
    elevation = _elevation(values.get("elev", ""))
    return Waypoint(values.get("name", ""), latitude, longitude, elevation, style, values.get("desc", ""))


def _elevation(text: str) -> float:
    """Return the elevation in `12.0m` or `40ft`, m; NaN where there is none."""
    plain, factor = text.lower().removesuffix("m"), 1.0
    if plain.endswith("ft"):
        plain, factor = plain.removesuffix("ft"), FOOT
    try:
        return factor * float(plain)
    except ValueError:
        return math.nan
