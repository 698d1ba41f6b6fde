"""Waypoints: where and how a passage may be planned, as a few candidates per element."""

from airrace.frames import quaternion
from airrace.records import record
from airrace.track.course import Course, Passage


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


def is_only_a_height(passage: Passage) -> bool:
    """Return whether a passage asks for nothing but a height: any flight that rises to it on its way will do."""
    return passage.roll is None and passage.element.only_a_height


def candidates(course: Course, index: int) -> list[Waypoint]:
    """Return the ways in which a passage of a course may be planned."""
    passage = course.passages[index]
    crossings = passage.element.crossings(passage.direction, _first_heading(course), rolling=passage.roll is not None)
    return [Waypoint(passage, one.position, one.heading, one.climb, one.bank, one.axis, one.free) for one in crossings]


def _first_heading(course: Course) -> float:
    """Return a heading (rad) that turns with the course: that of its first element that has one; north without any."""
    headings = (passage.element.axis for passage in course.passages)
    return next((heading for heading in headings if heading is not None), 0.0)
