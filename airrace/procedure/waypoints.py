"""Where and how a passage may be planned: a few candidates per element."""

import math
from dataclasses import dataclass

import numpy as np

from airrace.frames import quaternion
from airrace.track.course import Course, Direction, Passage
from airrace.track.gates import Gate, Manoeuvre, Pylon

COURSES = 2.0 * math.pi / 36 * np.arange(36)  # of a manoeuvre that leaves its own free, from the first passage's
OFFSETS = math.radians(10.0) * np.arange(-6, 7)
BESIDE_OFFSETS = math.radians(10.0) * np.arange(-8, 9)  # at a pylon, whose crossing angle may be larger
BANKS = 2.0 * math.pi / 8 * np.arange(8)
PYLON_MARGIN = 4.0  # m beyond the clearance, where the plan passes a pylon
STEEP = math.radians(80.0)  # steeper than this a bank is but another heading


@dataclass(frozen=True)
class Waypoint:
    """One passage as planned.

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
        """Attitude, wings level where the bank is free."""
        return quaternion(self.heading, self.climb, self.bank or 0.0)


def is_only_a_height(passage: Passage) -> bool:
    """Whether a passage asks for nothing but a height: any flight that rises to it on its way will do."""
    element = passage.element
    if not isinstance(element, Manoeuvre) or passage.roll is not None:
        return False
    asked = (element.bank, element.climb, element.heading)
    return asked == (None, None, None) and not element.north.bounded and not element.east.bounded


def candidates(course: Course, index: int) -> list[Waypoint]:
    """The ways in which a passage of a course may be planned."""
    passage = course.passages[index]
    match passage.element:
        case Gate():
            return _at_gate(passage, passage.element)
        case Pylon():
            return _at_pylon(passage, passage.element)
        case Manoeuvre():
            return _in_manoeuvre(passage, passage.element, _first_heading(course))


def _at_gate(passage: Passage, gate: Gate) -> list[Waypoint]:
    """Courses around the axis, flown forward, in reverse or either way."""
    forward = [gate.heading] if passage.direction is not Direction.REVERSE else []
    reverse = [gate.heading + math.pi] if passage.direction is not Direction.FORWARD else []
    offsets = OFFSETS[np.abs(OFFSETS) <= gate.tolerances.crossing + 1e-9]
    position = (gate.north, gate.east, gate.height)
    return [
        Waypoint(passage, position, axis + float(offset), 0.0, gate.bank, axis)
        for axis in (*forward, *reverse)
        for offset in offsets
    ]


def _at_pylon(passage: Passage, pylon: Pylon) -> list[Waypoint]:
    """All courses within the crossing limit of either direction across the line to the pylon."""
    distance = pylon.tolerances.clearance + PYLON_MARGIN
    north, east = pylon.north + distance * math.cos(pylon.side), pylon.east + distance * math.sin(pylon.side)
    offsets = BESIDE_OFFSETS[np.abs(BESIDE_OFFSETS) <= pylon.tolerances.crossing + 1e-9]
    return [
        Waypoint(passage, (north, east, pylon.height), axis + float(offset), 0.0, None, axis)
        for axis in (pylon.side + math.pi / 2, pylon.side - math.pi / 2)
        for offset in offsets
    ]


def _first_heading(course: Course) -> float:
    """A heading (rad) that turns with the course: that of its first element that has one; north without any."""
    for passage in course.passages:
        match passage.element:
            case Gate(heading=heading):
                return heading
            case Pylon(side=side):
                return side + math.pi / 2
            case Manoeuvre(heading=heading) if heading is not None:
                return heading
            case Manoeuvre():
                pass
    return 0.0


def _in_manoeuvre(passage: Passage, element: Manoeuvre, reference: float) -> list[Waypoint]:
    """The prescribed attitude at every course that is allowed; a position only where all of it is prescribed.

    Free courses are counted from a reference (rad). A roll may end at any bank; where the line is steep, bank and
    course are one.
    """
    headings = (reference + COURSES).tolist() if element.heading is None else [element.heading]
    climb = element.climb or 0.0
    banks = [element.bank]
    if passage.roll is not None and element.bank is None and abs(climb) < STEEP:
        banks = BANKS.tolist()
    free = element.position is None
    return [
        Waypoint(passage, element.position, heading, climb, bank, heading, free)
        for heading in headings
        for bank in banks
    ]
