"""Commands that fly: `optimize`, from a track file to a certified flight in a checkpoint, and `resume`."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
    TrackFile,
    Verbose,
    file_option,
    output_option,
    stage_option,
    track_option,
)
from airrace.procedure.settings import GuessKind, SearchEffort
from airrace.runs.command_result import CommandResult, empty_result
from airrace.standard_streams import STANDARD, stem_of

if TYPE_CHECKING:
    from airrace.runs.plan import Changes, ExecutionPlan


def optimize(
    track: TrackFile,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    guess: Annotated[
        GuessKind | None, typer.Option(help="Where the point mass starts from; the settings say homotopy by default.")
    ] = None,
    search: Annotated[
        SearchEffort | None,
        typer.Option(help="How much is tried to find the fastest route; the settings say quick by default."),
    ] = None,
    alternatives: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=20,
            metavar="K",
            help="Take the K best routes through all stages; by default the best, and another that is hardly slower.",
        ),
    ] = None,
    mesh_check: MeshChecked = None,
    until: LastStage = None,
    output: Annotated[
        Path | None, output_option("RUN.h5", "Checkpoint to write; by default TRACK.h5 in the current folder.")
    ] = None,
    force: Force = False,
    start: Annotated[
        Path | None, file_option("OTHER.h5", "Start from this run's optimum of the highest stage that it holds.")
    ] = None,
    overrides: Overrides = None,
    reserve: Annotated[
        float | None,
        typer.Option(
            metavar="P",
            help="Keep margins so that a race in disturbances breaks no limit with this probability, e.g. 0.9.",
        ),
    ] = None,
    sign: SigningKey = None,
    dry_run: DryRun = False,
    threads: Threads = None,
    timeout: Timeout = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Fly a course as fast as can be.

    The flight is optimised stage by stage, and each stage is stored in a checkpoint as soon as it is finished. The last
    one is certified; those before it are solved and checked on one mesh, or certified as well with --mesh-check all.
    """
    with answering(empty_result(stem_of(track)), as_json=as_json, verbose=verbose) as answer:
        from airrace.optimal_control.solvers.process.idle_processes import start_early
        from airrace.process import available_cores

        threads = threads or available_cores()
        if not dry_run:
            start_early(1 if search is SearchEffort.OFF else min(2, threads))  # the other is for what is tried
        from airrace.errors import UsageError
        from airrace.inputs import load_inputs
        from airrace.runs.output import NO_PIPE, ensure_free
        from airrace.runs.plan import chosen_texts, plan_new_run
        from airrace.runs.signing import signer_of

        signer = None if sign is None else signer_of(sign)
        path = output or Path(f"{stem_of(track)}.h5")
        if path == STANDARD:
            raise UsageError(NO_PIPE)
        read = [track, aircraft, settings, start, sign]
        ensure_free(path, force=force, hint=f"continue it with `airrace resume {path}` or ", sources=read)
        chosen = chosen_texts("settings", guess=guess, search=search, alternatives=alternatives, mesh_check=mesh_check)
        chosen = [*(overrides or ()), *chosen, *chosen_texts("rules.reserve", probability=reserve)]
        inputs = load_inputs(track, aircraft=aircraft, settings=settings, overrides=chosen)
        plan = plan_new_run(inputs, until=until, path=path, start=start)
        _fly(answer, plan.signed(signer), threads=threads, timeout=timeout, dry_run=dry_run, quiet=quiet)


def resume(
    run_file: RunFile,
    until: LastStage = None,
    from_stage: Annotated[str | None, stage_option("Compute this stage and all after it again.", "--from")] = None,
    mesh_check: MeshChecked = None,
    dry_run: DryRun = False,
    overrides: Overrides = None,
    track: Annotated[Path | None, track_option("Fly this track instead of the stored one: a file or a name.")] = None,
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
        from airrace.runs.plan import Changes, chosen_texts, open_source_run, plan_changed_run, plan_resumed_run
        from airrace.runs.run import open_run
        from airrace.runs.signing import ensure_own, signer_of

        signer = None if sign is None else signer_of(sign)
        changes = Changes(track, aircraft, settings, tuple(overrides or ()))
        _ensure_sensible(changes, run_file, output, sign, force=force, from_stage=from_stage)
        if output is not None:
            changes = changes.with_overrides(chosen_texts("settings", mesh_check=mesh_check))
            plan = plan_changed_run(open_source_run(run_file), changes, until=until, path=output)
        else:
            ensure_own(run_file, signer)
            plan = plan_resumed_run(open_run(run_file), until=until, from_stage=from_stage, mesh_check=mesh_check)
        _fly(answer, plan.signed(signer), threads=threads, timeout=timeout, dry_run=dry_run, quiet=quiet)


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


def _fly(
    answer: CommandResult, plan: "ExecutionPlan", *, threads: int, timeout: float | None, dry_run: bool, quiet: bool
) -> None:
    """Fly a plan, watched on stderr, and fill in the answer with its tables; or only say what would run."""
    from airrace.runs.command_result import ExitCode
    from airrace.runs.execute import execute_for_command
    from airrace.runs.plan import PlannedStage
    from airrace.views.progress_view import watching

    if dry_run:
        steps = plan.steps or [PlannedStage(stage, "it is not finished") for stage in plan.stages]
        answer.fields = {"track": plan.run.name, "steps": [step.as_object() for step in steps]}
        answer.texts.extend(() if quiet else ["\n".join(map(str, steps))])
        return
    with watching(plan.run.race.course.name, plan.stages, quiet=quiet) as progress:
        run, results, reserve = execute_for_command(answer, plan, threads=threads, timeout=timeout, progress=progress)
    if results and answer.code is not ExitCode.INTERRUPTED and not quiet:
        from airrace.cli.run_tables import flight_texts  # not needed before there is something to show

        answer.texts.extend(flight_texts(replace(plan, run=run), results))
        if reserve is not None:
            from airrace.cli.tables import render

            answer.texts.append(render(reserve.table()))
