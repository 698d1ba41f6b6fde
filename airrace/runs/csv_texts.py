"""The texts `export csv` writes."""

import io

from airrace.export import Provenance, export_csv, export_splits_csv
from airrace.procedure import run as procedure
from airrace.procedure.result import StageResult
from airrace.runs.run import Run


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
