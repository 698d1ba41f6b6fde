"""The tilting of turns about the straight line between their ends: slanted at first, over the top when upright."""

import math
from collections.abc import Sequence

import numpy as np

from airrace.dynamics.point_mass import PointMassControl, PointMassState
from airrace.environment.atmosphere import g0
from airrace.frames import quaternion
from airrace.optimal_control.problem import Iterate
from airrace.procedure.phase_segments import align_quaternions
from airrace.trajectory import Array

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
    time = np.concatenate([times[0], *(one[1:] for one in times[1:])])
    _tilt(state[:3], angle)
    _set_attitude(state, time, rows)
    ends = np.cumsum([0, *(piece.control.shape[1] for piece in pieces)])
    found: list[Iterate] = []
    for piece, first, last in zip(pieces, ends, ends[1:], strict=False):
        x, steps = state[:, first : last + 1], np.diff(time[first : last + 1])
        control = piece.control.copy()
        for row, one in enumerate(PointMassControl.quantities()):
            if one.rate_of:
                control[row] = np.diff(x[rows.index(one.rate_of)]) / steps
        found.append(Iterate(piece.durations, x, control))
    return found


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
    for row, history in zip(("q0", "q1", "q2", "q3"), np.array(q).T, strict=True):
        state[rows.index(row)] = history
    align_quaternions(state)
    state[rows.index("V_K")] = speed
    state[rows.index("n_z")] = np.linalg.norm(lift, axis=0) / g0
    state[rows.index("p_Kbar")] = np.clip(
        np.gradient(np.unwrap(banks), time), -GUESS_ROLL_RATE_MAX, GUESS_ROLL_RATE_MAX
    )
