"""Single pylons, which are passed on one side."""

import math

from airrace.quantities import Interval
from airrace.records import record
from airrace.track.element import Crossing, Direction, Drawing, Frame, climb_condition
from airrace.track.passing import NOT_POSITIVE, ZERO, Passing, Tolerances, Tolerant, offsets

MARGIN = 4.0
"""The distance beyond the clearance at which the plan passes a pylon, m."""
MOST_STEPS = 8
"""The largest number of courses that the plan tries to either side of the axis.

The crossing angle may be larger than at a gate.
"""


@record
class Pylon(Tolerant):
    """A single pylon passed on one side, bank free (slalom, turning point).

    Attributes:
        side: azimuth from the pylon to the side on which it is passed, rad.
        reach: farthest distance from the pylon at which the passing counts, m.
    """

    name: str
    north: float
    east: float
    height: float
    side: float
    reach: float
    passing: Passing
    tolerances: Tolerances

    @property
    def type_name(self) -> str:
        return "pylon"

    @property
    def passing_side(self) -> float:
        return self.side

    @property
    def axis(self) -> float:
        return self.side + math.pi / 2

    def crossings(self, direction: Direction, reference: float, *, rolling: bool) -> list[Crossing]:
        """Return all courses within the crossing limit of either direction across the line to the pylon."""
        beside = self.beside(self.tolerances.clearance + MARGIN, self.side)
        return [
            Crossing((beside.north, beside.east, self.height), axis + float(offset), 0.0, None, axis)
            for axis in (self.side + math.pi / 2, self.side - math.pi / 2)
            for offset in offsets(MOST_STEPS, self.tolerances.crossing)
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

    def drawing(self) -> Drawing:
        """Return a dot, and the stretch in which the passing counts."""
        return Drawing(
            legend="pylon, and its window",
            posts=(self.beside(0.0, self.side),),
            reach=(self.beside(self.tolerances.clearance, self.side), self.beside(self.reach, self.side)),
        )
