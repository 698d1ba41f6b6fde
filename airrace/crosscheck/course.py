"""An optimum flown by JSBSim, which is put back onto it at every full second and left to the controls alone in between.

Between the nodes deflections are linear, and the lever follows its command:
`delta_T_dot = (delta_T_cmd - delta_T) / tau_T`.

What is left is mostly JSBSim's rate of alpha, which lags by one step: in a hard pull-up 8 mm after a second, half of
that with half the step, and 0.5 mm for an aircraft without `C_malphadot`.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from airrace.crosscheck.flown import STEP, Flown, body_attitude
from airrace.dynamics.inner_loop_controls import SurfaceControl
from airrace.dynamics.six_dof import SixDofState
from airrace.records import record
from airrace.trajectory import Array, Trajectory

PIECE = 1.0
"""The time for which JSBSim flies without being put back onto the optimum, s."""


@record
class Miss:
    """The distance from the optimum at which a piece of a flight by JSBSim ends.

    Attributes:
        start, end: the ends of the piece, s from the start of the race.
        distance: the distance between the positions at its end, m.
        angle: the angle between the attitudes of the body there, rad.
    """

    start: float
    end: float
    distance: float
    angle: float


def fly_course(
    flown: Flown, optimum: Trajectory, at: Callable[[Array], Mapping[str, Array]], tau_T: float
) -> tuple[Miss, ...]:
    """Fly every piece of the optimum by JSBSim with the optimum's controls; the last piece may be shorter.

    Args:
        flown: the aircraft in the air of the day.
        optimum: an optimum of the six-dof model, in still air.
        at: states of the optimum at any times (s, shape (n,)), by name.
        tau_T: the time constant of the lever, s.
    """
    steps = round(PIECE / STEP)
    last = math.floor(optimum.race_time / STEP + 1e-6)  # a race of whole steps is flown to its end
    first = np.arange(0, last, steps)
    ends = np.minimum(first + steps, last)
    starts, goals = (_states(at(count.astype(np.float64) * STEP)) for count in (first, ends))
    misses: list[Miss] = []
    for start, goal, begin, end in zip(starts, goals, first.tolist(), ends.tolist(), strict=True):
        flown.start(start)
        below = np.array([start.x, start.y, 0.0])
        for moved in _controls(optimum, np.arange(begin + 1.0, end + 1.0) * STEP, tau_T):
            flown.control(moved)
            flown.advance()
        distance = np.linalg.norm(below + flown.position() - np.array([goal.x, goal.y, goal.z]))
        angle = _angle(flown.attitude(), body_attitude(goal))
        misses.append(Miss(begin * STEP, end * STEP, float(distance), angle))
    return tuple(misses)


def _states(histories: Mapping[str, Array]) -> list[SixDofState[float]]:
    rows = [histories[name].tolist() for name in SixDofState.names()]
    return [SixDofState[float].split(column) for column in zip(*rows, strict=True)]


def _controls(optimum: Trajectory, times: Array, tau_T: float) -> list[dict[str, float]]:
    """Return deflections (rad) and lever at given times."""
    interval = np.clip(np.searchsorted(optimum.time, times, side="right") - 1, 0, len(optimum.time) - 2)
    since = times - optimum.time[interval]
    histories = {
        rate.rate_of: optimum.of(rate.rate_of)[interval] + optimum.of(rate.name)[interval] * since
        for rate in SurfaceControl.quantities()
        if rate.rate_of
    }
    commanded = optimum.of("delta_T_cmd")[interval]
    histories["delta_T"] = commanded + (optimum.of("delta_T")[interval] - commanded) * np.exp(-since / tau_T)
    rows = zip(*(values.tolist() for values in histories.values()), strict=True)
    return [dict(zip(histories, row, strict=True)) for row in rows]


def _angle(R_1: Array, R_2: Array) -> float:
    """Return the angle of the rotation from one attitude to the other, rad.

    It follows from `|R_1 - R_2| = 2 sqrt(2) sin(angle / 2)`.
    """
    return float(2.0 * np.arcsin(min(1.0, np.linalg.norm(R_1 - R_2) / np.sqrt(8.0))))
