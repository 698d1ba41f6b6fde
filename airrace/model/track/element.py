"""Elements of a course: all that plan, problem, pictures and remarks ask of the thing that an aircraft passes.

A kind of element is one class derived from `Element` or `PlacedElement`. It answers in plain numbers, so code that
plans, optimises, draws or reviews a course needs to know no kind. Angles are in radians, clockwise from north; lengths
in metres; positions in the track's north-east frame, heights above its origin.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from airrace.model.parameters import Parameter
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval, Quantity

PYLON_HEIGHT = 25.0
"""The height of the air-filled pylons of the races from 2014 to 2019, m."""


class Direction(Enum):
    """A direction in which a gate is passed; `PLANNED` is the one that makes the shorter race."""

    FORWARD = "forward"
    REVERSE = "reverse"
    PLANNED = "planned"


@dataclass(frozen=True)
class CrossingCandidate:
    """A way in which an element may be crossed, for the plan to choose from.

    Attributes:
        position: north, east, height; None where nothing is planned of it.
        heading: the course at the crossing.
        climb: the climb angle.
        bank: the prescribed bank; None where it is free.
        axis: the heading that the crossing is measured against.
        free: whether the element leaves the position free.
    """

    position: tuple[float, float, float] | None
    heading: float
    climb: float
    bank: float | None
    axis: float
    free: bool = False


@dataclass(frozen=True)
class Frame:
    """The place of a crossing and the directions it is measured against.

    Attributes:
        north, east: the centre.
        axis: the heading of the axis.
        bank: the bank that excesses of bank are counted from.
        bank_tan: tangent of the tolerance of the bank.
        crossing_tan: tangent of the largest horizontal angle between path and axis.
        half_span: distance of the wing tips from the aircraft's centre; zero where the wing is left out of account.
    """

    north: float = 0.0
    east: float = 0.0
    axis: float = 0.0
    bank: float = 0.0
    bank_tan: float = 0.0
    crossing_tan: float = 0.0
    half_span: float = 0.0


Symbols = Mapping[str, Any]
"""Symbols by name. Any: casadi's SX, which plain arithmetic and `airrace.model.frames` take."""


@dataclass(frozen=True, eq=False)
class GateOutput:
    """The quantities that a kind of element observes of an aircraft besides those of every crossing.

    One object serves all elements of a kind, so that its equations are made once.

    Attributes:
        name: identifies it in messages.
        quantities: declarations of what is seen. Their units decide with which tolerance the certificate measures them.
        parameters: declarations of what distinguishes elements of the kind.
        values: maps the quantities of a crossing by name (`airrace.model.dynamics.observations.CrossingValues`) and the
            parameters by name, those of the crossing (`CrossingParameters`) among them, to the quantities in order.
    """

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    values: Callable[[Symbols, Symbols], Sequence[Any]]


@dataclass(frozen=True)
class Drawing:
    """The drawing of an element as seen from above.

    Attributes:
        legend: what the legend of a picture calls elements like this one.
        posts: what stands there.
        post_height: the height of their tops above the origin, m.
        across: the ends of a stroke across the way through it, for a picture too small for anything else.
        window: the ends of the stretch that the aircraft flies through.
        reach: the ends of the stretch beside it that the aircraft flies through.
    """

    legend: str
    posts: tuple[Point, ...] = ()
    post_height: float = PYLON_HEIGHT
    across: tuple[Point, Point] | None = None
    window: tuple[Point, Point] | None = None
    reach: tuple[Point, Point] | None = None


class Element(ABC):
    """A thing to be passed; `name` is unique on the course.

    `stands`: whether it stands at a place and a height, rather than being an attitude at a free place.
    `directed`: whether it can be passed forward or in reverse.
    """

    name: str
    stands: bool = False
    directed: bool = False

    @property
    @abstractmethod
    def type_name(self) -> str:
        """The name of its kind in tables, which is that in a track file."""

    @property
    def base_name(self) -> str:
        """The name of its entry in the file: `q` of `q/1`."""
        return self.name.partition("/")[0]

    # Its place.

    @property
    @abstractmethod
    def place(self) -> tuple[float, float] | None:
        """The place, north and east; None if they are free."""

    @property
    @abstractmethod
    def nominal_height(self) -> float | None:
        """The height of the passing that is planned; None where it is free."""

    @property
    @abstractmethod
    def heights(self) -> Interval:
        """The heights at which the passing counts."""

    @property
    def position(self) -> tuple[float, float, float] | None:
        """The position, north, east and height; None unless all three are known."""
        if self.place is None or self.nominal_height is None:
            return None
        return (*self.place, self.nominal_height)

    # Its passing.

    @property
    @abstractmethod
    def axis(self) -> float | None:
        """A heading that turns with the element; None where it has none."""

    @property
    def climbs(self) -> Interval | None:
        """The climb angles at which a level way may pass it; None where no level way leads there."""
        return None

    @property
    def prescribed_bank(self) -> float | None:
        """The prescribed bank, also where its mirror image would do; None where it is free."""
        return None

    @property
    def prescribed_climb(self) -> float | None:
        """The prescribed climb angle; None where it is free."""
        return None

    @property
    def passing_side(self) -> float | None:
        """The azimuth from its place to the one side on which it is passed; None where it has no such side.

        A kind that has one calls it `pass_side_deg` in its keys.
        """
        return None

    @property
    def two_edged(self) -> bool:
        """Whether the prescribed bank may be to either side."""
        return False

    @property
    def free_course(self) -> bool:
        """Whether it may be passed on any course, so that it does not determine the course."""
        return False

    @property
    def only_a_height(self) -> bool:
        """Whether it asks for nothing but a height: any flight that rises to it on its way will do."""
        return False

    def course(self, direction: Direction) -> float | None:
        """Return the course along its axis when passed in a direction; None if it is free or still to be planned."""
        if not self.directed or self.axis is None or direction is Direction.PLANNED:
            return None
        return self.axis + (math.pi if direction is Direction.REVERSE else 0.0)

    # Its part in the plan and in the optimal control problem.

    @abstractmethod
    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[CrossingCandidate]:
        """Return the ways in which it may be crossed.

        Args:
            direction: which way it is passed.
            reference: a heading from which free courses are counted.
            rolling: whether a roll ends here.
        """

    @abstractmethod
    def conditions(self, axis: float) -> dict[str, Interval]:
        """Return the conditions of its passing when planned along an axis, as ranges by name.

        The ranges are of states, of the quantities of a crossing (`CrossingValues` in
        `airrace.model.dynamics.observations`) and of those of its output.
        """

    @abstractmethod
    def frame(self, axis: float, bank: float, span: float) -> Frame:
        """Return the frame of its passing when planned along an axis with a bank, by an aircraft of a wing span."""

    @property
    def output(self) -> GateOutput | None:
        """Its quantities besides those of every crossing; None for no more."""
        return None

    @property
    def output_values(self) -> tuple[float, ...]:
        """The values of its output's parameters."""
        return ()

    def parameters(self) -> Sequence[Parameter[Any]]:
        """Return the numbers of its passing that may be relaxed, by their keys in the entry; an element is the model.

        Where a course is infeasible, they are tried one by one (`airrace.procedure.infeasibility`).
        """
        return ()

    # Its part in pictures and remarks.

    @abstractmethod
    def drawing(self) -> Drawing:
        """Return how it is drawn."""

    def remarks(self, name: str) -> Iterator[tuple[str, str]]:
        """Yield what a race director would ask about it: the subject in a word, and a sentence without a full stop.

        Args:
            name: the name of its passage.
        """
        yield from ()

    def misfit(self, span: float, aircraft: str) -> tuple[str, str] | None:
        """Return why an aircraft does not fit: the key of the file to blame and a sentence; None if it does fit.

        Args:
            span: the span of its wing, m.
            aircraft: the name of the aircraft.
        """
        return None

    def height_key(self, *, too_high: bool) -> str:
        """Return the key of the file for a height that is too high or too low."""
        return "height_m"


class PlacedElement(Element):
    """An element that stands somewhere: a gate, a pylon.

    A kind declares `north`, `east` and `height` besides its name.
    """

    stands = True
    north: float
    east: float
    height: float

    @property
    def place(self) -> tuple[float, float]:
        return self.north, self.east

    @property
    def nominal_height(self) -> float:
        return self.height

    @property
    def position(self) -> tuple[float, float, float]:
        return self.north, self.east, self.height

    @property
    def heights(self) -> Interval:
        return Interval.exactly(self.height)

    @property
    def climbs(self) -> Interval:
        return Interval()

    def beside(self, distance: float, azimuth: float) -> Point:
        """Return the point at a distance (m) from its centre in the direction of an azimuth (rad)."""
        return Point(self.north + distance * math.cos(azimuth), self.east + distance * math.sin(azimuth))


def climb_condition(allowed: Interval) -> dict[str, Interval]:
    """Return a range of climb angles as a condition; without bounds where it allows everything."""
    lower = math.sin(allowed.lower) if allowed.lower > -math.pi / 2 else -math.inf
    upper = math.sin(allowed.upper) if allowed.upper < math.pi / 2 else math.inf
    return {"climb_sine": Interval(lower, upper)}
