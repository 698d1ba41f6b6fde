"""The surroundings of a course in a track file: safety lines, crowds, obstacles and the airspace, and whether they
leave room.

A box is cleared by upright cylinders of one radius around the squares into which it is cut, of which those along
its border will do. Up to a length of 1 km they reach less than 5 m beyond its sides.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.files.inputs.kinds.kind import CompositeElement
from airrace.files.inputs.nodes import CORNERS_MAX, KeyPath, Reporter
from airrace.files.inputs.places import NOWHERE, Azimuth, PlacedEntry, PlaceEntry, Places
from airrace.files.inputs.rules import Distance
from airrace.files.inputs.schema import Schema, optional
from airrace.model.track import polygons
from airrace.model.track.course import Crowd, CrowdShape, Obstacle, SafetyLine
from airrace.model.track.polygons import Point

SAME_PLACE = 0.01
"""The distance below which two corners are one, m."""
ROUNDING = 1e-6
"""The excess over a distance that is put down to rounding and not reported, m."""
SQUARE_SIDE, SQUARES_MAX = 10.0, 100
"""The side of the squares of a box, m, and the largest number of them along one of its sides.

Squares of a long box are larger, so that there are no more. At most they are 1.7 times as long, as their number is
rounded.
"""
OBSTACLE_HEIGHT_MAX = 1000.0
BOX_MAX = 5000.0
"""The greatest length and width of a box, m."""
SHAPES = {"point": CrowdShape.POINT, "line": CrowdShape.LINE, "polygon": CrowdShape.AREA}

Corners = Annotated[list[PlaceEntry], Field(max_length=CORNERS_MAX)]


class SafetyLineEntry(Schema):
    what: ClassVar[str] = "a safety line"
    from_: PlaceEntry = Field(alias="from", description="a point of the line")
    to: PlaceEntry = Field(description="another point of it; the line has no ends and runs from `from` to here")
    keep: Literal["left", "right"] = Field(description="the side of the line, seen along it, on which the flight stays")
    margin_m: Annotated[float, Ge(0), Le(1000)] = Field(default=0.0, description="required distance from the line")

    def build(self, name: str, places: Places) -> SafetyLine:
        """Return the line; valid only if nothing was reported."""
        path: KeyPath = ("safety_lines", name)
        start, end = places.point(self.from_, (*path, "from")), places.point(self.to, (*path, "to"))
        if _same(start, end):
            places.reporter.value((*path, "to"), "is the same place as `from`; a line needs two different points")
        return SafetyLine(name, start, end, keep_right=self.keep == "right", margin=self.margin_m)


class CrowdEntry(Schema):
    """A group of people on the ground, given by exactly one of `point`, `line` and `polygon`."""

    what: ClassVar[str] = "a crowd"
    point: PlaceEntry | None = optional("where people are: a single place")
    line: Corners | None = optional("where people are: along a line from corner to corner")
    polygon: Corners | None = optional("where people are: within an area; its corners in order, the first not repeated")
    distance_m: Distance | None = optional("least required distance; without it that of `rules.crowd_distance_m`")
    height_m: Annotated[float, Ge(-500), Le(5000)] = Field(
        default=0.0, description="height of the people above the origin"
    )
    measured: Literal["slant", "over-ground"] = Field(
        default="slant", description="whether the distance is measured in space or over ground alone"
    )

    def build(self, name: str, distance: float | None, places: Places) -> Crowd:
        """Return the crowd; `distance` (m) holds if it does not say its own."""
        path: KeyPath = ("crowd", name)
        shapes = [key for key in SHAPES if getattr(self, key) is not None]
        if not shapes:
            places.reporter.key(path, "a crowd needs one of `point`, `line` and `polygon`")
        if len(shapes) > 1:
            places.reporter.key((*path, shapes[1]), f"not together with `{shapes[0]}`; a crowd has one shape")
        if self.distance_m is None and distance is None:
            message = "missing; say it here, or for every crowd as `crowd_distance_m` of the rules"
            places.reporter.key((*path, "distance_m"), message)
        return Crowd(
            name=name,
            shape=SHAPES[shapes[0] if shapes else "point"],
            corners=self._corners(path, places),
            distance=self.distance_m or distance or 0.0,
            height=self.height_m,
            slant=self.measured == "slant",
        )

    def _corners(self, path: KeyPath, places: Places) -> tuple[Point, ...]:
        if self.point is not None:
            return (places.point(self.point, (*path, "point")),)
        if self.line is not None:
            corners = _points(self.line, (*path, "line"), places)
            if len(self.line) < 2:
                message = "a line needs at least two corners; a single place is a `point`"
                places.reporter.value((*path, "line"), message)
            return corners or (NOWHERE,)
        return (NOWHERE,) if self.polygon is None else _polygon(self.polygon, (*path, "polygon"), places)


class ObstacleEntry(PlacedEntry):
    """An obstacle: a mast, a cylinder with a `radius_m`, or a box with `length_m` and `width_m`."""

    what: ClassVar[str] = "an obstacle"
    height_m: Annotated[float, Gt(0), Le(OBSTACLE_HEIGHT_MAX)] = Field(description="height of its top above the origin")
    radius_m: Annotated[float, Ge(0), Le(500)] | None = optional("radius of a cylinder; 0 by default, for a mast")
    length_m: Annotated[float, Gt(0), Le(BOX_MAX)] | None = optional(
        "length of a box, along its heading; with `width_m`"
    )
    width_m: Annotated[float, Gt(0), Le(BOX_MAX)] | None = optional(
        "width of a box, across its heading; with `length_m`"
    )
    heading_deg: Azimuth | None = optional("direction of a box's length; 0 by default")
    clearance_m: Annotated[float, Ge(0.5), Le(500)] = Field(
        default=10.0, description="least distance of the wing from it at any time"
    )

    def build(self, name: str, places: Places) -> Obstacle:
        """Return the obstacle; valid only if nothing was reported."""
        path: KeyPath = ("obstacles", name)
        middle = places.point(self, path)
        box = {"length_m": self.length_m, "width_m": self.width_m}
        is_box = self.length_m is not None or self.width_m is not None or self.heading_deg is not None
        for key, value in box.items():
            if is_box and value is None:
                places.reporter.key((*path, key), "missing; a box has `length_m` and `width_m`")
        if self.length_m is None or self.width_m is None:
            return Obstacle(name, (middle,), self.radius_m or 0.0, self.height_m, self.clearance_m)
        if self.radius_m is not None:
            message = "not together with `length_m`; an obstacle is a cylinder or a box"
            places.reporter.key((*path, "radius_m"), message)
        corners, inside, radius = _box(middle, self.length_m, self.width_m, math.radians(self.heading_deg or 0.0))
        return Obstacle(name, inside, radius, self.height_m, self.clearance_m, corners)


def _box(
    middle: Point, length: float, width: float, heading: float
) -> tuple[tuple[Point, ...], tuple[Point, ...], float]:
    """Return the corners of a box, the middles of the squares along its border, and the radius around such a square."""

    def point(along: float, across: float) -> Point:
        cos, sin = math.cos(heading), math.sin(heading)
        return Point(middle.north + along * cos - across * sin, middle.east + along * sin + across * cos)

    side = max(min(length, width, SQUARE_SIDE), max(length, width) / SQUARES_MAX)
    # Round lengths are far from those with one square more.
    rows, columns = max(1, math.floor(length / side + 0.3)), max(1, math.floor(width / side + 0.3))
    a, b = length / rows, width / columns
    middles: list[Point] = []
    for row in range(rows):
        for column in range(columns):
            if row in (0, rows - 1) or column in (0, columns - 1):
                middles.append(point((row + 0.5) * a - 0.5 * length, (column + 0.5) * b - 0.5 * width))
    corners = tuple(point(i * 0.5 * length, j * 0.5 * width) for i, j in ((1, -1), (1, 1), (-1, 1), (-1, -1)))
    return corners, tuple(middles), 0.5 * math.hypot(a, b)


def build_airspace(entries: Sequence[PlaceEntry] | None, places: Places) -> tuple[Point, ...]:
    """Return the corners of the convex area of the race; empty if there is none, or none to rely on."""
    if entries is None:
        return ()
    before = len(places.reporter.findings)
    corners = _polygon(entries, ("airspace",), places)
    if len(places.reporter.findings) > before:
        return ()  # the corners form no area that could be checked
    dent = polygons.dent(corners)
    if dent is not None:
        places.reporter.value(
            ("airspace", dent),
            "the airspace is dented inwards at this corner and must be convex; leave the corner out and keep the "
            "notch free with an area of `crowd`",
        )
        return ()
    return corners


def _polygon(entries: Sequence[PlaceEntry], path: KeyPath, places: Places) -> tuple[Point, ...]:
    """Return the corners of a simple polygon; report one that is none."""
    reported = len(places.reporter.findings)
    corners = _points(entries, path, places)
    if len(entries) < 3:
        places.reporter.value(path, f"an area needs at least three corners, not {len(entries)}")
        return corners
    if _same(corners[0], corners[-1]):
        message = "is the first corner again; leave it out, an area closes by itself"
        places.reporter.value((*path, len(corners) - 1), message)
    if len(places.reporter.findings) > reported:
        return corners
    farthest = max(corners, key=lambda corner: polygons.distance(corner, corners[:1], closed=False))
    if all(abs(polygons.to_right(corners[0], farthest, corner)) < SAME_PLACE for corner in corners):
        places.reporter.value(path, "all corners lie on one line; an area needs three that do not")
        return corners
    for index, corner in enumerate(corners):
        before, after = corners[index - 1], corners[(index + 1) % len(corners)]
        beside = polygons.distance(after, (before, corner), closed=False)
        if min(beside, polygons.distance(before, (corner, after), closed=False)) < SAME_PLACE:
            places.reporter.value((*path, index), "the border turns back on itself at this corner; leave it out")
            return corners
    crossing = polygons.crossing_edges(corners)
    if crossing is not None:
        edges = " and ".join(f"from corner {index} to corner {(index + 1) % len(corners)}" for index in crossing)
        message = f"the border crosses itself: {edges} (counted from 0); give the corners in order"
        places.reporter.value(path, message)
    return corners


def _points(entries: Sequence[PlaceEntry], path: KeyPath, places: Places) -> tuple[Point, ...]:
    """Return the corners; report neighbours at the same place."""
    corners = tuple(places.point(entry, (*path, index)) for index, entry in enumerate(entries))
    for index, (before, corner) in enumerate(pairwise(corners), start=1):
        if _same(before, corner):
            places.reporter.value((*path, index), "is the same place as the corner before; leave one of them out")
    return corners


def _same(a: Point, b: Point) -> bool:
    return bool(polygons.distance(a, (b,), closed=False) < SAME_PLACE)


def check_room(
    elements: Iterable[CompositeElement],
    crowds: Sequence[Crowd],
    obstacles: Sequence[Obstacle],
    airspace: tuple[Point, ...],
    reporter: Reporter,
) -> None:
    """Report every element outside of the airspace, or closer to people or an obstacle than is allowed."""
    for element in elements:
        if element.position is None:
            continue
        place, height = element.position
        excess = polygons.distance(place, airspace, closed=True) if airspace else 0.0
        if excess > ROUNDING:
            reporter.key(element.path, f"stands {excess:.4g} m outside of the `airspace`")
        for crowd in crowds:
            distance = polygons.distance(place, crowd.corners, closed=crowd.shape is CrowdShape.AREA)
            distance = math.hypot(distance, height - crowd.height) if crowd.slant else distance
            if distance < crowd.distance - ROUNDING:
                how = "in space" if crowd.slant else "over ground"
                message = f"is {distance:.4g} m from the crowd `{crowd.name}`, measured {how}"
                reporter.key(element.path, f"{message}; at least {crowd.distance:g} m")
        for obstacle in obstacles:
            distance = (
                min(polygons.distance(place, (axis,), closed=False) for axis in obstacle.places) - obstacle.radius
            )
            if distance < obstacle.clearance - ROUNDING and height < obstacle.height + obstacle.clearance:
                message = f"is {distance:.4g} m from the obstacle `{obstacle.name}`; at least {obstacle.clearance:g} m"
                reporter.key(element.path, message)
