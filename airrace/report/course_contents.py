"""A course as the script of a report is told of it.

elements    what is passed
  name
  label       what is written beside it; empty where another one on the same spot carries it
  posts       feet of pylons, [[north, east], ...]
  top         height of the pylons, m
  window      ends [[north, east], [north, east]] of the stretch that is flown through; null where there is none
  reach       likewise, of the stretch beside a pylon in which a passing counts
  heights     [lowest, highest] of the passing, m
  place       [north, east, height] of its name; where it stands nowhere, where the first flight passed it
crowd       [{name, corners, closed, distance, height}]
lines       safety lines, [{name, start, end, keep_right}]
airspace    corners [[north, east], ...]; empty where there is none
frame       [south, north, west, east] of what is to be seen, m
"""

import math
from collections.abc import Mapping

from airrace.quantities import Interval
from airrace.track.element import Element
from airrace.track.limits import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point
from airrace.views.map_model import MapModel

INFLATED = 25.0
"""The usual height of an inflated pylon, m."""
ABOVE = 5.0
"""The height by which a pylon rises above the highest passing that counts, m."""
ENDLESS = 0.15
"""The share of the course's extent by which a safety line, which has no ends, is drawn beyond its defining points."""


def course_contents(seen: MapModel, passed: Mapping[str, tuple[float, float, float]]) -> dict[str, object]:
    """Return the object that the module describes.

    Args:
        seen: the course from above.
        passed: where the first flight passed the elements, by their names: north, east, height, m.
    """
    course = seen.course
    labels = {mark.element.name: mark.label for mark in seen.marks}
    elements = {passage.element.name: passage.element for passage in course.passages}
    extent = max(seen.north - seen.south, seen.east - seen.west)
    return {
        "elements": [
            {"name": one.name, "label": labels.get(one.name, one.name), **_element(one, passed)}
            for one in elements.values()
            if _placed(one, passed)
        ],
        "crowd": [_crowd(crowd) for crowd in course.crowd],
        "lines": [_line(line, ENDLESS * extent) for line in seen.lines],
        "airspace": [_place(corner) for corner in course.airspace],
        "frame": [seen.south, seen.north, seen.west, seen.east],
    }


def _placed(element: Element, passed: Mapping[str, tuple[float, float, float]]) -> bool:
    return element.position is not None or element.name in passed


def _element(element: Element, passed: Mapping[str, tuple[float, float, float]]) -> dict[str, object]:
    drawing = element.drawing()
    place = element.position or passed[element.name]
    low, high = _heights(element.heights, place[2])
    return {
        "posts": [_place(post) for post in drawing.posts],
        "top": max(INFLATED, high + ABOVE) if high < place[2] + 4.0 * INFLATED else place[2] + INFLATED,
        "window": None if drawing.window is None else [_place(end) for end in drawing.window],
        "reach": None if drawing.reach is None else [_place(end) for end in drawing.reach],
        "heights": [low, high],
        "place": list(place),
    }


def _heights(allowed: Interval, nominal: float) -> tuple[float, float]:
    """Return the heights of a passing, cut off where they have no bounds."""
    low = allowed.lower if math.isfinite(allowed.lower) else 0.0
    return low, allowed.upper if math.isfinite(allowed.upper) else nominal + INFLATED


def _crowd(crowd: Crowd) -> dict[str, object]:
    return {
        "name": crowd.name,
        "corners": [_place(corner) for corner in crowd.corners],
        "closed": crowd.shape is CrowdShape.AREA,
        "distance": crowd.distance,
        "height": crowd.height,
    }


def _line(line: SafetyLine, beyond: float) -> dict[str, object]:
    """Return a stretch of the line: between its two points, and some way beyond."""
    north, east = line.end.north - line.start.north, line.end.east - line.start.east
    share = beyond / math.hypot(north, east)
    return {
        "name": line.name,
        "start": [line.start.north - share * north, line.start.east - share * east],
        "end": [line.end.north + share * north, line.end.east + share * east],
        "keep_right": line.keep_right,
    }


def _place(point: Point) -> list[float]:
    return [point.north, point.east]
