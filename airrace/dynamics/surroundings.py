"""The quantities observed all along a leg: the distance from a straight line on the ground, and the climb angle."""

import math
from collections.abc import Sequence

import casadi as ca

from airrace.dynamics.flight_model import ATTITUDE, column, named_symbols
from airrace.environment.elementary import atan2, sqrt
from airrace.frames import rotation
from airrace.quantities import Quantity, T, Vector, quantity, vector
from airrace.system import Observation
from airrace.track.course import SafetyLine
from airrace.track.polygons import Point

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
