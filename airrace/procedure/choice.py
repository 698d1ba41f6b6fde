"""The choice among several flights of one stage: the fastest, or one that is hardly slower and simpler to fly."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.complexity import complexity_of
from airrace.procedure.result import HARDLY_SLOWER, Note, NoteKind, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.stage_problem import StageProblem

SAME_FLIGHT = 2e-4
"""The difference of race times below which two optima from different starts are the same flight, s."""


SAME_STATE = 1e-2
"""The largest difference of states, in their scales, by which two flights are the same one on two meshes."""
NEAR_TIE = 4.0
"""The multiple of the limit of the certificate's `race_time_change` (1) by which race times of flights that were solved
on one mesh each may differ because of their meshes; each may err by about that limit."""


def mesh_resolution(settings: Settings, race_time: float) -> float:
    """Return the difference of race times that two flights solved on one mesh each may owe to their meshes, s."""
    return NEAR_TIE * settings.certificate.change_of(race_time)


def fastest_of(results: Sequence[StageResult]) -> StageResult:
    """Return the fastest of the results that hold; the first if none does."""
    return min(results, key=lambda result: result.trajectory.race_time if result.holds else math.inf)


def index_of(result: StageResult, results: Sequence[StageResult]) -> int:
    """Return the index of the result that has the trajectory of `result`."""
    return next(number for number, candidate in enumerate(results) if candidate.trajectory is result.trajectory)


def simplest_of(stage_problem: StageProblem, results: Sequence[StageResult]) -> StageResult:
    """Return, of the results that hold and are hardly slower than the fastest, the one that is simplest to fly.

    Without one that holds it is the first. One that is not certified never takes the place of one that is.

    Args:
        stage_problem: the problem of their stage.
        results: of one stage.
    """
    fastest = fastest_of(results)
    longest = fastest.trajectory.race_time + HARDLY_SLOWER
    close = [result for result in results if result.holds and result.trajectory.race_time < longest]
    close = [result for result in close if result.certified or not fastest.certified]
    if len(close) < 2:
        return fastest
    return min(
        close, key=lambda result: (complexity_of(stage_problem, result.trajectory).rank, result.trajectory.race_time)
    )


def with_note_on_faster(
    stage_problem: StageProblem, chosen: StageResult, results: Sequence[StageResult]
) -> StageResult:
    """Return the chosen result, with a note on the time that the fastest would save if it is another one."""
    fastest = fastest_of(results)
    saved = chosen.trajectory.race_time - fastest.trajectory.race_time
    if not (chosen.holds and fastest.holds and saved > SAME_FLIGHT):
        return chosen
    harder, simpler = (complexity_of(stage_problem, result.trajectory).describe() for result in (fastest, chosen))
    text = f"a route that saves {1e3 * saved:.1f} ms was left for a simpler one: {simpler}, instead of {harder}"
    return dataclasses.replace(chosen, notes=(*chosen.notes, Note(NoteKind.SIMPLER_ROUTE, text)))


def is_same_flight(first: Trajectory, second: Trajectory) -> bool:
    """Return whether two flights of one course take one time, with the same states at the same shares of all legs."""
    if first.phases != second.phases or abs(first.race_time - second.race_time) > SAME_FLIGHT:
        return False
    axes: list[Array] = []
    for trajectory in (first, second):
        legs = zip(trajectory.first_node, trajectory.first_node[1:], strict=False)
        places = [
            number
            + (trajectory.time[begin : end + 1] - trajectory.time[begin]) / np.ptp(trajectory.time[begin : end + 1])
            for number, (begin, end) in enumerate(legs)
        ]
        axes.append(np.concatenate([place[:-1] for place in places] + [[float(len(places))]]))
    for quantity, row, other_row in zip(first.states, first.state, second.state, strict=True):
        resampled = np.interp(axes[0], axes[1], np.asarray(other_row, np.float64))
        if not np.allclose(resampled, row, rtol=0.0, atol=SAME_STATE * quantity.scale):
            return False
    return True
