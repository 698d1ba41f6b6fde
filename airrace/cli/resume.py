"""The command `airrace resume`: it continues a run where it ended, or flies it again with something changed."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering
from airrace.cli.options import (
    AircraftFile,
    AsJson,
    LastStage,
    Overrides,
    Quiet,
    RunFile,
    SettingsFile,
    SigningKey,
    Threads,
    Timeout,
    WhatIsProved,
)
from airrace.runs.answer import Answer, unflown

if TYPE_CHECKING:
    from airrace.runs.starting import Changes
    from airrace.runs.task import Step


def resume(
    run_file: RunFile,
    until: LastStage = None,
    from_stage: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="STAGE",
            autocompletion=completion.stages,
            help="Compute this stage and all after it again.",
        ),
    ] = None,
    proof: WhatIsProved = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would run, and why.")] = False,
    overrides: Overrides = None,
    track: Annotated[
        Path | None,
        typer.Option(
            metavar="TRACK",
            readable=False,
            autocompletion=completion.tracks,
            help="Fly this track instead of the stored one: a file or a name.",
        ),
    ] = None,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="NEW.h5", help="Checkpoint of the changed run; needed with --set, --track and the like."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing NEW.h5.")] = False,
    sign: SigningKey = None,
    threads: Threads = None,
    timeout: Timeout = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Continue a run, or change it.

    It goes on after the last stage that still stands, in the same file. With --proof all the proof of stages that were
    solved on one mesh is completed first. With --set, --track, --aircraft or --settings the changed run is started from
    the highest stage of this one that holds and written to --out; this file stays as it is.
    """
    with answering(unflown(None), as_json=as_json) as answer:
        from airrace.optimal_control.spawn import start_early
        from airrace.process import available_cores

        threads = threads or available_cores()
        if not dry_run:
            start_early()
        from airrace.cli.running import fly
        from airrace.runs.beginning import settings_texts
        from airrace.runs.resuming import changed_task, continued_task
        from airrace.runs.signing import ensure_own, signer_of
        from airrace.runs.starting import Changes, other_run
        from airrace.runs.stored import opened_run

        signer = None if sign is None else signer_of(sign)
        changes = Changes(track, aircraft, settings, tuple(overrides or ()))
        _ensure_sensible(changes, run_file, out, force=force, from_stage=from_stage)
        if out is not None:
            changes = changes.with_overrides(settings_texts(proof=proof))
            task = changed_task(other_run(run_file), changes, until=until, out=out)
        else:
            ensure_own(run_file, signer)
            task = continued_task(opened_run(run_file), until=until, from_stage=from_stage, proof=proof)
        if dry_run:
            _tell(answer, task.run.name, task.steps, quiet=quiet)
            return
        fly(answer, task.signed(signer), threads=threads, timeout=timeout, quiet=quiet)


def _ensure_sensible(changes: "Changes", run: Path, out: Path | None, *, force: bool, from_stage: str | None) -> None:
    """Refuse options that do not go together.

    Raises:
        UsageError: changes without a file for the changed run, or such a file without changes; a stage to compute
            again in a run that is started from another one; a file that exists or is the run itself.
        StorageError: the folder of the new file does not exist or takes no files.
    """
    from airrace.errors import UsageError
    from airrace.runs.output import ensure_free
    from airrace.runs.starting import ensure_other_file

    if not changes:
        if out is not None or force:
            raise UsageError("--out and --force belong to a changed run: say with --set, --track, ... what changes")
        return
    if out is None:
        raise UsageError(f"{run} stays as it is: name the checkpoint of the changed run with --out NEW.h5")
    if from_stage is not None:
        raise UsageError("--from goes on in the same run; a changed run starts from the highest stage up to --until")
    ensure_other_file(run, out)
    ensure_free(out, force=force)


def _tell(answer: Answer, track: str, steps: "Sequence[Step]", *, quiet: bool) -> None:
    """Fill in the answer with what would run."""
    from airrace.runs.task import described

    answer.fields = {"track": track, "steps": [step.as_object() for step in steps]}
    answer.texts.extend(() if quiet else ["\n".join(described(steps))])
