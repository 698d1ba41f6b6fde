"""The plan of a flight that exists already: its choices are read off its states at the passages.

A stored optimum belongs to one route: along which axis a passage is crossed, to which side a roll goes. The flight
itself says so, so nothing about it has to be stored, and nothing that is stored about it can be wrong.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np

from airrace.frames import angle_between, angles, rotation
from airrace.planning.plan import Plan, plan, stops_of
from airrace.planning.planning_model import PlanningModel
from airrace.planning.route_decisions import RouteDecisions
from airrace.planning.waypoints import Waypoint, candidates
from airrace.quantities import Quantity
from airrace.records import record
from airrace.track.course import Course
from airrace.track.gates import STEEP
from airrace.trajectory import Array, Trajectory

TURN = math.radians(45.0)
"""The angle above which a flight has chosen the side of a turn, rad.

A flight that turns less has chosen none; forced to one, its plan might fly a circle.
"""
LEVEL = 0.2
"""The share of a step's length that must lie over ground for the step to have a course."""
POSITION = ("x", "y", "z")
ATTITUDE = ("q0", "q1", "q2", "q3")


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
    row = {one.name: history for one, history in zip(states, state, strict=True)}
    q, r = np.stack([row[name] for name in ATTITUDE]), np.stack([row[name] for name in POSITION])
    stops = stops_of(course)
    ways = {stop: (waypoint_from_solution(course, stop, q[:, first_node[stop]]),) for stop in stops}
    angle = {
        stop: track_turn(r[:, first_node[before] : first_node[stop] + 1]).angle
        for before, stop in itertools.pairwise(stops)
    }
    turns = {stop: 1 if one > 0.0 else -1 for stop, one in angle.items() if abs(one) > TURN}
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
    return RouteDecisions(ways, turns, rolls, edges)


def waypoint_from_solution(course: Course, index: int, q: Array) -> Waypoint:
    """Return the candidate of a passage that is nearest to how it was passed, with its course over ground.

    Args:
        course: of the flight.
        index: the index of the passage.
        q: the attitude as a quaternion, shape (4,).
    """
    heading, _, _ = angles(rotation([float(one) for one in q]))
    passage, known = course.passages[index], candidates(course, index)
    nearest = min(known, key=lambda one: abs(angle_between(heading, one.heading)))
    if not passage.element.stands:
        banked = passage.roll is not None or passage.element.prescribed_bank is not None
        by_attitude = banked or abs(nearest.climb) > STEEP  # on a steep line bank and course are one
        return max(known, key=lambda one: abs(float(np.dot(q, one.q)))) if by_attitude else nearest
    return dataclasses.replace(nearest, heading=nearest.heading + angle_between(heading, nearest.heading))


@record
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
    R = rotation([float(one) for one in q])
    return math.atan2(R[2][1], R[2][2])
