"""What a run came to: the object printed with `--json` and the exit code its stages deserve."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from airrace.optimal_control.certificate import Certificate
from airrace.procedure.result import Explored, GateSplit, Outcome, StageResult, Way, Why
from airrace.runs.answer import Answer
from airrace.runs.exit_codes import ExitCode, worst

_CODES = {
    Outcome.SOLVED: ExitCode.DONE,
    Outcome.NOT_CERTIFIED: ExitCode.NOT_CERTIFIED,
    Outcome.NOT_CONVERGED: ExitCode.NOT_CERTIFIED,
    Outcome.INFEASIBLE: ExitCode.INFEASIBLE,
    Outcome.TIMEOUT: ExitCode.TIMEOUT,
}


REASONS: Mapping[Why, str] = {
    Why.FIRST: "first mesh",
    Why.CALM: "calm",
    Why.INTEGRATION: "replay",
    Why.LIMITS: "limits",
    Why.HAMILTONIAN: "hamiltonian",
    Why.RACE_TIME: "race time",
}
"""What the intervals of a mesh were last cut, or joined, for."""


def summarise(answer: Answer, track: str, results: Sequence[StageResult], wall: float) -> None:
    """Fill in the object, and fail the answer unless the last stage and all certified ones before it hold.

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
    """How stages end a run: the gravest of their codes, and the sentence of the first stage that has it."""
    codes = _codes(results)
    code = worst(codes)
    if code is ExitCode.DONE:
        return code, ""
    result = results[codes.index(code)]
    return code, f"{result.stage.value}: {_verdict(result)}"


def is_certified(results: Sequence[StageResult]) -> bool:
    """Whether a run may call itself certified: its last stage is, and none before it failed."""
    return bool(results) and worst(_codes(results)) is ExitCode.DONE


def run_object(track: str | None, results: Iterable[StageResult], wall: float, *, certified: bool) -> dict[str, object]:
    """The object of a run; `race_time_s` is that of its last stage, null where that found no flight."""
    stages = [stage_object(result) for result in results]
    return {
        "track": track,
        "certified": certified,
        "race_time_s": stages[-1]["race_time_s"] if stages else None,
        "wall_s": finite(wall),
        "stages": stages,
    }


def stage_object(result: StageResult) -> dict[str, object]:
    """One stage of the object."""
    return {
        "stage": result.stage.value,
        "status": result.outcome.value,
        "message": result.message,
        "race_time_s": finite(result.trajectory.race_time) if result.is_flight else None,
        "lap_times_s": lap_times(result.splits) if result.is_flight else [],
        "regularisation_s": finite(result.facts.regularisation),
        "started_from": result.facts.source or None,
        "strayed_m": finite(result.facts.strayed) if result.facts.source else None,
        "iterations": result.iterations,
        "solve_s": finite(result.timings.solve),
        "derivatives_s": finite(result.timings.derivatives),
        "wall_s": finite(result.timings.wall),
        "certified": result.certified,
        "rivals": [
            {"race_time_s": finite(rival.trajectory.race_time), "certified": rival.certified} for rival in result.rivals
        ],
        "mesh": mesh_object(result),
        "ways": [way_object(way) for way in result.explored.ways],
        "explored": explored_object(result.explored) if result.explored.ways else None,
        "certificate": None if result.certificate is None else certificate_object(result.certificate),
    }


def lap_times(splits: Sequence[GateSplit]) -> list[float]:
    """Time of every lap, s, by the numbers that the names of the passings begin with; empty for a race of one lap."""
    ends = {split.name.partition(":")[0]: split.time for split in splits}  # the last passing of a lap ends it
    times = list(ends.values())
    return [after - before for before, after in itertools.pairwise(times)] if len(times) > 2 else []


def mesh_object(result: StageResult) -> dict[str, object] | None:
    """Where the nodes of a mesh went; None where nothing was measured."""
    steps, record = np.diff(result.trajectory.time), result.mesh
    if not len(record.why):
        return None
    counts = np.bincount(record.why, minlength=len(Why)).tolist()
    return {
        "intervals": len(steps),
        "intervals_of_coarser_mesh": int(record.coarser.sum()) - 1,
        "shortest_s": float(steps.min()),
        "longest_s": float(steps.max()),
        "why": {REASONS[why]: counts[why] for why in Why},
    }


def way_object(way: Way) -> dict[str, object]:
    """A way round that was tried; race time and difference are those of a rough mesh."""
    return {
        "way": way.text,
        "race_time_s": finite(way.race_time),
        "difference_s": finite(way.difference),
        "priced": way.priced,
    }


def explored_object(explored: Explored) -> dict[str, object]:
    """How exploring went: of the flights optimised as a whole, how many led to the best, elsewhere, nowhere."""
    return {
        "seconds": finite(explored.seconds),
        "led_to_best": explored.led,
        "led_elsewhere": explored.elsewhere,
        "lost": explored.lost,
        "loops": list(explored.loops),
    }


def certificate_object(certificate: Certificate) -> dict[str, object]:
    """Every number, not only the verdict; what could not be measured is null and does not hold."""
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


def finite(value: float) -> float | None:
    """JSON knows neither NaN nor infinity."""
    return float(value) if math.isfinite(value) else None


def _codes(results: Sequence[StageResult]) -> list[ExitCode]:
    return [_code(result, last=result is results[-1]) for result in results]


def _code(result: StageResult, *, last: bool) -> ExitCode:
    """A stage that is a mere guess by design is no failure, unless the run ends with it: then nothing is certified."""
    if result.outcome is not Outcome.SOLVED:
        return _CODES[result.outcome]
    if result.certificate is None:
        return ExitCode.NOT_CERTIFIED if last else ExitCode.DONE
    return ExitCode.DONE if result.certified else ExitCode.NOT_CERTIFIED


def _verdict(result: StageResult) -> str:
    if result.outcome is not Outcome.SOLVED:
        return result.message or result.outcome.value
    if result.certificate is None:
        return "the run ends with a guess, which is not certified"
    failed = ", ".join(item.name for item in result.certificate.failed)
    return f"not certified: {failed or 'nothing was measured'}"
