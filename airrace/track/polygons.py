"""Plane geometry of the ground: corners, edges, on which side a place lies, how far away it is."""

import itertools
import math
from collections.abc import Sequence

from airrace.records import record


@record
class Point:
    """A place on the ground: north and east of the track's origin, m."""

    north: float
    east: float


def to_right(start: Point, end: Point, place: Point) -> float:
    """Return the distance of a place to the right of the directed line through two different points, m."""
    return _cross(start, end, place) / _length(start, end)


def edges(corners: Sequence[Point], *, closed: bool) -> list[tuple[Point, Point]]:
    """Return pairs of neighbouring corners; of a closed outline also the last with the first."""
    pairs = list(itertools.pairwise(corners))
    return [*pairs, (corners[-1], corners[0])] if closed else pairs


def area(corners: Sequence[Point]) -> float:
    """Return the area of a simple polygon, m2; positive if its corners run clockwise as seen from above."""
    return 0.5 * sum(a.north * b.east - a.east * b.north for a, b in edges(corners, closed=True))


def dent(corners: Sequence[Point]) -> int | None:
    """Return the index of the first corner of a simple polygon at which it bulges inwards; None if it is convex."""
    sense = math.copysign(1.0, area(corners))
    for index, corner in enumerate(corners):
        following = corners[(index + 1) % len(corners)]
        if sense * _cross(corners[index - 1], corner, following) < 0.0:
            return index
    return None


def crossing_edges(corners: Sequence[Point]) -> tuple[int, int] | None:
    """Return two edges of a polygon, by the corner they begin with, that cross or touch; None if it is simple."""
    sides = edges(corners, closed=True)
    for one, other in itertools.combinations(range(len(sides)), 2):
        neighbours = other - one == 1 or other - one == len(sides) - 1
        if not neighbours and cross(*sides[one], *sides[other]):
            return one, other
    return None


def cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether the stretches from a to b and from c to d have a point in common."""
    opposed = _cross(a, b, c) * _cross(a, b, d), _cross(c, d, a) * _cross(c, d, b)
    if max(opposed) < 0.0:
        return True
    apart = min(
        _distance_to_edge(c, a, b), _distance_to_edge(d, a, b), _distance_to_edge(a, c, d), _distance_to_edge(b, c, d)
    )
    return apart == 0.0


def distance(place: Point, corners: Sequence[Point], *, closed: bool) -> float:
    """Return the distance of a place from a point, a line or (closed) an area, m; zero within an area."""
    if len(corners) == 1:
        return _length(place, corners[0])
    if closed and inside(place, corners):
        return 0.0
    return min(_distance_to_edge(place, a, b) for a, b in edges(corners, closed=closed))


def inside(place: Point, corners: Sequence[Point]) -> bool:
    """Return whether a place lies within a simple polygon.

    A ray from inside to the north crosses its border an odd number of times.
    """
    crossings = 0
    for a, b in edges(corners, closed=True):
        if (a.east > place.east) != (b.east > place.east):
            north = a.north + (place.east - a.east) / (b.east - a.east) * (b.north - a.north)
            crossings += north > place.north
    return crossings % 2 == 1


def _distance_to_edge(place: Point, a: Point, b: Point) -> float:
    along_north, along_east = b.north - a.north, b.east - a.east
    squared = along_north**2 + along_east**2
    part = ((place.north - a.north) * along_north + (place.east - a.east) * along_east) / squared if squared else 0.0
    part = min(max(part, 0.0), 1.0)
    return math.hypot(place.north - a.north - part * along_north, place.east - a.east - part * along_east)


def _cross(a: Point, b: Point, c: Point) -> float:
    """Return twice the area of a triangle, m2; positive if c lies to the right of the way from a to b."""
    return (b.north - a.north) * (c.east - a.east) - (b.east - a.east) * (c.north - a.north)


def _length(a: Point, b: Point) -> float:
    return math.hypot(b.north - a.north, b.east - a.east)
