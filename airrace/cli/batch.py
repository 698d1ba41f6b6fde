"""Commands that solve many: `batch` (many courses), `sweep` (many values) and `fairness` (aircraft and air)."""

import signal
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from airrace import interrupts
from airrace.batch import BatchOptions
from airrace.cli.answer import answer_with_files, answering, ensure_room, render
from airrace.cli.options import (
    AsJson,
    DryRun,
    Force,
    LastStage,
    Overrides,
    Quiet,
    RunFile,
    SettingsFile,
    Threads,
    TrackFile,
    Verbose,
    complete_aircraft,
    file_option,
    output_option,
    stage_option,
)


def batch(
    courses: Annotated[
        list[str],
        typer.Argument(
            metavar="COURSES...", help="Track files, patterns such as 'tracks/*.yaml', names, or a batch.yaml."
        ),
    ],
    aircraft: Annotated[
        list[Path] | None, file_option("FILE", "Fly every course with this aircraft; as often as you like.")
    ] = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    sweep: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUES",
            help="Fly every value of a key of --set: a list (0,5,10) or a range (first:last:step); several multiply.",
        ),
    ] = None,
    until: LastStage = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Jobs at a time; by default all cores, or threads of workers."),
    ] = None,
    output: Annotated[Path, output_option("DIR", "Where checkpoints and records lie.")] = Path("batch"),
    cluster: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Fly on a dask.distributed cluster (tcp://scheduler:8786).")
    ] = None,
    timeout: Annotated[
        float | None, typer.Option(min=0.1, metavar="SECONDS", help="Stop a job that takes longer.")
    ] = None,
    retries: Annotated[
        int, typer.Option(min=0, metavar="N", help="How often a job whose process crashed is tried again.")
    ] = 1,
    dry_run: DryRun = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Fly jobs again that ended without a certified flight.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", "-f", help="Fly all jobs again, from their start.")] = False,
    csv_file: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the table as CSV.")] = None,
    junit_file: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Write a JUnit report.")] = None,
    markdown_file: Annotated[
        Path | None, typer.Option("--markdown", metavar="FILE", help="Write the table as Markdown.")
    ] = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Fly many courses.

    Every combination of course, aircraft and swept values is a job with a checkpoint of its own. A second call flies
    only what is not finished, or has changed.
    """
    with answering({"certified": False, "jobs": []}, as_json=as_json, verbose=verbose) as answer:
        from airrace.batch.supervision import supervise
        from airrace.cli.batch_output import Reports, answer_with, describe_plan, watching_batch

        ensure_room(csv_file, junit_file, markdown_file, as_json=as_json)
        started = time.perf_counter()
        options = BatchOptions(
            courses=courses,
            aircraft=aircraft or (),
            settings=settings,
            set=overrides or (),
            sweep=sweep or (),
            until=until,
            jobs=jobs,
            output=output,
            cluster=cluster,
            timeout=timeout,
            retries=retries,
            retry_failed=retry_failed,
            force=force,
        )
        reports = Reports(csv_file, junit_file, markdown_file)
        if dry_run:
            plan = options.checked_plan()
            reports.ensure_writable(plan)
            describe_plan(answer, plan, quiet=quiet)
            return
        with options.prepared() as (plan, pool):
            reports.ensure_writable(plan)
            with stopping() as stop_asked, watching_batch(quiet=quiet) as watcher:
                results = supervise(plan, pool, options, watcher, stop_asked=stop_asked)
        answer_with(answer, plan, results, reports, wall=time.perf_counter() - started, quiet=quiet)


ONE_REQUEST = 0.3
"""The time within which two signals are one request, s.

Whoever ends a process and its group, as `timeout` does, signals it twice within a millisecond; nobody presses Ctrl-C
twice as fast as this.
"""


@contextmanager
def stopping() -> Generator[Callable[[], bool], None, None]:
    """Provide a function that tells whether the user asked to stop.

    Ctrl-C (or SIGTERM) asks; the second time, everything is dropped at once. What is asked for ends no sooner than all
    signals of one request have come, for the last of them would interrupt the tables.
    """
    asked: list[float] = []

    def ask(number: int, frame: FrameType | None) -> None:
        if not asked:
            asked.append(time.monotonic())
        elif time.monotonic() - asked[0] > ONE_REQUEST:
            raise KeyboardInterrupt

    before = {number: signal.signal(number, ask) for number in interrupts.SIGNALS}
    try:
        yield lambda: bool(asked)
        for began in asked:
            time.sleep(max(0.0, began + ONE_REQUEST - time.monotonic()))
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


ROWS_SHOWN = 30
"""The largest number of combinations that a terminal shows."""


def sweep(
    run_file: RunFile,
    sweep: Annotated[
        list[str],
        typer.Option(
            metavar="KEY=VALUES",
            help="Values of a key as --set takes it: a list 0,5,10, a range first:last:step, or a list of both; "
            "several multiply.",
        ),
    ],
    stage: Annotated[str, stage_option("Which stage.")] = "point-mass",
    overrides: Overrides = None,
    output: Annotated[
        Path | None, output_option("FILE", "Write all combinations, .csv or .parquet (extra: parquet).")
    ] = None,
    force: Force = False,
    threads: Threads = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Solve one stage of a run under every combination of values, some a second.

    Each is solved from its neighbour and measured like a stage that is solved on one mesh. Routes stay those of the
    run; `airrace batch` flies every combination from scratch instead.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.batch.sweep import ensure_sweep_file
        from airrace.batch.sweep import sweep as solve_sweep
        from airrace.runs.command_result import ExitCode
        from airrace.runs.output import ensure_free
        from airrace.views.plain_text import SafeStream
        from airrace.views.tables import Table

        if output is not None:
            ensure_room(output, as_json=as_json)
            ensure_sweep_file(output)
            ensure_free(output, force=force, sources=[run_file])
        shows = not quiet and sys.stderr.isatty()
        terminal = SafeStream(sys.stderr, commanded=True)

        def tell(done: int, number: int) -> None:
            if shows:
                print(f"\r{done} of {number}", end="" if done < number else "\r\033[K", file=terminal, flush=True)

        found = solve_sweep(
            run_file, sweep, stage=stage, set=overrides or (), threads=threads, output=output, tell=tell
        )
        answer.fields.update(found.as_object())
        table = found.table()
        if not quiet:
            left = len(table.rows) - ROWS_SHOWN
            more = (f"{left} more; --output writes all",) if left > 0 else ()
            notes = (*table.notes, *more)
            answer.texts.append(render(Table(table.title, table.columns, table.rows[:ROWS_SHOWN], notes)))
        answer_with_files(answer, [] if output is None else [output], quiet=quiet)
        if unsolved := len(found.points) - found.solved:
            answer.fail(ExitCode.NOT_CERTIFIED, f"{unsolved} of {len(found.points)} combinations have no optimum")


def fairness(
    track: TrackFile,
    aircraft: Annotated[
        list[Path] | None,
        file_option(
            "FILE", "An aircraft: a file or a name, e.g. pc9; as often as you like.", complete=complete_aircraft
        ),
    ] = None,
    winds: Annotated[
        str | None,
        typer.Option(metavar="ROSE", help="Winds, e.g. 0,5,10kt@8: from eight directions; by default the course's."),
    ] = None,
    sweep: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUES", help="Values of another key of the air; as often as you like."),
    ] = None,
    flights: Annotated[
        list[str] | None,
        typer.Option("--flight", metavar="FLIGHT", help="A run or a flight log to normalise; as often as you like."),
    ] = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    until: LastStage = None,
    cold: Annotated[
        bool, typer.Option("--cold", help="Find every optimum from the course alone as well, and take the faster one.")
    ] = False,
    output: Annotated[
        Path | None, output_option("DIR", "Keep the runs here; a second call takes up what is there.")
    ] = None,
    csv_file: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the optima as CSV.")] = None,
    force: Force = False,
    threads: Threads = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Tell what aircraft and air are worth on a course: handicaps, spreads, and times as of still standard air."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.inputs import load_inputs
        from airrace.runs.output import documents_of, ensure_free, ensure_unread, write_text

        ensure_room(csv_file, as_json=as_json)
        if csv_file is not None:
            ensure_free(csv_file, force=force, sources=[track, settings, *(aircraft or ()), *(flights or ())])
            ensure_unread([csv_file], documents_of(load_inputs(track, settings=settings, overrides=overrides or ())))
        from airrace.batch.fairness import fairness as find_fairness
        from airrace.batch.planning import parse_sweeps
        from airrace.runs.command_result import ExitCode

        found = find_fairness(
            track,
            aircraft=aircraft or (),
            winds=winds,
            sweep=parse_sweeps(sweep or ()),
            flights=flights or (),
            settings=settings,
            set=overrides or (),
            until=until,
            cold=cold,
            output=output,
            threads=threads,
            tell=lambda text: None if quiet else print(text, file=sys.stderr, flush=True),
        )
        answer.fields.update(found.as_object())
        if csv_file is not None:
            write_text(csv_file, found.air_table().csv(".10g"))
        if not quiet:
            answer.texts.extend(render(table) for table in found.tables())
        answer_with_files(answer, [] if csv_file is None else [csv_file], quiet=quiet)
        if found.messages:
            answer.fail(ExitCode.NOT_CERTIFIED, found.messages[0])
