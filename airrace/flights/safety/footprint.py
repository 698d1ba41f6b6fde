"""The footprint of flights: the ground that is met where an aircraft fails, instant by instant, and the people there.

At every instant the aircraft may begin to fall. The impact lies between the fall in vacuum and that with the drag area,
as wide as the aircraft to either side, and from instant to instant this stretch sweeps over the ground. With its power
lost it glides instead: straight on, or anywhere within the hull of what its best glide reaches behind a turn.

This is mechanics, not the formula of an authority, and no prediction either: an aircraft that breaks up, spins, or is
under control falls elsewhere, wreckage slides on, and light pieces drift with the wind.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from airrace.errors import UsageError
from airrace.flights.results.flight import Flight
from airrace.flights.safety.falls_and_glides import (
    AirColumn,
    Glide,
    Impacts,
    Reach,
    States,
    best_glide,
    fall_in_vacuum,
    fall_with_drag,
    level_fall_distance,
    reach,
)
from airrace.flights.safety.outlines import Outline, Raster
from airrace.model.environment import g0
from airrace.model.track.course import Crowd, CrowdShape
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.clearance import beside_border, beside_line, ground_distance
from airrace.race import Race

NOT_AN_AUTHORITYS = (
    "Free fall and best glide as mechanics has them: not the scatter formula of any authority, and no prediction. "
    "Break-up, spin, sliding wreckage, drifting pieces and the pilot's decisions are not in it."
)
NEEDED = ("x", "y", "height", "V_K", "chi", "gamma")
"""The histories of a flight that a footprint needs."""


RATE = 50.0
"""The instants of a flight, 1/s: 2 m apart at 100 m/s."""
GLIDE_EVERY = 5
"""Of how many instants one is looked at without power: its reach changes slowly."""
STRETCH_POINTS = 17
"""The points of the stretch between both falls of which distances are measured; it is some 50 m long."""
CELLS = 800
"""The cells of the raster of the outline along its longer edge: some 2 m each."""
STEP = 10.0
"""The distance of points on the outlines of crowds and on the way of a glide, m."""


@dataclass(frozen=True, eq=False)
class Track:
    """The instants of one flight.

    Attributes:
        label: what people call it.
        time: s, rising, shape (n,).
        states: at these times.
        legs: the numbers of the passages in which the legs end, likewise; None where they are not known.
    """

    label: str
    time: Array
    states: States
    legs: NDArray[np.int64] | None = None

    @classmethod
    def from_flight(cls, flight: Flight, rate: float = RATE) -> "Track":
        """Return the instants of a flight at a rate (1/s); those at which it knows no height are left out.

        Raises:
            UsageError: it knows neither place nor velocity.
        """
        missing = [name for name in NEEDED if name not in flight]
        if missing:
            raise UsageError(f"{flight.label} has no footprint: it does not know {', '.join(missing)}")
        time = flight.times_at_rate(rate)
        states = States.from_flight(flight, time)
        finite = np.isfinite(states.place).all(axis=1) & np.isfinite(states.velocity).all(axis=1)
        if not finite.any():
            raise UsageError(f"{flight.label} has no footprint: its height or its velocity is known nowhere")
        passings = [crossing.time for crossing in flight.crossings]
        known = len(passings) > 1 and all(crossing.found for crossing in flight.crossings)
        legs = np.searchsorted(passings[1:-1], time[finite], side="right") + 1 if known else None
        return cls(flight.label, time[finite], States(states.place[finite], states.velocity[finite]), legs)


@dataclass(frozen=True)
class CrowdExposure:
    """How near impacts come to one group of people.

    Attributes:
        crowd: the people.
        distance: least distance over ground of an impact from them, half the span taken off, m; zero where one hits.
        label, time: the flight, and when the aircraft begins to fall there, s.
        seconds: for how long falls that begin meanwhile hit them, s, over all flights.
        overlap: the share of the footprint on their area, m2; zero for points and lines.
        straight_seconds: for how long a glide straight on would lead over them, s.
        turned_seconds: for how long they lie within reach of a glide behind a turn, s.
    """

    crowd: Crowd
    distance: float
    label: str
    time: float
    seconds: float
    overlap: float
    straight_seconds: float
    turned_seconds: float

    @property
    def measures(self) -> tuple[str | float, ...]:
        """All of it but the people, in its order."""
        return (
            *(self.distance, self.label, self.time, self.seconds, self.overlap),
            *(self.straight_seconds, self.turned_seconds),
        )


@dataclass(frozen=True)
class BorderExposure:
    """How near impacts come to a safety line or the border of the airspace, or how far beyond.

    Attributes:
        name: of the line or the border, in words.
        distance: of the impact that is least on the allowed side, half the span taken off, m; negative beyond.
        label, time: the flight, and when the aircraft begins to fall there, s.
        seconds: for how long falls that begin meanwhile end beyond, s, over all flights.
    """

    name: str
    distance: float
    label: str
    time: float
    seconds: float


@dataclass(frozen=True)
class Footprint:
    """The impact footprint of some flights.

    Attributes:
        race: course, aircraft and air.
        tracks: the flights.
        drag_area: C_D A of the fall with drag, m2, and `drag_source`, where it comes from.
        glide: the best one; `glide_source` likewise.
        vacuum, drag: the falls from every instant, flight after flight.
        reach: without power, from every `GLIDE_EVERY`th instant of every flight.
    """

    race: Race
    tracks: tuple[Track, ...]
    drag_area: float
    drag_source: str
    glide: Glide
    glide_source: str
    vacuum: Impacts
    drag: Impacts
    reach: Reach

    @property
    def half_span(self) -> float:
        """The width of the footprint to either side of an impact, m."""
        return 0.5 * self.race.aircraft.airframe.b

    @cached_property
    def time(self) -> Array:
        """The times of all instants, s, shape (n,)."""
        return np.concatenate([track.time for track in self.tracks])

    @cached_property
    def states(self) -> States:
        """The states of all instants."""
        return _join(self.tracks)

    @property
    def labels(self) -> list[str]:
        """The flights that the instants belong to, by label."""
        return [track.label for track in self.tracks for _ in track.time]

    @cached_property
    def glide_rows(self) -> np.ndarray:
        """The instants of `reach` among all of them."""
        rows = np.arange(len(self.time))
        return np.concatenate([rows[row][::GLIDE_EVERY] for row in self._rows()])

    @cached_property
    def lengths(self) -> dict[str, Array]:
        """The ways over ground from the aircraft to the impact, m, shape (n,): `vacuum`, `drag`, and of the check with
        the speed and the height of the moment as if flight were level, `level`.
        """
        place = self.states.place[:, :2]
        falls = {"vacuum": self.vacuum, "drag": self.drag}
        ways = {name: np.linalg.norm(impacts.place - place, axis=1) for name, impacts in falls.items()}
        return {**ways, "level": level_fall_distance(self.states.speed, self.states.place[:, 2])}

    @cached_property
    def raster(self) -> Raster:
        """The ground that falls meet."""
        swept = ((self.vacuum.place[rows], self.drag.place[rows]) for rows in self._rows())
        return Raster.from_stretches(swept, self.half_span, CELLS)

    @cached_property
    def falls(self) -> tuple[Outline, ...]:
        """The outline of the ground that falls meet."""
        return self.raster.outlines()

    @cached_property
    def glides(self) -> Outline:
        """The hull of the ground within reach without power."""
        points = self.reach.turned.reshape(-1, 2)
        hull = ConvexHull(points)
        return Outline(points[hull.vertices[::-1]])  # of north and east counterclockwise is clockwise from above

    @cached_property
    def crowds(self) -> tuple[CrowdExposure, ...]:
        """How near impacts come to people, in the order of the course."""
        return tuple(self._exposure(crowd) for crowd in self.race.course.crowd)

    @cached_property
    def borders(self) -> tuple[BorderExposure, ...]:
        """How near impacts come to safety lines, on the legs on which they count, and to the border."""
        course, unknown = self.race.course, -1
        legs = np.concatenate(
            [np.full(len(track.time), unknown) if track.legs is None else track.legs for track in self.tracks]
        )
        exposures: list[BorderExposure] = []
        for line in course.safety_lines:
            counts = (legs == unknown) | np.isin(legs, course.passages_with_line(line))
            beside = np.minimum(beside_line(self.vacuum.place, line), beside_line(self.drag.place, line))
            if counts.any():
                exposures.append(self._border_exposure(f"safety line {line.name}", np.where(counts, beside, np.inf)))
        if course.airspace:
            inside = (beside_border(impacts.place, course.airspace) for impacts in (self.vacuum, self.drag))
            exposures.append(self._border_exposure("airspace", np.minimum(*inside)))
        return tuple(exposures)

    def _border_exposure(self, name: str, beside: Array) -> BorderExposure:
        distances, steps = beside - self.half_span, np.concatenate([_spans(track.time) for track in self.tracks])
        row = int(np.argmin(distances))
        seconds = float(steps[distances < 0.0].sum())
        return BorderExposure(name, float(distances[row]), self.labels[row], float(self.time[row]), seconds)

    def distances(self, crowd: Crowd) -> Array:
        """Return the least distance of every impact from people, half the span taken off, m, shape (n,)."""
        distances = np.full(len(self.time), np.inf)
        for share in np.linspace(0.0, 1.0, STRETCH_POINTS).tolist():
            points = self.vacuum.place + share * (self.drag.place - self.vacuum.place)
            distances = np.minimum(distances, ground_distance(points, crowd))
        return np.maximum(distances - self.half_span, 0.0)

    def _exposure(self, crowd: Crowd) -> CrowdExposure:
        distances = self.distances(crowd)
        row = int(np.argmin(distances))
        overlap = 0.0
        if crowd.shape is CrowdShape.AREA and distances[row] == 0.0:
            covered = self.raster.centres[self.raster.inside > 0.0]
            overlap = float((ground_distance(covered, crowd) == 0.0).sum()) * self.raster.cell**2
        straight, turned = self._glides_to(crowd)
        steps = np.concatenate([_spans(track.time) for track in self.tracks])
        glide_steps = np.concatenate([_spans(track.time[::GLIDE_EVERY]) for track in self.tracks])
        seconds = steps[distances == 0.0], glide_steps[straight], glide_steps[turned]
        label, (hit, led, reached) = self.labels[row], (float(span.sum()) for span in seconds)
        return CrowdExposure(crowd, float(distances[row]), label, float(self.time[row]), hit, overlap, led, reached)

    def _glides_to(self, crowd: Crowd) -> tuple[np.ndarray, np.ndarray]:
        """Return from which instants a glide straight on leads over people, and from which they are within reach."""
        begin = self.states.place[self.glide_rows, :2]
        end, ring = self.reach.straight, self.reach.turned
        outline = _outline(crowd)
        straight = np.full(len(begin), np.inf)
        for share in np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(end - begin, axis=1).max() / STEP)).tolist():
            straight = np.minimum(straight, ground_distance(begin + share * (end - begin), crowd))
        turned = _within(outline, ring).any(axis=1) | (ground_distance(ring, crowd) == 0.0).any(axis=1)
        return straight <= max(self.half_span, 0.5 * STEP), turned

    def _rows(self) -> list[slice]:
        """Return the rows of every flight."""
        ends = np.cumsum([0, *(len(track.time) for track in self.tracks)]).tolist()
        return [slice(begin, end) for begin, end in pairwise(ends)]

    def as_object(self) -> dict[str, object]:
        """Return it for JSON, in SI units."""
        lengths = {f"{name}_farthest_m": float(length.max()) for name, length in self.lengths.items()}
        keys = ("distance_m", "flight", "time_s", "hit_s", "overlap_m2", "glide_straight_s", "glide_turned_s")
        return {
            "flights": [track.label for track in self.tracks],
            "aircraft": self.race.aircraft.name,
            "drag_area_m2": self.drag_area,
            "drag_area_source": self.drag_source,
            "glide_ratio": self.glide.ratio,
            "glide_ratio_source": self.glide_source,
            "glide_speed_m_s": self.glide.speed,
            "falls": {**lengths, "time_longest_s": float(self.vacuum.time.max())},
            "glide_straight_m": [float(self.reach.distance.min()), float(self.reach.distance.max())],
            "crowds": [
                {
                    "name": crowd.crowd.name,
                    "rule_m": crowd.crowd.distance,
                    **dict(zip(keys, crowd.measures, strict=True)),
                }
                for crowd in self.crowds
            ],
            "borders": [
                {
                    "name": border.name,
                    "distance_m": border.distance,
                    "flight": border.label,
                    "time_s": border.time,
                    "beyond_s": border.seconds,
                }
                for border in self.borders
            ],
            "outlines": {"falls": _rings(self.falls), "glides": _rings([self.glides])},
            "remark": NOT_AN_AUTHORITYS,
        }


def footprint_of(
    race: Race,
    tracks: Sequence[Track],
    *,
    drag_area: float | None = None,
    glide_ratio: float | None = None,
) -> Footprint:
    """Return the impact footprint of flights of one race.

    Args:
        race: course, aircraft and air; the ground is flat, at the height of the course's origin.
        tracks: their instants, at least one.
        drag_area: C_D A of a falling aircraft, m2; None for `C_D0 S`, the least that its airframe has.
        glide_ratio: that of the handbook; None for that of the polar.

    Raises:
        UsageError: a drag area or a glide ratio that no aircraft has.
    """
    # A judgement: above these bounds lie a parachute and every glider.
    for name, value, most, unit in (("drag area", drag_area, 1000.0, " m2"), ("glide ratio", glide_ratio, 70.0, "")):
        if value is not None and not 0.0 < value <= most:
            raise UsageError(f"a {name} of {value:g}{unit} is out of range: it must lie above 0 and not above {most:g}")
    aircraft = race.aircraft
    states = _join(tracks)
    top = float((states.place[:, 2] + np.maximum(states.velocity[:, 2], 0.0) ** 2 / (2.0 * g0)).max())
    air = AirColumn.from_air(race.air, top)
    area = aircraft.drag.C_D0 * aircraft.airframe.S if drag_area is None else drag_area
    glide = best_glide(aircraft, float(np.interp(0.0, air.height, air.density)), glide_ratio)
    return Footprint(
        race,
        tuple(tracks),
        drag_area=area,
        drag_source="C_D0 times wing area, the least drag of the airframe" if drag_area is None else "given",
        glide=glide,
        glide_source="the aircraft's polar, without the drag of the propeller" if glide_ratio is None else "given",
        vacuum=fall_in_vacuum(states),
        drag=fall_with_drag(states, air, mass=aircraft.airframe.m, drag_area=area),
        reach=reach(_join(tracks, GLIDE_EVERY), air, glide),
    )


def _join(tracks: Sequence[Track], every: int = 1) -> States:
    """Return the states of all flights one behind the other, every so many of each."""
    places, velocities = zip(
        *((track.states.place[::every], track.states.velocity[::every]) for track in tracks), strict=True
    )
    return States(np.concatenate(places), np.concatenate(velocities))


def _spans(time: Array) -> Array:
    """Return the time that every sample stands for: half of the steps on both sides, s."""
    middles = 0.5 * (time[:-1] + time[1:])
    return np.diff(np.concatenate([time[:1], middles, time[-1:]]))


def _outline(crowd: Crowd) -> Array:
    """Return points of the outline of where people stand, m, shape (n, 2)."""
    corners = [(corner.north, corner.east) for corner in crowd.corners]
    corners = [*corners, corners[0]] if crowd.shape is CrowdShape.AREA else corners
    points = [np.array(corners[:1])]
    for a, b in pairwise(corners):
        points.append(np.linspace(a, b, 2 + int(math.dist(a, b) / STEP)))
    return np.concatenate(points)


def _within(points: Array, rings: Array) -> np.ndarray:
    """Return whether points (k, 2) lie within rings (n, m, 2), shape (n, k).

    A ray from inside to the north crosses the ring an odd number of times.
    """
    inside = np.zeros((len(rings), len(points)), bool)
    north, east = points[:, 0], points[:, 1]
    for corner in range(rings.shape[1]):
        a, b = rings[:, corner - 1, None], rings[:, corner, None]
        wide = np.where(a[..., 1] == b[..., 1], 1.0, b[..., 1] - a[..., 1])
        level = a[..., 0] + (east - a[..., 1]) / wide * (b[..., 0] - a[..., 0])
        inside ^= ((a[..., 1] > east) != (b[..., 1] > east)) & (level > north)
    return inside


def _rings(outlines: Sequence[Outline]) -> list[dict[str, object]]:
    rings: list[dict[str, object]] = []
    for outline in outlines:
        holes = [np.round(hole, 2).tolist() for hole in outline.holes]
        rings.append({"border": np.round(outline.border, 2).tolist(), "holes": holes})
    return rings
