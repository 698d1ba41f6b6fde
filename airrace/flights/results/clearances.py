"""Clearances of a flight from pylons, obstacles, crowds, lines and borders, and near misses of pylons and obstacles.

The distance from a pylon is that of the wing, from tip to tip, from a vertical line up to the pylon's height; that from
an obstacle is measured from the cylinders around it. Wing and required distance are those of the certificate of an
optimum (`airrace.procedure.planning.clearance`). All other distances are those of the aircraft's centre, as the
rules measure it. Where a flight knows no height, the slant distance from people is that over ground, and pylons and
obstacles are left out.

The rules measure the distance of the wing tips from the pylons of a gate at the instant of its passing, along the line
between the pylons. The wing of an aircraft that crosses this line askew reaches it some hundredths of a second before
or after, and may be closer to a pylon then. Nothing at all keeps the wing away from the pylons of other gates.

As histories they have names and are distances at every instant, in metres: `distance_pylon_g1` and
`distance_obstacle_mast` are those of the wing; `distance_crowd_stands`, `distance_safety_line_shore`,
`distance_airspace`, `distance_floor` and `distance_ceiling` are those of the aircraft's centre, negative beyond a line
or a border. They follow from position and attitude, and no file stores them.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airrace.flights.results.derivation import Values, complete_histories
from airrace.flights.results.flight import (
    Basis,
    Flight,
    Histories,
    History,
    Leg,
    Source,
    TimedCrossing,
    legs_of,
    passings_around,
)
from airrace.model.frames import QUATERNION
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.clearance import (
    PylonPost,
    Wing,
    beside_border,
    beside_line,
    closest_in_steps,
    ground_distance,
    pylons_of,
    wing_distance,
    wing_position,
)
from airrace.procedure.planning.route_decisions import PLANNED_MAX
from airrace.race import Race

NEAR_MISS = 0.1
"""The length by which a clearance is missed before it is reported, m: less cannot be seen from beside the course."""
BESIDE = 0.25
"""The time before and after a passing within which a near miss belongs to it, s."""


@dataclass(frozen=True)
class Clearance:
    """The least distance from one thing on one leg.

    Attributes:
        kind: `pylon`, `obstacle`, `crowd`, `safety line`, `airspace`, `floor` or `ceiling`.
        name: of the thing; empty where there is but one of its kind.
        distance: m; negative beyond a line or a border.
        required: the least distance that the rules ask for, m.
        time: when, s after the start.
        north, east, height: where the aircraft is then, m.
    """

    kind: str
    name: str
    distance: float
    required: float
    time: float
    north: float
    east: float
    height: float

    @property
    def margin(self) -> float:
        """The distance that is left beyond the required one, m; negative where it is violated."""
        return self.distance - self.required

    @property
    def text(self) -> str:
        """The thing from which the distance is measured, e.g. `pylon g3`."""
        return f"{self.kind} {self.name}".rstrip()


@dataclass(frozen=True, eq=False)
class Distance:
    """The distance from one thing all along a flight, m, shape (n,); NaN where it is not known.

    `legs` are the numbers of the legs on which it has to hold; None for all.
    """

    kind: str
    name: str
    required: float
    values: Array
    legs: frozenset[int] | None = None


def distances(flight: Flight) -> tuple[Distance, ...]:
    """Return the distances from everything that the course names; empty where its position is not known."""
    return (*pylons(flight), *surroundings(flight)) if flight.has("x", "y", "height") else ()


def surroundings(flight: Flight) -> Iterator[Distance]:
    """Yield the distances from people, safety lines, the border of the airspace, floor and ceiling.

    A safety line counts on the legs that name it; one that none names, on all.

    Args:
        flight: one whose position is known.
    """
    course, height = flight.course, flight["height"]
    places = np.stack([flight["x"], flight["y"]], axis=1)
    for crowd in course.crowd:
        distance = ground_distance(places, crowd)
        if crowd.slant:
            above = height - crowd.height
            distance = np.hypot(distance, np.where(np.isnan(above), 0.0, above))
        yield Distance("crowd", crowd.name, crowd.distance, distance)
    for line in course.safety_lines:
        legs = frozenset(course.passages_with_line(line)) - {0}  # no leg leads to the start
        if legs:
            yield Distance("safety line", line.name, line.margin, beside_line(places, line), legs)
    if course.airspace:
        yield Distance("airspace", "", 0.0, beside_border(places, course.airspace))
    floor, ceiling = course.rules.height.lower, course.rules.height.upper
    if np.isfinite(floor):
        yield Distance("floor", "", 0.0, height - floor)
    if np.isfinite(ceiling):
        yield Distance("ceiling", "", 0.0, ceiling - height)


def least(flight: Flight, leg: Leg, measured: Sequence[Distance]) -> tuple[Clearance, ...]:
    """Return the least distance from every thing that counts on a leg, that with the least margin first.

    Args:
        flight: whose leg it is.
        leg: a complete leg.
        measured: `distances` of the flight.
    """
    clearances = [
        _least(flight, distance, leg.rows)
        for distance in measured
        if distance.legs is None or leg.number in distance.legs
    ]
    return tuple(
        sorted((clearance for clearance in clearances if clearance is not None), key=lambda clearance: clearance.margin)
    )


def least_of_all(flight: Flight, measured: Iterable[Distance]) -> tuple[Clearance, ...]:
    """Return the least distance from every thing on all complete legs together, in the order of `measured`.

    Args:
        flight: a flight.
        measured: distances of the flight, e.g. `distances`.
    """
    clearances: list[Clearance] = []
    for distance in measured:
        rows = [np.zeros(0, np.int64)]
        rows += [leg.rows for leg in legs_of(flight) if distance.legs is None or leg.number in distance.legs]
        if (clearance := _least(flight, distance, np.concatenate(rows))) is not None:
            clearances.append(clearance)
    return tuple(clearances)


def least_distances(flight: Flight) -> tuple[Clearance, ...]:
    """Return the least distance of a flight from every thing on its course, that with the least margin first."""
    return tuple(sorted(least_of_all(flight, distances(flight)), key=lambda clearance: clearance.margin))


def nearest_pylon(clearances: Sequence[Clearance]) -> tuple[Clearance, ...]:
    """Return least distances, of those from pylons that with the least margin alone, which comes first."""
    of_pylons = [clearance for clearance in clearances if clearance.kind == "pylon"]
    without_pylons = [clearance for clearance in clearances if clearance.kind != "pylon"]
    return (*sorted(of_pylons, key=lambda pylon: pylon.margin)[:1], *without_pylons)


def at_row(flight: Flight, distance: Distance, row: int) -> Clearance:
    """Return the distance at one time of a flight."""
    north, east, height = (float(flight[name][row]) for name in ("x", "y", "height"))
    away, time = float(distance.values[row]), float(flight.time[row])
    return Clearance(distance.kind, distance.name, away, distance.required, time, north, east, height)


def _least(flight: Flight, distance: Distance, rows: NDArray[np.int64]) -> Clearance | None:
    """Return the least distance at some times; None where none of them is known."""
    finite = rows[np.isfinite(distance.values[rows])]
    return at_row(flight, distance, int(finite[int(np.argmin(distance.values[finite]))])) if len(finite) else None


def pylons(flight: Flight, measure: Callable[[Wing, PylonPost], Array] | None = None) -> Iterator[Distance]:
    """Yield the distance of the wing from the pylons of every element, in the order of first passings, and from every
    obstacle; none where the flight knows its height nowhere.

    Args:
        flight: one whose position is known.
        measure: returns the distance of a wing's axis from a pylon, m, shape (n,); by default the least from half a
            step before a time to half a step after it.
    """
    standing, measure = pylons_of(flight.course), measure or _least_about
    if not standing or not np.isfinite(flight["height"]).any():
        return
    wing = _wing(flight)
    for name in dict.fromkeys(passage.element.name for passage in flight.course.passages):
        own = [pylon for pylon in standing if pylon.name == name]
        # Usually one: a pylon in the place of another element's may have to be cleared by more than its neighbour.
        for required in sorted({pylon.required for pylon in own}):
            pylon_distances = [measure(wing, pylon) for pylon in own if pylon.required == required]
            yield Distance("pylon", name, required, np.minimum.reduce(pylon_distances))
    for obstacle in flight.course.obstacles:
        axes = [measure(wing, pylon) for pylon in standing if pylon.name == obstacle.name]
        yield Distance("obstacle", obstacle.name, obstacle.clearance, np.minimum.reduce(axes) - obstacle.radius)


def _wing(flight: Flight) -> Wing:
    """Return the way of the wing; without an attitude that of the centre."""
    values = {"x": flight["x"], "y": flight["y"], "z": -flight["height"]}
    if not flight.has(*QUATERNION):
        centre = np.stack([values["x"], values["y"], -values["z"]])
        return Wing(flight.time, centre, np.zeros_like(centre))
    values |= {name: flight[name] for name in (*QUATERNION, "beta_K") if name in flight}
    return Wing(flight.time, *wing_position(values, 0.5 * flight.aircraft.airframe.b))


def _least_about(wing: Wing, pylon: PylonPost) -> Array:
    """Return the least distance from a pylon from half a step before to half a step after every time, m, shape (n,)."""
    least = wing_distance(pylon, wing.centre, wing.half)
    if len(least) < 2:
        return least
    distance, time = closest_in_steps(wing, pylon)
    early = time - wing.time[:-1] <= wing.time[1:] - time
    finite = np.isfinite(least)
    least[:-1] = np.where(finite[:-1] & early, np.fmin(least[:-1], distance), least[:-1])
    least[1:] = np.where(finite[1:] & ~early, np.fmin(least[1:], distance), least[1:])
    return least


@dataclass(frozen=True)
class NearMiss:
    """One pylon or obstacle passed closely.

    Attributes:
        clearance: of the wing from the pylon, and what its passing asks for.
        passing: the passing within `BESIDE` of what stands there, the other gate of a quad included; None where the
            pylon is passed on another leg.
        before, after: the passings between which it happens.
    """

    clearance: Clearance
    passing: TimedCrossing | None
    before: TimedCrossing
    after: TimedCrossing

    @property
    def where(self) -> str:
        """When it happens, in words, e.g. `0.02 s after 1:g4`."""
        if self.passing is None:
            return f"on the leg {self.before.name} -> {self.after.name}"
        apart = self.clearance.time - self.passing.time
        if abs(apart) < 0.005:
            return f"at {self.passing.name}"
        return f"{abs(apart):.2f} s {'before' if apart < 0.0 else 'after'} {self.passing.name}"


def near_misses(flight: Flight) -> tuple[NearMiss, ...]:
    """Return all near misses in the order in which they happen; none where its position is not known, or it
    misses a passing.
    """
    if not flight.has("x", "y", "height") or not all(crossing.found for crossing in flight.crossings):
        return ()
    misses = [_near_miss(flight, clearance) for distance in pylons(flight) for clearance in _closest(flight, distance)]
    return tuple(sorted(misses, key=lambda miss: miss.clearance.time))


def _closest(flight: Flight, distance: Distance) -> Iterator[Clearance]:
    """Yield the least distance of every stretch on which it is less than the passing asks for."""
    start, finish = flight.crossings[0].time, flight.crossings[-1].time
    racing = (flight.time >= start) & (flight.time <= finish)
    below = racing & (distance.values < distance.required - NEAR_MISS)  # NaN is not below
    turns = np.flatnonzero(np.diff(np.concatenate([[False], below, [False]]).astype(np.int8)))
    for first, end in turns.reshape(-1, 2).tolist():
        yield at_row(flight, distance, first + int(np.argmin(distance.values[first:end])))


def _near_miss(flight: Flight, clearance: Clearance) -> NearMiss:
    time = clearance.time
    if clearance.kind == "obstacle":
        return NearMiss(clearance, None, *passings_around(flight, time))
    (place,) = {
        crossing.passage.element.place
        for crossing in flight.crossings
        if crossing.passage.element.name == clearance.name
    }
    own = [
        crossing
        for crossing in flight.crossings
        if crossing.passage.element.place == place and abs(crossing.time - time) <= BESIDE
    ]
    passing = min(own, key=lambda crossing: abs(crossing.time - time), default=None)
    return NearMiss(clearance, passing, *passings_around(flight, time))


POSITION = ("x", "y", "height")


def with_distances(flight: Flight) -> Flight:
    """Return the flight with the histories of its distances, at its crossings as well; as it is without a position."""
    if not flight.has(*POSITION):
        return flight
    histories = distance_histories(flight)
    crossings = list(flight.crossings)
    for place, crossing in enumerate(crossings):
        if crossing.found:
            row = min(int(np.searchsorted(flight.time, crossing.time - 1e-9)), len(flight.time) - 1)
            values = {name: float(history.values[row]) for name, history in histories.items()}
            crossings[place] = replace(crossing, values={**crossing.values, **values})
    return replace(flight, histories={**flight.histories, **histories}, crossings=tuple(crossings))


def distance_histories(flight: Flight) -> Histories:
    """Return the histories of all distances of a flight whose position is known, by name.

    On a course that is too long to be planned pylons are left out.
    """
    short = len(flight.course.passages) <= PLANNED_MAX
    wing = pylons(flight, lambda wing, post: wing_distance(post, wing.centre, wing.half)) if short else ()
    histories: dict[str, History] = {}
    for distance in (*wing, *surroundings(flight)):
        plain = re.sub(r"\W+", "_", f"distance {distance.kind} {distance.name}".strip(), flags=re.ASCII)
        number, name = 2, plain
        while name in histories:
            name, number = f"{plain}_{number}", number + 1
        histories[name] = History(_quantity(name, distance), distance.values, Basis.DERIVED)
    return histories


def _quantity(name: str, distance: Distance) -> Quantity:
    text = f"distance from {distance.kind} {distance.name}".rstrip()
    lower = -np.inf if distance.legs is not None or distance.kind == "pylon" else distance.required
    return Quantity(name, "m", lower=lower, text=text)


def distance_columns(race: Race, names: Collection[str]) -> Mapping[Quantity, Callable[[Values], Array]]:
    """Return the distances that tables of a flight hold besides its states; see `derivation.table_columns`."""
    if not {"x", "y", "z"} <= set(names):
        return {}
    last: tuple[Values, Histories] = {}, {}  # of the samples requested last: all columns of them come at once

    def histories_of(samples: Values) -> Histories:
        solved = {name: History(Quantity(name, ""), values, Basis.SOLVED) for name, values in samples.items()}
        time = np.arange(len(samples["x"]), dtype=np.float64)
        return distance_histories(Flight(race, Source(""), time, complete_histories(race, solved), ()))

    def column(name: str) -> Callable[[Values], Array]:
        def values(samples: Values) -> Array:
            nonlocal last
            if last[0] is not samples:
                last = samples, histories_of(samples)
            return last[1][name].values

        return values

    nowhere = {name: np.zeros(1) for name in ("x", "y", "z")}
    return {history.quantity: column(name) for name, history in histories_of(nowhere).items()}


def with_nearest(flight: Flight, within: float) -> Flight:
    """Return the flight with the distance from the nearest thing of every kind, for pictures: `nearest_pylon`, ...

    Args:
        flight: one with distances.
        within: the distance beyond which those of the wing, which are short, are NaN, m.
    """
    nearest: dict[str, History] = {}
    for kind in ("pylon", "obstacle", "crowd", "safety_line"):
        histories = [history for name, history in flight.histories.items() if name.startswith(f"distance_{kind}_")]
        if histories:
            values = np.minimum.reduce([history.values for history in histories])
            if kind in ("pylon", "obstacle"):
                values = np.where(values <= within, values, np.nan)
            lower = max(history.quantity.lower for history in histories)
            nearest[f"nearest_{kind}"] = History(Quantity(f"nearest_{kind}", "m", lower=lower), values, Basis.DERIVED)
    return replace(flight, histories={**flight.histories, **nearest})
