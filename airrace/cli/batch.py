"""The command `airrace batch`: many courses at once."""

import signal
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from airrace import interrupts
from airrace.batch import BatchOptions
from airrace.cli.answer import answering, ensure_room
from airrace.cli.options import (
    AsJson,
    DryRun,
    LastStage,
    Overrides,
    Quiet,
    SettingsFile,
    Verbose,
    file_option,
    output_option,
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
        if dry_run:
            describe_plan(answer, options.plan(options.sources()), quiet=quiet)
            return
        reports = Reports(csv_file, junit_file, markdown_file)
        plan, results = options.fly(lambda: watching_batch(quiet=quiet), stopping, reports.ensure_writable)
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
