"""The kinds of elements that airrace brings along: gates, pylons, manoeuvres. A further kind is one more class."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from airrace.model.parameters import SINE, TANGENT, Parameter, attribute_parameter
from airrace.model.track.element import (
    PYLON_HEIGHT,
    CrossingCandidate,
    Direction,
    Drawing,
    Element,
    Frame,
    PlacedElement,
    climb_condition,
)
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Array

POSITIVE = Interval(lower=0.0)
NOT_POSITIVE = Interval(upper=0.0)
ZERO = Interval.exactly(0.0)
STEP = math.radians(10.0)
"""The angle from one course to the next among those that a plan chooses from, rad."""

HIGHEST = 5000.0
"""The largest height that the track language knows, m."""
ANGLE_MAX, ANGLE_AT_QUADS_MAX = 85.0, 40.0
"""The angles up to which climb and crossing are relaxed, and a crossing at a quad, deg."""


class Passing(Enum):
    """The strictness with which a gate is passed: exactly, or anywhere inside its window, as in races."""

    POINT = "point"
    WINDOW = "window"


@dataclass(frozen=True)
class Tolerances:
    """The tolerances of a `window` passing at a gate; `point` passings ignore all but `climb` and `crossing`.

    Attributes:
        clearance: least distance of the wing tips from a pylon, m.
        height: legal heights of the aircraft at the gate above the track's origin, m.
        bank: largest deviation from the prescribed bank, rad.
        climb: allowed kinematic climb angles, rad.
        crossing: largest horizontal angle between the path and the gate's axis, rad (below pi/2).
    """

    clearance: float
    height: Interval
    bank: float
    climb: Interval
    crossing: float


class ElementWithTolerances(PlacedElement):
    """An element that stands somewhere and is passed by the rules.

    A kind declares `passing` and `tolerances` besides.
    """

    passing: Passing
    tolerances: Tolerances

    @property
    def heights(self) -> Interval:
        return Interval.exactly(self.height) if self.passing is Passing.POINT else self.tolerances.height

    @property
    def climbs(self) -> Interval:
        return Interval() if self.passing is Passing.POINT else self.tolerances.climb

    def parameters(self) -> Sequence[Parameter[Any]]:
        """Return what a passing tolerates; a `point` passing ignores heights and clearance."""
        crossing_max = ANGLE_AT_QUADS_MAX if "/" in self.name else ANGLE_MAX
        angles = [
            self._tolerance("crossing_max_deg", "crossing", "crossing angle", 10.0, crossing_max, scale=TANGENT),
            self._tolerance("climb_max_deg", "climb.upper", "climb angle", 10.0, ANGLE_MAX, scale=SINE),
            self._tolerance("climb_min_deg", "climb.lower", "climb angle", -10.0, -ANGLE_MAX, scale=SINE),
        ]
        if self.passing is Passing.POINT:
            return angles
        lowest, nearer = min(self.tolerances.height.lower, 0.0), -max(0.5, 0.1 * self.tolerances.clearance)
        return [
            *angles,
            self._tolerance("height_max_m", "height.upper", "height", 5.0, HIGHEST),
            self._tolerance("height_min_m", "height.lower", "height", -5.0, lowest),
            self._tolerance("clearance_m", "clearance", "clearance", nearer, 0.0, digit=0.1),
        ]

    def _tolerance(
        self, key: str, path: str, label: str, step: float, limit: float, **declared: Any
    ) -> Parameter["ElementWithTolerances"]:
        return attribute_parameter(
            self, key, f"tolerances.{path}", label=label, relaxing_step=step, limit=limit, **declared
        )


def offsets(most: int, crossing: float) -> Array:
    """Return courses beside an axis, rad: up to `most` steps to either side, within the largest crossing angle."""
    courses = STEP * np.arange(-most, most + 1)
    return np.asarray(courses[np.abs(courses) <= crossing + 1e-9], dtype=np.float64)


LEVEL = 0.0
KNIFE_EDGE_RIGHT = math.pi / 2
KNIFE_EDGE_LEFT = -math.pi / 2
WIDTHS = Interval(10.0, 14.0)
"""The widths of racing gates by the rules of 2014 to 2019, m."""
WIDE = math.radians(89.9)
"""The largest tolerance of an angle, rad: beyond it the tangent is too large to compute with."""


@dataclass(frozen=True)
class Gate(ElementWithTolerances):
    """Two pylons, passed between at a prescribed bank: 0 for a level gate, +-pi/2 for a knife-edge gate.

    Those of a quad share four, at the corners of a square, and are passed in the middle between two pairs of them.

    Attributes:
        name: unique on the course.
        north, east: centre, m.
        height: nominal height of the passing (exact with `Passing.POINT`), m.
        heading: direction of the axis in forward direction, rad.
        width: distance between the pylons, m.
        bank: prescribed kinematic bank angle, rad (+pi/2: right wing down).
        either_bank: a knife-edge gate that allows either wing down.
        pylon_height: the height of the pylons' tops above the origin, m.
        square: whether it is one of a quad.
    """

    name: str
    north: float
    east: float
    height: float
    heading: float
    width: float
    passing: Passing
    tolerances: Tolerances
    bank: float = 0.0
    either_bank: bool = False
    pylon_height: float = PYLON_HEIGHT
    square: bool = False

    directed = True

    @property
    def type_name(self) -> str:
        return "level" if math.isclose(self.bank, 0.0, abs_tol=1e-9) else "knife-edge"

    @property
    def axis(self) -> float:
        return self.heading

    @property
    def prescribed_bank(self) -> float:
        return self.bank

    @property
    def two_edged(self) -> bool:
        return self.either_bank

    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[CrossingCandidate]:
        """Return courses around the axis, forward, in reverse or either way."""
        forward = [self.heading] if direction is not Direction.REVERSE else []
        reverse = [self.heading + math.pi] if direction is not Direction.FORWARD else []
        return [
            CrossingCandidate(self.position, axis + float(offset), 0.0, self.bank, axis)
            for axis in (*forward, *reverse)
            for offset in offsets(6, self.tolerances.crossing)
        ]

    def conditions(self, axis: float) -> dict[str, Interval]:
        """Return the conditions of a passing between the pylons, wing tips and all; or exactly in their middle."""
        allowed = self.tolerances
        bounds = {"along": ZERO, "course_excess_right": NOT_POSITIVE, "course_excess_left": NOT_POSITIVE}
        if self.passing is Passing.POINT:
            exact = {"right": ZERO, "height": Interval.exactly(self.height)}
            return bounds | exact | {"bank_sine": ZERO, "bank_cosine": POSITIVE} | climb_condition(allowed.climb)
        reach = self.width / 2 - allowed.clearance
        between = Interval(-reach, reach)
        bounds |= {"right_wing": between, "left_wing": between, "height": allowed.height}
        if allowed.bank > WIDE:
            bounds["bank_cosine"] = POSITIVE
        else:
            bounds |= {"bank_excess_right": NOT_POSITIVE, "bank_excess_left": NOT_POSITIVE}
        return bounds | climb_condition(allowed.climb)

    def frame(self, axis: float, bank: float, span: float) -> Frame:
        return Frame(
            north=self.north,
            east=self.east,
            axis=axis,
            bank=bank,
            bank_tan=math.tan(self.tolerances.bank) if self.tolerances.bank <= WIDE else 0.0,
            crossing_tan=math.tan(self.tolerances.crossing),
            half_span=0.0 if self.passing is Passing.POINT else span / 2,
        )

    def parameters(self) -> Sequence[Parameter[Any]]:
        if self.passing is Passing.POINT:
            return super().parameters()
        return [
            *super().parameters(),
            self._tolerance("bank_tolerance_deg", "bank", "bank tolerance", 5.0, 89.0, scale=TANGENT),
            attribute_parameter(self, "width_m", "width", label="width", relaxing_step=1.0, limit=100.0, digit=0.1),
        ]

    def drawing(self) -> Drawing:
        """Return its pylons, and the window left between their clearances."""
        half, right = 0.5 * self.width, self.heading + math.pi / 2
        open_half = max(half - self.tolerances.clearance, 0.0)
        ends = self.beside(-half, right), self.beside(half, right)
        diagonal, corners = math.sqrt(2.0) * half, (0.25 * math.pi + 0.5 * math.pi * np.arange(4)).tolist()
        return Drawing(
            legend="gate, and the courses through it",
            posts=tuple(self.beside(diagonal, right + corner) for corner in corners) if self.square else ends,
            post_height=self.pylon_height,
            across=ends,
            window=(self.beside(-open_half, right), self.beside(open_half, right)),
        )

    def remarks(self, name: str) -> Iterator[tuple[str, str]]:
        if not WIDTHS.lower - 1e-9 <= self.width <= WIDTHS.upper + 1e-9:
            yield "width", f"the gate of `{name}` is {self.width:g} m wide; racing gates are 10 to 14 m wide"

    def misfit(self, span: float, aircraft: str) -> tuple[str, str] | None:
        """Return why an aircraft with its wings level does not fit between the pylons with their clearances."""
        clearance = self.tolerances.clearance
        room = self.width - 2.0 * clearance
        if self.passing is Passing.POINT or self.bank != LEVEL or room > span:
            return None
        return (
            "width_m",
            f"a width of {self.width:g} m less two clearances of {clearance:g} m leaves {room:g} m; "
            f"the wing of {aircraft} spans {span:g} m",
        )


MARGIN = 4.0
"""The distance beyond the clearance at which the plan passes a pylon, m."""


@dataclass(frozen=True)
class Pylon(ElementWithTolerances):
    """A single pylon passed on one side, bank free (slalom, turning point).

    Attributes:
        side: azimuth from the pylon to the side on which it is passed, rad.
        reach: farthest distance from the pylon at which the passing counts, m.
        pylon_height: the height of its top above the origin, m.
    """

    name: str
    north: float
    east: float
    height: float
    side: float
    reach: float
    passing: Passing
    tolerances: Tolerances
    pylon_height: float = PYLON_HEIGHT

    @property
    def type_name(self) -> str:
        return "pylon"

    @property
    def passing_side(self) -> float:
        return self.side

    @property
    def axis(self) -> float:
        return self.side + math.pi / 2

    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[CrossingCandidate]:
        """Return all courses within the crossing limit of either direction across the line to the pylon."""
        beside = self.beside(self.tolerances.clearance + MARGIN, self.side)
        return [
            CrossingCandidate((beside.north, beside.east, self.height), axis + float(offset), 0.0, None, axis)
            for axis in (self.side + math.pi / 2, self.side - math.pi / 2)
            # More courses than at a gate, as the crossing angle may be larger.
            for offset in offsets(8, self.tolerances.crossing)
        ]

    def conditions(self, axis: float) -> dict[str, Interval]:
        """Return the conditions of a passing on its side, both wing tips clear of it, measured across the track."""
        allowed = self.tolerances
        to_right = math.sin(self.side - axis) > 0.0
        clear = Interval(lower=allowed.clearance) if to_right else Interval(upper=-allowed.clearance)
        bounds = {
            "along": ZERO,
            "right": Interval(0.0, self.reach) if to_right else Interval(-self.reach, 0.0),
            "beside_right": clear,
            "beside_left": clear,
            "course_excess_right": NOT_POSITIVE,
            "course_excess_left": NOT_POSITIVE,
        }
        return bounds | {"height": self.heights} | climb_condition(allowed.climb)

    def frame(self, axis: float, bank: float, span: float) -> Frame:
        return Frame(
            north=self.north,
            east=self.east,
            axis=axis,
            bank=bank,
            crossing_tan=math.tan(self.tolerances.crossing),
            half_span=0.0 if self.passing is Passing.POINT else span / 2,
        )

    def parameters(self) -> Sequence[Parameter[Any]]:
        if self.passing is Passing.POINT:
            return super().parameters()
        reach = attribute_parameter(self, "reach_m", "reach", label="reach", relaxing_step=10.0, limit=1000.0)
        return [*super().parameters(), reach]

    def drawing(self) -> Drawing:
        """Return a dot, and the stretch in which the passing counts."""
        return Drawing(
            legend="pylon, and its window",
            posts=(self.beside(0.0, self.side),),
            post_height=self.pylon_height,
            reach=(self.beside(self.tolerances.clearance, self.side), self.beside(self.reach, self.side)),
        )


INVERTED = math.pi
COURSES = 2.0 * math.pi / 36 * np.arange(36)
"""The courses that the plan tries for a manoeuvre that leaves its own free, rad, from the first passage's."""
BANKS = 2.0 * math.pi / 8 * np.arange(8)
"""The banks at which a roll may end that leaves them free, rad."""
STEEP = math.radians(80.0)
"""The climb angle above which a line is so steep that a bank is but another heading, rad."""
VERTICAL = 1e-6
"""The distance from +-pi/2 within which a climb angle is vertical, rad."""


@dataclass(frozen=True)
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
        angles = (self.bank, self.climb, self.heading)
        return angles == (None, None, None) and not self.north.constrained and not self.east.constrained

    def course(self, direction: Direction) -> float | None:
        return self.heading

    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[CrossingCandidate]:
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
        return [
            CrossingCandidate(self.position, heading, climb, bank, heading, free)
            for heading in headings
            for bank in banks
        ]

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
        """Return its own frame, independent of the plan.

        Where its course is free any frame would do, and one flight must not be described in several.
        """
        return Frame(axis=self.heading or 0.0, bank=self.bank or 0.0)

    def parameters(self) -> Sequence[Parameter[Any]]:
        """Return the ends of its range of heights; none where the height is exact."""
        if self.height.lower == self.height.upper:
            return ()
        ends = (("height_min_m", "lower", -10.0, min(self.height.lower, 0.0)), ("height_max_m", "upper", 10.0, HIGHEST))
        return [
            attribute_parameter(self, key, f"height.{end}", label="height", relaxing_step=step, limit=limit)
            for key, end, step, limit in ends
        ]

    def drawing(self) -> Drawing:
        return Drawing(legend="manoeuvre")

    def height_key(self, *, too_high: bool) -> str:
        if self.height.lower == self.height.upper:
            return "height_m"
        return "height_min_m" if too_high else "height_max_m"
