"""The limits of a course besides its elements: safety lines, crowds, and rolls on the way."""

from enum import Enum

from airrace.quantities import Interval
from airrace.records import record
from airrace.track.polygons import Point


@record
class SafetyLine:
    """A line not to be crossed, endless to both sides, on the legs that name it.

    Attributes:
        start, end: two points of it; they give it a direction.
        keep_right: whether the flight stays to the right of it (as seen along its direction), else to the left.
        margin: distance to be kept from it, m.
    """

    name: str
    start: Point
    end: Point
    keep_right: bool
    margin: float = 0.0


class CrowdShape(Enum):
    """A shape of a crowd: one point, a line from each corner to the next, or an area with the corners on its border."""

    POINT = "point"
    LINE = "line"
    AREA = "area"


@record
class Crowd:
    """A group of people to keep away from.

    Attributes:
        corners: one for a point, two or more for a line, three or more (without the first again) for an area.
        height: the height of the people above the track's origin, m.
        distance: least distance, m.
        slant: whether the distance is measured in space as in (16) of the paper, else over ground alone.
    """

    name: str
    shape: CrowdShape
    corners: tuple[Point, ...]
    distance: float
    height: float = 0.0
    slant: bool = True


class Turning(Enum):
    """A direction of a roll, as the pilot sees it."""

    RIGHT = "right"
    LEFT = "left"
    EITHER = "either"


@record
class Roll:
    """A roll on a line: flown on the leg that ends with the passage that carries it.

    Attributes:
        angle: least angle of the roll, rad.
        climb: climb angles allowed meanwhile, rad.
        gain: least height gained meanwhile, m.
        turning: the direction of the roll.
    """

    angle: float
    climb: Interval
    gain: float = 0.0
    turning: Turning = Turning.EITHER
