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
    """Return all candidates for a passage of a course.

    They turn with the course: directions that are free are spread from the heading of its first element that has one.
    """
    passage = course.passages[index]
    headings = (stop.element.axis for stop in course.passages)
    first = next((heading for heading in headings if heading is not None), 0.0)
    crossings = passage.element.crossings(passage.direction, first, rolling=passage.roll is not None)
    return [
        Waypoint(
            passage, crossing.position, crossing.heading, crossing.climb, crossing.bank, crossing.axis, crossing.free
        )
        for crossing in crossings
    ]


@dataclasses.dataclass(frozen=True)
class RouteDecisions:
    """Decisions by the index of the passage concerned; whatever is absent is left to the plan.

    Attributes:
        candidates: the only candidates of a passage.
        turns: the side to which the path turns on its way to this passage: 1 to the right, -1 to the left.
        rolls: the side of the roll on the leg that ends with this passage.
        edges: the wing that points down at a knife edge that allows either.
        prefer_last_on_ties: take the last of equally short plans instead of the first; a mirror exchanges the two.
        lengths: the least length of the path to this passage, m, where there is one as long.
    """

    candidates: Mapping[int, tuple[Waypoint, ...]] = field(default_factory=dict[int, tuple[Waypoint, ...]])
    turns: Mapping[int, int] = field(default_factory=dict[int, int])
    rolls: Mapping[int, int] = field(default_factory=dict[int, int])
    edges: Mapping[int, int] = field(default_factory=dict[int, int])
    prefer_last_on_ties: bool = False
    lengths: Mapping[int, float] = field(default_factory=dict[int, float])

    def candidates_at(self, course: Course, index: int) -> list[Waypoint]:
        """Return the candidates for a passage."""
        return list(self.candidates[index]) if index in self.candidates else candidates(course, index)

    def roll(self, course: Course, index: int) -> Roll | None:
        """Return the roll on the leg that ends with a passage, to the chosen side; None for no roll."""
        roll = course.passages[index].roll
        if roll is None or index not in self.rolls:
            return roll
        return dataclasses.replace(roll, turning=Turning.RIGHT if self.rolls[index] > 0 else Turning.LEFT)

    def without_candidates(self, *indices: int) -> "RouteDecisions":
        """Return these choices with all candidates of some passages left open."""
        remaining = {index: own for index, own in self.candidates.items() if index not in indices}
        return dataclasses.replace(self, candidates=remaining)

    def with_those_of(self, other: "RouteDecisions", stops: Set[int]) -> "RouteDecisions":
        """Return these decisions, but another flight's at some stops, and the paths by which it gets there."""
        changes: dict[str, Mapping[int, Any]] = {}  # Any: whatever is decided
        for name in ("candidates", "turns", "rolls", "edges", "lengths"):
            own: Mapping[int, Any] = getattr(self, name)
            replacement: Mapping[int, Any] = getattr(other, name)
            remaining = {index: decision for index, decision in own.items() if index not in stops}
            changes[name] = {**remaining, **{index: replacement[index] for index in replacement if index in stops}}
        return dataclasses.replace(self, **changes)

    def as_planned(self, waypoints: Mapping[int, Waypoint]) -> "RouteDecisions":
        """Return these choices, but at some passages those that a plan has made; turns are left to the next plan.

        The flight since may turn less than that plan did, which forced a side.
        """

        def side(angle: float | None) -> int:
            return 1 if (angle or 0.0) > 0.0 else -1

        return dataclasses.replace(
            self,
            candidates={i: (waypoints[i],) if i in waypoints else own for i, own in self.candidates.items()},
            turns={},
            rolls={i: side(waypoints[i].rolled) if i in waypoints else own for i, own in self.rolls.items()},
            edges={i: side(waypoints[i].bank) if i in waypoints else own for i, own in self.edges.items()},
        )


ANY = RouteDecisions()
"""The choices that leave everything to the plan."""

MIRRORED_TIES = RouteDecisions(prefer_last_on_ties=True)
"""The choices that leave everything to the plan, which decides ties the other way."""
