"""Clearances: of the wing from pylons and obstacles in continuous time, of tracks over ground from people and borders.

The wing is the straight line from tip to tip: the body's in models that have a body, the flight path's in the others
(`frames.right_wing`); the problem, its certificate and whatever shows a flight mean the same one. A pylon is the
vertical line from far below up to its top. An obstacle is such lines, too, cleared by the radius of their cylinders
more; above its top as well, where that is more than is asked. With `d` the aircraft's centre relative to the pylon
(north, east), `w` half of the wing, from the centre to the right tip, and `h - H` the centre's height above the top of
the pylon, the squared distance of the point `s` of the wing, -1 <= s <= 1, is

    f(s) = |d + s w|^2 + max(h - H + s w_h, 0)^2

a convex function made of two parabolas. Its minimum is at the vertex of one of them, at the point where they meet, or
at a tip: the least of these four values is exact.

Between the given times tips move along cubics with slopes from central differences, which is true within a millimetre
where samples are 0.02 s apart. Of a cubic the distance is sampled closely and once more about the least value.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from airrace.model.frames import right_wing, rotation
from airrace.model.track.course import ClearanceRule, Course, Crowd, CrowdShape, SafetyLine
from airrace.model.track.gates import ElementWithTolerances, Passing
from airrace.model.track.polygons import Point, area, beside, distance, edges, inside
from airrace.optimal_control.trajectory import Array

LEAST_CLEARANCE = 0.5
"""The clearance of pylons whose element asks for no more, m: that of the rules of 2014 to 2019."""
NEAR = 10.0
"""The distance beyond clearance and wing at which a pylon counts as near, m."""
PARTS = 48
"""The number of parts into which a step is divided to find the least distance, and again the part with the least."""
ABEAM_MAX = 0.1
"""The longest time between the moment abeam and that of the least distance, s; on a leg that ends before, or where the
wing hits, it could be longer."""
NO_EXTENT = 1e-9
"""The extent of a wing below which it has none in a direction, m; other points of it are the nearest then."""


Place = tuple[float, float]
"""North and east of a pylon, m, rounded so that places can be compared."""


def place_of(post: "Point | PylonPost") -> Place:
    """Return the place of a pylon; elements with a pylon in the same place share it, as those of a quad do."""
    return round(post.north, 6), round(post.east, 6)


@dataclass(frozen=True)
class PylonPost:
    """A post of a pylon or gate of a course.

    Attributes:
        name: of the element or obstacle that it belongs to, which may have several.
        north, east: m.
        height: of its top above the origin of the course, m.
        required: the least distance of a wing, m; of an obstacle with the radius.
        post: its number among the pylons of its element.
        radius: of the cylinder around it, m.
        is_obstacle: whether it is one of an obstacle.
    """

    name: str
    north: float
    east: float
    height: float
    required: float
    post: int = 0
    radius: float = 0.0
    is_obstacle: bool = False

    @property
    def text(self) -> str:
        """What it is, e.g. `pylon of g3`."""
        return f"obstacle {self.name}" if self.is_obstacle else f"pylon of {self.name}"


@dataclass(frozen=True, eq=False)
class Wing:
    """The way of a wing.

    Attributes:
        time: s, rising, shape (n,).
        centre: of the aircraft: north, east, height, m; shape (3, n).
        half: from the centre to the right tip, likewise.
    """

    time: Array
    centre: Array
    half: Array

    @cached_property
    def slopes(self) -> tuple[Array, Array]:
        """The slopes of centre and half at the given times, m/s; each of shape (3, n)."""
        return np.gradient(self.centre, self.time, axis=1), np.gradient(self.half, self.time, axis=1)


@dataclass(frozen=True)
class ClosestApproach:
    """The least distance of a wing from a pylon on a stretch of a flight.

    Attributes:
        leg: the number of the leg, from 0.
        distance: m.
        time: s.
        abeam: when that point of the wing is abeam of the pylon which is the nearest one at `time`, s; another moment
            where the stretch ends before or begins after it.
        along, beside: where the aircraft's centre is then as seen from the pylon, in directions of the velocity over
            ground and to its right, m.
    """

    pylon: PylonPost
    leg: int
    distance: float
    time: float
    abeam: float
    along: float
    beside: float

    @property
    def shortfall(self) -> float:
        """The length by which the required distance is missed, m; negative where it is met."""
        return self.pylon.required - self.distance


def pylons_of(course: Course) -> tuple[PylonPost, ...]:
    """Return all pylons of a course, in the order of the first passings of their elements, and those of obstacles."""
    found: dict[Place, PylonPost] = {}
    for element in {passage.element.name: passage.element for passage in course.passages}.values():
        drawing, required = element.drawing(), LEAST_CLEARANCE
        if isinstance(element, ElementWithTolerances) and element.passing is Passing.WINDOW:
            required = max(required, element.tolerances.clearance)
        for number, post in enumerate(drawing.posts):
            pylon = PylonPost(element.name, post.north, post.east, drawing.post_height, required, number)
            before = found.get(place_of(post))
            if before is None:
                found[place_of(post)] = pylon
            elif before.required < required:
                found[place_of(post)] = replace(before, required=required)
    obstacles = [
        PylonPost(
            obstacle.name,
            at.north,
            at.east,
            obstacle.height,
            obstacle.clearance + obstacle.radius,
            number,
            obstacle.radius,
            True,
        )
        for obstacle in course.obstacles
        for number, at in enumerate(obstacle.places)
    ]
    return (*found.values(), *obstacles)


def cleared_pylons(course: Course) -> tuple[PylonPost, ...]:
    """Return the pylons from which the wing has to be clear at any time: all by the rule `flight`, else obstacles'."""
    always = course.rules.clearance is ClearanceRule.FLIGHT
    return tuple(pylon for pylon in pylons_of(course) if always or pylon.is_obstacle)


def wing_position(values: Mapping[str, Array], semispan: float) -> tuple[Array, Array]:
    """Return centre and half of a wing, see `Wing`; each of shape (3, ...).

    Args:
        values: by name `x`, `y`, `z` (m), `q0` to `q3` and, where there is a body, `beta_K` (rad); each of shape (...).
        semispan: from the aircraft's centre to a wing tip, m.
    """
    centre = np.stack([values["x"], values["y"], -values["z"]])
    beta_K = values.get("beta_K", np.zeros_like(centre[0]))
    north, east, down = right_wing(rotation([values[f"q{i}"] for i in range(4)]), np.sin(beta_K), np.cos(beta_K))
    return centre, semispan * np.stack([north, east, -down])


def wing_distance(pylon: PylonPost, centre: Array, half: Array) -> Array:
    """Return the distance of a wing from a pylon, m, shape (...).

    Args:
        pylon: from which it is measured.
        centre, half: see `Wing`; shape (3, ...).
    """
    return nearest_points(pylon, centre, half)[0]


def nearest_points(pylon: PylonPost, centre: Array, half: Array) -> tuple[Array, Array]:
    """Return the distance of a wing from a pylon, m, and which point it is of: from -1, the left tip, to 1.

    Args:
        pylon, centre, half: see `wing_distance`.

    Returns:
        Two arrays of shape (...).
    """
    d = centre - np.array([pylon.north, pylon.east, pylon.height]).reshape(3, *(1,) * (centre.ndim - 1))
    level, whole = (np.sum(half[:rows] ** 2, axis=0) for rows in (2, 3))
    vertices = (
        -np.sum(d[:2] * half[:2], axis=0) / np.where(level > NO_EXTENT**2, level, 1.0),
        -np.sum(d * half, axis=0) / np.where(whole > NO_EXTENT**2, whole, 1.0),
        -d[2] / np.where(np.abs(half[2]) > NO_EXTENT, half[2], np.inf),
    )
    least, nearest = np.full(level.shape, np.inf), np.zeros(level.shape)
    for vertex in vertices:
        share = np.clip(vertex, -1.0, 1.0)
        foot = d + share * half
        squared = foot[0] ** 2 + foot[1] ** 2 + np.maximum(foot[2], 0.0) ** 2
        nearest = np.where(squared < least, share, nearest)
        least = np.minimum(least, squared)
    return np.sqrt(least), nearest


def closest_in_steps(wing: Wing, pylon: PylonPost) -> tuple[Array, Array]:
    """Return the least distance from a pylon within every step, m, and when, s; each of shape (n - 1,).

    Far away it is that at the nearer end of the step, which is larger than the least, but not near either.
    """
    away = wing_distance(pylon, wing.centre, wing.half)
    later = away[1:] < away[:-1]
    distance, time = np.where(later, away[1:], away[:-1]), np.where(later, wing.time[1:], wing.time[:-1])
    moved = np.linalg.norm(np.diff(wing.centre, axis=1), axis=0)
    near = np.flatnonzero(distance < pylon.required + NEAR + 2.0 * moved)
    if len(near):
        shares = np.broadcast_to(np.linspace(0.0, 1.0, PARTS + 1), (len(near), PARTS + 1))
        for part in (0.5 / PARTS, 0.0):
            values = wing_distance(pylon, *_between(wing, near, shares))
            best = np.argmin(values, axis=1)[:, None]
            share = np.take_along_axis(shares, best, axis=1)
            if part:
                shares = np.clip(share + 2.0 * part * np.linspace(-1.0, 1.0, PARTS + 1), 0.0, 1.0)
        distance[near] = np.take_along_axis(values, best, axis=1)[:, 0]
        time[near] = wing.time[near] + share[:, 0] * np.diff(wing.time)[near]
    return distance, time


def closest_approaches(wing: Wing, pylons: Sequence[PylonPost], legs: Sequence[int]) -> Iterator[ClosestApproach]:
    """Yield the least distances from every pylon on every leg: of each passing nearby, else the least of the leg.

    Args:
        wing: its way.
        pylons: of the course.
        legs: numbers of the times at which legs begin and, last, the race ends.
    """
    for pylon in pylons:
        distance, time = closest_in_steps(wing, pylon)
        near = pylon.required + NEAR
        of_legs = [begin + _passings(distance[begin:end], near) for begin, end in pairwise(legs)]
        steps = np.concatenate(of_legs)
        (velocity, centre), (turning, half) = _motion(wing, time[steps])
        along, beside, _ = _seen_from(pylon, velocity, centre)
        _, nearest = nearest_points(pylon, centre, half)
        ahead, _, speed = _seen_from(pylon, velocity + nearest * turning, centre + nearest * half)
        abeam = time[steps] - np.clip(ahead / speed, -ABEAM_MAX, ABEAM_MAX)
        leg = np.repeat(np.arange(len(of_legs)), [len(of_leg) for of_leg in of_legs])
        columns = (leg, distance[steps], time[steps], abeam, along, beside)
        for numbers in zip(*(column.tolist() for column in columns), strict=True):
            yield ClosestApproach(pylon, *numbers)


def _passings(distance: Array, near: float) -> NDArray[np.intp]:
    """Return where a distance is smaller than around, as far as it is less than `near`; else where it is smallest."""
    falls, rises = np.diff(distance, prepend=np.inf) <= 0.0, np.diff(distance, append=np.inf) > 0.0
    dips = np.flatnonzero(falls & rises & (distance < near))
    return dips if len(dips) else np.array([np.argmin(distance)])


def _motion(wing: Wing, times: Array) -> list[tuple[Array, Array]]:
    """Return velocity and place of centre and half at times (m,), s: m/s and m, each of shape (3, m)."""
    steps = np.clip(np.searchsorted(wing.time, times, side="right") - 1, 0, len(wing.time) - 2)
    h = wing.time[steps + 1] - wing.time[steps]
    places = _between(wing, steps, ((times - wing.time[steps]) / h)[:, None])
    return [
        ((way[:, steps + 1] - way[:, steps]) / h, place[:, :, 0])
        for way, place in zip((wing.centre, wing.half), places, strict=True)
    ]


def _seen_from(pylon: PylonPost, velocity: Array, place: Array) -> tuple[Array, Array, Array]:
    """Return where points are as seen from a pylon, along and to the right of their velocity, m, and their speed, m/s.

    Args:
        velocity, place: of the points, shape (3, m).
    """
    speed = np.maximum(np.hypot(*velocity[:2]), 1e-9)
    d = place[:2] - np.array([[pylon.north], [pylon.east]])
    return np.sum(velocity[:2] * d, axis=0) / speed, (velocity[0] * d[1] - velocity[1] * d[0]) / speed, speed


def _between(wing: Wing, steps: np.ndarray, shares: Array) -> tuple[Array, Array]:
    """Return centre and half of a wing within some steps (m,), at shares (m, k) of them; each of shape (3, m, k)."""
    h, s = (wing.time[steps + 1] - wing.time[steps])[:, None], shares
    found: list[Array] = []
    for way, slope in zip((wing.centre, wing.half), wing.slopes, strict=True):
        first, last = way[:, steps, None], way[:, steps + 1, None]
        found.append(
            (1.0 + 2.0 * s) * (1.0 - s) ** 2 * first
            + s**2 * (3.0 - 2.0 * s) * last
            + h * s * (1.0 - s) ** 2 * slope[:, steps, None]
            - h * s**2 * (1.0 - s) * slope[:, steps + 1, None]
        )
    return found[0], found[1]


def crowd_overflown(way: Array, crowd: Crowd) -> bool:
    """Return whether a way (samples, 2) leads over a line or an area of people."""
    closed = crowd.shape is CrowdShape.AREA
    if closed and inside(way, crowd.corners).any():
        return True
    for a, b in edges(crowd.corners, closed=closed):
        along, across = beside(way, a, b)
        changes = across[:-1] * across[1:] < 0.0
        share = across[:-1] / np.where(changes, across[:-1] - across[1:], 1.0)
        met = along[:-1] + share * np.diff(along)
        if (changes & (met >= 0.0) & (met <= np.hypot(b.north - a.north, b.east - a.east))).any():
            return True
    return False


def beside_line(way: Array, line: SafetyLine) -> Array:
    """Return how far each sample of a way (samples, 2) is on the allowed side of a safety line, m, shape (samples,)."""
    _, across = beside(way, line.start, line.end)
    return across if line.keep_right else -across


def beside_border(way: Array, corners: Sequence[Point]) -> Array:
    """Return how far every sample of a way (samples, 2) lies inside a convex area, m, shape (samples,)."""
    sense = np.copysign(1.0, area(corners))
    return np.minimum.reduce([sense * beside(way, a, b)[1] for a, b in edges(corners, closed=True)])


def ground_distance(ways: Array, crowd: Crowd) -> Array:
    """Return the distance over ground of every place (..., 2) from a crowd, shape (...), m; zero within an area."""
    return distance(ways, crowd.corners, closed=crowd.shape is CrowdShape.AREA)
