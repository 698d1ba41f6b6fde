"""The command `airrace resume`: it continues a run where it ended, or flies it again with something changed."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering
from airrace.cli.options import (
    AircraftFile,
    AsJson,
    DryRun,
    Force,
    LastStage,
    MeshChecked,
    Overrides,
    Quiet,
    RunFile,
    SettingsFile,
    SigningKey,
    Threads,
    Timeout,
    Verbose,
    output_option,
)
from airrace.runs.command_result import empty_result

if TYPE_CHECKING:
    from airrace.runs.plan import Changes


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
    mesh_check: MeshChecked = None,
    dry_run: DryRun = False,
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
    output: Annotated[
        Path | None, output_option("NEW.h5", "Checkpoint of the changed run; needed with --set, --track and the like.")
    ] = None,
    force: Force = False,
    sign: SigningKey = None,
    threads: Threads = None,
    timeout: Timeout = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Continue a run, or change it.

    It goes on after the last stage that still stands, in the same file. With --mesh-check all the mesh check of stages
    that were solved on one mesh comes first. With --set, --track, --aircraft or --settings the changed run is started
    from the highest stage of this one that holds and written to --output; this file stays as it is.
    """
    with answering(empty_result(None), as_json=as_json, verbose=verbose) as answer:
        from airrace.optimal_control.solvers.process.idle_processes import start_early
        from airrace.process import available_cores

        threads = threads or available_cores()
        if not dry_run:
            start_early()
        from airrace.cli.running import describe_task, fly
        from airrace.runs.plan import Changes, changed_task, continued_task, other_run, settings_texts
        from airrace.runs.run import opened_run
        from airrace.runs.signing import ensure_own, signer_of

        signer = None if sign is None else signer_of(sign)
        changes = Changes(track, aircraft, settings, tuple(overrides or ()))
        _ensure_sensible(changes, run_file, output, sign, force=force, from_stage=from_stage)
        if output is not None:
            changes = changes.with_overrides(settings_texts(mesh_check=mesh_check))
            task = changed_task(other_run(run_file), changes, until=until, out=output)
        else:
            ensure_own(run_file, signer)
            task = continued_task(opened_run(run_file), until=until, from_stage=from_stage, mesh_check=mesh_check)
        if dry_run:
            describe_task(answer, task, quiet=quiet)
            return
        fly(answer, task.signed(signer), threads=threads, timeout=timeout, quiet=quiet)


def _ensure_sensible(
    changes: "Changes", run: Path, out: Path | None, sign: Path | None, *, force: bool, from_stage: str | None
) -> None:
    """Refuse options that do not go together.

    Raises:
        UsageError: changes without a file for the changed run, or such a file without changes; a stage to compute
            again in a run that is started from another one; a file that exists or is read.
        StorageError: the folder of the new file does not exist or takes no files.
    """
    from airrace.errors import UsageError
    from airrace.runs.output import NO_PIPE, ensure_free
    from airrace.standard_streams import STANDARD

    if STANDARD in (out, run if out is None else None):
        raise UsageError(NO_PIPE)
    if not changes:
        if out is not None or force:
            raise UsageError("--output and --force belong to a changed run: say with --set, --track, ... what changes")
        return
    if out is None:
        raise UsageError(f"{run} stays as it is: name the checkpoint of the changed run with --output NEW.h5")
    if from_stage is not None:
        raise UsageError("--from goes on in the same run; a changed run starts from the highest stage up to --until")
    ensure_free(out, force=force, sources=[run, changes.track, changes.aircraft, changes.settings, sign])
