"""What stands on a course: the elements an aircraft flies through, past, or (at a free position) performs.

Angles in radians, clockwise from north; lengths in metres; positions in the track's north-east frame, heights above its
origin. An element says what it is; `course.py` says how and when it is flown.
"""

import math
from dataclasses import dataclass
from enum import Enum

from airrace.quantities import Interval


class Passing(Enum):
    """How strictly gates are passed: exactly (the paper), or anywhere inside their window (the rules)."""

    POINT = "point"
    WINDOW = "window"


@dataclass(frozen=True)
class Tolerances:
    """What a `window` passing allows at a gate; `point` passings ignore all but `climb` and `crossing`.

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


@dataclass(frozen=True)
class Gate:
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


@dataclass(frozen=True)
class Pylon:
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


@dataclass(frozen=True)
class Manoeuvre:
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
    def position(self) -> tuple[float, float, float] | None:
        """North, east and height where all three are prescribed, m."""
        ranges = (self.north, self.east, self.height)
        exact = all(one.lower == one.upper for one in ranges)
        return (self.north.lower, self.east.lower, self.height.lower) if exact else None


Element = Gate | Pylon | Manoeuvre

LEVEL = 0.0
KNIFE_EDGE_RIGHT = math.pi / 2
KNIFE_EDGE_LEFT = -math.pi / 2
INVERTED = math.pi
