"""The texts `export csv` writes."""

import io

from airrace.checkpoint import Checkpoint
from airrace.errors import UsageError
from airrace.export import Provenance, export_csv, export_splits_csv
from airrace.procedure import run as procedure
from airrace.procedure.result import StageResult
from airrace.runs.run import Run


def stored_result(checkpoint: Checkpoint, name: str | None) -> StageResult:
    """The stage a user names, the last stored one by default.

    Raises:
        UsageError: it is not in the checkpoint.
    """
    stored = {stage.result.stage.value: stage.result for stage in checkpoint.stages}
    if not stored:
        raise UsageError("no stage of this run is finished yet")
    if name is None:
        return list(stored.values())[-1]
    if name not in stored:
        raise UsageError(f"this run has no stage {name!r}; it has: {', '.join(stored)}")
    return stored[name]


def flight_text(run: Run, result: StageResult, rate: float | None) -> str:
    """The flight on its mesh, or at a fixed rate integrated between the nodes."""
    race = run.inputs.race
    text = io.StringIO(newline="")
    export_csv(
        result,
        text,
        rate_hz=rate,
        derived=procedure.derived_quantities(race, run.inputs.settings, result),
        sampler=None if rate is None else procedure.sampler(race, run.inputs.settings, result),
        provenance=Provenance(race.course.name, race.aircraft.name, run.checkpoint.versions.get("airrace", "unknown")),
    )
    return text.getvalue()


def splits_text(result: StageResult) -> str:
    """The gate splits."""
    text = io.StringIO(newline="")
    export_splits_csv(result, text)
    return text.getvalue()
