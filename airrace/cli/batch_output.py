"""What a batch shows: its result, tables and reports at its end, and a live table or plain lines meanwhile."""

import os
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import IO, TextIO, cast

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table as RichTable
from rich.text import Text

from airrace.cli.printed_result import full_columns, render, terminal_columns
from airrace.errors import Finding
from airrace.pages.views.plain_text import SafeStream, plain
from airrace.pages.views.progress_view import commands_cursor
from airrace.pages.views.tables import Column, Table
from airrace.pages.views.terminal import PlainConsole
from airrace.runs.batch.planning import BatchPlan, JobResult, PlannedJob
from airrace.runs.batch.reports import (
    STATES,
    BatchResult,
    WindSummary,
    annotations,
    append_summary,
    batch_table,
    counts,
    counts_words,
    junit_report,
    markdown_report,
    ranking_of,
    wind_summaries,
    wind_words,
)
from airrace.runs.batch.supervision import StageFinished, Watcher
from airrace.runs.command_result import CommandResult, ExitCode, worst
from airrace.runs.output import ensure_free, write_text
from airrace.runtime.standard_streams import STANDARD

FINDINGS_MAX = 500
"""The largest number of findings that are printed for a batch."""
MESSAGE_MAX = 90
"""The longest message in the table, in characters; the other reports hold longer ones in full."""
NAME_MAX = 20
"""The longest line of a job's name on a narrow terminal, in characters: so much is left of 80 columns beside its
state, the stage with the longest name, its race time and how far it is behind.
"""
REASONS_MAX = 20
"""The largest number of reasons that are stated one by one before any job runs."""


@dataclass(frozen=True)
class Reports:
    """The files that are written at the end, each None if it is not wanted. Every call replaces them."""

    csv: Path | None
    junit: Path | None
    markdown: Path | None

    def ensure_writable(self, plan: BatchPlan) -> None:
        """Make sure, before any job runs, that the reports can be written and would spoil nothing.

        Raises:
            UsageError: one is a folder or read by the batch, or is another file that the batch writes.
            StorageError: a folder does not exist or takes no files.
        """
        paths = [path for path in (self.csv, self.junit, self.markdown) if path is not None]
        if paths:
            ensure_free(*plan.files(), *paths, force=True, sources=plan.read, made=plan.folder)


def describe_plan(command_result: CommandResult, plan: BatchPlan, *, quiet: bool) -> None:
    """Fill in the result of `--dry-run`."""
    actions = [step.action for step in plan.steps]
    objects = [step.as_object() for step in plan.steps]
    command_result.fields = {
        "jobs": objects,
        "counts": {action: actions.count(action) for action in ("fly", "keep", "refuse")},
    }
    if not quiet:
        lines: list[str] = []
        for step in plan.steps:
            lines.append(f"{step.name}: {step.action}" + (f" ({step.reason})" if step.reason else ""))
        command_result.texts.append("\n".join([*lines, plan_line(plan)]))
    _fail_for_inputs(
        command_result, plan, [step.result for step in plan.steps if step.result and step.action == "refuse"]
    )


def fill_in_results(
    command_result: CommandResult,
    plan: BatchPlan,
    results: Sequence[JobResult],
    reports: Reports,
    *,
    wall: float,
    quiet: bool,
) -> None:
    """Fill in the result of a batch, and write its reports.

    Raises:
        StorageError: a report cannot be written; everything else is in the result by then.
    """
    rows = ranking_of(plan, results)
    summaries = wind_summaries(rows)
    code = worst(ExitCode(result.code) if result.code in list(ExitCode) else ExitCode.BUG for result in results)
    command_result.fields = {
        "certified": bool(rows) and code is ExitCode.DONE and not plan.findings,
        "wall_s": wall,
        "counts": counts(rows),
        "jobs": [row.as_object() for row in rows],
        "winds": [summary.as_object() for summary in summaries],
    }
    if not quiet and STANDARD not in (reports.csv, reports.junit, reports.markdown):
        columns = terminal_columns()
        tables = (*ranking_tables(rows, columns), *wind_tables(summaries, columns))
        command_result.texts.extend(render(table) for table in tables)
    _fail_for_inputs(command_result, plan, results)
    if code is not ExitCode.DONE:
        hint = "; the same command goes on" if code is ExitCode.INTERRUPTED else ""
        command_result.fail(code, f"not all jobs are certified: {counts_words(rows)}{hint}", command_result.findings)
    if os.environ.get("GITHUB_ACTIONS") == "true":
        for line in annotations(rows, plan.findings):
            print(plain(line), file=SafeStream(sys.stderr, commanded=True))
        append_summary(markdown_report(rows, summaries))
    for path, report in (
        (reports.csv, lambda: batch_table(rows).csv(end="\r\n")),  # as RFC 4180 has it
        (reports.junit, lambda: junit_report(rows)),
        (reports.markdown, lambda: markdown_report(rows, summaries)),
    ):
        if path is not None:  # names of files may hold bytes that UTF-8 cannot
            write_text(path, report().encode("utf-8", "backslashreplace").decode())


def _fail_for_inputs(command_result: CommandResult, plan: BatchPlan, results: Sequence[JobResult]) -> None:
    """Report all findings, each once."""
    findings = list(dict.fromkeys([*plan.findings, *(finding for result in results for finding in result.findings)]))
    if findings:
        number = len(findings)
        more = [] if number <= FINDINGS_MAX else [Finding("", 0, 0, "", f"and {number - FINDINGS_MAX} more findings")]
        text = f"some input is not valid: {number} finding{'' if number == 1 else 's'}"
        command_result.fail(ExitCode.INVALID_INPUT, text, [*findings[:FINDINGS_MAX], *more])


_JOB, _RACE_TIME = Column("job"), Column("race time", "s", ".3f")
_RANKING = (_JOB, Column("state"), Column("stage"), _RACE_TIME, Column("behind", "s", "+z.3f"))
_MESSAGE = Column("message", wraps=True)


def ranking_tables(rows: Sequence[BatchResult], columns: int | None = None) -> list[Table]:
    """Return all jobs, course by course, the fastest of each first.

    They are one table, or where the terminal is too narrow for it three: the ranking, how the jobs were solved, and the
    messages.

    Args:
        rows: the jobs in their order.
        columns: the width of the terminal, None without one.
    """
    searched, laps = any(row.result.routes is not None for row in rows), any(row.result.laps for row in rows)
    heads = (
        *([Column("best lap", "s", ".3f")] if laps else []),
        *([Column("routes", "evaluated", "d"), Column("next route", "behind s", "+z.3f")] if searched else []),
        Column("wall", "s", ".1f"),
    )
    ranks: list[tuple[str | float | None, ...]] = []
    flights: list[tuple[str | float | None, ...]] = []
    messages: list[str] = []
    for row in rows:
        result, routes = row.result, row.result.routes
        ranks.append((row.state, result.stage or "-", result.race_time, row.behind_words))
        flights.append(
            (
                *([min(result.laps, default=None)] if laps else []),
                *([routes and routes.tried, routes and routes.behind] if searched else []),
                "kept" if row.step.action == "keep" else result.wall,
            )
        )
        line = " ".join(result.message.split())
        messages.append(line if len(line) <= MESSAGE_MAX else f"{line[: MESSAGE_MAX - 3]}...")
    title = f"{len(rows)} jobs: {counts_words(rows) or 'none'}"
    numbers = [(row.name, *rank, *flight) for row, rank, flight in zip(rows, ranks, flights, strict=True)]
    table, has_messages = Table(title, (*_RANKING, *heads), numbers), columns is None or any(messages)
    # Narrower columns would break most lines of a message.
    if columns is None or full_columns(table) + 30 * has_messages <= columns:
        cells = [(*cells, message) for cells, message in zip(numbers, messages, strict=True)]
        return [Table(title, (*table.columns, _MESSAGE), cells) if has_messages else table]
    jobs = [fold_name(row.name) for row in rows]
    reports = [(job, message) for job, message in zip(jobs, messages, strict=True) if message]
    return [
        Table(title, _RANKING, [(job, *rank) for job, rank in zip(jobs, ranks, strict=True)]),
        Table("flights", (_JOB, *heads), [(job, *flight) for job, flight in zip(jobs, flights, strict=True)]),
        *([Table("messages", (_JOB, _MESSAGE), reports)] if reports else []),
    ]


def fold_name(name: str) -> str:
    """Return a job's name on as many lines as it needs on a narrow terminal, cut after commas."""
    lines = [""]
    for part in re.split(r"(?<=,)", name):
        if lines[-1] and len(lines[-1] + part) > NAME_MAX:
            lines.append("  ")
        lines[-1] += part
    return "\n".join(lines)


_WIND = (Column(""), _JOB, Column("wind"), _RACE_TIME)
_DIRECTIONS = (Column("from", "deg", "s"), Column("mean", "s", ".3f"), Column("s per", "kt", "+z.4f"))


def wind_tables(summaries: Sequence[WindSummary], columns: int | None = None) -> list[Table]:
    """Return tables for every course that was solved in several winds: best and worst, and the mean by direction.

    Args:
        summaries: what the courses have shown.
        columns: the width of the terminal, None without one; names of jobs are folded where it is too narrow.
    """
    tables: list[Table] = []
    for summary in summaries:
        slope = "" if summary.per_knot is None else f", {summary.per_knot:+.4f} s per knot"
        title = f"wind: {summary.title}: {summary.flights} certified flights{slope}"
        extremes = (("best", summary.best), ("worst", summary.worst))
        table = Table(title, _WIND, [(word, row.name, wind_words(row), row.race_time) for word, row in extremes])
        if columns is not None and full_columns(table) > columns:
            rows = [(word, fold_name(row.name), wind_words(row), row.race_time) for word, row in extremes]
            table = replace(table, rows=rows)
        tables.append(table)
        if summary.bearings:
            directions = [(bearing.from_deg, bearing.mean, bearing.per_knot) for bearing in summary.bearings]
            tables.append(Table("by direction of the wind", _DIRECTIONS, directions))
    return tables


Clock = Callable[[], float]


@contextmanager
def watching_batch(*, quiet: bool) -> Generator[Watcher, None, None]:
    """Provide the watcher that suits stderr, for the duration of a batch."""
    if quiet:
        yield Watcher()
    elif commands_cursor(sys.stderr):
        view = LiveTable(PlainConsole(file=cast(TextIO, SafeStream(sys.stderr, commanded=True))))
        with view.live:
            yield view
    else:
        yield BatchLines(cast(TextIO, SafeStream(sys.stderr)))


class BatchLines(Watcher):
    """A watcher that prints one line per event, without control codes."""

    def __init__(self, stream: IO[str], clock: Clock = time.monotonic) -> None:
        self._stream = stream
        self._clock = clock
        self._began = clock()
        self._done = self._total = 0

    def on_begin(self, plan: BatchPlan) -> None:
        self._total = sum(step.result is None for step in plan.steps)
        again = [f"{step.name}: again ({step.reason})" for step in plan.steps if step.reason not in ("", "new")]
        if len(again) > REASONS_MAX:
            again[REASONS_MAX:] = [f"and {len(again) - REASONS_MAX} more again (--dry-run tells all)"]
        for line in (plan_line(plan), *again):
            self._line(line)

    def on_start(self, step: PlannedJob, attempt: int, where: str) -> None:
        self._line(f"{step.name}: started{_circumstances(attempt, where)}")

    def on_stage_start(self, step: PlannedJob, stage: str) -> None:
        self._line(f"{step.name}: {stage} started")

    def on_stage_end(self, step: PlannedJob, event: StageFinished) -> None:
        race_time = "" if event.race_time is None else f", race time {event.race_time:.3f} s"
        self._line(f"{step.name}: {event.stage} {event.status}{race_time}")

    def on_retry(self, step: PlannedJob, reason: str) -> None:
        self._line(f"{step.name}: tried again: {reason}")

    def on_end(self, step: PlannedJob, result: JobResult) -> None:
        self._done += 1
        self._line(f"{_ending_line(step, result)} ({self._done} of {self._total})")

    def _line(self, text: str) -> None:
        print(f"[{self._clock() - self._began:7.1f} s] {text}", file=self._stream, flush=True)


@dataclass(frozen=True)
class _JobUnderWay:
    """A job under way."""

    since: float
    attempt: int
    where: str
    stage: str = ""
    state: str = "starting"
    race_time: float | None = None


class LiveTable(BatchLines):
    """A watcher that shows the jobs under way as a live table; those that ended scroll away above it.

    The view is drawn from another thread: what it reads is replaced as a whole, never changed.
    """

    def __init__(self, console: Console, clock: Clock = time.monotonic) -> None:
        super().__init__(console.file, clock)
        self._console = console
        self._jobs: dict[str, _JobUnderWay] = {}
        self._ended: Counter[str] = Counter()
        self.live = Live(
            console=console,
            get_renderable=self._render,
            refresh_per_second=4,
            transient=True,
            redirect_stdout=False,  # stdout is data
        )

    def on_start(self, step: PlannedJob, attempt: int, where: str) -> None:
        self._jobs = {**self._jobs, step.name: _JobUnderWay(self._clock(), attempt, where)}

    def on_stage_start(self, step: PlannedJob, stage: str) -> None:
        if job := self._jobs.get(step.name):
            self._jobs = {**self._jobs, step.name: replace(job, stage=stage, state="flying")}

    def on_stage_end(self, step: PlannedJob, event: StageFinished) -> None:
        if job := self._jobs.get(step.name):
            changed = replace(job, stage=event.stage, state=event.status, race_time=event.race_time)
            self._jobs = {**self._jobs, step.name: changed}

    def on_retry(self, step: PlannedJob, reason: str) -> None:
        self._forget(step)
        super().on_retry(step, reason)

    def on_end(self, step: PlannedJob, result: JobResult) -> None:
        self._forget(step)
        self._ended = self._ended + Counter([STATES.get(result.code, "failed")])
        self._line(_ending_line(step, result))

    def _forget(self, step: PlannedJob) -> None:
        self._jobs = {name: job for name, job in self._jobs.items() if name != step.name}

    def _line(self, text: str) -> None:
        self.live.console.print(Text(text))

    def _render(self) -> RenderableType:
        now, jobs, ended = self._clock(), self._jobs, self._ended
        table = RichTable(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for name in ("job", "stage", "race time s", "state", "elapsed s"):
            table.add_column(name, justify="right" if name.endswith(" s") else "left", no_wrap=True, style="none")
        for name, job in islice(jobs.items(), max(1, self._console.height - 4)):
            race_time = "-" if job.race_time is None else f"{job.race_time:.3f}"
            state = f"{job.state}{_circumstances(job.attempt, job.where)}"
            table.add_row(Text(name), job.stage or "-", race_time, Text(state), f"{now - job.since:.0f}")
        states = ", ".join(f"{number} {state}" for state, number in ended.items())
        done = f"{ended.total()} of {self._total} done{f' ({states})' if states else ''}"
        return Group(table, Text(f"{done}, {len(jobs)} under way, {now - self._began:.0f} s", style="bold"))


def plan_line(plan: BatchPlan) -> str:
    """Return the plan in a line, e.g. `8 jobs: 3 kept, 5 to fly`."""
    actions = [step.action for step in plan.steps]
    words = {"keep": "kept", "fly": "to fly", "refuse": "with invalid input"}
    parts = [f"{actions.count(action)} {word}" for action, word in words.items() if action in actions]
    return f"{len(actions)} job{'' if len(actions) == 1 else 's'}: {', '.join(parts) or 'none'}"


def _ending_line(step: PlannedJob, result: JobResult) -> str:
    race_time = "" if result.race_time is None else f", race time {result.race_time:.3f} s"
    state, message = STATES.get(result.code, "failed"), " ".join(result.message.split())
    detail = f": {message}" if message not in ("", state) else ""
    return f"{step.name}: {state}{race_time}, {result.wall:.1f} s{detail}"


def _circumstances(attempt: int, where: str) -> str:
    parts = [*([f"attempt {attempt}"] if attempt > 1 else []), *([f"on {where}"] if where else [])]
    return f" ({', '.join(parts)})" if parts else ""
