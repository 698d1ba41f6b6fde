"""The command `airrace batch`: many courses at once."""

import signal
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from airrace import interrupts
from airrace.cli.answer import answering, ensure_room
from airrace.cli.options import AsJson, DryRun, LastStage, Overrides, Quiet, SettingsFile, Verbose, output_option
from airrace.errors import UsageError

if TYPE_CHECKING:
    from airrace.batch.executor import Executor


def batch(
    courses: Annotated[
        list[str],
        typer.Argument(
            metavar="COURSES...", help="Track files, patterns such as 'tracks/*.yaml', names, or a batch.yaml."
        ),
    ],
    aircraft: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", readable=False, help="Fly every course with this aircraft; as often as you like."),
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
    force: Annotated[bool, typer.Option("--force", "-f", help="Fly all jobs again, from their beginning.")] = False,
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
        from airrace.batch.planning import make_plan
        from airrace.batch.record import Choice, locked
        from airrace.batch.sources import Manner, find_sources, parse_sweeps
        from airrace.batch.supervision import Policy, supervise
        from airrace.cli.batch_answer import Reports, answer_with, describe_plan
        from airrace.cli.batch_tables import watching_batch
        from airrace.runs.plan import stage_by_name
        from airrace.runs.run import library_versions

        ensure_room(csv_file, junit_file, markdown_file, as_json=as_json)
        started = time.perf_counter()
        choice = Choice.ALL if force else Choice.FAILED if retry_failed else Choice.NONE
        manner = Manner(tuple(aircraft or ()), settings, tuple(overrides or ()), parse_sweeps(sweep or ()), until)
        sources = find_sources(courses, manner)
        for group in sources.groups:
            stage_by_name(group.manner.until)
        versions = ", ".join(f"{name} {number}" for name, number in library_versions().items())
        last = stage_by_name(None).value
        if dry_run:
            plan = make_plan(sources, output, until=last, versions=versions, choice=choice)
            describe_plan(answer, plan, quiet=quiet)
            return
        reports = Reports(csv_file, junit_file, markdown_file)
        with _executor(cluster, jobs, timeout) as executor, locked(output):
            plan = make_plan(sources, output, until=last, versions=versions, choice=choice)
            reports.ensure_writable(plan)
            policy = Policy(timeout, retries, choice)
            with stopping() as stop_asked, watching_batch(quiet=quiet) as watcher:
                results = supervise(plan, executor, policy, watcher, stop_asked=stop_asked)
            answer_with(answer, plan, results, reports, wall=time.perf_counter() - started, quiet=quiet)


def _executor(cluster: str | None, jobs: int | None, timeout: float | None) -> "Executor":
    """Return the executor that flies the jobs: this machine or a cluster.

    A cluster is given as long to have a worker as a job has to end.
    """
    from airrace.batch.process import JOB_COMMAND
    from airrace.process import available_cores
    from airrace.runs.run import library_versions

    if cluster is None:
        from airrace.batch.local import LocalExecutor

        return LocalExecutor(JOB_COMMAND, jobs or available_cores())
    try:
        from airrace.batch.cluster import WORKERS_WAIT, ClusterExecutor
    except ModuleNotFoundError as error:
        raise UsageError("--cluster needs dask.distributed: pip install 'airrace[cluster]'") from error
    return ClusterExecutor(cluster, JOB_COMMAND[1:], library_versions(), jobs, timeout or WORKERS_WAIT)


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
