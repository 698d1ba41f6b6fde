"""The segments of a course, each between two passages that are planned for themselves; their shapes, in words, too."""

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.model.frames import QUATERNION, rotation
from airrace.model.track.course import Course
from airrace.optimal_control.trajectory import Array
from airrace.procedure.multistart.coarse_solution import CoarseSolution
from airrace.procedure.multistart.rolls import Reversal, reversals
from airrace.procedure.planning.plan import POSITION, stops_of, track_turn

SAMPLES = 17
"""Number of samples of a phase at which two flights are compared."""
POSITION_TOLERANCE = 12.0
"""Largest distance at which two flights still take the same route, m."""
ATTITUDE_TOLERANCE = math.radians(70.0)
"""Largest angle between the attitudes of two flights on the same route, rad."""
LONG_TURN = math.radians(100.0)
"""The turn from which on a segment is mentioned in the description of a whole flight, rad."""
STRAIGHT = math.radians(15.0)
"""Largest turn that is called straight, rad."""
UPRIGHT = math.radians(5.0)
"""Largest lateral turn with which a loop leans to no side, rad."""
FLAT = 15.0
"""Largest rise above both ends, or between them, that is called flat, m."""
STEEP = math.radians(60.0)
"""The climb angle from which on a turn leads over the top, rad."""


@dataclass(frozen=True)
class Segment:
    """A part of the course from one stop to the next.

    `first` and `last` are numbers of passages, and of the phases between them.
    """

    number: int
    first: int
    last: int


def segments_of(course: Course) -> list[Segment]:
    """Return all segments of a course in order."""
    return [Segment(number, *pair) for number, pair in enumerate(itertools.pairwise(stops_of(course)))]


@dataclass(frozen=True)
class SegmentShape:
    """The shape of a segment as a flight takes it.

    Attributes:
        turn: angle by which its track turns, rad, positive to the right.
        lateral_turn: what of it is to a side; half a loop turns the track by half a circle, but to none.
        steepest: largest magnitude of its climb angle, rad.
        height: largest height, m.
        rise: of that above the higher end, m.
        gain: height of its end above its start, m.
        overhead: whether the aircraft is upside down at the top.
        length: of its track over ground, m.
        rolls: from one side to the other, that begin on it.
    """

    turn: float
    lateral_turn: float
    steepest: float
    height: float
    rise: float
    gain: float
    overhead: bool
    length: float
    rolls: tuple[Reversal, ...] = ()

    def describe(self) -> str:
        """Return how the segment is taken, in words."""
        return ", ".join([self._track(), *(roll.describe() for roll in self.rolls)])

    def _track(self) -> str:
        side = f"to the {'right' if self.turn > 0.0 else 'left'}"
        high = f"{round(self.height, -1):.0f} m high"
        if self.rise > FLAT and self.steepest > STEEP and self.overhead:
            return f"over the top{f' {side}' if abs(self.lateral_turn) > UPRIGHT else ''}, {high}"
        turned = f"{round(abs(math.degrees(self.turn)), -1):.0f} degrees {side}"
        if abs(self.turn) < STRAIGHT:
            turned = "straight"
        if self.rise > FLAT:
            return f"{turned}, {high}"
        if abs(self.gain) <= FLAT:
            return f"{turned}, flat"
        return f"{turned}, {'climbing' if self.gain > 0.0 else 'descending'} {round(abs(self.gain), -1):.0f} m"


def shape_of(coarse: CoarseSolution, segment: Segment) -> SegmentShape:
    """Return the shape of one segment of a flight."""
    r, q = _position_and_attitude(coarse, segment.first, segment.last)
    height, turn, R = -r[2], track_turn(r), rotation(list(q))
    nodes, (_, whole) = coarse.problem.first_node, _position_and_attitude(coarse, 0, len(coarse.problem.phases))
    return SegmentShape(
        turn=turn.angle,
        lateral_turn=turn.lateral,
        steepest=float(np.arcsin(np.clip(np.abs(R[2][0]), 0.0, 1.0)).max()),
        height=float(height.max()),
        rise=float(height.max() - max(height[0], height[-1])),
        gain=float(height[-1] - height[0]),
        overhead=bool(R[2][2][int(height.argmax())] < 0.0),
        length=float(np.hypot(*np.diff(r[:2])).sum()),
        rolls=tuple(r for r in reversals(whole) if nodes[segment.first] <= r.first < nodes[segment.last]),
    )


def differing(first: CoarseSolution, second: CoarseSolution, segments: Iterable[Segment]) -> list[Segment]:
    """Return the segments that two flights take on different routes."""
    return [segment for segment in segments if not same_route(first, segment, second, segment)]


def neighbours(segments: Iterable[Segment]) -> list[list[Segment]]:
    """Return segments in order, grouped where they follow one another."""
    groups: list[list[Segment]] = []
    for segment in segments:
        if groups and groups[-1][-1].number == segment.number - 1:
            groups[-1].append(segment)
        else:
            groups.append([segment])
    return groups


def inside_window(segments: Sequence[Segment], first: int, last: int) -> list[tuple[Segment, Segment]]:
    """Return the segments within the phases `first ... last - 1`, as they are numbered there and in the race."""
    within = [segment for segment in segments if first <= segment.first and segment.last <= last]
    return [(replace(segment, first=segment.first - first, last=segment.last - first), segment) for segment in within]


def same_route(first: CoarseSolution, segment: Segment, second: CoarseSolution, counterpart: Segment) -> bool:
    """Return whether two flights take the same route through a segment, which may be another one in the second flight.

    Where a roll goes the other way, the quaternions end with opposite signs.
    """
    signs = set[float]()
    phases = zip(range(segment.first, segment.last), range(counterpart.first, counterpart.last), strict=True)
    for first_phase, second_phase in phases:
        (r_1, q_1), (r_2, q_2) = _samples(first, first_phase), _samples(second, second_phase)
        distance = float(np.linalg.norm(r_1 - r_2, axis=0).max())
        cosines = (q_1 * q_2).sum(axis=0)
        signs |= set(np.sign(cosines).tolist())
        angle = 2.0 * math.acos(min(1.0, float(np.abs(cosines).min())))
        if not distance <= POSITION_TOLERANCE or not angle <= ATTITUDE_TOLERANCE or len(signs) > 1:
            return False
    return True


def segment_name(course: Course, segment: Segment) -> str:
    """Return a segment by the names of the passages at its ends."""
    return f"{course.passages[segment.first].name} -> {course.passages[segment.last].name}"


def describe_segments(course: Course, coarse: CoarseSolution, segments: Sequence[Segment]) -> str:
    """Describe how a flight takes some segments, e.g. "1:g4 -> 1:g5: over the top to the right, 140 m high"."""
    return "; ".join(f"{segment_name(course, segment)}: {shape_of(coarse, segment).describe()}" for segment in segments)


def describe_route(course: Course, coarse: CoarseSolution, segments: Sequence[Segment]) -> str:
    """Describe the long turns of a flight, one after another."""
    turns = [segment for segment in segments if abs(shape_of(coarse, segment).turn) >= LONG_TURN]
    return describe_segments(course, coarse, turns) or "no long turns"


def _position_and_attitude(coarse: CoarseSolution, first: int, last: int) -> tuple[Array, Array]:
    """Return positions (3, n) and attitudes (4, n) at the nodes of some phases."""
    names, nodes = [state.name for state in coarse.problem.system.states], coarse.problem.first_node
    state = coarse.iterate.state[:, nodes[first] : nodes[last] + 1]
    return state[[names.index(name) for name in POSITION]], state[[names.index(name) for name in QUATERNION]]


def _samples(coarse: CoarseSolution, phase: int) -> tuple[Array, Array]:
    """Return positions (3, n) and attitudes (4, n) of one phase at equal shares of its duration."""
    shares = np.concatenate([[0.0], np.cumsum(coarse.problem.phases[phase].fractions)])
    r, q = _position_and_attitude(coarse, phase, phase + 1)
    at = np.linspace(0.0, 1.0, SAMPLES)
    rows: list[Array] = [np.interp(at, shares, row) for row in (*r, *q)]
    q = np.stack(rows[3:])
    return np.stack(rows[:3]), q / np.linalg.norm(q, axis=0)
