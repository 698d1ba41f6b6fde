"""Other attitudes of a flight: its rolls from one side to the other, each the other way, and its turns, tilted.

A roll leads through level or through inverted flight, a full turn about the velocity apart. Where an aircraft pulls
down, banked beyond the vertical, it can do so on either side. What is pushed can be pulled, half a roll away. Each
choice is a local optimum of its own.

Turns are tilted about the straight line between their ends: slanted at first, over the top when upright.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.model.dynamics.point_mass import PointMassControl, PointMassState
from airrace.model.environment import g0
from airrace.model.frames import QUATERNION, product, quaternion, rotation
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import interval_durations
from airrace.optimal_control.trajectory import Array
from airrace.procedure.guess import QUATERNION_ROWS, align_quaternions

BANKED = math.sin(math.radians(30.0))
"""Sine of the bank from which on a flight is banked to a side (1)."""
PULLS_DOWN = math.cos(math.radians(105.0))
"""Cosine of the bank beyond which an aircraft pulls down (1). In hard level turns it is banked by up to 104 deg."""
PULL_DOWN_MAX = 2.5
"""Longest time for which an aircraft that could do so on either side pulls down, s; else it turns meanwhile."""
ROLL_MAX = 2.0
"""Longest roll that is reversed, s; through level flight it may be a weave, which needs no roll."""
BLEND = 0.4
"""Time in which a guess changes sides before and after a pull-down or a push, s."""
PUSH, PUSH_MIN = -0.5, 0.4
"""Load factor (1) that is reached under negative load factors that are pulled instead, and their shortest time, s."""
REACH, PUSH_REACH = 3.5, 10.0
"""Time before and after a roll, or a push, that a window holds, s. Pulled, a Half Cuban Eight is 16 ms faster and 9 m
lower throughout; with 7 s its window leads back to the push."""
ROLL_RATE_ROW = PointMassState.names().index("p_Kbar")
LOAD_FACTOR_ROW = PointMassState.names().index("n_z")


@dataclass(frozen=True)
class Reversal:
    """A roll from one side to the other.

    Attributes:
        first: the last node that is banked to the one side.
        last: the first node that is banked to the other.
        angle: rolled between them, rad, positive to the right.
        inverted: whether the aircraft is upside down on the way.
    """

    first: int
    last: int
    angle: float
    inverted: bool

    def describe(self) -> str:
        """Return the roll in words."""
        side, way = "right" if self.angle > 0.0 else "left", "inverted" if self.inverted else "level"
        return f"rolling {side} through {way}"


@dataclass(frozen=True)
class Reroll:
    """A flight with one roll the other way, or one pull or push otherwise.

    `first` and `last` are the nodes between which it differs, `reach` is what a window holds before and after, s.
    """

    first: int
    last: int
    kind: str
    flight: Iterate
    reach: float


def rerolls(problem: Problem, iterate: Iterate) -> Iterator[Reroll]:
    """Yield a flight with each of its rolls the other way, each pull and push otherwise, in the order of the nodes."""
    variants = [*_other_ways(problem, iterate), *_other_sides(problem, iterate), *_pulled(problem, iterate)]
    yield from sorted(variants, key=lambda reroll: (reroll.first, reroll.last))


def reversals(q: Array) -> list[Reversal]:
    """Return the rolls from one side to the other in a history of attitudes (4, n), in order."""
    right, bank = rotation(list(q))[2][1], _bank(q)
    banked = np.flatnonzero(np.abs(right) > BANKED).tolist()
    return [
        Reversal(a, b, angle := float(bank[b] - bank[a]), (angle > 0.0) != bool(right[b] > 0.0))
        for a, b in itertools.pairwise(banked)
        if right[a] * right[b] < 0.0
    ]


def _other_ways(problem: Problem, iterate: Iterate) -> Iterator[Reroll]:
    """Yield each roll from side to side through inverted instead of level flight, or the other way round."""
    time = _time(problem, iterate)
    fastest = problem.system.states[ROLL_RATE_ROW].upper
    for reversal in reversals(iterate.state[QUATERNION_ROWS]):
        turn, first, last = -math.copysign(math.tau, reversal.angle), reversal.first, reversal.last
        if time[last] - time[first] > ROLL_MAX:
            continue
        while time[last] - time[first] < abs(reversal.angle + turn) / fastest and (first > 0 or last < len(time) - 1):
            first, last = max(0, first - 1), min(len(time) - 1, last + 1)
        share = np.clip((time - time[first]) / (time[last] - time[first]), 0.0, 1.0)
        added = turn * share**2 * (3.0 - 2.0 * share)
        kind = f"roll through {'level' if reversal.inverted else 'inverted'}"
        yield Reroll(reversal.first, reversal.last, kind, _roll_over(problem, iterate, added), REACH)


def _other_sides(problem: Problem, iterate: Iterate) -> Iterator[Reroll]:
    """Yield each short pull down banked to the other side."""
    time, q = _time(problem, iterate), iterate.state[QUATERNION_ROWS]
    R, bank = rotation(list(q)), _bank(q)
    inverted = {node for reversal in reversals(q) if reversal.inverted for node in (reversal.first, reversal.last)}
    for first, last in _runs((R[2][2] < 0.0) & (np.abs(R[2][1]) > BANKED)):
        if first == last or inverted.intersection(range(first, last + 1)):
            continue
        if R[2][2][first : last + 1].min() > PULLS_DOWN or time[last] - time[first] > PULL_DOWN_MAX:
            continue
        away = np.maximum(np.maximum(time[first] - time, time - time[last]), 0.0)
        nearest = math.remainder(float(bank[(first + last) // 2]), math.tau) - bank[(first + last) // 2]
        added = -2.0 * (bank + nearest) * np.clip(1.0 - away / BLEND, 0.0, 1.0)
        yield Reroll(first, last, "pull on the other side", _roll_over(problem, iterate, added), REACH)


def pushes(time: Array, load: Array) -> list[tuple[int, int]]:
    """Return the first and the last node of each push: a stretch under negative load factors that is long and hard.

    Args:
        time: of the nodes, s; shape (n,).
        load: factor, shape (n,).
    """
    return [
        (first, last)
        for first, last in _runs(load < 0.0)
        if time[last] - time[first] >= PUSH_MIN and load[first : last + 1].min() <= PUSH
    ]


def _pulled(problem: Problem, iterate: Iterate) -> Iterator[Reroll]:
    """Yield each stretch that is pushed, under negative load factors, pulled half a roll away with the same lift."""
    time, load, bank = _time(problem, iterate), iterate.state[LOAD_FACTOR_ROW], _bank(iterate.state[QUATERNION_ROWS])
    for first, last in pushes(time, load):
        shares = np.clip((time - time[[[first], [last]]]) / BLEND, -1.0, 1.0)
        around = (np.flatnonzero(np.abs(share) < 1.0) for share in shares)
        rolled = [float(bank[nodes[-1]] - bank[nodes[0]]) for nodes in around]
        # Where it rolls it stops doing so; where it does not, it rolls back the way it comes, at first through level.
        into, out = (-math.copysign(1.0, angle) if abs(angle) > 0.5 * math.pi else 0.0 for angle in rolled)
        if not (into or out):
            into = -math.copysign(1.0, math.remainder(float(bank[first]), math.tau))
        signs = np.array([into or -out, out or -into])
        added = 0.5 * math.pi * signs @ (1.0 + np.sin(0.5 * math.pi * shares))
        variant = _roll_over(problem, iterate, added)
        variant.state[LOAD_FACTOR_ROW, first : last + 1] *= -1.0
        yield Reroll(first, last, "pull instead of push", variant, PUSH_REACH)


def _roll_over(problem: Problem, iterate: Iterate, added: Array) -> Iterate:
    """Return a flight rolled further by an angle (rad) at each node."""
    fastest, time = problem.system.states[ROLL_RATE_ROW].upper, _time(problem, iterate)
    state, control, half = iterate.state.copy(), iterate.control.copy(), 0.5 * added
    turned = [np.cos(half), np.sin(half), np.zeros_like(half), np.zeros_like(half)]
    state[QUATERNION_ROWS] = np.array(product(list(state[QUATERNION_ROWS]), turned))
    state[ROLL_RATE_ROW] = np.clip(state[ROLL_RATE_ROW] + np.gradient(added, time), -fastest, fastest)
    names = [control.rate_of for control in problem.system.controls]
    control[names.index(PointMassState.names()[ROLL_RATE_ROW])] = np.diff(state[ROLL_RATE_ROW]) / np.diff(time)
    return Iterate(iterate.durations, state, control)


def _bank(q: Array) -> Array:
    """Return the bank along a history of attitudes, without jumps, rad."""
    R = rotation(list(q))
    return np.unwrap(np.arctan2(R[2][1], R[2][2]))


def _time(problem: Problem, iterate: Iterate) -> Array:
    return np.concatenate([[0.0], np.cumsum(interval_durations(problem, iterate.durations))])


def _runs(holds: NDArray[np.bool_]) -> Sequence[tuple[int, int]]:
    """Return the first and the last of all nodes in a row at which something holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]])))
    return [(int(first), int(behind) - 1) for first, behind in edges.reshape(-1, 2)]


GUESS_ROLL_RATE_MAX = 2.0
"""The largest roll rate in the guess, rad/s; where a path is almost straight its bank jumps."""


def tilt_turn(pieces: Sequence[Iterate], angle: float) -> list[Iterate]:
    """Return a level turn in pieces, tilted by an angle (rad), at its own speed.

    The deviation from the line between the ends is raised; attitude, load factor and roll rate are those with which the
    path is free of sideslip.
    """
    rows = PointMassState.names()
    seconds = [float(piece.durations[0]) for piece in pieces]
    times = [
        np.linspace(0.0, T, piece.control.shape[1] + 1) + before
        for T, piece, before in zip(seconds, pieces, np.cumsum([0.0, *seconds[:-1]]), strict=True)
    ]
    state = np.hstack([pieces[0].state, *(piece.state[:, 1:] for piece in pieces[1:])])
    time = np.concatenate([times[0], *(piece_time[1:] for piece_time in times[1:])])
    _tilt(state[:3], angle)
    _set_attitude(state, time, rows)
    ends = np.cumsum([0, *(piece.control.shape[1] for piece in pieces)])
    tilted: list[Iterate] = []
    for piece, first, last in zip(pieces, ends, ends[1:], strict=False):
        x, steps = state[:, first : last + 1], np.diff(time[first : last + 1])
        control = piece.control.copy()
        for row, quantity in enumerate(PointMassControl.quantities()):
            if quantity.rate_of:
                control[row] = np.diff(x[rows.index(quantity.rate_of)]) / steps
        tilted.append(Iterate(piece.durations, x, control))
    return tilted


def _tilt(r: Array, angle: float) -> None:
    """Tilt positions (3, n), north, east, down, in place."""
    along = r[:2, -1] - r[:2, 0]
    if np.linalg.norm(along) < 30.0:  # m, below which a chord has no direction to speak of
        along = r[:2, 1] - r[:2, 0]
    along = along / np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    offset = across @ (r[:2] - r[:2, :1])
    r[:2] -= np.outer(across, (1.0 - math.cos(angle)) * offset)
    r[2] -= math.sin(angle) * np.abs(offset)


def _set_attitude(state: Array, time: Array, rows: Sequence[str]) -> None:
    """Set attitude, speed, load factor and roll rate along a path, in place."""
    velocity = np.gradient(state[:3], time, axis=1)
    speed = np.linalg.norm(velocity, axis=0)
    ahead = velocity / speed
    force = np.gradient(velocity, time, axis=1) - np.array([[0.0], [0.0], [g0]])
    lift = force - (force * ahead).sum(axis=0) * ahead
    up = lift / np.maximum(np.linalg.norm(lift, axis=0), 1e-6)
    right = np.cross(ahead, up, axis=0)  # down is -up, and right = down x ahead = ahead x up
    banks = [math.atan2(y, -z) for y, z in zip(right[2], up[2], strict=True)]
    q = [
        quaternion(math.atan2(y, x), -math.asin(max(-1.0, min(1.0, float(z)))), bank)
        for (x, y, z), bank in zip(ahead.T, banks, strict=True)
    ]
    for row, history in zip(QUATERNION, np.array(q).T, strict=True):
        state[rows.index(row)] = history
    align_quaternions(state)
    state[rows.index("V_K")] = speed
    state[rows.index("n_z")] = np.linalg.norm(lift, axis=0) / g0
    state[rows.index("p_Kbar")] = np.clip(
        np.gradient(np.unwrap(banks), time), -GUESS_ROLL_RATE_MAX, GUESS_ROLL_RATE_MAX
    )
