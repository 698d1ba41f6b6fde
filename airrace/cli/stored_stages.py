"""The content of a checkpoint as `airrace show` tells it: its stages, and legs and laps of one of them."""

import logging
from pathlib import Path

from airrace.checkpoint import Checkpoint, inputs_hash, stale_stages
from airrace.errors import InputError, UsageError
from airrace.procedure.result import StageResult
from airrace.records import record
from airrace.results import Flight
from airrace.runs.json_objects import legs_object, run_object, stage_object
from airrace.runs.run import Run, ensure_readable, run_of_checkpoint
from airrace.runs.stage_view import downgrade_stale, is_certified
from airrace.views.plain_text import one_line

logger = logging.getLogger(__name__)


@record
class StoredStages:
    """Stages to be shown.

    Attributes:
        checkpoint: that holds them.
        every: all stages of the run as they may be told: those that no longer stand are not certified.
        results: the stages that are shown, in their order.
        flight: that of the stage that was asked for, by default of the last one that found a flight; None where there
            is none, or where this version of airrace does not accept the stored inputs.
        stage: the name of the stage that the flight belongs to; empty without one.
    """

    checkpoint: Checkpoint
    every: tuple[StageResult, ...]
    results: tuple[StageResult, ...]
    flight: Flight | None
    stage: str


def stored_stages(checkpoint: Checkpoint, path: Path, stage: str | None) -> StoredStages:
    """Choose what is shown.

    Args:
        checkpoint: read from a file.
        path: of that file.
        stage: the name of the only stage that is shown; None for all.

    Raises:
        UsageError: the run has no such stage.
    """
    run, refusal = _understood(checkpoint, path)
    every = results = _standing(checkpoint) if run is None else run.told
    if stage is not None:
        names = ", ".join(result.stage.value for result in results) or "none"
        results = tuple(result for result in results if result.stage.value == stage)
        if not results:
            raise UsageError(f"this run has no stage {stage!r}; it has: {names}")
    flown = next((result for result in reversed(results) if result.is_flight), None)
    if flown is None:
        return StoredStages(checkpoint, every, results, None, "")
    if run is None:
        logger.warning("legs and laps are left out: this version of airrace refuses the inputs: %s", refusal)
        return StoredStages(checkpoint, every, results, None, "")
    name = flown.stage.value
    return StoredStages(checkpoint, every, results, run.flight(name), name)


def _understood(checkpoint: Checkpoint, path: Path) -> tuple[Run | None, str]:
    """Return the run; None, and why, where this version of airrace does not accept its inputs."""
    try:
        return ensure_readable(run_of_checkpoint(checkpoint, path)), ""
    except InputError as error:
        return None, str(error.findings[0])


def _standing(checkpoint: Checkpoint) -> tuple[StageResult, ...]:
    """Return the stages of a run whose inputs are not understood; they may stand on these inputs as they are stored."""
    stale = dict(stale_stages(checkpoint, inputs_hash(checkpoint.inputs.resolved)))
    results = (stored.result for stored in checkpoint.stages)
    return tuple(downgrade_stale(result, stale.get(result.stage, "")) for result in results)


def stored_stages_object(shown: StoredStages) -> dict[str, object]:
    """Return the object of the run, with `legs` and `laps` in the stage whose flight is told.

    `unverified` says that all of it is read from the file and nothing is measured.
    """
    checkpoint, results, every = shown.checkpoint, shown.results, shown.every
    wall = sum(result.timings.wall for result in every)
    track = one_line(Path(checkpoint.inputs.track.path).stem)
    legs = {} if shown.flight is None else {shown.stage: legs_object(shown.flight)}
    stages = [stage_object(result) | legs.get(result.stage.value, {}) for result in results]
    return run_object(track, results, wall, certified=is_certified(every)) | {"stages": stages, "unverified": True}
