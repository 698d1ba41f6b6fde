"""Runs: solved, continued, opened, verified, and what their race time depends on."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Union

from airrace import options
from airrace.model.parameters import ParameterGroup
from airrace.options import Option
from airrace.procedure.settings import SearchEffort

if TYPE_CHECKING:
    from airrace.api.run import Run, Watch
    from airrace.flights.results import ReserveState, Verification
    from airrace.procedure.result import Progress
    from airrace.runs.run_state import RunState
    from airrace.runs.stage_data import Sensitivities
    from airrace.runs.verification import StageVerification

RunGiven = Union[str, Path, "RunState"]
"""A run, or its file."""


def optimize(
    track: options.Track,
    *,
    aircraft: options.Aircraft = None,
    settings: options.Settings = None,
    guess: options.Guess = None,
    search: options.Search = None,
    gap: options.Gap = None,
    alternatives: options.Alternatives = None,
    mesh_check: options.MeshChecked = None,
    until: options.Until = None,
    output: Annotated[
        str | Path | None, options.output("RUN.h5", "Checkpoint to write; by default TRACK.h5 in the current folder.")
    ] = None,
    force: options.Force = False,
    start: Annotated[
        RunGiven | None, Option("Start from this run's optimum of the highest stage that it holds.", "OTHER.h5")
    ] = None,
    set: options.Set = (),
    reserve: options.Reserve = None,
    dry_run: options.DryRun = False,
    threads: options.Threads = None,
    timeout: options.Timeout = None,
    progress: "bool | Progress | Watch" = False,
) -> "Run":
    """Fly a course as fast as can be.

    The flight is optimised stage by stage, and each stage is stored in a checkpoint as soon as it is finished. The last
    one is certified; those before it are solved on one mesh, as closely as the next one needs, or certified as well
    with --mesh-check all.

    Examples:
        >>> run = airrace.optimize("half_cuban_eight", until="point-mass", search="off")
        >>> print(f"{run.race_time:.3f} s, certified: {run.certified}")
        8.908 s, certified: True

    Args:
        output: a file that is renewed after every stage, so that nothing is lost by an interruption; None for none.
        progress: whether a view of the run under way is shown on stderr; or who watches, or provides it.

    Returns:
        The run. A stage that ends without a certified optimum is the last one, and no error: `Run.certified` tells, and
        `Run.message` says why.

    Raises:
        InputError: track, aircraft, settings or values are not valid; it carries all findings.
        UsageError: no such stage, a file that exists, or a run that cannot be started from.
        OutOfTime: the run is not finished within `timeout`.
        SolverCrash: the solver process died.
        StorageError: the system refused to write the file.
    """
    from airrace.optimal_control.solvers import start_early
    from airrace.runtime.process import available_cores

    threads = threads or available_cores()
    if not dry_run:  # the solver loads while this process does
        start_early(1 if search in (SearchEffort.OFF, "off") else min(2, threads))  # the other is for what is tried
    from airrace.api.run import fly
    from airrace.errors import UsageError
    from airrace.runs.execution_plan import chosen_texts, plan_new_run, read_inputs, value_texts
    from airrace.runs.output import ensure_free, ensure_run_file

    if gap is not None:
        if search not in (None, SearchEffort.THOROUGH, SearchEffort.THOROUGH.value):
            raise UsageError("--gap is for --search thorough, which it implies")
        if start is not None:
            raise UsageError("--gap is for a flight from the course alone: with --start only routes nearby are tried")
        search = SearchEffort.THOROUGH
    path = None if output is None else ensure_run_file(output)
    if path is not None:
        hint = f"continue it with `airrace resume {path}` or "
        ensure_free(path, force=force, hint=hint, sources=[track, aircraft, settings, start])
    inputs = read_inputs(
        track,
        aircraft,
        settings,
        [*value_texts(set), *chosen_texts("rules.reserve", probability=reserve)],
        guess=guess,
        search=search,
        gap=gap,
        alternatives=alternatives,
        mesh_check=mesh_check,
    )
    plan = plan_new_run(inputs, until=until, path=path, start=start)
    return fly(plan, threads=threads, timeout=timeout, progress=progress, dry_run=dry_run)


def resume(
    run: Annotated[RunGiven, options.RUN_FILE],
    *,
    until: options.Until = None,
    from_: options.FromStage = None,
    mesh_check: options.MeshChecked = None,
    dry_run: options.DryRun = False,
    set: options.Set = (),
    track: options.OtherTrack = None,
    aircraft: options.Aircraft = None,
    settings: options.Settings = None,
    output: Annotated[
        str | Path | None,
        options.output("NEW.h5", "Checkpoint of the changed run; needed with --set, --track and the like."),
    ] = None,
    force: options.Force = False,
    threads: options.Threads = None,
    timeout: options.Timeout = None,
    progress: "bool | Progress | Watch" = False,
) -> "Run":
    """Continue a run, or change it.

    It goes on after the last stage that still stands, in the same file. With --mesh-check all the mesh check of stages
    that were solved on one mesh comes first. With --set, --track, --aircraft or --settings the changed run is started
    from the highest stage of this one that holds and written to --output; this file stays as it is.

    Examples:
        >>> windy = airrace.resume(run, set={"environment.wind.from_deg": 90, "environment.wind.speed_kt": 10})
        >>> print(f"{windy.race_time - run.race_time:+.3f} s")
        -0.079 s

    Args:
        until: the last stage; None for the last one there is, of a changed run for the last one of this run.
        mesh_check: which stages have a mesh check from now on, `last` or `all`; None for what the run was asked for.
        output: the file to be written; None for the file of the run, of a changed run for none.
        progress: whether a view of the run under way is shown on stderr; or who watches, or provides it.

    Returns:
        The run with all its stages.

    Raises:
        CheckpointError: the file cannot be read.
        InputError: the changed inputs are not valid.
        UsageError: no such stage, a file that exists, or nothing to start from.
        OutOfTime: the run is not finished within `timeout`.
        SolverCrash: the solver process died.
        StorageError: the system refused to write the file.
    """
    from airrace.optimal_control.solvers import start_early
    from airrace.runtime.process import available_cores

    if not dry_run:  # the solver loads while this process does
        start_early()
    from airrace.api.run import fly
    from airrace.errors import UsageError
    from airrace.runs.execution_plan import (
        Changes,
        aircraft_of,
        chosen_texts,
        document_or_path,
        open_source_run,
        plan_changed_run,
        plan_resumed_run,
        value_texts,
    )
    from airrace.runs.output import ensure_free, ensure_run_file
    from airrace.runs.run_state import RunState, open_run

    changes = Changes(
        document_or_path(track), document_or_path(aircraft_of(track, aircraft)), settings, value_texts(set)
    )
    path = None if output is None else ensure_run_file(output)
    if changes and from_ is not None:
        raise UsageError("--from goes on in the same run; a changed run starts from the highest stage up to --until")
    if path is not None:
        before = run.path if isinstance(run, RunState) else run
        ensure_free(path, force=force, sources=[before, track, aircraft, settings] if changes else [])
    if changes:
        source = run if isinstance(run, RunState) else open_source_run(Path(run))
        changes = changes.with_overrides(chosen_texts("settings", mesh_check=mesh_check))
        plan = plan_changed_run(source, changes, until=until, path=path)
    else:
        stored = run if isinstance(run, RunState) else open_run(ensure_run_file(run))
        stored = stored if path is None else stored.moved(path)
        plan = plan_resumed_run(stored, until=until, from_stage=from_, mesh_check=mesh_check)
    return fly(plan, threads=threads or available_cores(), timeout=timeout, progress=progress, dry_run=dry_run)


def open(path: str | Path) -> "Run":
    """Open the run in a file that `airrace optimize` or `Run.save` has written.

    Args:
        path: the path of the file.

    Raises:
        CheckpointError: there is no such file, or it is not a whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts what the run was given.
    """
    from airrace.api.run import Run
    from airrace.runs.run_state import open_run

    return Run.of(open_run(Path(path)))


@dataclass(frozen=True)
class FileVerification:
    """What was measured again of a file.

    Attributes:
        track: the name of the course.
        stages: the verification of each stage of a run.
        reserve: the reserve that the run keeps; None without.
        log: of a flight log, what it is called and its verification; None for a run.
    """

    track: str
    stages: "tuple[StageVerification, ...]" = ()
    reserve: "ReserveState | None" = None
    log: "tuple[str, Verification] | None" = None


def verify(
    run: Annotated[RunGiven, options.RUN_FILE],
    *,
    other_versions: Annotated[
        bool,
        Option("Also verify a run that other versions of airrace and its libraries have made, and leave open which."),
    ] = False,
) -> FileVerification:
    """Verify all that a run tells.

    Every stage is measured again from its histories and multipliers alone, and what is stored is compared with that. A
    run is verified if nothing differs, the stage that it ends with is certified, and all others hold in what they
    claim. Of an imported log passings, histories and violations are made once more of the log that is stored.

    Raises:
        CheckpointError: the file cannot be read.
        NotCertified: there is no certificate in the run.
    """
    from airrace.files.checkpoint import LogCheckpoint, read_stored
    from airrace.runs.log_view import open_log
    from airrace.runs.run_state import RunState, ensure_readable, run_of_checkpoint
    from airrace.runs.verification import verify_log, verify_run

    if not isinstance(run, RunState):
        checkpoint = read_stored(Path(run))
        if isinstance(checkpoint, LogCheckpoint):
            log = open_log(checkpoint)
            verification = verify_log(log, versions=not other_versions)
            return FileVerification(log.inputs.race.course.name, log=(checkpoint.label, verification))
        run = ensure_readable(run_of_checkpoint(checkpoint, Path(run)))
    stages = verify_run(run, versions=not other_versions)
    return FileVerification(run.name, stages, run.stages[-1].stamp.reserve if run.results else None)


def sensitivity(
    run: Annotated[RunGiven, options.RUN_FILE],
    *,
    stage: options.Stage = None,
    by: Annotated[str | ParameterGroup | None, Option("Only the numbers of these.")] = None,
) -> "Sensitivities":
    """Tell how the race time depends on every number.

    These are shadow prices in seconds per unit, from the multipliers of an optimum; nothing is solved again.

    Raises:
        CheckpointError: the file cannot be read.
        NotCertified: the stage is no certified optimum.
        UsageError: there is no such stage.
    """
    from airrace.runs.run_state import RunState, open_run

    run = run if isinstance(run, RunState) else open_run(Path(run))
    return run.stage(stage).sensitivities(by.value if isinstance(by, ParameterGroup) else by)
