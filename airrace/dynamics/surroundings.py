"""The quantities observed all along a leg: the distance from a line, the climb angle, the distance from a crowd.

The exact distance from a crowd has edges and corners that a solver cannot digest. Its stand-in takes, for the nearest
edge and for the foot of the perpendicular on it,

    smooth_minimum(a, b) = (a + b - sqrt((a - b)^2 + w^2)) / 2      (never larger than the minimum)
    smooth_clip(s; 0, L) = (L + sqrt(s^2 + w^2) - sqrt((s - L)^2 + w^2)) / 2

with widths w that are small parts of the distance to be kept, so that it is wrong by less than two thousandths of that.
Over ground, the distance from an area is negative within it, so that there is a way out. In space (16)

    d = sqrt(max(d_ground, 0)^2 + (h - h_crowd)^2)
"""

import functools
import math
from collections.abc import Sequence

import casadi as ca

from airrace.dynamics.outer_loop import ATTITUDE
from airrace.environment.elementary import atan2, maximum, minimum, smooth_clip, smooth_maximum, sqrt
from airrace.frames import Scalar, rotation
from airrace.quantities import Quantity, T, Vector, quantity, vector
from airrace.records import record
from airrace.system import Observation, column, named_symbols
from airrace.track.course import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point, area

VERTICAL = 1e-3
"""The angle from the vertical (rad) within which the climb angle is rounded off, for it has an edge there."""


@vector
class LineParameters(Vector[T]):
    """The parameters of a straight line on the ground.

    `normal . position - offset` is the distance to one side of it.
    """

    normal_north: T = quantity("1", text="direction to the side that counts as positive")
    normal_east: T = quantity("1", text="direction to the side that counts as positive")
    offset: T = quantity("m", scale=100.0, text="distance of the line from the origin")


@vector
class LineValues(Vector[T]):
    """The distance of the aircraft from the line."""

    beside: T = quantity("m", scale=100.0, text="distance from the line, to the allowed side")


@vector
class ClimbValues(Vector[T]):
    """The steepness of the path."""

    climb: T = quantity("rad", text="climb angle")


def line_observation(states: Sequence[Quantity]) -> Observation:
    """Return the observation of the distance from a line for a model whose states include `x, y`."""
    x, b = named_symbols(states), named_symbols(LineParameters.quantities())
    beside = b["normal_north"] * x["x"] + b["normal_east"] * x["y"] - b["offset"]
    return Observation(
        name="line",
        quantities=LineValues.quantities(),
        parameters=LineParameters.quantities(),
        values=ca.Function("line", [column(x.values()), column(b.values())], [beside]),
    )


def line_values(start: Point, end: Point, *, right: bool) -> tuple[float, ...]:
    """Return the parameters of the line through two points; positive to its right or left, seen from start to end."""
    along = (end.north - start.north, end.east - start.east)
    length = math.hypot(*along)
    sign = 1.0 if right else -1.0
    north, east = -sign * along[1] / length, sign * along[0] / length
    values = LineParameters(normal_north=north, normal_east=east, offset=north * start.north + east * start.east)
    return tuple(values.join())


def safety_line_values(line: SafetyLine) -> tuple[float, ...]:
    """Return the parameters of a safety line; its allowed side is positive."""
    return line_values(line.start, line.end, right=line.keep_right)


def climb_observation(states: Sequence[Quantity], *, exact: bool) -> Observation:
    """Return the observation of the climb angle for a model whose states include the attitude `q0 ... q3`."""
    x = named_symbols(states)
    R = rotation([x[name] for name in ATTITUDE])
    level = R[0][0] * R[0][0] + R[1][0] * R[1][0]
    climb = atan2(-R[2][0], sqrt(level if exact else level + VERTICAL * VERTICAL))
    nothing = ca.SX.sym("none", 0)
    return Observation(
        name="climb exact" if exact else "climb",
        quantities=ClimbValues.quantities(),
        parameters=(),
        values=ca.Function("climb", [column(x.values()), nothing], [climb], {"cse": True}),
    )


CLIP_WIDTH = 0.02
"""The width of the smooth clip, as a part of the distance to be kept (1)."""
MINIMUM_WIDTH = 0.002
"""The width of the smooth minimum, as a part of the distance to be kept (1)."""
LEAST_DISTANCE = 0.1
"""The distance (m) that the widths are relative to where a crowd may be approached more closely than that."""
TINY = 1e-6
"""A length (m) that keeps the distance from an edge differentiable on the edge."""

DISTANCE = Quantity("distance", "m", scale=100.0, text="distance from the crowd")

Place = tuple[Scalar, Scalar]
"""A position over ground: north and east, m."""


@record
class CrowdKind:
    """The structure of a crowd's distance: everything that shapes its equations but the numbers."""

    shape: CrowdShape
    corners: int
    slant: bool

    @classmethod
    def of(cls, crowd: Crowd) -> "CrowdKind":
        """Return the kind of a crowd."""
        return cls(crowd.shape, len(crowd.corners), crowd.slant)

    @property
    def name(self) -> str:
        """The name of the observation."""
        return f"crowd {self.shape.value} {self.corners} {'slant' if self.slant else 'ground'}"

    @property
    def parameters(self) -> tuple[Quantity, ...]:
        """The height, the distance to be kept (which smoothing is relative to), then north and east of each corner."""
        corners = [Quantity(f"{axis}_{number}", "m") for number in range(self.corners) for axis in ("north", "east")]
        return (Quantity("height", "m"), Quantity("keep", "m"), *corners)


def crowd_values(crowd: Crowd) -> tuple[float, ...]:
    """Return the values of `CrowdKind.parameters`; the corners of an area run clockwise."""
    corners = list(crowd.corners)
    if crowd.shape is CrowdShape.AREA and area(corners) < 0.0:
        corners.reverse()
    return (
        crowd.height,
        max(crowd.distance, LEAST_DISTANCE),
        *(one for corner in corners for one in (corner.north, corner.east)),
    )


def crowd_observation(states: Sequence[Quantity], kind: CrowdKind, *, exact: bool) -> Observation:
    """Return the observation of the distance from a crowd for a model whose states include `x, y, z`."""
    x, b = named_symbols(states), named_symbols(kind.parameters)
    height, keep, *rest = b.values()
    corners = list(zip(rest[::2], rest[1::2], strict=True))
    geometry = _Exact() if exact else _Smooth(keep)
    ground = _ground_distance(kind.shape, (x["x"], x["y"]), corners, geometry)
    above = -x["z"] - height
    outside = geometry.not_negative(ground) if kind.shape is CrowdShape.AREA else ground
    distance = sqrt(outside * outside + above * above) if kind.slant else ground
    return Observation(
        name=kind.name + (" exact" if exact else ""),
        quantities=(DISTANCE,),
        parameters=kind.parameters,
        values=ca.Function("crowd", [column(x.values()), column(b.values())], [distance], {"cse": True}),
    )


class _Exact:
    """The operations of the exact distance, which have edges."""

    def least(self, distances: Sequence[Scalar]) -> Scalar:
        return functools.reduce(minimum, distances)

    def clip(self, s: Scalar, length: Scalar) -> Scalar:
        return minimum(maximum(s, 0.0), length)

    def not_negative(self, distance: Scalar) -> Scalar:
        return maximum(distance, 0.0)

    def length(self, north: Scalar, east: Scalar) -> Scalar:
        return sqrt(north * north + east * east)


class _Smooth:
    """The operations of the smooth distance, which round those edges off."""

    def __init__(self, keep: Scalar) -> None:
        self._keep = keep

    def least(self, distances: Sequence[Scalar]) -> Scalar:
        nearest, *others = distances
        for other in others:
            nearest = -smooth_maximum(-nearest, -other, MINIMUM_WIDTH * self._keep)
        return nearest

    def clip(self, s: Scalar, length: Scalar) -> Scalar:
        return smooth_clip(s, 0.0, length, CLIP_WIDTH * self._keep)

    def not_negative(self, distance: Scalar) -> Scalar:
        return smooth_maximum(distance, 0.0, CLIP_WIDTH * self._keep)

    def length(self, north: Scalar, east: Scalar) -> Scalar:
        return sqrt(north * north + east * east + TINY * TINY)


def _ground_distance(shape: CrowdShape, place: Place, corners: Sequence[Place], geometry: _Exact | _Smooth) -> Scalar:
    """Return the distance over ground, m; within an area it is the distance from its border, negative."""
    if shape is CrowdShape.POINT:
        return geometry.length(place[0] - corners[0][0], place[1] - corners[0][1])
    following = [*corners[1:], corners[0]] if shape is CrowdShape.AREA else corners[1:]
    sides = list(zip(corners, following, strict=False))
    nearest = geometry.least([_edge_distance(place, a, b, geometry) for a, b in sides])
    if shape is CrowdShape.LINE:
        return nearest
    return nearest * (1.0 - 2.0 * _winding(place, sides))


def _edge_distance(place: Place, a: Place, b: Place, geometry: _Exact | _Smooth) -> Scalar:
    along = (b[0] - a[0], b[1] - a[1])
    length = sqrt(along[0] * along[0] + along[1] * along[1])
    away = (place[0] - a[0], place[1] - a[1])
    foot = geometry.clip((away[0] * along[0] + away[1] * along[1]) / length, length)
    return geometry.length(away[0] - foot * along[0] / length, away[1] - foot * along[1] / length)


def _winding(place: Place, sides: Sequence[tuple[Place, Place]]) -> Scalar:
    """Return how often a border that runs clockwise winds around a place: 1 within, 0 outside.

    The angles under which the sides are seen add up to a full turn or to nothing; so do their derivatives, to nothing.
    """
    turn: Scalar = 0.0
    for a, b in sides:
        to_a, to_b = (a[0] - place[0], a[1] - place[1]), (b[0] - place[0], b[1] - place[1])
        turn += atan2(to_a[0] * to_b[1] - to_a[1] * to_b[0], to_a[0] * to_b[0] + to_a[1] * to_b[1])
    return turn / (2.0 * math.pi)
