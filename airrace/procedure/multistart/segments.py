"""The stretches of a course, each between two passages that are planned for themselves, and their shapes in flight."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from airrace.dynamics.point_mass import PointMassState
from airrace.frames import rotation
from airrace.optimal_control.problem import Iterate
from airrace.planning.decisions_from_solution import ATTITUDE, POSITION, track_turn
from airrace.planning.plan import stops_of
from airrace.procedure.multistart.coarse_solution import CoarseSolution
from airrace.procedure.phase_segments import phase_piece
from airrace.records import record
from airrace.track.course import Course
from airrace.trajectory import Array

SAMPLES = 17
"""The number of samples of a phase where two flights are compared."""
APART = 12.0
"""The largest distance at which two flights still fly the same way, m."""
ROLLED = math.radians(70.0)
"""The largest angle between the attitudes at which two flights still fly the same way, rad."""


@record
class Segment:
    """A part of the course from one stop to the next.

    `first` and `last` are numbers of passages, and of the phases between them.
    """

    number: int
    first: int
    last: int


def stretches(course: Course) -> list[Segment]:
    """Return all stretches of a course in order."""
    return [Segment(number, *pair) for number, pair in enumerate(itertools.pairwise(stops_of(course)))]


@record
class Shape:
    """The shape of a stretch as a flight takes it.

    Attributes:
        turn: angle by which its track turns, rad, positive to the right.
        aside: what of it is to a side; half a loop turns the track by half a circle, but to none.
        steepest: largest magnitude of its climb angle, rad.
        height: largest height, m.
        rise: of that above the higher end, m.
        gain: height of its end above its beginning, m.
        overhead: whether the aircraft is upside down at the top.
        seconds: its duration.
        length: of its track over ground, m.
    """

    turn: float
    aside: float
    steepest: float
    height: float
    rise: float
    gain: float
    overhead: bool
    seconds: float
    length: float


def shape(coarse: CoarseSolution, stretch: Segment) -> Shape:
    """Return the shape of one stretch of a flight."""
    nodes = coarse.problem.first_node
    first, last = nodes[stretch.first], nodes[stretch.last]
    row = rows(coarse)
    height = -row["z"][first : last + 1]
    turn = track_turn(np.stack([row[name][first : last + 1] for name in POSITION]))
    R = rotation([row[name][first : last + 1] for name in ATTITUDE])
    return Shape(
        turn=turn.angle,
        aside=turn.aside,
        steepest=float(np.arcsin(np.clip(np.abs(R[2][0]), 0.0, 1.0)).max()),
        height=float(height.max()),
        rise=float(height.max() - max(height[0], height[-1])),
        gain=float(height[-1] - height[0]),
        overhead=bool(R[2][2][int(height.argmax())] < 0.0),
        seconds=float(coarse.iterate.durations[stretch.first : stretch.last].sum()),
        length=float(np.hypot(*(np.diff(row[name][first : last + 1]) for name in ("x", "y"))).sum()),
    )


def rows(coarse: CoarseSolution) -> dict[str, Array]:
    """Return the histories of a flight's states by name."""
    names = [one.name for one in coarse.problem.system.states]
    return dict(zip(names, coarse.iterate.state, strict=True))


def differing(one: CoarseSolution, other: CoarseSolution, all_stretches: Sequence[Segment]) -> list[Segment]:
    """Return the stretches that two flights take in different ways."""
    return [stretch for stretch in all_stretches if not same_way(one, stretch, other, stretch)]


def neighbours(some: Sequence[Segment]) -> list[list[Segment]]:
    """Return stretches in order, grouped where they follow one another."""
    groups: list[list[Segment]] = []
    for stretch in some:
        if groups and groups[-1][-1].number == stretch.number - 1:
            groups[-1].append(stretch)
        else:
            groups.append([stretch])
    return groups


def same_way(one: CoarseSolution, stretch: Segment, other: CoarseSolution, counterpart: Segment) -> bool:
    """Return whether two flights take a stretch alike, which may begin at other phases of them."""
    pairs = zip(range(stretch.first, stretch.last), range(counterpart.first, counterpart.last), strict=True)
    return all(alike(_piece(one, here), _piece(other, there)) for here, there in pairs)


def alike(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    """Return whether two flights through a phase, as positions (3, n) and attitudes (4, n), are the same way."""
    apart = np.linalg.norm(one[0] - other[0], axis=0).max()
    cosine = np.abs((one[1] * other[1]).sum(axis=0)).min()
    return bool(apart <= APART and 2.0 * math.acos(min(1.0, float(cosine))) <= ROLLED)


def sampled(iterate: Iterate, fractions: tuple[float, ...]) -> tuple[Array, Array]:
    """Return positions (3, n) and attitudes (4, n) of one phase, point mass, at equal shares of its duration."""
    old, new = np.concatenate([[0.0], np.cumsum(fractions)]), np.linspace(0.0, 1.0, SAMPLES)
    history = dict(zip(PointMassState.names(), iterate.state, strict=False))  # counters of rolls come behind

    def at(names: Sequence[str]) -> Array:
        values: list[Array] = [np.interp(new, old, history[name]) for name in names]
        return np.stack(values)

    q = at(ATTITUDE)
    return at(POSITION), q / np.linalg.norm(q, axis=0)


def _piece(coarse: CoarseSolution, index: int) -> tuple[Array, Array]:
    return sampled(phase_piece(coarse.iterate, coarse.problem, index), coarse.problem.phases[index].fractions)
