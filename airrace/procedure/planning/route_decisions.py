"""Route decisions: the candidates for each passage, and what a plan has to keep to, where it would otherwise decide.

Which route a race takes is decided in a few places: along which axis a passage is crossed and with which course,
to which side the path turns between two passages, to which side a roll or a knife edge goes.
"""

import dataclasses
import math
from collections.abc import Mapping, Set
from dataclasses import field
from typing import Any

from airrace.model.frames import quaternion
from airrace.model.track.course import Course, Passage, Roll, Turning

PLANNED_MAX = 400
"""The largest number of passages of a course that is planned; each takes about a millisecond."""


@dataclasses.dataclass(frozen=True)
class Waypoint:
    """A passage as planned.

    Attributes:
        passage: which one.
        position: north, east, height, m; None where nothing is planned of it.
        heading: course at the passage, rad.
        climb: climb angle, rad.
        bank: prescribed bank, rad; None where free.
        axis: heading of the axis that the crossing is measured against, rad.
        free: whether the element leaves the position free.
        rolled: angle of the roll on the leg that ends here, rad; positive to the right, zero without a roll.
    """

    passage: Passage
    position: tuple[float, float, float] | None
    heading: float
    climb: float
    bank: float | None
    axis: float
    free: bool = False
    rolled: float = 0.0

    @property
    def q(self) -> list[float]:
        """The attitude as a quaternion, wings level where the bank is free."""
        return quaternion(self.heading, self.climb, self.bank or 0.0)


def place(passage: Passage) -> tuple[float, float, float] | None:
    """Return north, east and height (NaN where free) of an element, m; None if it may be anywhere."""
    where, height = passage.element.place, passage.element.nominal_height
    return None if where is None else (*where, math.nan if height is None else height)


def candidates(course: Course, index: int) -> list[Waypoint]:
    """Return the ways in which a passage of a course may be planned.

    They turn with the course: directions that are free are spread from the heading of its first element that has one.
    """
    passage = course.passages[index]
    headings = (one.element.axis for one in course.passages)
    first = next((heading for heading in headings if heading is not None), 0.0)
    crossings = passage.element.crossings(passage.direction, first, rolling=passage.roll is not None)
    return [Waypoint(passage, one.position, one.heading, one.climb, one.bank, one.axis, one.free) for one in crossings]


@dataclasses.dataclass(frozen=True)
class RouteDecisions:
    """The choices that are made already, by the index of the passage concerned; the others are free.

    Attributes:
        ways: the candidates that are left of a passage.
        turns: the side to which the path turns on its way to this passage: 1 to the right, -1 to the left.
        rolls: the side of the roll on the leg that ends with this passage.
        edges: the wing that points down at a knife edge that allows either.
        last: whether of equally short plans the last is taken instead of the first; a mirror exchanges the two.
        lengths: the least length of the path to this passage, m, where there is one as long.
    """

    ways: Mapping[int, tuple[Waypoint, ...]] = field(default_factory=dict[int, tuple[Waypoint, ...]])
    turns: Mapping[int, int] = field(default_factory=dict[int, int])
    rolls: Mapping[int, int] = field(default_factory=dict[int, int])
    edges: Mapping[int, int] = field(default_factory=dict[int, int])
    last: bool = False
    lengths: Mapping[int, float] = field(default_factory=dict[int, float])

    def candidates(self, course: Course, index: int) -> list[Waypoint]:
        """Return the ways in which a passage may still be planned."""
        return list(self.ways[index]) if index in self.ways else candidates(course, index)

    def roll(self, course: Course, index: int) -> Roll | None:
        """Return the roll on the leg that ends with a passage, to the chosen side; None for no roll."""
        roll = course.passages[index].roll
        if roll is None or index not in self.rolls:
            return roll
        return dataclasses.replace(roll, turning=Turning.RIGHT if self.rolls[index] > 0 else Turning.LEFT)

    def without_ways(self, *indices: int) -> "RouteDecisions":
        """Return these choices, except for the ways in which some passages are crossed."""
        left = {index: ways for index, ways in self.ways.items() if index not in indices}
        return dataclasses.replace(self, ways=left)

    def with_those_of(self, other: "RouteDecisions", stops: Set[int]) -> "RouteDecisions":
        """Return these decisions, but another flight's at some stops, and the paths by which it gets there."""
        changes: dict[str, Mapping[int, Any]] = {}  # Any: whatever is decided
        for name in ("ways", "turns", "rolls", "edges", "lengths"):
            own: Mapping[int, Any] = getattr(self, name)
            others: Mapping[int, Any] = getattr(other, name)
            kept = {index: decision for index, decision in own.items() if index not in stops}
            changes[name] = {**kept, **{index: others[index] for index in others if index in stops}}
        return dataclasses.replace(self, **changes)

    def as_planned(self, waypoints: Mapping[int, Waypoint]) -> "RouteDecisions":
        """Return these choices, but at some passages those that a plan has made; turns are left to the next plan.

        The flight since may turn less than that plan did, which forced a side.
        """

        def side(angle: float | None) -> int:
            return 1 if (angle or 0.0) > 0.0 else -1

        return dataclasses.replace(
            self,
            ways={index: (waypoints[index],) if index in waypoints else ways for index, ways in self.ways.items()},
            turns={},
            rolls={i: side(waypoints[i].rolled) if i in waypoints else own for i, own in self.rolls.items()},
            edges={i: side(waypoints[i].bank) if i in waypoints else own for i, own in self.edges.items()},
        )


ANY = RouteDecisions()
"""The choices that leave everything to the plan."""

MIRRORED_TIES = RouteDecisions(last=True)
"""The choices that leave everything to the plan, which decides ties the other way."""
