"""`airrace resume`: go on where a run ended, or fly it again with something changed."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import AircraftFile, AsJson, LastStage, Overrides, Quiet, RunFile, SettingsFile, Threads
from airrace.runs.answer import Answer, unflown

if TYPE_CHECKING:
    from airrace.runs.continuation import Step


def resume(
    run_file: RunFile,
    until: LastStage = None,
    from_stage: Annotated[
        str | None, typer.Option("--from", metavar="STAGE", help="Compute this stage and all after it again.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would run, and why.")] = False,
    overrides: Overrides = None,
    track: Annotated[
        Path | None,
        typer.Option(
            metavar="TRACK", readable=False, help="Fly this track instead of the stored one: a file or a name."
        ),
    ] = None,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="NEW.h5", help="Checkpoint of the changed run; needed with --set, --track and the like."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing NEW.h5.")] = False,
    threads: Threads = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Continue a run, or change it.

    It goes on after the last stage that still stands, in the same file. With --set, --track, --aircraft or --settings
    the changed run is started from the highest certified stage of this one and written to --out; this file stays as it
    is.
    """
    with answering(unflown(None), as_json=as_json) as answer:
        from airrace.optimal_control.spawn import start_early

        if not dry_run:
            start_early()
        from airrace.checkpoint import read_checkpoint
        from airrace.cli.running import fly
        from airrace.runs.continuation import continuation, starting_steps
        from airrace.runs.run import stored_run
        from airrace.runs.stage_names import stage_named
        from airrace.runs.starting import Changes, another, changed_run, ensure_sensible, last_stage, other_run

        changes = Changes(track, aircraft, settings, tuple(overrides or ()))
        ensure_sensible(changes, run_file, out, force=force, from_stage=from_stage)
        kept, start = (), None
        if out is not None:
            before = other_run(run_file)
            last = last_stage(before) if until is None else stage_named(until)
            run = changed_run(before, changes, out)
            start = another(before, run, last)
            steps = starting_steps(start, last)
        else:
            run, last = stored_run(read_checkpoint(run_file), run_file), stage_named(until)
            again = None if from_stage is None else stage_named(from_stage)
            plan = continuation(run, until=last, from_stage=again)
            kept, steps = plan.kept, plan.steps
        if dry_run:
            _tell(answer, run.name, steps, quiet=quiet)
            return
        fly(answer, run, finished=kept, until=last, threads=threads, quiet=quiet, start=start)


def _tell(answer: Answer, track: str, steps: "Sequence[Step]", *, quiet: bool) -> None:
    """Say what would run."""
    from airrace.runs.continuation import described

    answer.fields = {"track": track, "steps": [step.as_object() for step in steps]}
    answer.texts.extend(() if quiet else ["\n".join(described(steps))])
