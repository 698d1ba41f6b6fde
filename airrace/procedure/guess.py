"""From a plan to histories: speed held, bank and load factor from the smoothed curvature of the planned path."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from airrace.dynamics.point_mass import PointMassState
from airrace.environment.atmosphere import g0
from airrace.frames import product, rotation
from airrace.optimal_control.problem import Iterate
from airrace.procedure.attitudes import align_quaternions
from airrace.procedure.cruise import Cruise
from airrace.procedure.plan import Plan, Waypoint
from airrace.procedure.rotation_time import rotation_time, rotation_vector
from airrace.procedure.settings import MeshSettings
from airrace.trajectory import Array

SMOOTHING = 0.25  # s of flight to either side over which the curvature is averaged
GATE_REACH = 0.15  # s of flight over which the prescribed bank of a gate holds in the guess
COUNT_MAX = 120  # intervals in a phase to begin with; where that is too coarse, the mesh is refined
SHORTEST_LEG = 0.3  # s
COUNT_STEP = 4  # phases of like length share their number of intervals, and so a solver made ready for it

Fractions = tuple[float, ...]
History = PointMassState[Array]


def leg_seconds(plan: Plan) -> list[float]:
    """Planned duration of each leg, s."""
    seconds: list[float] = []
    for leg, (a, b) in zip(plan.legs, itertools.pairwise(plan.waypoints), strict=True):
        turning = rotation_time(a.q, b.q, plan.cruise) if leg.path is None else leg.path.length / plan.cruise.V
        seconds.append(max(turning, SHORTEST_LEG))
    return seconds


def first_mesh(plan: Plan, settings: MeshSettings) -> list[Fractions]:
    """Equal intervals in each phase, about `settings.interval` seconds long."""
    counts = [max(settings.intervals_min, math.ceil(s / settings.interval)) for s in leg_seconds(plan)]
    counts = [min(COUNT_STEP * math.ceil(count / COUNT_STEP), COUNT_MAX) for count in counts]
    return [(1.0 / count,) * count for count in counts]


def guess(plan: Plan, mesh: Sequence[Fractions]) -> Iterate:
    """Histories of the point mass along the plan.

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
    return Iterate(durations, state, _controls(PointMassState[Array].split(state), steps))


def _controls(history: History, steps: Array) -> Array:
    """Rates of the piecewise linear commands; the lever stays at full power. Shape (4, N)."""
    rates = [np.diff(values) / steps for values in (history.n_z, history.n_y, history.p_Kbar)]
    return np.vstack([*rates, np.ones_like(steps)])


def _level_history(plan: Plan, index: int, share: Array) -> History:
    """Along a Dubins path: coordinated turns at constant speed, height changing evenly."""
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
    """Curvature averaged over `SMOOTHING` to either side, across the neighbouring legs where they are level, too."""
    reach = SMOOTHING * plan.cruise.V
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


def _bank_at_gates(bank: Array, s: Array, length: float, a: Waypoint, b: Waypoint, pace: Cruise) -> Array:
    """The prescribed banks at both ends, blended into the bank of the turn."""
    for waypoint, distance in ((a, s), (b, length - s)):
        if waypoint.bank is not None:
            weight = np.exp(-((distance / (GATE_REACH * pace.V)) ** 2))
            bank = bank + weight * (waypoint.bank - bank)
    return bank


def _turning_history(plan: Plan, index: int, share: Array) -> History:
    """From one attitude to the next by the shortest rotation at constant rates; starts at the origin."""
    a, b, pace = plan.waypoints[index], plan.waypoints[index + 1], plan.cruise
    duration = leg_seconds(plan)[index]
    roll, pitch, _ = (angle / duration for angle in rotation_vector(a.q, b.q))
    q = np.array([rotated(a.q, b.q, float(part)) for part in share]).T
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


def rotated(start: Sequence[float], end: Sequence[float], part: float) -> list[float]:
    """The attitude after a part of the rotation from start to end."""
    vector = [part * angle for angle in rotation_vector(start, end)]
    angle = math.sqrt(sum(one * one for one in vector))
    factor = math.sin(angle / 2) / angle if angle > 1e-12 else 0.5
    return product(start, [math.cos(angle / 2), *(factor * one for one in vector)])


def _join_positions(plan: Plan, histories: list[History]) -> None:
    """Put the turning legs one behind the other and shear them so that they end at the next known position."""
    index = 0
    while index < len(histories):
        if plan.legs[index].path is not None:
            index += 1
            continue
        last = index
        while last < len(histories) and plan.legs[last].path is None:
            last += 1
        _place_chain(plan.waypoints[index], plan.waypoints[last], histories[index:last])
        index = last


def _place_chain(start: Waypoint, end: Waypoint, chain: Sequence[History]) -> None:
    """Move the histories of a chain, in place: each begins where the one before ends, the last ends at `end`."""
    at = np.array([0.0, 0.0, -50.0]) if start.position is None else _down(start.position)
    steps = sum(len(history.x) - 1 for history in chain)
    travelled = sum((np.array([h.x[-1], h.y[-1], h.z[-1]]) for h in chain), start=at)
    gap = np.zeros(3) if end.position is None else _down(end.position) - travelled
    done = 0
    for history in chain:
        part = (done + np.arange(len(history.x))) / steps
        moved = [
            values + origin + miss * part for values, origin, miss in zip(_position(history), at, gap, strict=True)
        ]
        at = at + np.array([values[-1] for values in _position(history)])
        for values, new in zip(_position(history), moved, strict=True):
            values[:] = new
        done += len(history.x) - 1


def _position(history: History) -> tuple[Array, Array, Array]:
    return history.x, history.y, history.z


def _down(position: tuple[float, float, float]) -> Array:
    """North, east, down of a position given with its height."""
    return np.array([position[0], position[1], -position[2]])
