"""Margins by which an optimum keeps a reserve: from the linear covariance, with the risk allocated over the limits.

Every limit of the course is met somewhere by the optimum: with some room left, the distance to what counts as a breach,
which flights in disturbances use up with a standard deviation sigma. With a margin m the optimum keeps at least

    room(m) = allowed + rate m

and one flight in Phi(-room / sigma) breaks the limit. The margins are those of

    min sum_k price_k m_k   so that   sum_i Phi(-room_i / sigma_i) <= risk

the sum over all limits of a race, an upper bound of the chance that any is broken (Boole); a margin belongs to one key
of the inputs and tightens all limits that come from it. `price` is what it costs in race time. The Lagrangian falls
apart into one search along each margin.

A pilot at the stall cannot pull harder when he is off the line, so that a flight that stays there for long scatters
more than its covariance predicts. A margin of the lift coefficient leaves him that.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import ndtr

from airrace.flights.safety.closed_loop import ClosedLoop
from airrace.flights.safety.covariance import covariance
from airrace.flights.safety.disturbances import Scatter
from airrace.flights.safety.judge import (
    ANGLE_ALLOWED,
    KINDS,
    LENGTH_ALLOWED,
    LENGTHS,
    Judge,
    onto_plane,
    wing_of,
)
from airrace.flights.safety.monte_carlo import LOAD
from airrace.flights.safety.nominal import ERRORS, gradients, instants
from airrace.flights.safety.over_g import LOAD_ALLOWED
from airrace.flights.safety.pilot import PilotModel
from airrace.flights.safety.plant import CONTROLS, DISTURBANCES, STATE
from airrace.model.track.gates import ElementWithTolerances, Passing
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.clearance import (
    Wing,
    beside_border,
    beside_line,
    closest_approaches,
    ground_distance,
    wing_distance,
)
from airrace.procedure.planning.parameters import course_limits
from airrace.procedure.planning.route_decisions import Waypoint
from airrace.procedure.result import StageResult
from airrace.race import Race

SIZE = len(ERRORS)
STALL = "stall"
"""The kind of the limit of lift, which is no breach."""


MARGIN_MAX = 4.0
"""The largest margin, in standard deviations: beyond it a risk is below 4e-5."""
MARGIN_SHARE = 0.8
"""The share of the way between two opposite limits that margins may take up."""
PRICE_MIN = 2e-3
"""What a standard deviation of margin costs at least, s: a limit that costs nothing yet may once others are tighter."""
MARGIN_STEPS = 81
"""The number of margins that are compared for one key."""
FAR = 12.0
"""The distance beyond which a pylon is no limit, m."""
BINDING_ROOM = 0.5
"""The room beyond its margin, in standard deviations, with which a limit counts as one that binds."""
LIFT_ROOM = 2.0
"""The room to the stall that leaves a pilot all he can do, in standard deviations of the angle of attack beyond where
he begins to pull less."""
OPPOSITE = -0.95
"""The cosine between the directions away from two limits below which they are opposite."""


@dataclass(frozen=True)
class Limit:
    """A limit as an optimum meets it at one place.

    Attributes:
        key: of the input that a margin is taken from; empty where none tightens it.
        kind: of the breach, as `airrace.flights.safety.judge` counts it.
        place: the passage, or that in which the leg ends.
        room: from the optimum to what counts as a breach, in the unit of the limit.
        sigma: standard deviation of the room.
        allowed: what is allowed beyond the limit.
        rate: by how much a margin of 1 in the unit of its key widens the room.
        between: the room from here to the opposite limit, of which margins take a share; infinite without one.
        idle: the margin up to which something else is stricter.
        present: the margin with which the optimum was solved.
        cap: the margin beyond which a passing of a fixed height leaves no flight.
    """

    key: str
    kind: str
    place: str
    room: float
    sigma: float
    allowed: float
    rate: float = 1.0
    between: float = math.inf
    idle: float = 0.0
    present: float = 0.0
    cap: float = math.inf

    @property
    def risk_now(self) -> float:
        """The probability of a breach with the room that there is."""
        return float(ndtr(-self.room / self.sigma))

    @property
    def most(self) -> float:
        """The largest margin that leaves a flight, and half of the room to the opposite limit."""
        return min(0.5 * MARGIN_SHARE * self.between / self.rate, self.cap)

    @property
    def negligible_risk_margin(self) -> float:
        """The margin beyond which a risk is negligible."""
        return self.idle + max(MARGIN_MAX * self.sigma - self.allowed, 0.0) / self.rate

    def risk(self, margin: Array) -> Array:
        """Return the probability of a breach where the optimum keeps a margin, of any shape.

        A limit that does not bind leaves the room that it leaves now at any margin; one that does, none.
        """
        needed = self.allowed + self.rate * (margin - self.idle)
        binds = self.room - self.allowed - self.rate * max(self.present - self.idle, 0.0) < BINDING_ROOM * self.sigma
        return np.asarray(ndtr(-(needed if binds else np.maximum(self.room, needed)) / self.sigma))


def limits_of(
    race: Race, result: StageResult, loop: ClosedLoop, scatter: Scatter, margins: Mapping[str, float]
) -> list[Limit]:
    """Return all limits of the course as a stage meets them.

    Args:
        race: course, aircraft and air, without margins.
        result: its stage six-dof, solved with margins or without.
        loop: a pilot trained for it.
        scatter: the disturbances.
        margins: with which the stage was solved, by key.
    """
    judge, P = Judge.from_optimum(race, result, loop), covariance(loop, scatter)[:, :-1, :-1]
    limits = [*_of_passings(judge, loop, P), *_of_pylons(judge, loop, P), *_along(race, judge, loop, P)]
    near = (limit for limit in limits if limit.sigma > 0.0 and limit.room < 3.0 * MARGIN_MAX * limit.sigma)
    # a `point` has no tolerances
    tolerated = {course_limit.key for course_limit in course_limits(race) if math.isfinite(course_limit.value)}
    present: list[Limit] = []
    for limit in near:
        key = limit.key if limit.key in tolerated else ""
        present.append(replace(limit, key=key, present=margins.get(limit.key, 0.0)))
    return present


def _of_passings(judge: Judge, loop: ClosedLoop, P: Array) -> Iterator[Limit]:
    """Yield the tolerances of gates."""
    for number, waypoint in enumerate(judge.waypoints):
        element, line = waypoint.passage.element, judge.states[:, [number]]
        if number == 0 or not element.stands:
            continue
        ends, room = _rooms(judge, waypoint, line)
        onto, _ = onto_plane(loop.nominal, judge.boundaries[number], number, line)
        slopes = gradients(lambda x, _, waypoint=waypoint: _rooms(judge, waypoint, x)[1], line)[:, 0, :SIZE]
        towards, slopes = _directions(slopes), slopes @ onto
        now = _at(P, loop, loop.nominal.passing_times[number])[:SIZE, :SIZE]
        sigma = np.sqrt(np.maximum(np.einsum("qi,ij,qj->q", slopes, now, slopes), 0.0))
        keys, rates = [""] * len(ends), np.ones(len(ends))
        for parameter in element.parameters():
            step = -math.copysign(0.1 * parameter.usual_step, parameter.relaxing_step)
            tighter = replace(waypoint.passage, element=parameter.set(element, parameter.value + step))
            rate = (room - _rooms(judge, replace(waypoint, passage=tighter), line)[1])[:, 0] / abs(step)
            for row in np.flatnonzero(rate > 1e-9).tolist():
                if not keys[row]:  # a clearance, which a width would tighten, too
                    keys[row], rates[row] = f"gates.{element.base_name}.{parameter.key}", rate[row]
        for row, (name, _) in enumerate(ends):
            if name == "along" or not sigma[row] > 0.0:
                continue
            kind = KINDS.get(name, "tolerance")
            allowed = LENGTH_ALLOWED if kind in LENGTHS else ANGLE_ALLOWED
            between = np.min(room[row, 0] + room[towards @ towards[row] < OPPOSITE, 0], initial=np.inf)
            numbers = (float(value) for value in (room[row, 0] + allowed, sigma[row], allowed, rates[row], between))
            yield Limit(keys[row], kind, waypoint.passage.name, *numbers)


def _directions(slopes: Array) -> Array:
    """Return the directions in which rooms grow, shape (k, 6): of the position, else of the attitude."""
    position, attitude = slopes[:, :3], slopes[:, 4:7]
    placed = np.linalg.norm(position, axis=1, keepdims=True) > 1e-6
    directions = np.concatenate([np.where(placed, position, 0.0), np.where(placed, 0.0, attitude)], axis=1)
    return directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)


def _rooms(judge: Judge, waypoint: Waypoint, states: Array) -> tuple[list[tuple[str, float]], Array]:
    """Return the ends of all ranges of a passing, by quantity and sign, and the room to each, shape (k, n)."""
    boundary = judge.boundary(waypoint)
    assert boundary.observation is not None  # it is the boundary of a passage
    rows = {quantity.name: row for row, quantity in enumerate(boundary.observation.quantities)}
    outputs = at_points(boundary.observation.values, states, np.array(boundary.values))
    bounds = [(name, bound) for name, bound in boundary.bounds.items() if name in rows]
    ranges = [(name, sign, end) for name, bound in bounds for sign, end in ((1.0, bound.upper), (-1.0, bound.lower))]
    stated = [(name, sign, end) for name, sign, end in ranges if math.isfinite(end)]
    rooms = [sign * (end - outputs[rows[name]]) for name, sign, end in stated]
    return [(name, sign) for name, sign, _ in stated], np.array(rooms)


def _of_pylons(judge: Judge, loop: ClosedLoop, P: Array) -> Iterator[Limit]:
    """Yield the distances of the wing from pylons and obstacles, one for each time that it comes near.

    The course keeps it clear of all of them at any time.
    """
    nominal = loop.nominal
    clock = instants(loop.pilot.sample, len(P))
    line = nominal.at(clock)
    wing = Wing(clock, *wing_of(line, judge.semispan))
    legs = np.searchsorted(clock, nominal.passing_times).tolist()
    legs[-1] = min(legs[-1], len(clock) - 1)
    elements = {passage.element.name: passage.element for passage in judge.course.passages}
    for approach in closest_approaches(wing, judge.pylons, legs):
        pylon, place = approach.pylon, judge.waypoints[approach.leg + 1].passage.name
        allowed = LENGTH_ALLOWED
        room = approach.distance - pylon.required + allowed
        if room > FAR:
            continue
        at = nominal.at(np.array([approach.time]))
        slopes = gradients(lambda x, _, pylon=pylon: wing_distance(pylon, *wing_of(x, judge.semispan))[None], at)[0, 0]
        sigma = math.sqrt(slopes @ _at(P, loop, approach.time) @ slopes)
        if pylon.is_obstacle:
            yield Limit(f"obstacles.{pylon.name}.clearance_m", "flight clearance", place, room, sigma, allowed)
            continue
        element, key, idle = elements[pylon.name], "", 0.0
        if isinstance(element, ElementWithTolerances) and element.passing is Passing.WINDOW:
            key = f"gates.{element.base_name}.clearance_m"
            idle = max(pylon.required - element.tolerances.clearance, 0.0)  # of another element's, or the least of all
        yield Limit(key, "flight clearance", place, room, sigma, allowed, idle=idle)


def _along(race: Race, judge: Judge, loop: ClosedLoop, P: Array) -> Iterator[Limit]:
    """Yield the limits that hold along the flight, each once per leg: where it is met most closely."""
    clock = instants(loop.pilot.sample, len(P))
    line, course, rules = loop.nominal.at(clock), race.course, race.course.rules
    line[4:8] /= np.linalg.norm(line[4:8], axis=0)
    rows = [loop.plant.path_row(name) for name in ("n_z", "alpha_A")]
    stall_angle = loop.plant.system.path[rows[1]].upper
    keys = [
        *(("rules.floor_m", "floor"), ("rules.ceiling_m", "ceiling"), ("rules.floor_m", "ground")),
        *(("rules.n_z_max", LOAD), ("rules.n_z_min", LOAD), ("rules.C_L_max", STALL)),
        *((f"crowd.{crowd.name}.distance_m", "crowd") for crowd in course.crowd),
        *((f"safety_lines.{safety_line.name}.margin_m", "safety line") for safety_line in course.safety_lines),
        *([("", "airspace")] if course.airspace else []),
    ]

    def rooms(x: Array, d: Array) -> Array:
        height, places = -x[STATE["z"]], np.stack([x[0], x[1]], axis=-1)
        _, half = wing_of(x, judge.semispan)
        n_z, alpha_A = loop.plant.path_of(np.concatenate([np.zeros((CONTROLS, x.shape[1])), d]))(x)[rows]
        distances = [height - rules.height.lower, rules.height.upper - height, height - np.abs(half[2])]
        distances += [judge.load.upper - n_z, n_z - judge.load_rule.lower, stall_angle - alpha_A]
        for crowd in course.crowd:
            distance = ground_distance(places, crowd)
            if crowd.slant:
                distance = np.hypot(distance, height - crowd.height)
            distances.append(distance - crowd.distance)
        distances += [beside_line(places, safety_line) - safety_line.margin for safety_line in course.safety_lines]
        if course.airspace:
            distances.append(beside_border(places, course.airspace))
        return np.stack(distances)

    lift = race.aircraft.lift  # what is stricter than the rules: the aircraft's load factor, an angle of attack
    reached = lift.C_L0 + lift.C_Lalpha * stall_angle
    idle = {
        "rules.n_z_max": max(rules.n_z.upper - judge.load.upper, 0.0),
        "rules.n_z_min": max(judge.load_rule.lower - rules.n_z.lower, 0.0),
        "rules.C_L_max": max(min(rules.C_L.upper, lift.C_L_max) - reached, 0.0),
    }
    fixed_heights = [
        -z.upper for z in (boundary.bounds.get("z", Interval()) for boundary in judge.boundaries) if z.lower == z.upper
    ]
    caps = {
        "rules.floor_m": min((height - rules.height.lower for height in fixed_heights), default=math.inf),
        "rules.ceiling_m": min((rules.height.upper - height for height in fixed_heights), default=math.inf),
    }
    with np.errstate(invalid="ignore"):  # of limits that are not set
        slopes = np.nan_to_num(gradients(rooms, line))
    sigma = np.sqrt(np.maximum(np.einsum("qni,nij,qnj->qn", slopes, P, slopes), 0.0))
    room = rooms(line, np.zeros((DISTURBANCES, len(clock))))
    for leg, (begin, end) in enumerate(pairwise(np.searchsorted(clock, loop.nominal.passing_times).tolist())):
        place = course.passages[leg + 1]
        lines = {safety_line.name for safety_line in place.safety_lines}
        for row, (key, kind) in enumerate(keys):
            if kind == "safety line" and key.split(".")[1] not in lines:
                continue
            inside = slice(begin, max(end, begin + 1))
            at = int(np.argmin(room[row, inside] - 3.0 * sigma[row, inside])) + begin
            allowed = {LOAD: LOAD_ALLOWED, "ground": 0.0, STALL: 0.0}.get(kind, LENGTH_ALLOWED)
            rate = 1.0 / race.aircraft.lift.C_Lalpha if kind == STALL else 1.0
            numbers = float(room[row, at]) + allowed, float(sigma[row, at]), allowed, rate
            if math.isfinite(numbers[0]):
                cap = max(caps.get(key, math.inf), 0.0)
                yield Limit(key, kind, place.name, *numbers, idle=idle.get(key, 0.0), cap=cap)


def _at(P: Array, loop: ClosedLoop, time: float) -> Array:
    """Return the covariance at a time, that of the next sample."""
    return P[min(round(time / loop.pilot.sample), len(P) - 1)]


def lift_margin(limits: Sequence[Limit], pilot: PilotModel, share: float) -> float:
    """Return the margin of the lift coefficient for a share of the room to the stall that leaves a pilot all he can do.

    It is none where the flight does not stay near the stall.
    """
    near = [
        limit
        for limit in limits
        if limit.kind == STALL and limit.room < pilot.stall_margin + limit.present * limit.rate
    ]
    margins = (limit.idle + share * (pilot.stall_margin + LIFT_ROOM * limit.sigma) / limit.rate for limit in near)
    return max(margins, default=0.0) if share else 0.0


@dataclass(frozen=True, eq=False)
class Allocation:
    """Margins, and the risk that they leave.

    Attributes:
        margins: by key, in its unit.
        risks: of every limit.
        reaches: whether the sum of the risks is as small as was wanted.
    """

    margins: Mapping[str, float]
    risks: Array
    reaches: bool


def allocate(
    limits: Sequence[Limit], prices: Mapping[str, float], risk: float, weights: Mapping[str, float] | None = None
) -> Allocation:
    """Return the cheapest margins that leave a risk.

    Args:
        limits: of one race.
        prices: of margins, s per unit of their keys; those that are missing cost nothing.
        risk: the sum of the probabilities of breaches that is allowed.
        weights: of these probabilities, by the kinds of the limits; 1 where there is none.
    """

    def risk_of(limit: Limit, margin: Array) -> Array:
        return (weights or {}).get(limit.kind, 1.0) * limit.risk(margin)

    by_key: dict[str, list[Limit]] = {}
    for limit in limits:
        by_key.setdefault(limit.key, []).append(limit)
    fixed = sum(float(risk_of(limit, np.zeros(()))) for limit in by_key.pop("", []))
    tried, risks, costs = np.empty((3, len(by_key), MARGIN_STEPS))
    for row, (key, of_key) in enumerate(by_key.items()):
        most = min(max(limit.negligible_risk_margin for limit in of_key), min(limit.most for limit in of_key))
        tried[row] = np.linspace(0.0, most, MARGIN_STEPS)
        least = PRICE_MIN * max(limit.rate / limit.sigma for limit in of_key)
        risks[row] = sum(risk_of(limit, tried[row]) for limit in of_key)
        costs[row] = max(prices.get(key, 0.0), least) * tried[row]

    def chosen(weight: float) -> tuple[Array, float]:
        """Return the margins that are best where risk has a price, and the risk that they leave."""
        best = np.argmin(costs + weight * risks, axis=1)[:, None]
        return np.take_along_axis(tried, best, axis=1)[:, 0], fixed + float(np.take_along_axis(risks, best, 1).sum())

    low, high = 1e-6, 1e6
    for _ in range(60):
        weight = math.sqrt(low * high)
        low, high = (low, weight) if chosen(weight)[1] <= risk else (weight, high)
    margins = dict(zip(by_key, chosen(high)[0].tolist(), strict=True))
    left = np.array([float(risk_of(limit, np.array(margins.get(limit.key, 0.0)))) for limit in limits])
    return Allocation({key: margin for key, margin in margins.items() if margin > 0.0}, left, bool(left.sum() <= risk))
