"""Gates: two pylons that are flown between."""

import math
from collections.abc import Iterator

from airrace.quantities import Interval
from airrace.records import record
from airrace.track.element import Crossing, Direction, Drawing, Frame, climb_condition
from airrace.track.passing import NOT_POSITIVE, POSITIVE, ZERO, Passing, Tolerances, Tolerant, offsets

LEVEL = 0.0
KNIFE_EDGE_RIGHT = math.pi / 2
KNIFE_EDGE_LEFT = -math.pi / 2
WIDTHS = Interval(10.0, 14.0)
"""The widths of racing gates by the rules of 2014 to 2019, m."""
WIDE = math.radians(89.9)
"""The largest tolerance of an angle, rad: beyond it the tangent is too large to compute with."""
MOST_STEPS = 6
"""The largest number of courses that the plan tries to either side of the axis."""


@record
class Gate(Tolerant):
    """Two pylons, flown between at a prescribed bank: 0 for a level gate, +-pi/2 for a knife-edge gate.

    Attributes:
        name: unique on the course.
        north, east: centre, m.
        height: nominal height of the passing (exact with `Passing.POINT`), m.
        heading: direction of the axis when flown forward, rad.
        width: distance between the pylons, m.
        bank: prescribed kinematic bank angle, rad (+pi/2: right wing down).
        either_bank: a knife-edge gate that may be flown on either wing.
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

    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[Crossing]:
        """Return courses around the axis, flown forward, in reverse or either way."""
        forward = [self.heading] if direction is not Direction.REVERSE else []
        reverse = [self.heading + math.pi] if direction is not Direction.FORWARD else []
        return [
            Crossing(self.position, axis + float(offset), 0.0, self.bank, axis)
            for axis in (*forward, *reverse)
            for offset in offsets(MOST_STEPS, self.tolerances.crossing)
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

    def drawing(self) -> Drawing:
        """Return two pylons, and the window left between their clearances."""
        half, right = 0.5 * self.width, self.heading + math.pi / 2
        open_half = max(half - self.tolerances.clearance, 0.0)
        ends = self.beside(-half, right), self.beside(half, right)
        return Drawing(
            legend="gate, and the courses through it",
            posts=ends,
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
