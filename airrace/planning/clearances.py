"""The clearances of ways from crowds, safety lines and the border of the airspace; north and east in m."""

from collections.abc import Sequence

import numpy as np

from airrace.track.course import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point, area, edges
from airrace.trajectory import Array


def crowd_overflown(way: Array, crowd: Crowd) -> bool:
    """Return whether a way (samples, 2) leads over a line or an area of people."""
    closed = crowd.shape is CrowdShape.AREA
    if closed and _inside(way, crowd.corners).any():
        return True
    for a, b in edges(crowd.corners, closed=closed):
        along, across = _beside(way, a, b)
        changes = across[:-1] * across[1:] < 0.0
        share = across[:-1] / np.where(changes, across[:-1] - across[1:], 1.0)
        met = along[:-1] + share * np.diff(along)
        if (changes & (met >= 0.0) & (met <= np.hypot(b.north - a.north, b.east - a.east))).any():
            return True
    return False


def beside_line(way: Array, line: SafetyLine) -> Array:
    """Return how far each sample of a way (samples, 2) is on the allowed side of a safety line, m, shape (samples,)."""
    _, across = _beside(way, line.start, line.end)
    return across if line.keep_right else -across


def beside_border(way: Array, corners: Sequence[Point]) -> Array:
    """Return how far every sample of a way (samples, 2) lies inside a convex area, m, shape (samples,)."""
    sense = np.copysign(1.0, area(corners))
    return np.minimum.reduce([sense * _beside(way, a, b)[1] for a, b in edges(corners, closed=True)])


def ground_distance(ways: Array, crowd: Crowd) -> Array:
    """Return the distance over ground of every place (..., 2) from a crowd, shape (...), m; zero within an area."""
    if crowd.shape is CrowdShape.POINT:
        (corner,) = crowd.corners
        return np.hypot(ways[..., 0] - corner.north, ways[..., 1] - corner.east)
    closed = crowd.shape is CrowdShape.AREA
    nearest = np.full(ways.shape[:-1], np.inf)
    for a, b in edges(crowd.corners, closed=closed):
        along, across = _beside(ways, a, b)
        past = along - np.clip(along, 0.0, np.hypot(b.north - a.north, b.east - a.east))
        nearest = np.minimum(nearest, np.hypot(past, across))
    return np.where(_inside(ways, crowd.corners), 0.0, nearest) if closed else nearest


def _inside(ways: Array, corners: Sequence[Point]) -> np.ndarray:
    """Return whether places (..., 2) lie within a simple polygon.

    A ray from inside to the north crosses its border an odd number of times.
    """
    north, east = ways[..., 0], ways[..., 1]
    within = np.zeros(north.shape, bool)
    for a, b in edges(corners, closed=True):
        if a.east != b.east:
            level = a.north + (east - a.east) / (b.east - a.east) * (b.north - a.north)
            within ^= ((a.east > east) != (b.east > east)) & (level > north)
    return within


def _beside(ways: Array, a: Point, b: Point) -> tuple[Array, Array]:
    """Return how far every place (..., 2) lies along the line from a to b, and how far to its right, m."""
    length = np.hypot(b.north - a.north, b.east - a.east)
    direction = ((b.north - a.north) / length, (b.east - a.east) / length) if length > 0.0 else (1.0, 0.0)
    north, east = ways[..., 0] - a.north, ways[..., 1] - a.east
    return north * direction[0] + east * direction[1], east * direction[0] - north * direction[1]
