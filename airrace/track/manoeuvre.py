"""Manoeuvres: attitudes to be reached somewhere."""

import math

import numpy as np

from airrace.quantities import Interval
from airrace.records import record
from airrace.track.element import Crossing, Direction, Drawing, Element, Frame, climb_condition
from airrace.track.passing import NOT_POSITIVE, POSITIVE, ZERO

INVERTED = math.pi
COURSES = 2.0 * math.pi / 36 * np.arange(36)
"""The courses that the plan tries for a manoeuvre that leaves its own free, rad, from the first passage's."""
BANKS = 2.0 * math.pi / 8 * np.arange(8)
"""The banks at which a roll may end that leaves them free, rad."""
STEEP = math.radians(80.0)
"""The climb angle above which a line is so steep that a bank is but another heading, rad."""
VERTICAL = 1e-6
"""The distance from +-pi/2 within which a climb angle is vertical, rad."""


@record
class Manoeuvre(Element):
    """An attitude to be reached at a position that is free within bounds (top of a loop, a 45 degree line, ...).

    Attributes:
        bank: kinematic bank angle, rad (pi: inverted); None leaves it free.
        climb: kinematic climb angle, rad; None leaves it free.
        climb_tolerance: largest deviation from `climb`, rad.
        heading: kinematic course, rad; None leaves it free.
        north, east, height: ranges of the position, m; unbounded where free.
        kind: what tables call it: "manoeuvre", "high-turn", "vertical-roll".
    """

    name: str
    bank: float | None = None
    climb: float | None = None
    climb_tolerance: float = 0.0
    heading: float | None = None
    north: Interval = Interval()
    east: Interval = Interval()
    height: Interval = Interval()
    kind: str = "manoeuvre"

    @property
    def type_name(self) -> str:
        return self.kind

    @property
    def place(self) -> tuple[float, float] | None:
        fixed = self.north.lower == self.north.upper and self.east.lower == self.east.upper
        return (self.north.lower, self.east.lower) if fixed else None

    @property
    def nominal_height(self) -> float | None:
        return self.height.lower if self.height.lower == self.height.upper else None

    @property
    def heights(self) -> Interval:
        return self.height

    @property
    def axis(self) -> float | None:
        return self.heading

    @property
    def prescribed_bank(self) -> float | None:
        return self.bank

    @property
    def prescribed_climb(self) -> float | None:
        return self.climb

    @property
    def free_course(self) -> bool:
        return self.heading is None

    @property
    def only_a_height(self) -> bool:
        asked = (self.bank, self.climb, self.heading)
        return asked == (None, None, None) and not self.north.bounded and not self.east.bounded

    def course(self, direction: Direction) -> float | None:
        return self.heading

    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[Crossing]:
        """Return the prescribed attitude at every course that is allowed.

        A position is given only if all of it is prescribed. A roll may end at any bank; where the line is steep, bank
        and course are one.
        """
        headings = (reference + COURSES).tolist() if self.heading is None else [self.heading]
        climb = self.climb or 0.0
        banks = [self.bank]
        if rolling and self.bank is None and abs(climb) < STEEP:
            banks = BANKS.tolist()
        free = self.position is None
        return [Crossing(self.position, heading, climb, bank, heading, free) for heading in headings for bank in banks]

    def conditions(self, axis: float) -> dict[str, Interval]:
        """Return the conditions of the prescribed attitude.

        The vertical is two conditions: the sine of the climb angle is flat there.
        """
        bounds = {"x": self.north, "y": self.east, "z": Interval(-self.height.upper, -self.height.lower)}
        if self.climb is not None and self.climb_tolerance > 0.0:
            bounds |= climb_condition(Interval(self.climb - self.climb_tolerance, self.climb + self.climb_tolerance))
        elif self.climb is not None and abs(abs(self.climb) - math.pi / 2) < VERTICAL:
            up = POSITIVE if self.climb > 0.0 else NOT_POSITIVE
            return bounds | {"course_sine": ZERO, "course_cosine": ZERO, "climb_sine": up}
        elif self.climb is not None:
            bounds["climb_sine"] = Interval.exactly(math.sin(self.climb))
        if self.heading is not None:
            bounds |= {"course_sine": ZERO, "course_cosine": POSITIVE}
        if self.bank is not None:
            bounds |= {"bank_sine": ZERO, "bank_cosine": POSITIVE}
        return bounds

    def frame(self, axis: float, bank: float, span: float) -> Frame:
        """Return its own frame, whatever was planned.

        Where its course is free any frame would do, and one flight must not be described in several.
        """
        return Frame(axis=self.heading or 0.0, bank=self.bank or 0.0)

    def drawing(self) -> Drawing:
        return Drawing(legend="manoeuvre")

    def height_key(self, *, too_high: bool) -> str:
        if self.height.lower == self.height.upper:
            return "height_m"
        return "height_min_m" if too_high else "height_max_m"
