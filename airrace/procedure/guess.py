"""The guess of the point mass: histories along a plan, with bank and load factor from the smoothed curvature.

The speed is that of the plan and constant. Flights in pieces, one per phase, are cut, concatenated and shifted, their
quaternions without jumps of sign: q and -q are the same attitude, but not the same numbers.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.environment import g0
from airrace.model.frames import QUATERNION, product, rotation
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.plan import Plan, PlannedLeg
from airrace.procedure.planning.planning_model import PlanningModel, roll_time, rotation_time, turn_by
from airrace.procedure.planning.route_decisions import Waypoint
from airrace.procedure.settings import MeshSettings


@dataclass(frozen=True)
class FirstMesh:
    """The numbers of a first mesh.

    Attributes:
        smoothing: the time of flight to either side over which the curvature is averaged, s.
        long_race: the planned duration up to which a first mesh has intervals of the length that the settings
            name, s. A long race is limited by memory, and its race time may change by more, see
            `CertificateLimits.change_of`.
        stretch_max: the largest factor (1) by which the first intervals of a longer race are longer. 16 laps of
            the sixteen phases (529 s) were proved on 7,859 intervals with 1, on 6,677 with 1.4 and on 5,970
            with 1.8; summed over all meshes, iterations times intervals were 380, 289 and 368 thousand.
        shortest_leg: the shortest planned duration of a leg without a planned path, s.
        count_step: the step in which numbers of intervals rise. Phases of like length share their number, and
            so a solver made ready for it.
    """

    smoothing: float = 0.25
    long_race: float = 300.0
    stretch_max: float = 1.4
    shortest_leg: float = 0.3
    count_step: int = 4


FIRST_MESH = FirstMesh()


Fractions = tuple[float, ...]
History = PointMassState[Array]


def leg_seconds(plan: Plan) -> list[float]:
    """Return the planned duration of each leg, s."""
    return [
        _leg_seconds(leg, a, b, plan.cruise)
        for leg, (a, b) in zip(plan.legs, itertools.pairwise(plan.waypoints), strict=True)
    ]


def _leg_seconds(leg: PlannedLeg, a: Waypoint, b: Waypoint, pace: PlanningModel) -> float:
    if leg.path is not None:
        assert a.position is not None  # a level leg's ends have positions
        assert b.position is not None
        return math.hypot(leg.path.length, b.position[2] - a.position[2]) / pace.V
    roll = b.passage.roll
    turning = rotation_time(a.q, b.q, pace) if roll is None else roll_time(a.q, b.q, roll, pace)[0]
    return max(turning, FIRST_MESH.shortest_leg)


def first_mesh(plan: Plan, settings: MeshSettings) -> list[Fractions]:
    """Return a mesh of equal intervals in each phase, about `settings.interval` seconds long.

    In races of more than `FIRST_MESH.long_race` they grow with the race, up to `FIRST_MESH.stretch_max` times as long.
    """
    seconds = leg_seconds(plan)
    stretched = min(max(1.0, sum(seconds) / FIRST_MESH.long_race), FIRST_MESH.stretch_max)
    return [(1.0 / count,) * count for count in counts_of(seconds, settings, stretched)]


def counts_of(seconds: Sequence[float], settings: MeshSettings, stretched: float = 1.0) -> list[int]:
    """Return the numbers of intervals, longer by a factor, that phases of some durations (s) begin with."""
    interval = stretched * settings.interval
    counts = [max(settings.intervals_min, math.ceil(s / interval)) for s in seconds]
    # Where that is too coarse, the mesh is refined.
    return [min(FIRST_MESH.count_step * math.ceil(count / FIRST_MESH.count_step), 120) for count in counts]


def guess(plan: Plan, mesh: Sequence[Fractions]) -> Iterate:
    """Return histories of the point mass along the plan.

    Args:
        plan: waypoints and legs.
        mesh: fractions of each phase's intervals.
    """
    durations = np.array(leg_seconds(plan))
    shares = [np.concatenate([[0.0], np.cumsum(fractions)]) for fractions in mesh]
    histories = [
        _level_history(plan, index, share) if leg.path is not None else _turning_history(plan, index, share)
        for index, (leg, share) in enumerate(zip(plan.legs, shares, strict=True))
    ]
    _join_positions(plan, histories)
    state = np.hstack([np.vstack(list(history.join()))[:, :-1] for history in histories])
    state = np.hstack([state, np.vstack(list(histories[-1].join()))[:, -1:]])
    align_quaternions(state)
    steps = np.concatenate([np.asarray(fractions) * T for fractions, T in zip(mesh, durations, strict=True)])
    control = _controls(PointMassState[Array].split(state), steps)
    if plan.counting:
        counted, reset = _counters(plan, mesh, steps, state)
        state, control = np.vstack([state, counted]), np.vstack([control, reset])
    return Iterate(durations, state, control)


def _counters(plan: Plan, mesh: Sequence[Fractions], steps: Array, state: Array) -> tuple[Array, Array]:
    """Return histories of `RollCounter` (2, N + 1) and `RollReset` (2, N), which count on rolls and rest elsewhere."""
    history = PointMassState[Array].split(state)
    passing = np.vstack([0.5 * (history.p_Kbar[1:] + history.p_Kbar[:-1]), np.diff(-history.z) / steps])
    counted = np.zeros((2, len(steps) + 1))
    nodes = np.concatenate([[0], np.cumsum([len(fractions) for fractions in mesh])])
    for waypoint, first, last in zip(plan.waypoints[1:], nodes, nodes[1:], strict=False):
        if waypoint.passage.roll is not None:
            share = np.concatenate([[0.0], np.cumsum(steps[first:last])]) / steps[first:last].sum()
            counted[0, first : last + 1] = waypoint.rolled * share
            counted[1, first : last + 1] = history.z[first] - history.z[first : last + 1]
    return counted, np.diff(counted, axis=1) / steps - passing


def _controls(history: History, steps: Array) -> Array:
    """Return the rates of the piecewise linear commands; the throttle stays at full power. Shape (4, N)."""
    rates = [np.diff(values) / steps for values in (history.n_z, history.n_y, history.p_Kbar)]
    return np.vstack([*rates, np.ones_like(steps)])


def _level_history(plan: Plan, index: int, share: Array) -> History:
    """Return the history along a Dubins path: coordinated turns at constant speed, height changing evenly."""
    path, a, b = plan.legs[index].path, plan.waypoints[index], plan.waypoints[index + 1]
    assert path is not None  # it is a level leg, whose ends have positions
    assert a.position is not None
    assert b.position is not None
    s = share * path.length
    north, east, heading = path.points(s)
    across = plan.cruise.V**2 / g0 * _smoothed_curvature(plan, index, s)
    bank = _bank_at_gates(np.arctan(across), s, path.length, a, b, plan.cruise)
    height = a.position[2] + (b.position[2] - a.position[2]) * share
    half_chi, half_mu = heading / 2, bank / 2
    seconds = np.maximum(s, 1e-6 * np.arange(len(s))) / plan.cruise.V
    return PointMassState(
        x=north,
        y=east,
        z=-height,
        V_K=np.full_like(s, plan.cruise.V),
        q0=np.cos(half_chi) * np.cos(half_mu),
        q1=np.cos(half_chi) * np.sin(half_mu),
        q2=np.sin(half_chi) * np.sin(half_mu),
        q3=np.sin(half_chi) * np.cos(half_mu),
        delta_T=np.ones_like(s),
        n_z=np.hypot(1.0, across),
        n_y=np.zeros_like(s),
        p_Kbar=np.gradient(bank, seconds),
    )


def _smoothed_curvature(plan: Plan, index: int, s: Array) -> Array:
    """Return the curvature (1/m) averaged to either side, across neighbouring level legs, too."""
    reach = FIRST_MESH.smoothing * plan.cruise.V
    at = s[:, None] + np.linspace(-reach, reach, 21)
    path = plan.legs[index].path
    assert path is not None
    before = plan.legs[index - 1].path if index else None
    after = plan.legs[index + 1].path if index + 1 < len(plan.legs) else None
    curvature = path.curvature(np.clip(at, 0.0, path.length))
    if before is not None:
        curvature = np.where(at < 0.0, before.curvature(np.clip(at + before.length, 0.0, before.length)), curvature)
    if after is not None:
        curvature = np.where(at > path.length, after.curvature(np.clip(at - path.length, 0.0, after.length)), curvature)
    return curvature.mean(axis=1)


def _bank_at_gates(bank: Array, s: Array, length: float, a: Waypoint, b: Waypoint, pace: PlanningModel) -> Array:
    """Return the bank of the turn (rad), blended into the prescribed banks at both ends."""
    for waypoint, distance in ((a, s), (b, length - s)):
        if waypoint.bank is not None:
            # The bank of a gate holds over 0.15 s of flight.
            weight = np.exp(-((distance / (0.15 * pace.V)) ** 2))
            bank = bank + weight * (waypoint.bank - bank)
    return bank


def _turning_history(plan: Plan, index: int, share: Array) -> History:
    """Return the history of the shortest rotation from one attitude to the next, at constant rates.

    It starts at the origin.
    """
    a, b, pace = plan.waypoints[index], plan.waypoints[index + 1], plan.cruise
    duration = leg_seconds(plan)[index]
    whole = plan.turn(a, b)
    roll, pitch, _ = (angle / duration for angle in whole)
    q = np.array([turn_by(a.q, whole, float(part)) for part in share]).T
    R = rotation(list(q))
    step = duration * np.diff(share)
    direction = np.vstack([R[0][0], R[1][0], R[2][0]])
    middle = 0.5 * (direction[:, 1:] + direction[:, :-1])
    position = np.hstack([np.zeros((3, 1)), np.cumsum(pace.V * middle * step, axis=1)])
    return PointMassState(
        x=position[0],
        y=position[1],
        z=position[2],
        V_K=np.full_like(share, pace.V),
        q0=q[0],
        q1=q[1],
        q2=q[2],
        q3=q[3],
        delta_T=np.ones_like(share),
        n_z=R[2][2] + pitch * pace.V / g0,
        n_y=np.zeros_like(share),
        p_Kbar=np.full_like(share, roll),
    )


def _join_positions(plan: Plan, histories: list[History]) -> None:
    """Join the turning legs end to end, sheared so that they meet all that is known of positions."""
    index = 0
    while index < len(histories):
        if plan.legs[index].path is not None:
            index += 1
            continue
        last = index
        while last < len(histories) and plan.legs[last].path is None:
            last += 1
        _place_chain(plan.waypoints[index : last + 1], histories[index:last])
        index = last


def _place_chain(waypoints: Sequence[Waypoint], chain: Sequence[History]) -> None:
    """Move the histories of a chain, in place: each begins where the one before ends.

    The chain as integrated from its first waypoint misses the last one; the miss is made up for evenly on the way. So
    is what its heights lack at the waypoints between.
    """
    start, end = waypoints[0], waypoints[-1]
    origin = np.array([0.0, 0.0, -50.0]) if start.position is None else _down(start.position)
    corners = np.vstack([np.zeros(3), *(np.array([h.x[-1], h.y[-1], h.z[-1]]) for h in chain)]).cumsum(axis=0) + origin
    knots = np.concatenate([[0], np.cumsum([len(history.x) - 1 for history in chain])])
    target = corners.copy()
    if end.position is not None:
        target += np.outer(knots / knots[-1], _down(end.position) - corners[-1])
    for place, waypoint in enumerate(waypoints[1:-1], start=1):
        target[place, 2] = -_allowed_height(waypoint, -target[place, 2])
    for index, history in enumerate(chain):
        part = np.linspace(0.0, 1.0, len(history.x))
        begin, finish = target[index] - corners[index], target[index + 1] - corners[index + 1]
        for axis, values in enumerate(_position(history)):
            values += corners[index, axis] + begin[axis] + part * (finish[axis] - begin[axis])


def _allowed_height(waypoint: Waypoint, height: float) -> float:
    """Return the height nearest to `height` (m) that a manoeuvre allows."""
    element = waypoint.passage.element
    if element.stands:
        return height
    return min(max(height, element.heights.lower), element.heights.upper)


def _position(history: History) -> tuple[Array, Array, Array]:
    return history.x, history.y, history.z


def _down(position: tuple[float, float, float]) -> Array:
    """Return north, east and down of a position given with its height."""
    return np.array([position[0], position[1], -position[2]])


QUATERNION_ROWS = [PointMassState.names().index(name) for name in QUATERNION]
"""The rows of the quaternion in a state history."""
SHORTEST_SHARE = 0.2
"""The part of the planned duration (1) that a shifted piece lasts at least."""


def align_quaternions(state: Array) -> None:
    """Flip signs, in place, so that neighbours in a state history (n_x, N) lie on the same side."""
    q = state[QUATERNION_ROWS]
    q[:, 1:] *= np.cumprod(np.where((q[:, 1:] * q[:, :-1]).sum(axis=0) < 0.0, -1.0, 1.0))
    state[QUATERNION_ROWS] = q


def rotate(state: Array, before: Array, after: Array) -> Array:
    """Return the quaternions of `state`, rotated as from `before` to `after`; shape (4, N)."""
    q, q_before, q_after = (list(history[QUATERNION_ROWS]) for history in (state, before, after))
    inverse = [q_before[0], -q_before[1], -q_before[2], -q_before[3]]
    return np.array(product(product(q_after, inverse), q))


def phase_piece(whole: Iterate, problem: Problem, index: int) -> Iterate:
    """Return one phase of a flight."""
    first, last = problem.first_node[index], problem.first_node[index + 1]
    return Iterate(whole.durations[index : index + 1], whole.state[:, first : last + 1], whole.control[:, first:last])


def concatenate(pieces: Sequence[Iterate]) -> Iterate:
    """Return pieces as one flight; of two states at a gate the later one counts."""
    state = np.hstack([*(piece.state[:, :-1] for piece in pieces), pieces[-1].state[:, -1:]])
    align_quaternions(state)
    durations = np.concatenate([piece.durations for piece in pieces])
    return Iterate(durations, state, np.hstack([piece.control for piece in pieces]))


def shift(piece: Iterate, before: Iterate, after: Iterate) -> Iterate:
    """Return a solution shifted by the difference between two planned flights."""
    state = piece.state + after.state - before.state
    state[QUATERNION_ROWS] = rotate(piece.state, before.state, after.state)
    return Iterate(
        np.maximum(piece.durations + after.durations - before.durations, SHORTEST_SHARE * after.durations),
        state,
        piece.control + after.control - before.control,
    )
