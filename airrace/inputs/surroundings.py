"""The surroundings of a course in a track file: safety lines, crowds and the airspace, and whether they leave room."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le
from pydantic import Field

from airrace.inputs.kinds.kind import CompositeElement
from airrace.inputs.nodes import LIMITS, KeyPath, Reporter
from airrace.inputs.places import NOWHERE, PlaceEntry, Places
from airrace.inputs.rules import Distance
from airrace.inputs.schema import Schema, optional
from airrace.track import polygons
from airrace.track.course import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point

SAME_PLACE_M = 0.01
"""The distance below which two corners are one, m."""
ROUNDING_M = 1e-6
"""The excess over a distance that is put down to rounding and not reported, m."""
SHAPES = {"point": CrowdShape.POINT, "line": CrowdShape.LINE, "polygon": CrowdShape.AREA}

Corners = Annotated[list[PlaceEntry], Field(max_length=LIMITS.corners)]


class SafetyLineEntry(Schema):
    what: ClassVar[str] = "a safety line"
    from_: PlaceEntry = Field(alias="from", description="a point of the line")
    to: PlaceEntry = Field(description="another point of it; the line has no ends and runs from `from` to here")
    keep: Literal["left", "right"] = Field(description="the side of the line, seen along it, on which the flight stays")
    margin_m: Annotated[float, Ge(0), Le(1000)] = Field(default=0.0, description="required distance from the line")

    def build(self, name: str, places: Places) -> SafetyLine:
        """Return the line; it is only of use if nothing was reported."""
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
        given = [key for key in SHAPES if getattr(self, key) is not None]
        if not given:
            places.reporter.key(path, "a crowd needs one of `point`, `line` and `polygon`")
        if len(given) > 1:
            places.reporter.key((*path, given[1]), f"not together with `{given[0]}`; a crowd has one shape")
        if self.distance_m is None and distance is None:
            message = "missing; say it here, or for every crowd as `crowd_distance_m` of the rules"
            places.reporter.key((*path, "distance_m"), message)
        return Crowd(
            name=name,
            shape=SHAPES[given[0] if given else "point"],
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


def room_beside(line: SafetyLine, place: Point) -> float:
    """Return the distance of a place from a line on the allowed side, m; negative on the other."""
    to_right = polygons.to_right(line.start, line.end, place)
    return to_right if line.keep_right else -to_right


def build_airspace(entries: Sequence[PlaceEntry] | None, places: Places) -> tuple[Point, ...]:
    """Return the corners of the convex area of the race; empty if there is none, or none to rely on."""
    if entries is None:
        return ()
    known = len(places.reporter.findings)
    corners = _polygon(entries, ("airspace",), places)
    if len(places.reporter.findings) > known:
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
    known = len(places.reporter.findings)
    corners = _points(entries, path, places)
    if len(entries) < 3:
        places.reporter.value(path, f"an area needs at least three corners, not {len(entries)}")
        return corners
    if _same(corners[0], corners[-1]):
        message = "is the first corner again; leave it out, an area closes by itself"
        places.reporter.value((*path, len(corners) - 1), message)
    if len(places.reporter.findings) > known:
        return corners
    farthest = max(corners, key=lambda one: polygons.distance(one, corners[:1], closed=False))
    if all(abs(polygons.to_right(corners[0], farthest, one)) < SAME_PLACE_M for one in corners):
        places.reporter.value(path, "all corners lie on one line; an area needs three that do not")
        return corners
    for index, corner in enumerate(corners):
        before, after = corners[index - 1], corners[(index + 1) % len(corners)]
        to_edges = [(after, (before, corner)), (before, (corner, after))]
        if min(polygons.distance(place, edge, closed=False) for place, edge in to_edges) < SAME_PLACE_M:
            places.reporter.value((*path, index), "the border turns back on itself at this corner; leave it out")
            return corners
    crossing = polygons.crossing_edges(corners)
    if crossing is not None:
        one, other = (f"from corner {index} to corner {(index + 1) % len(corners)}" for index in crossing)
        places.reporter.value(
            path, f"the border crosses itself: {one} and {other} (counted from 0); give the corners in order"
        )
    return corners


def _points(entries: Sequence[PlaceEntry], path: KeyPath, places: Places) -> tuple[Point, ...]:
    """Return the corners; report neighbours at the same place."""
    corners = tuple(places.point(entry, (*path, index)) for index, entry in enumerate(entries))
    for index, (before, here) in enumerate(pairwise(corners), start=1):
        if _same(before, here):
            places.reporter.value((*path, index), "is the same place as the corner before; leave one of them out")
    return corners


def _same(a: Point, b: Point) -> bool:
    return polygons.distance(a, (b,), closed=False) < SAME_PLACE_M


def check_room(
    elements: Iterable[CompositeElement], crowds: Sequence[Crowd], airspace: tuple[Point, ...], reporter: Reporter
) -> None:
    """Report every element that stands outside of the airspace or closer to people than is allowed."""
    for element in elements:
        if element.position is None:
            continue
        place, height = element.position
        away = polygons.distance(place, airspace, closed=True) if airspace else 0.0
        if away > ROUNDING_M:
            reporter.key(element.path, f"stands {away:.4g} m outside of the `airspace`")
        for crowd in crowds:
            away = polygons.distance(place, crowd.corners, closed=crowd.shape is CrowdShape.AREA)
            away = math.hypot(away, height - crowd.height) if crowd.slant else away
            if away < crowd.distance - ROUNDING_M:
                how = "in space" if crowd.slant else "over ground"
                reporter.key(
                    element.path,
                    f"is {away:.4g} m from the crowd `{crowd.name}`, measured {how}; at least {crowd.distance:g} m",
                )
