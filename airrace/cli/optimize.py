"""Commands around runs: `optimize` and `resume` fly them, `show`, `verify` and `sensitivity` read them."""

from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.api import optimize as run_functions
from airrace.cli.command import command
from airrace.cli.printed_result import PrintedResult, render, terminal_columns
from airrace.options import Option
from airrace.runs.command_result import ExitCode, empty_result
from airrace.runtime.standard_streams import stem_of

if TYPE_CHECKING:
    from airrace.api.optimize import FileVerification
    from airrace.api.run import Run
    from airrace.files.checkpoint import Checkpoint, LogCheckpoint
    from airrace.procedure.result import Progress
    from airrace.runs.execute import Execution
    from airrace.runs.stage_data import Sensitivities

ShowStages = Annotated[bool, Option("Also list the stages with their race times and costs.")]
ShowRoutes = Annotated[bool, Option("Also list the routes that were tried.")]
ShowCertificate = Annotated[bool, Option("Also list every item of the certificate, and what is claimed.")]
ShowAll = Annotated[bool, Option("Show all there is, of every stage.")]


@command(run_functions.optimize)
def optimize(
    command_result: PrintedResult,
    function: "partial[Run]",
    *,
    stages: ShowStages = False,
    routes: ShowRoutes = False,
    certificate: ShowCertificate = False,
    all_: ShowAll = False,
) -> None:
    name = stem_of(function.keywords["track"])
    command_result.fields = empty_result(name)
    function.keywords["output"] = function.keywords["output"] or Path(f"{name}.h5")
    _fly(command_result, function, stages=stages, routes=routes, certificate=certificate, every=all_)


@command(run_functions.resume)
def resume(
    command_result: PrintedResult,
    function: "partial[Run]",
    *,
    stages: ShowStages = False,
    routes: ShowRoutes = False,
    certificate: ShowCertificate = False,
    all_: ShowAll = False,
) -> None:
    from airrace.errors import UsageError

    command_result.fields = empty_result(None)
    arguments = function.keywords
    changes = any(arguments[name] for name in ("set", "track", "aircraft", "settings"))
    if changes and arguments["output"] is None:
        run = arguments["run"]
        raise UsageError(f"{run} stays as it is: name the checkpoint of the changed run with --output NEW.h5")
    if not changes and (arguments["output"] is not None or arguments["force"]):
        raise UsageError("--output and --force belong to a changed run: say with --set, --track, ... what changes")
    _fly(command_result, function, stages=stages, routes=routes, certificate=certificate, every=all_)


class _Watcher:
    """Shows an execution on stderr, and keeps it."""

    def __init__(self, *, quiet: bool) -> None:
        self.quiet = quiet
        self.execution: Execution | None = None

    def __call__(self, execution: "Execution") -> "AbstractContextManager[Progress]":
        from airrace.pages.views.progress_view import watching

        self.execution = execution
        plan = execution.plan
        return watching(plan.run.race.course.name, plan.stages, quiet=self.quiet)


def _fly(command_result: PrintedResult, function: "partial[Run]", *, every: bool, **parts: bool) -> None:
    """Fly a run, watched on stderr, and fill in the result with its tables; or only say what would run.

    Args:
        command_result: filled in here.
        function: `optimize` or `resume` with the user's arguments.
        every, parts: see `run_screen.Parts`.
    """
    watcher = _Watcher(quiet=command_result.quiet)
    dry_run = function.keywords["dry_run"]
    try:
        function(progress=watcher)
    except BaseException as error:
        if watcher.execution is None or dry_run:
            raise
        from airrace.runs.execute import record_end

        record_end(command_result, watcher.execution, error, function.keywords["timeout"])
    execution = watcher.execution
    assert execution is not None  # for it was begun
    if dry_run:
        _add_steps(command_result, execution)
        return
    if command_result.code is ExitCode.DONE:
        from airrace.runs.execute import summarise

        summarise(command_result, execution)
    if execution.results and command_result.code is not ExitCode.INTERRUPTED and command_result.shows:
        from airrace.cli.run_screen import Parts, run_texts, solved_stages
        from airrace.cli.run_tables import comparison_texts

        compared, reserve = execution.comparison, execution.reserve
        further = [] if compared is None else list(comparison_texts([compared], every=every))
        if reserve is not None:
            further.append(render(reserve.table()))
        command_result.add(*run_texts(solved_stages(execution.run), Parts(every=every, **parts), further))


def _add_steps(command_result: PrintedResult, execution: "Execution") -> None:
    """Fill in the result of `--dry-run`."""
    from airrace.runs.execution_plan import PlannedStage

    plan = execution.plan
    stages = plan.steps or [PlannedStage(stage, "it is not finished") for stage in plan.stages]
    steps = [*stages, *([plan.reserve] if plan.reserve else [])]
    command_result.fields = {"track": plan.run.name, "steps": [step.as_object() for step in steps]}
    command_result.add("\n".join(map(str, steps)))


def _stored(
    run_file: Annotated[Path, options.RUN_FILE],
    *,
    stage: Annotated[str | None, Option("Show this stage alone; by default all.", "STAGE", completion="stages")] = None,
    verify: options.NoVerify = True,
) -> "Checkpoint | LogCheckpoint":
    """Show race time, verdict, gates and limits of a run.

    All of it fits one screen; options show more.
    """
    from airrace.files.checkpoint import read_stored

    del stage, verify  # what is shown of it
    return read_stored(run_file)


@command(_stored)
def show(
    command_result: PrintedResult,
    function: "partial[Checkpoint | LogCheckpoint]",
    *,
    legs: Annotated[
        bool, Option("Also tell every leg of the stage, by default the last, and least distances.")
    ] = False,
    stages: ShowStages = False,
    routes: ShowRoutes = False,
    certificate: ShowCertificate = False,
    all_: ShowAll = False,
) -> None:
    from airrace.cli.run_screen import Parts, run_texts, stored_stages
    from airrace.files.checkpoint import LogCheckpoint

    checkpoint = function()
    path, stage, verify = (function.keywords[name] for name in ("run_file", "stage", "verify"))
    if isinstance(checkpoint, LogCheckpoint):
        from airrace.cli.flight_tables import log_texts
        from airrace.runs.flight_sources import source_of
        from airrace.runs.log_view import open_log
        from airrace.runs.verification import with_verification

        log = open_log(checkpoint)
        source_of(log, stage)
        log = with_verification(log, verify=verify)
        command_result.fields.update(log.as_object())
        if command_result.shows:
            command_result.add(*log_texts(log, legs=legs))
        command_result.fail_if_refuted({log.recorded.label: log.verification})
        return
    shown = stored_stages(checkpoint, path, stage, verify=verify)
    command_result.fields.update(shown.as_object())
    if command_result.shows:
        parts = Parts(stages=stages, routes=routes, certificate=certificate, legs=legs, every=all_)
        command_result.add(*run_texts(shown, parts))
    command_result.fail_if_refuted({stage.value: verification for stage, verification in shown.verifications.items()})


@command(run_functions.verify)
def verify(command_result: PrintedResult, function: "partial[FileVerification]") -> None:
    from airrace.cli.run_tables import items_table
    from airrace.procedure.result import UNVERIFIABLE
    from airrace.runs.json_objects import reserve_object

    command_result.fields = {"track": None, "verified": False, "stages": []}
    verified = function()
    command_result.fields["track"] = verified.track
    if verified.log is not None:
        label, verification = verified.log
        command_result.fields.update(flown=True, verified=bool(verification.verified), verification=verification.words)
        if not verification.verified:
            command_result.fail(ExitCode.NOT_CERTIFIED, f"{label}: {verification.words}")
        command_result.add(f"{label}: {verification.outcome}; its log is taken as it is")
        return
    for stage in verified.stages:
        if stage.objection:
            command_result.fail(ExitCode.NOT_CERTIFIED, f"{stage.result.stage.value}: {stage.objection}")
    unverified = list(UNVERIFIABLE) + ["versions"] * function.keywords["other_versions"]
    command_result.fields.update(
        verified=not command_result.error,
        stages=[stage.as_object() for stage in verified.stages],
        unverified=unverified,
        reserve=reserve_object(verified.reserve),
    )
    for stage in verified.stages:
        command_result.add(f"{stage.result.stage.value}: {stage.finding}")
        if stage.certificate is not None:
            command_result.add(items_table(stage.certificate))
    if verified.reserve is not None:
        command_result.add(f"reserve: {verified.reserve.text}")
    command_result.add(f"unverified, for they cannot be measured again: {', '.join(unverified)}")


@command(run_functions.sensitivity)
def sensitivity(
    command_result: PrintedResult,
    function: "partial[Sensitivities]",
    *,
    csv: Annotated[bool, Option("Print comma-separated values, free numbers included.")] = False,
) -> None:
    from airrace.cli.flight_tables import sensitivities_text
    from airrace.errors import UsageError
    from airrace.pages.report.sensitivity_tables import sensitivities_csv
    from airrace.runs.run_state import open_run

    if command_result.as_json and csv:
        raise UsageError("--json and --csv exclude each other")
    run = open_run(function.keywords["run"])
    view = run.stage(function.keywords["stage"])
    command_result.fields.update(track=run.name, stage=view.name, race_time_s=None, sensitivities={})
    sensitivities = list(function(run=run).values())
    command_result.fields["race_time_s"] = view.race_time
    command_result.fields["sensitivities"] = {entry.key: entry.as_object() for entry in sensitivities}
    if command_result.shows:
        command_result.add(
            sensitivities_csv(sensitivities)
            if csv
            else sensitivities_text(view.result, sensitivities, terminal_columns())
        )
