"""Commands around runs: `optimize` and `resume` fly them, `show`, `verify` and `sensitivity` read them."""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from airrace.cli.answer import answering, render, terminal_columns
from airrace.cli.options import (
    AircraftFile,
    AsJson,
    DryRun,
    Force,
    LastStage,
    MeshChecked,
    NoVerify,
    Overrides,
    Quiet,
    RunFile,
    SettingsFile,
    ShowAll,
    ShowCertificate,
    ShowRoutes,
    ShowStages,
    SigningKey,
    StageOfRun,
    Threads,
    Timeout,
    TrackFile,
    TrustedKey,
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
    stages: ShowStages = False,
    routes: ShowRoutes = False,
    certificate: ShowCertificate = False,
    every: ShowAll = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Fly a course as fast as can be.

    The flight is optimised stage by stage, and each stage is stored in a checkpoint as soon as it is finished. The last
    one is certified; those before it are solved on one mesh, as closely as the next one needs, or certified as well
    with --mesh-check all.
    """
    with answering(empty_result(stem_of(track)), as_json=as_json, verbose=verbose) as answer:
        from airrace.optimal_control.solvers import start_early
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
        parts = {"stages": stages, "routes": routes, "certificate": certificate, "every": every}
        _fly(answer, plan.signed(signer), parts, threads=threads, timeout=timeout, dry_run=dry_run, quiet=quiet)


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
    stages: ShowStages = False,
    routes: ShowRoutes = False,
    certificate: ShowCertificate = False,
    every: ShowAll = False,
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
        from airrace.optimal_control.solvers import start_early
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
        parts = {"stages": stages, "routes": routes, "certificate": certificate, "every": every}
        _fly(answer, plan.signed(signer), parts, threads=threads, timeout=timeout, dry_run=dry_run, quiet=quiet)


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
    answer: CommandResult,
    plan: "ExecutionPlan",
    parts: Mapping[str, bool],
    *,
    threads: int,
    timeout: float | None,
    dry_run: bool,
    quiet: bool,
) -> None:
    """Fly a plan, watched on stderr, and fill in the answer with its tables; or only say what would run.

    `parts` are those of `run_screen.Parts`, which is not loaded before there is something to show.
    """
    from airrace.runs.command_result import ExitCode
    from airrace.runs.execute import ensure_executable, execute_for_command
    from airrace.runs.plan import PlannedStage
    from airrace.views.progress_view import watching

    if dry_run:
        ensure_executable(plan, timeout=timeout)
        stages = plan.steps or [PlannedStage(stage, "it is not finished") for stage in plan.stages]
        steps = [*stages, *([plan.reserve] if plan.reserve else [])]
        answer.fields = {"track": plan.run.name, "steps": [step.as_object() for step in steps]}
        answer.texts.extend(() if quiet else ["\n".join(map(str, steps))])
        return
    with watching(plan.run.race.course.name, plan.stages, quiet=quiet) as progress:
        run, results, reserve = execute_for_command(answer, plan, threads=threads, timeout=timeout, progress=progress)
    if results and answer.code is not ExitCode.INTERRUPTED and not quiet:
        from airrace.cli.run_screen import Parts, run_texts, solved_stages
        from airrace.cli.run_tables import comparison_texts

        compared = replace(plan, run=run).compare(results)
        further = [] if compared is None else list(comparison_texts([compared], every=parts["every"]))
        if reserve is not None:
            further.append(render(reserve.table()))
        answer.texts.extend(run_texts(solved_stages(run), Parts(**parts), further))


def show(
    run_file: RunFile,
    stage: Annotated[str | None, stage_option("Show this stage alone; by default all.")] = None,
    legs: Annotated[
        bool, typer.Option("--legs", help="Also tell every leg of the stage, by default the last, and least distances.")
    ] = False,
    stages: ShowStages = False,
    routes: ShowRoutes = False,
    certificate: ShowCertificate = False,
    every: ShowAll = False,
    no_verify: NoVerify = False,
    trust: TrustedKey = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Show race time, verdict, gates and limits of a run.

    All of it fits one screen; options show more.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint import LogCheckpoint, read_stored
        from airrace.cli.run_screen import Parts, run_texts, stored_stages
        from airrace.runs.signing import ensure_signed

        stored, signature = read_stored(run_file)
        signature = None if isinstance(stored, LogCheckpoint) else signature
        signed_by = "" if trust is None else ensure_signed(run_file, signature, trust)
        if isinstance(stored, LogCheckpoint):
            from airrace.cli.flight_tables import log_texts
            from airrace.runs.flight_sources import source_of
            from airrace.runs.log_view import open_log
            from airrace.runs.verification import with_confirmation

            log = open_log(stored)
            source_of(log, stage)
            log = with_confirmation(log, verify=not no_verify)
            answer.fields.update(log.as_object())
            if not as_json:
                answer.texts.extend(log_texts(log, legs=legs))
            answer.fail_if_refuted({log.recorded.label: log.confirmation})
            return
        shown = stored_stages(stored, run_file, stage, verify=not no_verify)
        answer.fields.update(shown.as_object(), signed_by=signed_by or None)
        if signed_by:
            answer.texts.append(f"signed by {signed_by}")
        if not as_json:
            parts = Parts(stages=stages, routes=routes, certificate=certificate, legs=legs, every=every)
            answer.texts.extend(run_texts(shown, parts))
        answer.fail_if_refuted({one.value: found for one, found in shown.confirmations.items()})


def verify(
    run_file: RunFile,
    other_versions: Annotated[
        bool,
        typer.Option(
            "--other-versions",
            help="Also verify a run that other versions of airrace and its libraries have made, and leave open which.",
        ),
    ] = False,
    trust: TrustedKey = None,
    sign: SigningKey = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Verify all that a run tells.

    Every stage is measured again from its histories and multipliers alone, and what is stored is compared with that. A
    run is verified if nothing differs, the stage that it ends with is certified, and all others hold in what they
    claim. Of an imported log passings, histories and violations are made once more of the log that is stored.
    """
    with answering({"track": None, "verified": False, "stages": []}, as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint import LogCheckpoint, read_stored
        from airrace.cli.run_tables import items_table
        from airrace.errors import UsageError
        from airrace.procedure.result import UNVERIFIABLE
        from airrace.runs.command_result import ExitCode
        from airrace.runs.json_objects import reserve_object
        from airrace.runs.run import ensure_readable, run_of_checkpoint
        from airrace.runs.signing import ensure_signed, signer_of
        from airrace.runs.verification import confirm_log, verify_run
        from airrace.standard_streams import STANDARD

        if sign is not None and run_file == STANDARD:
            raise UsageError("what is piped in cannot be signed: name a file")
        signer = None if sign is None else signer_of(sign)
        checkpoint, signature = read_stored(run_file)
        if isinstance(checkpoint, LogCheckpoint):
            from airrace.runs.log_view import open_log

            if sign is not None or trust is not None:
                raise UsageError("a flight log is not signed: leave --sign and --trust out")
            log = open_log(checkpoint)
            found = confirm_log(log, versions=not other_versions)
            answer.fields.update(flown=True, track=log.inputs.race.course.name, verified=bool(found.verified))
            answer.fields["verification"] = found.words
            if not found.verified:
                answer.fail(ExitCode.NOT_CERTIFIED, f"{checkpoint.label}: {found.words}")
            answer.texts.append(f"{checkpoint.label}: {found.outcome}; its log is taken as it is")
            return
        signed_by = "" if trust is None else ensure_signed(run_file, signature, trust)
        run = ensure_readable(run_of_checkpoint(checkpoint, run_file))
        answer.fields["track"] = run.name
        stages = verify_run(run, versions=not other_versions)
        for stage in stages:
            if stage.objection:
                answer.fail(ExitCode.NOT_CERTIFIED, f"{stage.result.stage.value}: {stage.objection}")
        unverified = [] if trust is not None else list(UNVERIFIABLE) + ["versions"] * other_versions
        answer.fields.update(verified=not answer.error, stages=[stage.as_object() for stage in stages])
        answer.fields.update(unverified=unverified, signed_by=signed_by or None)
        reserve = run.stages[-1].stamp.reserve if run.results else None
        answer.fields["reserve"] = reserve_object(reserve)
        for stage in stages:
            answer.texts.append(f"{stage.result.stage.value}: {stage.finding}")
            if stage.certificate is not None:
                answer.texts.append(render(items_table(stage.certificate)))
        if reserve is not None:
            answer.texts.append(f"reserve: {reserve.text}")
        if signed_by:
            answer.texts.append(f"signed by {signed_by}")
        elif unverified:
            answer.texts.append(f"unverified, for they cannot be measured again: {', '.join(unverified)}")
        if signer is not None and not answer.error:
            run.signing(signer).save(run_file)
            answer.texts.append(f"signed now by {signer.fingerprint}")


class GroupName(StrEnum):
    """A group of numbers whose sensitivities are wanted.

    The names are those of `airrace.sensitivity.ParameterGroup`, which is too heavy to import here.
    """

    TRACK = "track"
    AIRCRAFT = "aircraft"
    RULES = "rules"
    ENVIRONMENT = "environment"


def sensitivity(
    run_file: RunFile,
    stage: StageOfRun = None,
    by: Annotated[GroupName | None, typer.Option(help="Only the numbers of these.")] = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values, free numbers included.")] = False,
) -> None:
    """Tell how the race time depends on every number.

    These are shadow prices in seconds per unit, from the multipliers of an optimum; nothing is solved again.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.cli.flight_tables import sensitivities_text
        from airrace.errors import UsageError
        from airrace.report.sensitivity_tables import sensitivities_csv
        from airrace.runs.run import open_run

        if as_json and as_csv:
            raise UsageError("--json and --csv exclude each other")
        run = open_run(run_file)
        view = run.stage(stage)
        answer.fields.update(track=run.name, stage=view.name, race_time_s=None, sensitivities={})
        found = list(view.sensitivities(None if by is None else by.value).values())
        answer.fields["race_time_s"] = view.race_time
        answer.fields["sensitivities"] = {one.key: one.as_object() for one in found}
        answer.texts.append(
            sensitivities_csv(found) if as_csv else sensitivities_text(view.result, found, terminal_columns())
        )
