"""Commands that solve many: `batch` (many courses), `sweep` (many values) and `handicap` (many hours and headings)."""

import signal
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.api import sweeps
from airrace.cli.command import command
from airrace.cli.printed_result import PrintedResult
from airrace.options import Option
from airrace.runs.batch import BatchOptions
from airrace.runs.command_result import ExitCode
from airrace.runtime import interrupts

if TYPE_CHECKING:
    from airrace.runs.batch.handicap import HandicapResult
    from airrace.runs.batch.sweep import SweepResult


BATCH_HELP = """Fly many courses.

Every combination of course, aircraft and swept values is a job with a checkpoint of its own. A second call flies
only what is not finished, or has changed.
"""


@command(BatchOptions, help=BATCH_HELP)
def batch(
    command_result: PrintedResult,
    function: "partial[BatchOptions]",
    *,
    dry_run: options.DryRun = False,
    csv: Annotated[Path | None, Option("Write the table as CSV.", "FILE", written=True)] = None,
    junit: Annotated[Path | None, Option("Write a JUnit report.", "FILE", written=True)] = None,
    markdown: Annotated[Path | None, Option("Write the table as Markdown.", "FILE", written=True)] = None,
) -> None:
    from airrace.cli.batch_output import Reports, describe_plan, fill_in_results, watching_batch
    from airrace.runs.batch.supervision import supervise

    command_result.fields = {"certified": False, "jobs": []}
    start_time = time.perf_counter()
    jobs, reports = function(), Reports(csv, junit, markdown)
    if dry_run:
        plan = jobs.checked_plan()
        reports.ensure_writable(plan)
        describe_plan(command_result, plan, quiet=command_result.quiet)
        return
    with jobs.prepared() as (plan, pool):
        reports.ensure_writable(plan)
        with stopping() as stop_asked, watching_batch(quiet=command_result.quiet) as watcher:
            results = supervise(plan, pool, jobs, watcher, stop_asked=stop_asked)
    fill_in_results(
        command_result, plan, results, reports, wall=time.perf_counter() - start_time, quiet=command_result.quiet
    )


ONE_REQUEST = 0.3
"""The time within which two signals are one request, s.

A program that ends a process and its group, as `timeout` does, signals it twice within a millisecond; no user presses
Ctrl-C twice as fast as this.
"""


@contextmanager
def stopping() -> Generator[Callable[[], bool], None, None]:
    """Provide a function that tells whether the user asked to stop.

    Ctrl-C (or SIGTERM) asks; the second time, everything is dropped at once. What is asked for ends no sooner than all
    signals of one request have come, for the last of them would interrupt the tables.
    """
    request_times: list[float] = []

    def ask(number: int, frame: FrameType | None) -> None:
        if not request_times:
            request_times.append(time.monotonic())
        elif time.monotonic() - request_times[0] > ONE_REQUEST:
            raise KeyboardInterrupt

    before = {number: signal.signal(number, ask) for number in interrupts.SIGNALS}
    try:
        yield lambda: bool(request_times)
        for began in request_times:
            time.sleep(max(0.0, began + ONE_REQUEST - time.monotonic()))
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@command(sweeps.sweep)
def sweep(command_result: PrintedResult, function: "partial[SweepResult]", *, force: options.Force = False) -> None:
    from airrace.pages.views.plain_text import SafeStream
    from airrace.runs.output import ensure_free

    output = function.keywords["output"]
    if output is not None:
        ensure_free(output, force=force, sources=[function.keywords["run"]])
    terminal = SafeStream(sys.stderr, commanded=True)

    def tell(done: int, number: int) -> None:
        print(f"\r{done} of {number}", end="" if done < number else "\r\033[K", file=terminal, flush=True)

    result = function(tell=tell) if not command_result.quiet and sys.stderr.isatty() else function()
    command_result.fields.update(result.as_object())
    command_result.add(result.table().shortened())
    command_result.add_files(output)
    if unsolved := len(result.points) - result.solved:
        command_result.fail(ExitCode.NOT_CERTIFIED, f"{unsolved} of {len(result.points)} combinations have no optimum")


@command(sweeps.handicap)
def handicap(command_result: PrintedResult, function: "partial[HandicapResult]") -> None:
    def tell(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    result = function() if command_result.quiet else function(tell=tell)
    command_result.fields.update(result.as_object())
    command_result.add(*result.tables())
    command_result.add_files(function.keywords["output"])
    if result.messages:
        command_result.fail(ExitCode.NOT_CERTIFIED, result.messages[0])
