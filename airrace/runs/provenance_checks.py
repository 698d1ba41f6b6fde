"""The consistency of what a file tells about the making of a run, which nobody can measure again.

Such records are held against each other and against what can be known; where they agree they are still hearsay.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.fidelity_continuation import wanted_stages
from airrace.procedure.result import NoteKind, SearchReport, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.stage import STAGES, Stage

ROUNDED = 1e-9
"""The largest difference between two sums of the same numbers, as a fraction."""


def missing_stages(settings: Settings, results: Sequence[StageResult]) -> str:
    """Return a clause that names the stages below the last one that are not stored; empty where none is missing.

    A run that was started from another one has none below its first.
    """
    if not results:
        return ""
    stored, first = [one.stage for one in results], results[0]
    wanted = wanted_stages(settings, results[-1].stage)
    if first.provenance.source_run:
        wanted = wanted[wanted.index(first.stage) :] if first.stage in wanted else wanted
    missing = ", ".join(stage.value for stage in wanted if stage not in stored)
    return f"what it was started from is missing: {missing}" if missing else ""


def other_versions(stored: Mapping[str, str], running: Mapping[str, str]) -> str:
    """Return a clause on versions that cannot be confirmed, since others are running; empty where all agree."""
    differ = [
        f"{name} {stored.get(name, 'unknown')} (here {running.get(name, 'unknown')})"
        for name in dict.fromkeys((*running, *stored))
        if stored.get(name) != running.get(name)
    ]
    return f"it is said to be made with {', '.join(differ)}" if differ else ""


def contradictions(result: StageResult) -> Iterator[str]:
    """Yield a clause for every record of the making of a stage that contradicts another one, or that airrace never
    writes.
    """
    yield from _start(result)
    yield from _message(result)
    yield from _seconds(result)
    yield from _ways(result.search)
    for alternative in result.alternatives:
        if not alternative.holds or alternative.trajectory.race_time < result.trajectory.race_time:
            yield "an alternative does not hold, or is the faster one"


def _start(result: StageResult) -> Iterator[str]:
    provenance, stage = result.provenance, result.stage
    led = fidelity_of(stage).inner_controller is not None
    below = {Stage.POINT_MASS.value, STAGES[STAGES.index(stage) - 1].value} if led else {""}
    names = [one.value for one in STAGES]
    source = provenance.source_stage
    above = source not in names or names.index(source) > names.index(stage.value)
    if above if provenance.source_run else source not in below:
        yield f"no {stage.value} is started from {provenance.source!r}"
    numbers = (provenance.tracking_error, provenance.tracking_error_time, provenance.terminal_miss)
    if not all(math.isfinite(one) and one >= 0.0 for one in numbers) or (not led and any(numbers)):
        yield "the tracking error of the start is not possible"


def _message(result: StageResult) -> Iterator[str]:
    guess = fidelity_of(result.stage).guess
    if result.is_flight and result.suggested_changes:
        yield "a stage with a flight has no conflicts of limits"
    possible = {
        NoteKind.START: True,
        NoteKind.PLANNED_PHASES: guess,
        NoteKind.MESH_CHECK: result.holds and not result.certified,
    }
    strange = [note.text for note in result.notes if not possible[note.kind]]
    if result.message and (result.holds or guess):
        strange.append(result.message)
    for text in strange:
        yield f"airrace says nothing like {text!r} of such a stage"


def _seconds(result: StageResult) -> Iterator[str]:
    timings, attempts = result.timings, result.attempts
    spent = sum(attempt.seconds for attempt in attempts)
    numbers = (timings.solve, timings.derivatives, timings.wall, *(attempt.seconds for attempt in attempts))
    if not all(math.isfinite(one) and one >= 0.0 for one in numbers):
        yield "its timings are not possible"
    elif abs(timings.solve - spent) > ROUNDED * max(1.0, spent):
        yield f"solving took {timings.solve:.6g} s, and its attempts {spent:.6g} s"
    if any(attempt.iterations < 0 for attempt in attempts) or not attempts:
        yield "its attempts are not possible"


def _ways(explored: SearchReport) -> Iterator[str]:
    counts = (explored.led, explored.elsewhere, explored.lost, explored.seconds)
    if not all(math.isfinite(one) and one >= 0 for one in counts):
        yield "exploring went in a way that is not possible"
    if not explored.ways:
        return
    best = explored.ways[0].race_time
    differences = [way.race_time - way.difference - best for way in explored.ways]
    if not all(abs(one) <= ROUNDED * max(1.0, best) for one in differences):
        yield "the routes that were tried differ from the best by other times than are told"
    later = [way.difference for way in explored.ways[1:]]
    if any(after < before for before, after in itertools.pairwise(later)):
        yield "the routes that were tried are out of order"
