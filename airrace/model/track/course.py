"""The course: its elements in their order, the rules between them, what it keeps clear of, and its place on earth."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import cast

import numpy as np

from airrace.model.track.element import Direction, Element
from airrace.model.track.polygons import Point, to_right
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class SafetyLine:
    """A line not to be crossed, endless to both sides, on the legs that hold it.

    Attributes:
        start, end: two points of it; they give it a direction.
        keep_right: whether the flight stays to the right of it (as seen along its direction), else to the left.
        margin: required distance from it, m.
    """

    name: str
    start: Point
    end: Point
    keep_right: bool
    margin: float = 0.0

    def room(self, place: Point) -> float:
        """Return the distance of a place from the line on the allowed side, m; negative on the other."""
        right = to_right(self.start, self.end, place)
        return right if self.keep_right else -right


class CrowdShape(Enum):
    """A shape of a crowd: one point, a line from each corner to the next, or an area with the corners on its border."""

    POINT = "point"
    LINE = "line"
    AREA = "area"


@dataclass(frozen=True)
class Crowd:
    """A group of people to keep away from.

    Attributes:
        corners: one for a point, two or more for a line, three or more (without the first again) for an area.
        height: the height of the people above the track's origin, m.
        distance: least distance, m.
        slant: whether the distance is measured in space as in equation (16), else over ground alone.
    """

    name: str
    shape: CrowdShape
    corners: tuple[Point, ...]
    distance: float
    height: float = 0.0
    slant: bool = True


@dataclass(frozen=True)
class Obstacle:
    """A thing that stands in the way, as upright cylinders around all of it: a mast, a crane, a building.

    Attributes:
        places: the axes of the cylinders.
        radius: of the cylinders, m; 0 for a mast.
        height: of its top above the track's origin, m.
        clearance: least distance of the wing from the cylinders, m.
        corners: of its outline, in order; none where that is a circle.
    """

    name: str
    places: tuple[Point, ...]
    radius: float
    height: float
    clearance: float
    corners: tuple[Point, ...] = ()

    @property
    def outline(self) -> tuple[Point, ...]:
        """The corners of what is seen of it from above: of a circle 24, of a mast its place alone."""
        if self.corners or not self.radius:
            return self.corners or self.places[:1]
        (middle,), turns = self.places, [math.tau * number / 24 for number in range(24)]
        return tuple(
            Point(middle.north + self.radius * math.cos(turn), middle.east + self.radius * math.sin(turn))
            for turn in turns
        )


class Turning(Enum):
    """A direction of a roll, as the pilot sees it."""

    RIGHT = "right"
    LEFT = "left"
    EITHER = "either"


@dataclass(frozen=True)
class Roll:
    """A roll on a line: on the leg that ends with the passage that carries it.

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


__all__ = ["Course", "Direction", "EndState", "Origin", "Passage", "Rules"]


class EndState(Enum):
    """A state of flight at the instant at which the clock starts or stops.

    `SETTLED`: as in a steady flight with the load factor and the roll rate of that instant, without side force.
    `FREE`: in any way that the limits allow along the flight, in the middle of a manoeuvre as well.
    """

    SETTLED = "settled"
    FREE = "free"


@dataclass(frozen=True)
class Passage:
    """A passing of an element, and what holds on the leg that leads to it.

    Attributes:
        name: unique over the race and fit for a table, e.g. `2:g4` (lap 2, gate g4).
        lap: counts from 1.
        speed: allowed kinematic speed, m/s (the start's speed limit).
        safety_lines: lines not to be crossed on the leg that ends here.
        roll: a roll on the leg that ends here; None for none.
    """

    name: str
    lap: int
    element: Element
    direction: Direction = Direction.FORWARD
    speed: Interval = Interval()
    safety_lines: tuple[SafetyLine, ...] = ()
    roll: Roll | None = None


class ClearanceRule(Enum):
    """The time at which the wing keeps clear of pylons.

    `FLIGHT`: at any time, of every pylon of the course. `CROSSING`: at the instant of a passing, of its own pylons.
    """

    FLIGHT = "flight"
    CROSSING = "crossing"


class StartSpeed(Enum):
    """The speed that the limit at the start is a limit of."""

    GROUND = "ground_speed"
    TRUE = "true_airspeed"
    INDICATED = "indicated_airspeed"


@dataclass(frozen=True)
class PilotLimits:
    """The limits that a pilot keeps to besides those of the race; without a preset there are none.

    Attributes:
        n_z_min: least load factor all along, g.
        n_z_low: least load factor near the ground, g.
        low_height: the height up to which that is, above the track's origin, m.
        n_z_ends: least load factor over start and finish, g.
        onset: largest magnitude of the rate of the load factor at gates, pylons, start and finish, 1/s.
        roll_rate: largest magnitude of the roll rate there, rad/s.
        sideslip: largest magnitude of the sideslip there, rad.
        n_y: largest magnitude of the lateral load factor there, g.
        settled_start, settled_finish: whether the aircraft is settled there; it overrides the course's ends.
        steady_start, steady_finish: whether start and finish are passed in a steady turn, without rolling.
        turn_tolerance: largest deviation from the load factor of that turn, g.
    """

    n_z_min: float = -math.inf
    n_z_low: float = -math.inf
    low_height: float = 0.0
    n_z_ends: float = -math.inf
    onset: float = math.inf
    roll_rate: float = math.inf
    sideslip: float = math.inf
    n_y: float = math.inf
    settled_start: bool = False
    settled_finish: bool = False
    steady_start: bool = False
    steady_finish: bool = False
    turn_tolerance: float = 0.0


@dataclass(frozen=True)
class Rules:
    """The limits that hold along the whole flight.

    Attributes:
        n_z: load factor, g.
        alpha_A: aerodynamic angle of attack, rad (with the aircraft's lift curve it also bounds C_L).
        C_L: lift coefficient; the aircraft's own limits hold besides.
        p: largest magnitude of the roll rate, rad/s; the aircraft's own limit holds besides.
        beta_A: largest magnitude of the sideslip, rad; the aircraft's own limit holds besides.
        height: floor and ceiling above the track's origin, m.
        clearance: when the wing keeps clear of pylons.
        start_speed: what the limit of the speed at the start is a limit of.
        pilot: what the pilot keeps to besides.
    """

    n_z: Interval
    alpha_A: Interval = Interval()
    C_L: Interval = Interval()
    p: float = math.inf
    beta_A: float = math.inf
    height: Interval = Interval(lower=0.0)
    clearance: ClearanceRule = ClearanceRule.FLIGHT
    start_speed: StartSpeed = StartSpeed.GROUND
    pilot: PilotLimits = PilotLimits()

    @property
    def n_z_allowed(self) -> Interval:
        """The load factors that rules and pilot allow all along, g."""
        return self.n_z.intersect(Interval(lower=self.pilot.n_z_min))


@dataclass(frozen=True)
class Origin:
    """The place of the track's frame: WGS 84 (rad) if it is known, and its height above mean sea level (m)."""

    latitude: float | None = None
    longitude: float | None = None
    elevation: float = 0.0

    @property
    def has_coordinates(self) -> bool:
        """Whether latitude and longitude are known."""
        return self.latitude is not None and self.longitude is not None


@dataclass(frozen=True)
class Course:
    """A race: at least two passages, the first is the start, the last the finish.

    Attributes:
        crowd: where people are; their distance applies all along the flight.
        airspace: corners of the convex area of the race, in order; empty where it has no bounds.
        obstacles: what the wing keeps clear of at any time, independent of the rule for pylons.
        start_state, finish_state: how the aircraft flies when the clock starts and when it stops.
    """

    name: str
    passages: tuple[Passage, ...]
    rules: Rules
    origin: Origin = Origin()
    crowd: tuple[Crowd, ...] = ()
    airspace: tuple[Point, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    start_state: EndState = EndState.SETTLED
    finish_state: EndState = EndState.FREE

    @property
    def safety_lines(self) -> tuple[SafetyLine, ...]:
        """All safety lines that hold on some leg, in the order in which they are met; each name once."""
        return tuple({line.name: line for passage in self.passages for line in passage.safety_lines}.values())

    def passages_with_line(self, line: SafetyLine) -> list[int]:
        """Return the numbers of the passages whose legs keep to a safety line."""
        numbers: list[int] = []
        for number, passage in enumerate(self.passages):
            if any(safety_line.name == line.name for safety_line in passage.safety_lines):
                numbers.append(number)
        return numbers

    @property
    def settled_ends(self) -> tuple[bool, bool]:
        """Whether start and finish are passed in settled flight, as the course or the pilot's limits ask for it."""
        pilot = self.rules.pilot
        return (
            self.start_state is EndState.SETTLED or pilot.settled_start,
            self.finish_state is EndState.SETTLED or pilot.settled_finish,
        )

    @property
    def has_rolls(self) -> bool:
        return any(passage.roll is not None for passage in self.passages)


def metres(latitude: Array, longitude: Array, origin: Origin) -> tuple[Array, Array, Array]:
    """Return north, east and down (m) of places (rad, WGS 84) at the elevation of the origin, each of shape (n,).

    They are seen in the origin's local frame. How far a place lies below its horizontal plane, for the earth is round,
    is ignored: the track's frame is flat. Heights of that frame are added to the origin's elevation.

    Raises:
        ValueError: the origin has no latitude and longitude.
    """
    # Imported here: most courses are given in metres. ignore: the library leaves its arguments untyped.
    from pymap3d import geodetic2ned  # pyright: ignore[reportUnknownVariableType]

    phi, lam, h = _coordinates(origin)
    return cast(tuple[Array, Array, Array], geodetic2ned(latitude, longitude, h, phi, lam, h, deg=False))


def geodetic(north: Array, east: Array, origin: Origin) -> tuple[Array, Array]:
    """Return latitude and longitude (rad) of places (m), each of shape (n,): the inverse of `metres` without its down.

    Raises:
        ValueError: the origin has no latitude and longitude.
    """
    from pymap3d import ned2geodetic  # pyright: ignore[reportUnknownVariableType]

    phi, lam, h = _coordinates(origin)
    # The place is at the origin's elevation: its depth below the plane is found in two corrections.
    down = np.zeros_like(north)
    for _ in range(2):
        place = cast(tuple[Array, Array, Array], ned2geodetic(north, east, down, phi, lam, h, deg=False))
        down = down + np.reshape(place[2] - h, north.shape)
    place = cast(tuple[Array, Array, Array], ned2geodetic(north, east, down, phi, lam, h, deg=False))
    return np.reshape(place[0], north.shape), np.reshape(place[1], north.shape)


def _coordinates(origin: Origin) -> tuple[float, float, float]:
    if origin.latitude is None or origin.longitude is None:
        raise ValueError("the track's origin has no latitude and longitude")
    return origin.latitude, origin.longitude, origin.elevation
