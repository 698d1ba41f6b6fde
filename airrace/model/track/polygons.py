"""Plane geometry of the ground: corners, edges, on which side a place lies, how far away it is."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
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
    for first, second in itertools.combinations(range(len(sides)), 2):
        neighbours = second - first == 1 or second - first == len(sides) - 1
        if not neighbours and cross(*sides[first], *sides[second]):
            return first, second
    return None


def cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether the stretches from a to b and from c to d have a point in common."""
    opposed = _cross(a, b, c) * _cross(a, b, d), _cross(c, d, a) * _cross(c, d, b)
    if max(opposed) < 0.0:
        return True
    ends = [(c, (a, b)), (d, (a, b)), (a, (c, d)), (b, (c, d))]
    return bool(min(distance(place, edge, closed=False) for place, edge in ends) < 1e-9)  # m, rounding


def beside(places: Array, a: Point, b: Point) -> tuple[Array, Array]:
    """Return how far every place (..., 2) lies along the line from a to b, and how far to its right, m."""
    length = _length(a, b)
    direction = ((b.north - a.north) / length, (b.east - a.east) / length) if length > 0.0 else (1.0, 0.0)
    north, east = places[..., 0] - a.north, places[..., 1] - a.east
    return north * direction[0] + east * direction[1], east * direction[0] - north * direction[1]


def distance(places: Array | Point, corners: Sequence[Point], *, closed: bool) -> Array:
    """Return how far every place (..., 2) is from a point, a line or (closed) an area, m, shape (...); zero within."""
    places = _coordinates(places)
    if len(corners) == 1:
        return np.hypot(places[..., 0] - corners[0].north, places[..., 1] - corners[0].east)
    nearest = np.full(places.shape[:-1], np.inf)
    for a, b in edges(corners, closed=closed):
        along, across = beside(places, a, b)
        past = along - np.clip(along, 0.0, _length(a, b))
        nearest = np.minimum(nearest, np.hypot(past, across))
    return nearest * ~inside(places, corners) if closed else nearest


def inside(places: Array | Point, corners: Sequence[Point]) -> NDArray[np.bool_]:
    """Return whether places (..., 2) lie within a simple polygon, shape (...).

    A ray from inside to the north crosses its border an odd number of times.
    """
    places = _coordinates(places)
    north, east = places[..., 0], places[..., 1]
    within = np.zeros(north.shape, bool)
    for a, b in edges(corners, closed=True):
        if a.east != b.east:
            level = a.north + (east - a.east) / (b.east - a.east) * (b.north - a.north)
            within = within ^ (((a.east > east) != (b.east > east)) & (level > north))
    return within


def _coordinates(places: Array | Point) -> Array:
    return np.array([places.north, places.east]) if isinstance(places, Point) else places


def _cross(a: Point, b: Point, c: Point) -> float:
    """Return twice the area of a triangle, m2; positive if c lies to the right of the way from a to b."""
    return (b.north - a.north) * (c.east - a.east) - (b.east - a.east) * (c.north - a.north)


def _length(a: Point, b: Point) -> float:
    return math.hypot(b.north - a.north, b.east - a.east)
