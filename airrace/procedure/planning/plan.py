"""The plan of a race: how every element is crossed.

Which way a gate is left decides which optimum is found: phases solved one by one, without a crossing direction, leave
gates uselessly, and the joint optimum keeps the loops. So the headings at all passages come first, by dynamic
programming: a few candidates per passage, and between neighbours the length of the Dubins path (or, where a position is
free, the time to turn from one attitude to the next).

The plan of a flight that exists already makes the choices that are read off its states at the passages. The flight
itself says along which axis a passage is crossed and to which side a roll goes, so nothing about it has to be stored.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from airrace.model.frames import QUATERNION, angle_between, angles, rotation
from airrace.model.track.course import Course, Passage, Roll
from airrace.model.track.dubins import DubinsPath, circle, least, lengths, on_side, shortest
from airrace.model.track.gates import STEEP
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.planning.clearance import (
    Place,
    PylonPost,
    beside_border,
    beside_line,
    cleared_pylons,
    ground_distance,
    place_of,
)
from airrace.procedure.planning.planning_model import (
    PlanningModel,
    cruise,
    roll_time,
    rotation_time,
    rotation_vector,
    turn_by,
)
from airrace.procedure.planning.route_decisions import ANY, RouteDecisions, Waypoint, candidates
from airrace.race import Race

LEG_SAMPLES = 61
"""The number of places of a leg at which its distance from boundaries is taken."""
LEGS_KEPT = 4096
"""The number of legs of which paths, and lengths, are remembered: the plans of a search differ in a few legs."""
SLOPE_MAX = 0.4
"""The mean slope (1) above which a way is too short for a height. From the straight way between gates 318 m apart,
solves led a PC-9 up and down by 0.58 at most, and from a longer way by 0.73."""

ONE_PLACE = 0.01
"""The length of a way below which both of its ends are one place, m: places are not surveyed more closely.

Nothing flies from a place to itself but round a circle.
"""


@dataclasses.dataclass(frozen=True)
class PlannedLeg:
    """The stretch from one waypoint to the next.

    It is a level path if both ends have positions, else None (a change of attitude).
    """

    path: DubinsPath | None


@dataclasses.dataclass(frozen=True)
class Plan:
    """The waypoints of all passages and the legs between them.

    Attributes:
        seconds: planned race time.
        counting: whether the flight counts its rolls, see `flight_model.py`.
        prefer_last_on_ties: how ties were decided, and are to be decided on the way, see `RouteDecisions`.
    """

    waypoints: tuple[Waypoint, ...]
    legs: tuple[PlannedLeg, ...]
    cruise: PlanningModel
    seconds: float
    counting: bool
    prefer_last_on_ties: bool = False

    def turn(self, a: Waypoint, b: Waypoint) -> tuple[float, float, float]:
        """Return the rotation that leads from one waypoint to the next, rad.

        A roll turns further than the shortest way.
        """
        return _turn(a, b, prefer_last=self.prefer_last_on_ties)

    def part(self, legs: range) -> "tuple[Plan, int]":
        """Return the part of the plan that tells how some legs are flown, and the number of its first leg.

        A flight begins to turn on the leg before, and legs without paths are laid out from the next known place on.
        `seconds` stays that of the whole race.
        """
        first, last = max(legs.start - 1, 0), min(legs.stop + 1, len(self.legs))
        while first > 0 and self.legs[first].path is None:
            first -= 1
        while last < len(self.legs) and self.legs[last - 1].path is None:
            last += 1
        waypoints = self.waypoints[first : last + 1]
        return dataclasses.replace(self, waypoints=waypoints, legs=self.legs[first:last]), first


@dataclasses.dataclass(frozen=True)
class _Stop:
    """A passage that is planned for itself.

    It has its index and candidates, the side of the turn that leads to it (0: either), the least length of the path to
    it (m) and the roll on the way.
    """

    index: int
    candidates: list[Waypoint]
    side: int
    length_min: float
    roll: Roll | None


def plan(course: Course, pace: PlanningModel, choices: RouteDecisions = ANY) -> Plan:
    """Choose the candidate at every passage that makes the shortest race.

    Passages that ask for a height alone are put on the way between their neighbours afterwards.

    Args:
        course: to be planned.
        pace: how fast, and how tightly.
        choices: what is chosen already.
    """
    stops = [
        _Stop(
            index,
            choices.candidates_at(course, index),
            choices.turns.get(index, 0),
            choices.lengths.get(index, 0.0),
            choices.roll(course, index),
        )
        for index in stops_of(course)
    ]
    chosen, seconds = _shortest(stops, pace, prefer_last=choices.prefer_last_on_ties)
    waypoints, legs = [chosen[0]], list[PlannedLeg]()
    for (a, b), stop in zip(itertools.pairwise(chosen), stops[1:], strict=True):
        first, after = len(waypoints) - 1, stop.index
        leg, arrived = _leg(a, b, stop, pace, prefer_last=choices.prefer_last_on_ties)
        heights = course.passages[first + 1 : after]
        waypoints += [*_on_the_way(a, arrived, heights, leg, prefer_last=choices.prefer_last_on_ties), arrived]
        legs += _pieces(leg, len(heights) + 1)
    banked = _with_knife_edges(waypoints, legs, choices.edges)
    return Plan(tuple(banked), tuple(legs), pace, seconds, course.has_rolls, choices.prefer_last_on_ties)


def plan_with_room(course: Course, planned: Plan) -> Plan | None:
    """Return a plan with room where one lacks it; None where it has room, or turning the other way gives no more.

    It turns the other way where one leaves the boundaries (lines, airspace, distances from crowds), takes a longer way,
    such as a circle, where one climbs too steeply to a height between two gates, and passes gates so straight that the
    wing fits between their pylons.
    """
    pylons = {place_of(cleared_pylon): cleared_pylon for cleared_pylon in cleared_pylons(course)}
    remaining: dict[int, tuple[Waypoint, ...]] = {}
    for stop in stops_of(course):
        if not _fits(planned.waypoints[stop], pylons, planned.cruise):
            fitting = [candidate for candidate in candidates(course, stop) if _fits(candidate, pylons, planned.cruise)]
            if fitting:
                remaining[stop] = tuple(fitting)
    out, turns, lengths_min = _depths_outside(course, planned), dict[int, int](), dict[int, float]()
    for first, last in itertools.pairwise(stops_of(course)):
        paths = [leg.path for leg in planned.legs[first:last] if leg.path is not None]
        turn = sum(path.turn for path in paths)
        if max(out[first:last]) > 0.0 and abs(turn) > TURN:
            turns[last] = -1 if turn > 0.0 else 1
        heights = [
            waypoint.position[2] for waypoint in planned.waypoints[first : last + 1] if waypoint.position is not None
        ]
        needed = float(np.abs(np.diff(heights)).sum()) / SLOPE_MAX
        if sum(path.length for path in paths) < needed and len(paths) == last - first:
            lengths_min[last] = needed
    if turns:
        turned = plan(
            course, planned.cruise, RouteDecisions(remaining, turns, prefer_last_on_ties=planned.prefer_last_on_ties)
        )
        if sum(_depths_outside(course, turned)) >= sum(out):
            turns = {}
    if not (remaining or turns or lengths_min):
        return None
    return plan(
        course,
        planned.cruise,
        RouteDecisions(remaining, turns, lengths=lengths_min, prefer_last_on_ties=planned.prefer_last_on_ties),
    )


def _fits(way: Waypoint, pylons: Mapping[Place, PylonPost], pace: PlanningModel) -> bool:
    """Tell whether the wing is clear of the pylons at either end of the gate's line, to first order."""
    if way.position is None or way.bank is None:
        return True
    north, east, height = way.position
    half = pace.semispan * abs(math.cos(way.bank))
    for post in way.passage.element.drawing().posts:
        pylon, d_north, d_east = pylons.get(place_of(post)), post.north - north, post.east - east
        along = math.cos(way.axis) * d_north + math.sin(way.axis) * d_east
        if pylon is None or abs(along) > ONE_PLACE or height > pylon.height:
            continue
        if abs(math.cos(way.heading) * d_east - math.sin(way.heading) * d_north) < half + pylon.required:
            return False
    return True


def _depths_outside(course: Course, planned: Plan) -> list[float]:
    """Return how far every leg leads out of its boundaries over ground, m; 0 for one within them, and for attitudes."""
    depths: list[float] = []
    for leg, passage in zip(planned.legs, course.passages[1:], strict=True):
        depth = 0.0
        if leg.path is not None:
            north, east, _ = leg.path.points(np.linspace(0.0, leg.path.length, LEG_SAMPLES))
            way = np.stack([north, east], axis=-1)
            room = [beside_line(way, line) - line.margin for line in passage.safety_lines]
            room += [ground_distance(way, crowd) - crowd.distance for crowd in course.crowd]
            room += [beside_border(way, course.airspace)] if course.airspace else []
            depth = max([0.0, *(-float(distances.min()) for distances in room)])
        depths.append(depth)
    return depths


def stops_of(course: Course) -> list[int]:
    """Return the passages that are planned for themselves: all but those that ask for a height alone on the way."""
    ends = (0, len(course.passages) - 1)
    is_stop = [passage.roll is not None or not passage.element.only_a_height for passage in course.passages]
    return [index for index, stops in enumerate(is_stop) if stops or index in ends]


def _shortest(stops: Sequence[_Stop], pace: PlanningModel, *, prefer_last: bool) -> tuple[list[Waypoint], float]:
    """Return one of the candidates at every stop, and the planned time, s."""
    total = np.zeros(len(stops[0].candidates))
    choices: list[np.ndarray] = []
    for stop, next_stop in itertools.pairwise(stops):
        seconds = total[:, None] + _leg_seconds(stop.candidates, next_stop, pace)
        choices.append(least(seconds, last=prefer_last))
        total = seconds.min(axis=0)
    index = int(least(total, last=prefer_last))
    chosen = [index]
    for choice in reversed(choices):
        index = int(choice[index])
        chosen.append(index)
    return [stop.candidates[index] for stop, index in zip(stops, reversed(chosen), strict=True)], float(total.min())


def _level(start: Waypoint, end: Waypoint) -> bool:
    """Return whether a planar path can lead from one to the other."""
    known = start.position is not None and end.position is not None
    return known and start.climb == 0.0 and end.climb == 0.0 and end.passage.roll is None


def _leg_seconds(starts: Sequence[Waypoint], stop: _Stop, pace: PlanningModel) -> Array:
    """Return the planned times between the candidates of two stops, shape (len(starts), len(stop.candidates)), s."""
    ends = stop.candidates
    if _level(starts[0], ends[0]):
        assert starts[0].position is not None
        assert ends[0].position is not None
        headings = tuple(waypoint.heading for waypoint in starts), tuple(waypoint.heading for waypoint in ends)
        places = starts[0].position[:2], ends[0].position[:2]
        return _level_lengths(*places, *headings, pace.radius, stop.side, stop.length_min) / pace.V
    roll = stop.roll
    if roll is not None:
        return np.array([[roll_time(a.q, b.q, roll, pace)[0] for b in ends] for a in starts])
    return np.array([[rotation_time(a.q, b.q, pace) for b in ends] for a in starts])


@functools.lru_cache(maxsize=LEGS_KEPT)
def _level_lengths(
    start: tuple[float, float],
    end: tuple[float, float],
    start_headings: tuple[float, ...],
    end_headings: tuple[float, ...],
    radius: float,
    side: int,
    length_min: float,
) -> Array:
    """Return the lengths of the shortest paths from all headings at one place to all at another, m; read-only."""
    first, last = np.array(start_headings)[:, None], np.array(end_headings)[None, :]
    pieces = lengths(np.array(start), first, np.array(end), last, radius)
    way = on_side(pieces, side, length_min / radius).min(axis=0) * radius
    way = np.where(way < ONE_PLACE, math.tau * radius, way)
    way.setflags(write=False)  # it is kept
    return way


@functools.lru_cache(maxsize=LEGS_KEPT)
def _level_path(
    start: tuple[float, float],
    heading: float,
    end: tuple[float, float],
    end_heading: float,
    radius: float,
    side: int,
    length_min: float,
    prefer_last: bool,
) -> DubinsPath:
    """Return the shortest path; from a place to itself a circle."""
    place = np.array(start)
    path = shortest(place, heading, np.array(end), end_heading, radius, side, length_min=length_min, last=prefer_last)
    return circle(place, heading, radius, left=prefer_last) if path.length < ONE_PLACE else path


def _leg(
    a: Waypoint, b: Waypoint, stop: _Stop, pace: PlanningModel, *, prefer_last: bool
) -> tuple[PlannedLeg, Waypoint]:
    """Return the leg from a to b, and b as it is reached."""
    if _level(a, b):
        assert a.position is not None
        assert b.position is not None
        ends = a.position[:2], a.heading, b.position[:2], b.heading
        return PlannedLeg(_level_path(*ends, pace.radius, stop.side, stop.length_min, prefer_last)), b
    if stop.roll is None:
        return PlannedLeg(None), b
    _, angle = roll_time(a.q, b.q, stop.roll, pace, prefer_last=prefer_last)
    return PlannedLeg(None), dataclasses.replace(b, rolled=angle)


def _pieces(leg: PlannedLeg, count: int) -> list[PlannedLeg]:
    """Return a leg cut into equal pieces."""
    if leg.path is None or count == 1:
        return [leg] * count
    edges = np.linspace(0.0, leg.path.length, count + 1)
    return [PlannedLeg(leg.path.part(begin, end)) for begin, end in itertools.pairwise(edges.tolist())]


def _turn(a: Waypoint, b: Waypoint, *, prefer_last: bool) -> tuple[float, float, float]:
    roll, pitch, yaw = rotation_vector(a.q, b.q, a.rolled, prefer_last=prefer_last)
    return (b.rolled or roll, pitch, yaw)


def _on_the_way(
    a: Waypoint, b: Waypoint, heights: Sequence[Passage], leg: PlannedLeg, *, prefer_last: bool
) -> list[Waypoint]:
    """Return waypoints of passages that ask for a height alone, evenly between a and b."""
    waypoints: list[Waypoint] = []
    for number, passage in enumerate(heights, start=1):
        element, share = passage.element, number / (len(heights) + 1)
        if leg.path is None:
            heading, climb, _ = angles(rotation(turn_by(a.q, _turn(a, b, prefer_last=prefer_last), share)))
            waypoints.append(Waypoint(passage, None, heading, climb, None, heading, free=True))
            continue
        assert a.position is not None
        assert b.position is not None
        north, east, heading = (float(point[0]) for point in leg.path.points(np.array([share * leg.path.length])))
        height = a.position[2] + share * (b.position[2] - a.position[2])
        height = min(max(height, element.heights.lower), element.heights.upper)
        waypoints.append(Waypoint(passage, (north, east, height), heading, 0.0, None, heading, free=True))
    return waypoints


def _with_knife_edges(
    waypoints: Sequence[Waypoint], legs: Sequence[PlannedLeg], edges: Mapping[int, int]
) -> list[Waypoint]:
    """Return the waypoints with a bank at gates that allow either edge.

    It is the chosen one, else the one into which the path around the gate turns.
    """
    chosen: list[Waypoint] = []
    for index, waypoint in enumerate(waypoints):
        element = waypoint.passage.element
        prescribed = element.prescribed_bank
        if element.two_edged and prescribed is not None:
            around = _turn_around(legs[index - 1] if index else None, legs[index] if index < len(legs) else None)
            turn = edges.get(index, around)
            bank = math.copysign(abs(prescribed), turn if turn else prescribed)
            waypoint = dataclasses.replace(waypoint, bank=bank)
        chosen.append(waypoint)
    return chosen


def _turn_around(before: PlannedLeg | None, after: PlannedLeg | None, reach: float = 60.0) -> float:
    """Return the heading gained (to the right, rad) within `reach` metres before and after a passage."""
    turn = 0.0
    if before is not None and before.path is not None:
        s = np.linspace(max(before.path.length - reach, 0.0), before.path.length, 21)
        turn += float(before.path.curvature(s).mean()) * reach
    if after is not None and after.path is not None:
        s = np.linspace(0.0, min(reach, after.path.length), 21)
        turn += float(after.path.curvature(s).mean()) * reach
    return turn


def plan_race(race: Race) -> Plan:
    """Return the plan with which the optimisation of a race begins."""
    return plan(race.course, cruise(race.aircraft, race.course.rules))


TURN = math.radians(45.0)
"""The angle above which a flight has chosen the side of a turn, rad.

A flight that turns less has chosen none; forced to one, its plan might fly a circle.
"""
LEVEL = 0.2
"""The share of a step's length that must lie over ground for the step to have a course."""
POSITION = ("x", "y", "z")


def plan_from_solution(course: Course, pace: PlanningModel, trajectory: Trajectory) -> Plan:
    """Return the plan that makes all choices as a flight has made them.

    Args:
        course: of the flight.
        pace: how fast, and how tightly, it is planned.
        trajectory: of a flight through it, of any fidelity.
    """
    return plan(
        course,
        pace,
        decisions_from_solution(course, trajectory.states, trajectory.state, trajectory.first_node.tolist()),
    )


def decisions_from_solution(
    course: Course, states: Sequence[Quantity], state: Array, first_node: Sequence[int]
) -> RouteDecisions:
    """Return the choices of a flight.

    Args:
        course: of the flight.
        states: declarations of the states.
        state: the states at the nodes, shape (n_x, N + 1).
        first_node: the node of every passage.
    """
    row = {quantity.name: history for quantity, history in zip(states, state, strict=True)}
    q, r = np.stack([row[name] for name in QUATERNION]), np.stack([row[name] for name in POSITION])
    stops = stops_of(course)
    candidates = {stop: (waypoint_from_solution(course, stop, q[:, first_node[stop]]),) for stop in stops}
    angle = {
        stop: track_turn(r[:, first_node[before] : first_node[stop] + 1]).angle
        for before, stop in itertools.pairwise(stops)
    }
    turns = {stop: 1 if turn > 0.0 else -1 for stop, turn in angle.items() if abs(turn) > TURN}
    rolls = {
        index: 1 if row["Phi"][first_node[index]] > 0.0 else -1
        for index, passage in enumerate(course.passages)
        if passage.roll is not None
    }
    edges = {
        index: 1 if _bank(q[:, first_node[index]]) > 0.0 else -1
        for index, passage in enumerate(course.passages)
        if passage.element.two_edged
    }
    return RouteDecisions(candidates=candidates, turns=turns, rolls=rolls, edges=edges)


def waypoint_from_solution(course: Course, index: int, q: Array) -> Waypoint:
    """Return the candidate of a passage that is nearest to how it was passed, with its course over ground.

    Args:
        course: of the flight.
        index: the index of the passage.
        q: the attitude as a quaternion, shape (4,).
    """
    heading, _, _ = angles(rotation([float(component) for component in q]))
    passage, possible = course.passages[index], candidates(course, index)
    nearest = min(possible, key=lambda waypoint: abs(angle_between(heading, waypoint.heading)))
    if not passage.element.stands:
        banked = passage.roll is not None or passage.element.prescribed_bank is not None
        by_attitude = banked or abs(nearest.climb) > STEEP  # on a steep line bank and course are one
        return max(possible, key=lambda waypoint: abs(float(np.dot(q, waypoint.q)))) if by_attitude else nearest
    return dataclasses.replace(nearest, heading=nearest.heading + angle_between(heading, nearest.heading))


@dataclasses.dataclass(frozen=True)
class TrackTurn:
    """The angle by which a track over ground turns, rad, positive to the right.

    Attributes:
        angle: the whole angle.
        lateral: the part of it to a side; a track that reverses through the vertical turns to none.
    """

    angle: float
    lateral: float


def track_turn(r: Array) -> TrackTurn:
    """Return how a track turns, given as positions north, east and down (m), shape (3, n)."""
    steps = np.diff(r)
    steps = steps[:2, np.hypot(steps[0], steps[1]) > LEVEL * np.linalg.norm(steps, axis=0)]
    (n, e), (n_next, e_next) = steps[:, :-1], steps[:, 1:]
    angles = np.arctan2(n * e_next - e * n_next, n * n_next + e * e_next)
    reversed_ = np.abs(angles) > math.radians(150.0)  # not to a side, but through the vertical
    lateral = float(angles[~reversed_].sum())
    return TrackTurn(lateral + math.copysign(float(np.abs(angles[reversed_]).sum()), lateral), lateral)


def _bank(q: Array) -> float:
    R = rotation([float(component) for component in q])
    return math.atan2(R[2][1], R[2][2])
