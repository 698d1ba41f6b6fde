"""Waypoints: where and how a passage may be planned, as a few candidates per element."""

import math

from airrace.frames import quaternion
from airrace.records import record
from airrace.track.course import Course, Passage

PLANNED_MAX = 400
"""The largest number of passages of a course that is planned; each takes about a millisecond."""


@record
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
