"""The plan: in which direction every element is crossed, before anything is optimised.

Which way a gate is left decides which optimum is found: phases solved one by one, without a crossing direction, leave
gates uselessly, and the joint optimum keeps the loops. So the headings at all passages come first, by dynamic
programming: a few candidates per passage, and between neighbours the length of the Dubins path (or, where a position is
free, the time to turn from one attitude to the next).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.frames import quaternion
from airrace.procedure.cruise import Cruise
from airrace.procedure.rotation_time import rotation_time
from airrace.track.course import Course, Direction, Passage
from airrace.track.dubins import DubinsPath, lengths, shortest
from airrace.track.gates import Gate, Manoeuvre, Pylon
from airrace.trajectory import Array

HEADINGS = 36
OFFSETS = math.radians(10.0) * np.arange(-6, 7)
PYLON_MARGIN = 4.0  # m beyond the clearance, where the plan passes a pylon
KNIFE_EDGE = math.radians(60.0)  # a gate banked more than this is flown on edge


@dataclass(frozen=True)
class Waypoint:
    """One passage as planned.

    Attributes:
        passage: which one.
        position: north, east, height, m; None where the element leaves it free.
        heading: course at the passage, rad.
        climb: climb angle, rad.
        bank: prescribed bank, rad; None where free.
        axis: heading of the axis that the crossing is measured against, rad.
    """

    passage: Passage
    position: tuple[float, float, float] | None
    heading: float
    climb: float
    bank: float | None
    axis: float

    @property
    def q(self) -> list[float]:
        """Attitude, wings level where the bank is free."""
        return quaternion(self.heading, self.climb, self.bank or 0.0)


@dataclass(frozen=True)
class Leg:
    """From one waypoint to the next: a level path where both ends have positions, else None (a change of attitude)."""

    path: DubinsPath | None


def _level(here: Waypoint, there: Waypoint) -> bool:
    """Whether a planar path can lead from one to the other."""
    known = here.position is not None and there.position is not None
    return known and here.climb == 0.0 and there.climb == 0.0


@dataclass(frozen=True)
class Plan:
    """Waypoints of all passages and the legs between them; `seconds` is the planned race time."""

    waypoints: tuple[Waypoint, ...]
    legs: tuple[Leg, ...]
    cruise: Cruise
    seconds: float


def plan(course: Course, pace: Cruise) -> Plan:
    """Choose the candidate at every passage that makes the shortest race."""
    candidates = [_candidates(passage) for passage in course.passages]
    total = np.zeros(len(candidates[0]))
    choices: list[np.ndarray] = []
    for here, there in itertools.pairwise(candidates):
        seconds = total[:, None] + _leg_seconds(here, there, pace)
        choices.append(seconds.argmin(axis=0))
        total = seconds.min(axis=0)
    index = int(total.argmin())
    chosen = [index]
    for choice in reversed(choices):
        index = int(choice[index])
        chosen.append(index)
    waypoints = [options[one] for options, one in zip(candidates, reversed(chosen), strict=True)]
    legs = [_leg(a, b, pace) for a, b in itertools.pairwise(waypoints)]
    return Plan(tuple(_with_knife_edges(waypoints, legs)), tuple(legs), pace, float(total.min()))


def _candidates(passage: Passage) -> list[Waypoint]:
    element = passage.element
    if isinstance(element, Gate):
        return _gate_candidates(passage, element)
    if isinstance(element, Pylon):
        return _pylon_candidates(passage, element)
    return _manoeuvre_candidates(passage, element)


def _gate_candidates(passage: Passage, gate: Gate) -> list[Waypoint]:
    """Courses around the axis, flown forward, in reverse or either way."""
    forward = [gate.heading] if passage.direction is not Direction.REVERSE else []
    reverse = [gate.heading + math.pi] if passage.direction is not Direction.FORWARD else []
    offsets = OFFSETS[np.abs(OFFSETS) <= gate.tolerances.crossing + 1e-9]
    position = (gate.north, gate.east, gate.height)
    return [
        Waypoint(passage, position, axis + float(offset), 0.0, gate.bank, axis)
        for axis in (*forward, *reverse)
        for offset in offsets
    ]


def _pylon_candidates(passage: Passage, pylon: Pylon) -> list[Waypoint]:
    """All courses within the crossing limit of either direction across the line to the pylon."""
    distance = pylon.tolerances.clearance + PYLON_MARGIN
    north, east = pylon.north + distance * math.cos(pylon.side), pylon.east + distance * math.sin(pylon.side)
    waypoints: list[Waypoint] = []
    for heading in 2.0 * math.pi / HEADINGS * np.arange(HEADINGS):
        axis = pylon.side + math.copysign(math.pi / 2, math.sin(float(heading) - pylon.side))
        if abs(math.remainder(float(heading) - axis, 2.0 * math.pi)) <= pylon.tolerances.crossing + 1e-9:
            waypoints.append(Waypoint(passage, (north, east, pylon.height), float(heading), 0.0, None, axis))
    return waypoints


def _manoeuvre_candidates(passage: Passage, element: Manoeuvre) -> list[Waypoint]:
    """The prescribed attitude at every course that is allowed; a position only where all of it is prescribed."""
    free = 2.0 * math.pi / HEADINGS * np.arange(HEADINGS)
    headings = [element.heading] if element.heading is not None else [float(heading) for heading in free]
    return [
        Waypoint(passage, element.position, heading, element.climb or 0.0, element.bank, heading)
        for heading in headings
    ]


def _leg_seconds(here: Sequence[Waypoint], there: Sequence[Waypoint], pace: Cruise) -> Array:
    """Planned time from every candidate to every next one, shape (len(here), len(there)), s."""
    if _level(here[0], there[0]):
        assert here[0].position is not None
        assert there[0].position is not None
        start, end = np.array(here[0].position[:2]), np.array(there[0].position[:2])
        first = np.array([one.heading for one in here])[:, None]
        last = np.array([one.heading for one in there])[None, :]
        pieces = lengths(start, first, end, last, pace.radius)
        return np.asarray(pieces.sum(axis=1).min(axis=0) * pace.radius / pace.V)
    return np.array([[rotation_time(a.q, b.q, pace) for b in there] for a in here])


def _leg(a: Waypoint, b: Waypoint, pace: Cruise) -> Leg:
    if not _level(a, b):
        return Leg(None)
    assert a.position is not None
    assert b.position is not None
    return Leg(shortest(np.array(a.position[:2]), a.heading, np.array(b.position[:2]), b.heading, pace.radius))


def _with_knife_edges(waypoints: Sequence[Waypoint], legs: Sequence[Leg]) -> list[Waypoint]:
    """Gates that may be flown on either edge take the one into which the path around them turns."""
    chosen: list[Waypoint] = []
    for index, waypoint in enumerate(waypoints):
        element = waypoint.passage.element
        if isinstance(element, Gate) and element.either_bank:
            turn = _turn_around(legs[index - 1] if index else None, legs[index] if index < len(legs) else None)
            bank = math.copysign(abs(element.bank), turn if turn else element.bank)
            waypoint = Waypoint(waypoint.passage, waypoint.position, waypoint.heading, 0.0, bank, waypoint.axis)
        chosen.append(waypoint)
    return chosen


def _turn_around(before: Leg | None, after: Leg | None, reach: float = 60.0) -> float:
    """Heading gained (to the right, rad) within `reach` metres before and after a passage."""
    turn = 0.0
    if before is not None and before.path is not None:
        s = np.linspace(max(before.path.length - reach, 0.0), before.path.length, 21)
        turn += float(before.path.curvature(s).mean()) * reach
    if after is not None and after.path is not None:
        s = np.linspace(0.0, min(reach, after.path.length), 21)
        turn += float(after.path.curvature(s).mean()) * reach
    return turn
