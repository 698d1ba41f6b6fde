"""Races seen in a mirror, turned, or put somewhere else: the same races, so the same race time.

A `Change` mirrors first (east becomes west), then turns to the right about the track's origin, then moves. It applies
to everything that has a place or a direction: elements, safety lines, crowds, airspace, rolls, thermals and the wind.
The geographic position of the origin and its elevation stay as they are.
"""

import math
from dataclasses import dataclass, replace

from airrace.model.environment import Air
from airrace.model.track.course import Course, Crowd, Passage, SafetyLine, Turning
from airrace.model.track.gates import Element, Gate, Manoeuvre, Pylon
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval
from airrace.race import Race

OTHER_WAY = {Turning.RIGHT: Turning.LEFT, Turning.LEFT: Turning.RIGHT, Turning.EITHER: Turning.EITHER}


@dataclass(frozen=True)
class Change:
    """Mirror or not, then turn by `turn` (rad, clockwise from above), then move by `north` and `east` (m)."""

    mirror: bool = False
    turn: float = 0.0
    north: float = 0.0
    east: float = 0.0

    def place(self, north: float, east: float) -> tuple[float, float]:
        """A place, m."""
        side = -east if self.mirror else east
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return north * cos - side * sin + self.north, north * sin + side * cos + self.east

    def azimuth(self, angle: float) -> float:
        """A direction over ground, rad."""
        return self.bank(angle) + self.turn

    def bank(self, angle: float) -> float:
        """An angle to the right as the pilot sees it, rad."""
        return -angle if self.mirror else angle

    def point(self, point: Point) -> Point:
        """A place on the ground."""
        return Point(*self.place(point.north, point.east))


def mirrored(race: Race) -> Race:
    """The race seen in a mirror that exchanges east and west."""
    return changed(race, Change(mirror=True))


def rotated(race: Race, turn: float) -> Race:
    """The race turned about the track's origin by `turn` (rad, clockwise from above).

    Raises:
        ValueError: a position lies within a range of north or east, which would not be one any more.
    """
    return changed(race, Change(turn=turn))


def moved(race: Race, north: float, east: float) -> Race:
    """The race that much further north and east (m)."""
    return changed(race, Change(north=north, east=east))


def changed(race: Race, change: Change) -> Race:
    """The race after any change.

    Raises:
        ValueError: it is to be turned, and a position lies within a range of north or east.
    """
    return replace(race, course=_course(race.course, change), air=_air(race.air, change))


def _course(course: Course, change: Change) -> Course:
    return replace(
        course,
        passages=tuple(_passage(one, change) for one in course.passages),
        crowd=tuple(_crowd(one, change) for one in course.crowd),
        airspace=tuple(change.point(corner) for corner in course.airspace),
    )


def _passage(passage: Passage, change: Change) -> Passage:
    roll = passage.roll
    if roll is not None and change.mirror:
        roll = replace(roll, turning=OTHER_WAY[roll.turning])
    return replace(
        passage,
        element=_element(passage.element, change),
        safety_lines=tuple(_safety_line(one, change) for one in passage.safety_lines),
        roll=roll,
    )


def _element(element: Element, change: Change) -> Element:
    if isinstance(element, Manoeuvre):
        north, east = _ranges(element, change)
        heading = None if element.heading is None else change.azimuth(element.heading)
        bank = None if element.bank is None else change.bank(element.bank)
        return replace(element, north=north, east=east, heading=heading, bank=bank)
    north, east = change.place(element.north, element.east)
    match element:
        case Gate():
            heading, bank = change.azimuth(element.heading), change.bank(element.bank)
            return replace(element, north=north, east=east, heading=heading, bank=bank)
        case Pylon():
            return replace(element, north=north, east=east, side=change.azimuth(element.side))


def _ranges(element: Manoeuvre, change: Change) -> tuple[Interval, Interval]:
    """The ranges of north and east."""
    north, east = element.north, element.east
    if not north.constrained and not east.constrained:
        return north, east
    if north.lower == north.upper and east.lower == east.upper:
        place = change.place(north.lower, east.lower)
        return Interval.exactly(place[0]), Interval.exactly(place[1])
    if change.turn != 0.0:
        raise ValueError(f"{element.name} lies within a range of north or east and cannot be turned")
    if change.mirror:
        east = Interval(-east.upper, -east.lower)
    return (
        Interval(north.lower + change.north, north.upper + change.north),
        Interval(east.lower + change.east, east.upper + change.east),
    )


def _safety_line(line: SafetyLine, change: Change) -> SafetyLine:
    keep_right = line.keep_right != change.mirror
    return replace(line, start=change.point(line.start), end=change.point(line.end), keep_right=keep_right)


def _crowd(crowd: Crowd, change: Change) -> Crowd:
    return replace(crowd, corners=tuple(change.point(corner) for corner in crowd.corners))


def _air(air: Air, change: Change) -> Air:
    wind = air.wind and replace(air.wind, origin=change.azimuth(air.wind.origin))
    places = [change.place(one.north, one.east) for one in air.thermals]
    thermals = tuple(
        replace(one, north=north, east=east) for one, (north, east) in zip(air.thermals, places, strict=True)
    )
    return replace(air, wind=wind, thermals=thermals)
