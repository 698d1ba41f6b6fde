"""The result of a run: the object printed with `--json` and the exit code that its stages deserve."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from airrace.optimal_control.certificate import Certificate
from airrace.procedure.result import (
    GateSplit,
    Outcome,
    RefinementReason,
    SearchReport,
    StageResult,
    State,
    SuggestedChange,
    Way,
)
from airrace.runs.answer import Answer
from airrace.runs.exit_codes import ExitCode, worst

_CODES = {
    Outcome.SOLVED: ExitCode.DONE,
    Outcome.NOT_CERTIFIED: ExitCode.NOT_CERTIFIED,
    Outcome.NOT_CONVERGED: ExitCode.NOT_CERTIFIED,
    Outcome.INFEASIBLE: ExitCode.INFEASIBLE,
    Outcome.TIMEOUT: ExitCode.TIMEOUT,
}


REASONS: Mapping[RefinementReason, str] = {
    RefinementReason.FIRST: "first mesh",
    RefinementReason.CALM: "calm",
    RefinementReason.INTEGRATION: "replay",
    RefinementReason.LIMITS: "limits",
    RefinementReason.HAMILTONIAN: "hamiltonian",
    RefinementReason.RACE_TIME: "race time",
}
"""The words for the reasons for which intervals of a mesh were last cut or joined."""


def summarise(answer: Answer, track: str, results: Sequence[StageResult], wall: float) -> None:
    """Fill in the object, and fail the answer unless the last stage is certified and all optima before it hold.

    Args:
        track: name of the course.
        results: the stages of the run so far, in order.
        wall: seconds the command took.
    """
    answer.fields.update(run_object(track, results, wall, certified=is_certified(results)))
    code, sentence = verdict(results)
    if code is not ExitCode.DONE:
        answer.fail(code, sentence)


def verdict(results: Sequence[StageResult]) -> tuple[ExitCode, str]:
    """Return how stages end a run: the gravest of their codes, and the sentence of the first stage that has it."""
    codes = _codes(results)
    code = worst(codes)
    if code is ExitCode.DONE:
        return code, ""
    result = results[codes.index(code)]
    return code, f"{result.stage.value}: {_verdict(result)}"


def is_certified(results: Sequence[StageResult]) -> bool:
    """Tell whether a run may call itself certified: its last stage is, and none before it failed.

    Stages before it may be merely solved on one mesh.
    """
    return bool(results) and worst(_codes(results)) is ExitCode.DONE


def run_object(track: str | None, results: Iterable[StageResult], wall: float, *, certified: bool) -> dict[str, object]:
    """Return the object of a run; `race_time_s` is that of its last stage, null if that found no flight."""
    stages = [stage_object(result) for result in results]
    return {
        "track": track,
        "certified": certified,
        "race_time_s": stages[-1]["race_time_s"] if stages else None,
        "wall_s": finite(wall),
        "stages": stages,
    }


def stage_object(result: StageResult) -> dict[str, object]:
    """Return one stage of the object."""
    return {
        "stage": result.stage.value,
        "status": result.outcome.value,
        "state": result.state.value,
        "message": result.remarks,
        "race_time_s": finite(result.trajectory.race_time) if result.is_flight else None,
        "lap_times_s": lap_times(result.splits) if result.is_flight else [],
        "regularisation_s": finite(result.provenance.regularisation),
        "started_from": result.provenance.source or None,
        "tracking_error_m": finite(result.provenance.tracking_error) if result.provenance.source else None,
        "iterations": result.iterations,
        "solve_s": finite(result.timings.solve),
        "derivatives_s": finite(result.timings.derivatives),
        "wall_s": finite(result.timings.wall),
        "certified": result.certified,
        "alternatives": [
            {
                "race_time_s": finite(alternative.trajectory.race_time),
                "state": alternative.state.value,
                "certified": alternative.certified,
            }
            for alternative in result.alternatives
        ],
        "mesh": mesh_object(result),
        "ways": [way_object(way) for way in result.search.ways],
        "search": search_object(result.search) if result.search.ways else None,
        "conflicts": conflict_objects(result.suggested_changes),
        "certificate": None if result.certificate is None else certificate_object(result.certificate),
    }


def standing(result: StageResult, stale: str) -> StageResult:
    """Return a stage as it may be told: one that no longer stands is not certified, and says why.

    Args:
        result: as stored.
        stale: why it no longer stands, a clause; empty where it does.
    """
    if not stale:
        return result
    message = "; ".join(text for text in (f"it no longer stands: {stale}", result.message) if text)
    outcome = Outcome.NOT_CERTIFIED if result.outcome is Outcome.SOLVED else result.outcome
    return replace(result, outcome=outcome, message=message)


def lap_times(splits: Sequence[GateSplit]) -> list[float]:
    """Return the time of every lap, s, by the numbers that the passings' names begin with; empty for one lap."""
    ends = {split.name.partition(":")[0]: split.time for split in splits}  # the last passing of a lap ends it
    times = list(ends.values())
    return [after - before for before, after in itertools.pairwise(times)] if len(times) > 2 else []


def unproved(result: StageResult) -> str:
    """Return the sentence on a stage that was solved on one mesh where a certified one was wanted."""
    return result.remarks or "it is solved, but its race time was not confirmed on a second mesh"


def mesh_object(result: StageResult) -> dict[str, object] | None:
    """Return how the nodes of a mesh are distributed, and why; None if nothing was measured."""
    steps, record = np.diff(result.trajectory.time), result.mesh
    if not len(record.why):
        return None
    counts = np.bincount(record.why, minlength=len(RefinementReason)).tolist()
    return {
        "intervals": len(steps),
        "intervals_of_coarser_mesh": int(record.coarser.sum()) - 1,
        "shortest_s": float(steps.min()),
        "longest_s": float(steps.max()),
        "why": {REASONS[why]: counts[why] for why in RefinementReason},
    }


def way_object(way: Way) -> dict[str, object]:
    """Return the object of a route that was tried; race time and difference are those of a rough mesh."""
    return {
        "way": way.text,
        "race_time_s": finite(way.race_time),
        "difference_s": finite(way.difference),
        "priced": way.priced,
    }


def search_object(explored: SearchReport) -> dict[str, object]:
    """Return how exploring went: of the flights optimised as a whole, how many led to the best, elsewhere, nowhere."""
    return {
        "seconds": finite(explored.seconds),
        "led_to_best": explored.led,
        "led_elsewhere": explored.elsewhere,
        "lost": explored.lost,
        "loops": list(explored.loops),
    }


def certificate_object(certificate: Certificate) -> dict[str, object]:
    """Return the object of a certificate with all its numbers; what could not be measured is null and does not hold."""
    return {
        "solver_status": certificate.solver_status,
        "items": [
            {
                "name": item.name,
                "value": finite(item.value),
                "limit": finite(item.limit),
                "unit": item.unit,
                "holds": bool(item.holds),
                "where": item.where,
            }
            for item in certificate.items
        ],
    }


def conflict_objects(suggested_changes: Sequence[SuggestedChange]) -> list[dict[str, object]]:
    """Return the conflicts of limits for which no flight was found, each with what would resolve it."""
    groups = [list(group) for _, group in itertools.groupby(suggested_changes, key=lambda one: one.conflict)]
    return [
        {
            "where": group[0].where,
            "suggested_changes": [
                {
                    "key": one.key or None,
                    "text": one.text,
                    "unit": one.unit or None,
                    "given": finite(one.given),
                    "needed": finite(one.needed),
                    "race_time_s": finite(one.race_time),
                }
                for one in group
                if one.text
            ],
        }
        for group in groups
    ]


def finite(value: float) -> float | None:
    """Return a number as JSON can hold it: None for NaN and infinity, which JSON does not know."""
    return float(value) if math.isfinite(value) else None


def _codes(results: Sequence[StageResult]) -> list[ExitCode]:
    return [_code(result, last=result is results[-1]) for result in results]


def _code(result: StageResult, *, last: bool) -> ExitCode:
    """Return the exit code that a stage deserves.

    A stage that is a mere guess by design, or was solved on one mesh, is no failure, unless the run ends with it.
    """
    if result.outcome is not Outcome.SOLVED:
        return _CODES[result.outcome]
    if result.certificate is None:
        return ExitCode.NOT_CERTIFIED if last else ExitCode.DONE
    return ExitCode.DONE if result.certified or (result.holds and not last) else ExitCode.NOT_CERTIFIED


def _verdict(result: StageResult) -> str:
    if result.outcome is not Outcome.SOLVED:
        return result.remarks or result.outcome.value
    if result.certificate is None:
        return "the run ends with a guess, which is not certified"
    if result.state is State.SOLVED:
        return unproved(result)
    failed = ", ".join(item.name for item in result.certificate.failed)
    return f"not certified: {failed or 'nothing was measured'}"
