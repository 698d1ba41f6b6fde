"""Closed-loop flights measured by the rules of the course: passings, pylons, and all that must not be touched.

A passing is where a flight crosses the plane of its gate, nearest in time to where its clock shows the passing. It is
measured by the conditions that the gate sets to an optimum. The wing's distance from pylons is that of
`airrace.procedure.planning.clearance`, in continuous time. An optimum lies on its limits, so what cannot be seen is
allowed beyond each of them; see `Allowances`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airrace.flights.results.penalties import NONE_KNOWN, Penalties
from airrace.flights.safety.closed_loop import ClosedLoop, Flights
from airrace.flights.safety.nominal import TABLE_STEP, NominalFlight, errors
from airrace.flights.safety.over_g import LOAD_ALLOWED, LoadRule
from airrace.flights.safety.plant import STATE, STATES
from airrace.model.dynamics.observations import CrossingParameters, crossing_observation
from airrace.model.frames import rotation
from airrace.model.track.course import Course
from airrace.model.track.gates import ElementWithTolerances, Passing
from airrace.optimal_control.problem import Boundary
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.system import Observation, at_points
from airrace.optimal_control.trajectory import Array
from airrace.procedure import formulation
from airrace.procedure.planning.clearance import (
    PylonPost,
    Wing,
    beside_border,
    beside_line,
    cleared_pylons,
    closest_in_steps,
    ground_distance,
    pylons_of,
    wing_position,
)
from airrace.procedure.planning.plan import plan_from_solution
from airrace.procedure.planning.planning_model import cruise
from airrace.procedure.planning.route_decisions import Waypoint
from airrace.procedure.result import StageResult
from airrace.race import Race

Booleans = NDArray[np.bool_]


# What is allowed beyond a limit before it counts: judgements.
LENGTH_ALLOWED = 0.1
"""What is allowed beyond a length, m: a judge beside the course sees no less, see `flights.results.clearances`."""
ANGLE_ALLOWED = 0.0087
"""What is allowed beyond the sine of an angle, half a degree: cameras judge banks to about a degree."""
SPEED_ALLOWED = 0.5
"""What is allowed beyond a speed, m/s: a knot."""
TOUCH_DISTANCE = 0.05
"""The distance at which a wing counts as touching the line that a pylon is, m; samples of the least distance are some
millimetres apart. The ground is touched at the height of the origin."""
WINDOW = 40
"""The samples before and after a passing in which the plane of the gate is looked for, 0.8 s."""
GRID = 0.1
"""The step of the clock at which deviations are recorded, s."""

KINDS = {
    "right": "missed",
    "right_wing": "clearance",
    "left_wing": "clearance",
    "beside_right": "clearance",
    "beside_left": "clearance",
    "height": "height",
    "V_K": "speed",
    "bank_excess_right": "bank",
    "bank_excess_left": "bank",
    "bank_cosine": "bank",
    "bank_sine": "bank",
    "course_excess_right": "course",
    "course_excess_left": "course",
    "climb_sine": "climb",
}
"""The kind of breach by the name of the quantity whose range is left; of others it is `tolerance`."""
LENGTHS = ("missed", "clearance", "height")


@dataclass(frozen=True)
class Thing:
    """What a flight keeps its distance from.

    Attributes:
        kind: `crowd`, `safety line`, `airspace`, `obstacle` or `ground`.
        name: of the thing; empty where there is but one of its kind.
        required: the least distance that the course asks for, m; negative distances lie beyond a line or a border.
    """

    kind: str
    name: str
    required: float

    @property
    def text(self) -> str:
        """The thing in words, e.g. `crowd stands`."""
        return f"{self.kind} {self.name}".rstrip()


def things_of(course: Course) -> tuple[Thing, ...]:
    """Return people, lines, border, obstacles and the ground, in this order.

    The distance from the ground is that of the lower wing tip; the floor is a limit of the centre, and not in it.
    """
    border = [Thing("airspace", "", 0.0)] if course.airspace else []
    return (
        *(Thing("crowd", crowd.name, crowd.distance) for crowd in course.crowd),
        *(Thing("safety line", line.name, line.margin) for line in course.safety_lines),
        *border,
        *(Thing("obstacle", obstacle.name, obstacle.clearance) for obstacle in course.obstacles),
        Thing("ground", "", 0.0),
    )


@dataclass(frozen=True, eq=False)
class Judge:
    """The rules of a course, ready to measure flights.

    Attributes:
        course: whose rules they are.
        waypoints: the passages as they were made, those of a point as those of its window.
        boundaries: the conditions of every passage.
        states: of the optimum at the passages, shape (17, n).
        loads: its load factor there, g; shape (n,).
        pylons: of the course.
        semispan: m.
        load: the load factors that are allowed.
        load_rule: the pulls that count.
        seen: what is observed of a state at a passage.
    """

    course: Course
    waypoints: tuple[Waypoint, ...]
    boundaries: tuple[Boundary, ...]
    states: Array
    loads: Array
    pylons: tuple[PylonPost, ...]
    semispan: float
    load: Interval
    load_rule: LoadRule
    seen: Observation

    @classmethod
    def from_optimum(
        cls, race: Race, result: StageResult, loop: ClosedLoop, penalties: Penalties = NONE_KNOWN
    ) -> "Judge":
        """Return the rules of a race with the penalties of its season, for flights along the optimum of a stage."""
        plant, span = loop.plant, race.aircraft.airframe.b
        waypoints: list[Waypoint] = []
        pace = cruise(race.aircraft, race.course.rules)
        for waypoint in plan_from_solution(race.course, pace, result.trajectory).waypoints:
            element, passage = waypoint.passage.element, waypoint.passage
            if isinstance(element, ElementWithTolerances) and element.passing is Passing.POINT:
                kind: Any = element  # every kind of gate is a dataclass, but not all that is tolerant need be
                passage = replace(passage, element=replace(kind, passing=Passing.WINDOW))
            waypoints.append(replace(waypoint, passage=passage))
        crossing = crossing_observation(plant.system.states)
        states = loop.nominal.at(loop.nominal.passing_times)
        inputs = np.zeros((plant.path.size1_in(1), states.shape[1]))
        row = plant.path_row("n_z")
        limit = plant.system.path[row]
        return cls(
            race.course,
            tuple(waypoints),
            tuple(formulation.boundary(waypoint, crossing, span) for waypoint in waypoints),
            states,
            plant.path_of(inputs)(states)[row],
            pylons_of(race.course),
            0.5 * span,
            Interval(limit.lower, limit.upper),
            LoadRule.from_penalties(race, penalties),
            crossing,
        )

    @property
    def things(self) -> tuple[Thing, ...]:
        """What flights keep their distance from."""
        return things_of(self.course)

    def boundary(self, waypoint: Waypoint) -> Boundary:
        """Return the conditions of a passage."""
        return formulation.boundary(waypoint, self.seen, 2.0 * self.semispan)


@dataclass(frozen=True, eq=False)
class FlightMeasurements:
    """What some flights did; n flights.

    Attributes:
        crossed: deviations from the optimum at every passage: to the right of the gate's axis (m), height (m), bank
            about the path (rad), load factor (g), time (s); NaN where a flight did not pass; shape (passages, 5, n).
        breaches: kinds of breaches by passage: name of the kind to booleans, shape (passages, n).
        touched: pylons and obstacles touched, shape (pylons, n).
        nearest: least distance of the wing from every pylon, m; likewise.
        along: other limits broken, by kind, shape (n,).
        pulls: how many pulls that count begin on the leg that ends in each passage, shape (passages, n).
        distances: least distance from every one of the judge's things, m, shape (things, n); infinite where a flight
            was never on a leg that counts.
        deviations: lateral (m), height (m), bank (rad), load factor (g) on the grid of the clock; NaN where a flight is
            lost; shape (4, m, n).
        lost: whether a flight was lost.
    """

    crossed: Array
    breaches: Mapping[str, Booleans]
    touched: Booleans
    nearest: Array
    along: Mapping[str, Booleans]
    pulls: NDArray[np.int64]
    distances: Array
    deviations: Array
    lost: Booleans


def together(parts: Sequence[FlightMeasurements]) -> FlightMeasurements:
    """Return what all flights of some batches did, in their order."""

    def join(values: Sequence[Any]) -> Any:
        return np.concatenate(values, axis=-1)

    return FlightMeasurements(
        join([part.crossed for part in parts]),
        {kind: join([part.breaches[kind] for part in parts]) for kind in parts[0].breaches},
        join([part.touched for part in parts]),
        join([part.nearest for part in parts]),
        {kind: join([part.along[kind] for part in parts]) for kind in parts[0].along},
        join([part.pulls for part in parts]),
        join([part.distances for part in parts]),
        join([part.deviations for part in parts]),
        join([part.lost for part in parts]),
    )


def measure(judge: Judge, loop: ClosedLoop, flights: Flights) -> FlightMeasurements:
    """Measure flights by the rules."""
    nominal = loop.nominal
    count = flights.clock.shape[1]
    lost = flights.lost < len(flights.clock)
    crossed = np.full((len(judge.boundaries), 5, count), np.nan)
    breaches = {
        kind: np.zeros((len(judge.boundaries), count), bool) for kind in (*dict.fromkeys(KINDS.values()), "tolerance")
    }
    for number, boundary in enumerate(judge.boundaries):
        state, load, late = _crossing(judge, nominal, flights, number)
        missed = ~np.isfinite(state).all(axis=0)
        _judge(judge, boundary, number, np.where(missed, judge.states[:, [number]], state), breaches)
        for breach in breaches.values():
            breach[number] &= ~missed
        breaches["missed"][number] |= missed
        at_passing = judge.states[:, [number]]
        e = errors(state, np.repeat(at_passing, count, axis=1))
        axis = axis_of(boundary, at_passing)
        offset = state[:2] - at_passing[:2]
        right = axis[0] * offset[1] - axis[1] * offset[0]
        crossed[number] = np.stack([right, at_passing[2] - state[2], e[4], load - judge.loads[number], late])
    racing = (flights.clock >= nominal.passing_times[0]) & (flights.clock <= nominal.passing_times[-1])
    racing &= np.arange(len(flights.clock))[:, None] < flights.lost
    centre, half = wing_of(np.transpose(flights.state, (1, 2, 0)), judge.semispan)  # (3, n, K)
    nearest = _pylons(judge, flights, racing, centre, half)
    legs = legs_at(nominal, flights.clock)
    tip = (centre[2] - np.abs(half[2])).T  # the height of the lower wing tip
    distances = _distances(judge, flights, racing, legs, nearest, tip)
    return FlightMeasurements(
        crossed=crossed,
        breaches=breaches,
        touched=nearest < TOUCH_DISTANCE,
        nearest=nearest,
        along={
            "ground": distances[-1] < 0.0,
            "flight clearance": _too_near(judge, nearest),
            **_along(judge, flights, racing, distances),
        },
        pulls=_pulls(judge, flights, racing, legs),
        distances=distances,
        deviations=_deviations(loop, flights),
        lost=lost,
    )


def axis_of(boundary: Boundary, state: Array) -> tuple[float, float]:
    """Return the direction across the plane of a passage: the gate's axis, else the course, or north on a vertical."""
    values = dict(zip(CrossingParameters.names(), boundary.values, strict=False))
    if "along" in boundary.bounds:
        return values["axis_north"], values["axis_east"]
    R = rotation([float(component) for component in state[4:8, 0]])
    level = float(np.hypot(R[0][0], R[1][0]))
    return (R[0][0] / level, R[1][0] / level) if level > 1e-9 else (1.0, 0.0)


def onto_plane(nominal: NominalFlight, boundary: Boundary, number: int, state: Array) -> tuple[Array, Array]:
    """Return what carries errors at the clock of a passage along the flow to its plane, and the time that takes.

    Where no gate stands a passage is measured at its clock.

    Args:
        nominal: the optimum.
        boundary: the conditions of the passage.
        number: of the passage.
        state: of the optimum there, shape (17, 1).

    Returns:
        The map of errors, shape (16, 16), and the time lost per error of position, s/m, shape (3,).
    """
    clock = nominal.passing_times[number : number + 1]
    before, after = (nominal.at(clock + step) for step in (-TABLE_STEP, TABLE_STEP))
    flow = (errors(after, state) - errors(before, state))[:, 0] / (2.0 * TABLE_STEP if number else TABLE_STEP)
    away = np.array(
        rotation([float(component) for component in state[4:8, 0]])
    )  # north, east, down per error of position
    axis = axis_of(boundary, state)
    across = away[0] * axis[0] + away[1] * axis[1]  # along the axis per error of position
    sooner = across / (across @ flow[:3]) if "along" in boundary.bounds else np.zeros(3)
    onto = np.eye(len(flow))
    onto[:, :3] -= np.outer(flow, sooner)
    return onto, sooner


def _crossing(judge: Judge, nominal: NominalFlight, flights: Flights, number: int) -> tuple[Array, Array, Array]:
    """Return states, load factors and lateness (s) at a passage; NaN where a flight does not cross its plane."""
    boundary, when = judge.boundaries[number], float(nominal.passing_times[number])
    samples, count = flights.clock.shape
    flight = np.arange(count, dtype=np.int64)
    near = np.argmin(np.abs(flights.clock - when), axis=0)
    rows = np.clip(near + np.arange(-WINDOW, WINDOW + 1)[:, None], 0, samples - 1)
    if number == 0:
        before, share, crosses = np.zeros(count, np.int64), np.zeros(count), np.ones(count, bool)
    else:
        if "along" in boundary.bounds:
            values = dict(zip(CrossingParameters.names(), boundary.values, strict=False))
            along = values["axis_north"] * (flights.state[rows, 0, flight] - values["centre_north"])
            along = along + values["axis_east"] * (flights.state[rows, 1, flight] - values["centre_east"])
        else:
            along = flights.clock[rows, flight] - when
        passed = (along[:-1] < 0.0) & (along[1:] >= 0.0)
        apart = np.where(passed, np.abs(np.arange(-WINDOW, WINDOW) + 0.5)[:, None], np.inf)
        place, crosses = np.argmin(apart, axis=0), passed.any(axis=0)
        a, b = along[place, flight], along[place + 1, flight]
        before, share = rows[place, flight], np.where(crosses, a / np.where(crosses, a - b, 1.0), np.nan)
    crosses &= before < flights.lost
    after = np.minimum(before + 1, samples - 1)

    def between(values: Array) -> Array:
        first, last = values[before, ..., flight].T, values[after, ..., flight].T
        return np.where(crosses, first + share * (last - first), np.nan)

    state = np.zeros((STATES, count))
    state[: flights.state.shape[1]] = between(flights.state)
    state[4:8] /= np.linalg.norm(state[4:8], axis=0)
    # A load factor that begins to change at a passage bends within a sample: a parabola through the one before, too.
    bend = np.diff(flights.load[np.stack([np.maximum(before - 1, 0), before, after]), flight], 2, axis=0)[0]
    load = between(flights.load) - 0.5 * share * (1.0 - share) * bend
    late = flights.sample * (before + share) - when
    return state, load, np.where(crosses, late, np.nan)


def _judge(judge: Judge, boundary: Boundary, number: int, state: Array, breaches: Mapping[str, Booleans]) -> None:
    """Note what a passage breaks; manoeuvres are attitudes that no flight meets exactly, and are not judged."""
    assert boundary.observation is not None  # it is the boundary of a passage
    element = judge.course.passages[number].element
    if not element.stands:
        return
    outputs = at_points(boundary.observation.values, state, np.array(boundary.values))
    values = dict(zip((quantity.name for quantity in boundary.observation.quantities), outputs, strict=True))
    values["V_K"] = state[STATE["V_K"]]
    half = 0.5 * getattr(element, "width", np.inf)
    bounds = {"right": Interval(-half, half), **boundary.bounds}
    for name, allowed in bounds.items():
        if name == "along" or name not in values:
            continue
        kind = KINDS.get(name, "tolerance")
        beyond = LENGTH_ALLOWED if kind in LENGTHS else SPEED_ALLOWED if kind == "speed" else ANGLE_ALLOWED
        breaches[kind][number] |= (values[name] > allowed.upper + beyond) | (values[name] < allowed.lower - beyond)


def wing_of(states: Array, semispan: float) -> tuple[Array, Array]:
    """Return centre and half of the wing, see `Wing`, of states (11 or more, ...); each of shape (3, ...)."""
    return wing_position(dict(zip(STATE, states, strict=False)), semispan)


def _pylons(judge: Judge, flights: Flights, racing: Booleans, centre: Array, half: Array) -> Array:
    """Return the least distances of the wing from every pylon on steps that begin in the race, shape (pylons, n).

    All flights are one long way, each with a sample more at either end so that its slopes are its own. Of a flight that
    is lost the step before is left out, too, for its slope at the end is none of a flight.
    """
    samples, count = flights.clock.shape

    def pad(way: Array) -> Array:
        first, last = 2.0 * way[:, :, :1] - way[:, :, 1:2], 2.0 * way[:, :, -1:] - way[:, :, -2:-1]
        return np.concatenate([first, way, last], axis=2).reshape(3, -1)

    wing = Wing(flights.sample * np.arange(count * (samples + 2), dtype=np.float64), pad(centre), pad(half))
    lost = np.where(flights.lost < samples, flights.lost, samples + 1)
    sound = np.asarray(np.arange(2, samples + 1)[:, None] < lost, np.bool_)
    steps = np.transpose(racing[:-1] & sound)  # (n, K - 1)
    nearest = np.full((len(judge.pylons), count), np.inf)
    for row, pylon in enumerate(judge.pylons):
        distance, _ = closest_in_steps(wing, pylon)
        own = np.append(distance, np.inf).reshape(count, samples + 2)[:, 1:samples]
        nearest[row] = np.where(steps, own, np.inf).min(axis=1, initial=np.inf) - pylon.radius
    return nearest


def _too_near(judge: Judge, nearest: Array) -> Booleans:
    """Return which flights come nearer to a pylon or an obstacle than a wing may at any time, shape (n,)."""
    cleared = cleared_pylons(judge.course)
    required = [pylon.required - pylon.radius if pylon in cleared else 0.0 for pylon in judge.pylons]
    return np.asarray((nearest < np.array(required)[:, None] - LENGTH_ALLOWED).any(axis=0))


def legs_at(nominal: NominalFlight, clock: Array) -> NDArray[np.int64]:
    """Return the number of the passage in which the leg ends that is flown at some clock, of its shape."""
    last = len(nominal.passing_times) - 1
    return np.clip(np.searchsorted(nominal.passing_times, clock, side="right"), 1, max(last, 1))


def _distances(
    judge: Judge, flights: Flights, racing: Booleans, legs: NDArray[np.int64], nearest: Array, tip: Array
) -> Array:
    """Return the least distances of all flights from the judge's things, see `FlightMeasurements`."""
    course = judge.course
    places = np.stack([flights.state[:, 0], flights.state[:, 1]], axis=-1)
    rows: list[Array] = []

    def least(distance: Array, counts: Booleans = racing) -> None:
        rows.append(np.min(distance, axis=0, where=counts, initial=np.inf))

    for crowd in course.crowd:
        distance = ground_distance(places, crowd)
        if crowd.slant:
            distance = np.hypot(distance, -flights.state[:, STATE["z"]] - crowd.height)
        least(distance)
    for line in course.safety_lines:
        least(beside_line(places, line), racing & np.isin(legs, course.passages_with_line(line)))
    if course.airspace:
        least(beside_border(places, course.airspace))
    for obstacle in course.obstacles:
        own = [row for row, pylon in enumerate(judge.pylons) if pylon.is_obstacle and pylon.name == obstacle.name]
        rows.append(nearest[own].min(axis=0))
    least(tip)
    return np.stack(rows)


def _along(judge: Judge, flights: Flights, racing: Booleans, distances: Array) -> dict[str, Booleans]:
    """Return which other limits are broken: load factor, floor, ceiling, crowd, safety lines, airspace."""
    beyond, height = LENGTH_ALLOWED, -flights.state[:, STATE["z"]]
    floor, ceiling = judge.course.rules.height.lower, judge.course.rules.height.upper
    breaches = {
        "load factor": (flights.load > judge.load.upper + LOAD_ALLOWED)
        | (flights.load < judge.load.lower - LOAD_ALLOWED),
        "floor": height < floor - beyond,
        "ceiling": height > ceiling + beyond,
    }
    along = {kind: np.asarray((breach & racing).any(axis=0)) for kind, breach in breaches.items()}
    for kind in ("crowd", "safety line", "airspace"):
        along[kind] = np.zeros(len(flights.lost), bool)
        for thing, distance in zip(judge.things, distances, strict=True):
            if thing.kind == kind:
                along[kind] |= distance < thing.required - beyond
    return along


def _pulls(judge: Judge, flights: Flights, racing: Booleans, legs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many pulls that count begin on every leg, see `FlightMeasurements`."""
    begins = judge.load_rule.pulls(flights.load, flights.sample, racing)
    count = len(judge.boundaries)
    return np.stack([(begins & (legs == number)).sum(axis=0) for number in range(count)])


def grid_of(nominal: NominalFlight) -> Array:
    """Return the clock at which deviations are recorded, s; shape (m,)."""
    return np.arange(0.0, nominal.passing_times[-1], GRID)


def _deviations(loop: ClosedLoop, flights: Flights) -> Array:
    """Return the deviations on the grid, see `FlightMeasurements`."""
    nominal, grid = loop.nominal, grid_of(loop.nominal)
    line = nominal.at(grid)
    north, east = planes(line)
    inputs = np.zeros((loop.plant.path.size1_in(1), len(grid)))
    loads = loop.plant.path_of(inputs)(line)[loop.plant.path_row("n_z")]
    deviations = np.full((4, len(grid), flights.clock.shape[1]), np.nan)
    for flight in range(flights.clock.shape[1]):
        until = int(flights.lost[flight])
        clock = flights.clock[:until, flight]
        right, down, bank = (
            flights.error[:until, 1, flight],
            flights.error[:until, 2, flight],
            flights.error[:until, 4, flight],
        )
        rows: list[Array] = [np.interp(grid, clock, history, right=np.nan) for history in (right, down, bank)]
        load = np.interp(grid, clock, flights.load[:until, flight], right=np.nan)
        lateral = north[0] * rows[0] + north[1] * rows[1]
        height = east[0] * rows[0] + east[1] * rows[1]
        deviations[:, :, flight] = np.stack([lateral, height, rows[2], load - loads])
    return deviations


def planes(line: Array) -> tuple[Array, Array]:
    """Return what a metre to the right and a metre down in the axes of the path are to the right of the course, and up.

    Both of shape (2, n): (lateral per right, lateral per down), (height per right, height per down).
    """
    R = rotation(list(line[4:8]))
    level = np.sqrt(R[0][0] ** 2 + R[1][0] ** 2)
    safe = np.where(level > 1e-9, level, 1.0)
    across = np.where(level > 1e-9, -R[1][0] / safe, 0.0), np.where(level > 1e-9, R[0][0] / safe, 1.0)
    lateral = np.stack([across[0] * R[0][i] + across[1] * R[1][i] for i in (1, 2)])
    return lateral, -np.stack([R[2][1], R[2][2]])
