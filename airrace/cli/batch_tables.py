"""The tables of a batch, and its views on stderr: a live table on a terminal, else plain lines."""

import re
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TextIO, cast

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table as RichTable
from rich.text import Text

from airrace.batch.planning import BatchPlan, JobResult, PlannedJob
from airrace.batch.reports import STATES, BatchResult, WindSummary, counts_words, wind_words
from airrace.batch.supervision import StageFinished, Watcher
from airrace.cli.tables import full_columns
from airrace.records import record
from airrace.views.plain_console import PlainConsole
from airrace.views.progress_view import commands_cursor
from airrace.views.streams import SafeStream
from airrace.views.tables import Column, Table

MESSAGE_MAX = 90
"""The longest message in the table, in characters; the other reports hold longer ones in full."""
MESSAGE_LEAST = 30
"""The columns without which a message is not put beside numbers: narrower ones would break most of its lines."""
NAME_MAX = 20
"""The longest line of a job's name on a narrow terminal, in characters: so much is left of 80 columns beside its state,
the stage with the longest name, its race time and how far it is behind."""


_JOB, _STATE, _STAGE = Column("job"), Column("state"), Column("stage")
_RACE_TIME, _BEHIND = Column("race time", "s", ".3f"), Column("behind", "s", "+.3f")
_MESSAGE = Column("message", wraps=True)


def ranking_tables(rows: Sequence[BatchResult], columns: int | None = None) -> list[Table]:
    """Return all jobs, course by course, the fastest of each first.

    They are one table, or where the terminal is too narrow for it three: the ranking, how the jobs were flown, and the
    messages.

    Args:
        rows: the jobs in their order.
        columns: the width of the terminal, None without one.
    """
    title = f"{len(rows)} jobs: {counts_words(rows) or 'none'}"
    heads, flights = _flights(rows)
    ranks = [(row.state, row.result.stage or "-", row.result.race_time, row.behind_words) for row in rows]
    messages = [_shortened(row.result.message) for row in rows]
    whole = [(row.step.name, *rank, *flight) for row, rank, flight in zip(rows, ranks, flights, strict=True)]
    ranking = (_JOB, _STATE, _STAGE, _RACE_TIME, _BEHIND)
    table, noted = Table(title, (*ranking, *heads), whole), columns is None or any(messages)
    if columns is None or full_columns(table) + MESSAGE_LEAST * noted <= columns:
        cells = [(*cells, message) for cells, message in zip(whole, messages, strict=True)]
        return [Table(title, (*ranking, *heads, _MESSAGE), cells) if noted else table]
    jobs = [folded(row.step.name) for row in rows]
    said = [(job, message) for job, message in zip(jobs, messages, strict=True) if message]
    return [
        Table(title, ranking, [(job, *rank) for job, rank in zip(jobs, ranks, strict=True)]),
        Table("how they were flown", (_JOB, *heads), [(job, *one) for job, one in zip(jobs, flights, strict=True)]),
        *([Table("what was said of them", (_JOB, _MESSAGE), said)] if said else []),
    ]


def folded(name: str) -> str:
    """Return a job's name on as many lines as it needs on a narrow terminal, cut after commas."""
    lines = [""]
    for part in re.split(r"(?<=,)", name):
        if lines[-1] and len(lines[-1] + part) > NAME_MAX:
            lines.append("  ")
        lines[-1] += part
    return "\n".join(lines)


def wind_tables(summaries: Sequence[WindSummary], columns: int | None = None) -> list[Table]:
    """Return tables for every course that was flown in several winds: best and worst, and the mean by direction.

    Args:
        summaries: what the courses have shown.
        columns: the width of the terminal, None without one; names of jobs are folded where it is too narrow.
    """
    return [table for summary in summaries for table in _of_winds(summary, columns)]


_WIND = (Column(""), _JOB, Column("wind"), _RACE_TIME)
_DIRECTIONS = (Column("from", "deg", "s"), Column("mean", "s", ".3f"), Column("s per", "kt", "+.4f"))


def _of_winds(summary: WindSummary, columns: int | None) -> list[Table]:
    flights = [
        (words, row.step.name, wind_words(row), row.result.race_time)
        for words, row in (("best", summary.best), ("worst", summary.worst))
    ]
    slope = "" if summary.per_knot is None else f", {summary.per_knot:+.4f} s per knot"
    title = f"wind: {summary.title}: {summary.flights} certified flights{slope}"
    extremes = Table(title, _WIND, flights)
    if columns is not None and full_columns(extremes) > columns:
        extremes = Table(title, _WIND, [(words, folded(job), *more) for words, job, *more in flights])
    directions = [(one.from_deg, one.mean, one.per_knot) for one in summary.bearings]
    return [extremes, *([Table("by direction of the wind", _DIRECTIONS, directions)] if directions else [])]


def _flights(rows: Sequence[BatchResult]) -> tuple[list[Column], list[list[str | float | None]]]:
    """Return the columns and the cells of how the jobs were flown, of what any of them has to tell."""
    searched, laps = any(row.result.routes is not None for row in rows), any(row.result.laps for row in rows)
    heads = [
        *([Column("best lap", "s", ".3f")] if laps else []),
        *([Column("routes", "evaluated", "d"), Column("next route", "behind s", "+.3f")] if searched else []),
        Column("wall", "s", ".1f"),
    ]
    cells: list[list[str | float | None]] = []
    for row in rows:
        routes = row.result.routes
        cells.append(
            [
                *([min(row.result.laps, default=None)] if laps else []),
                *([routes and routes.tried, routes and routes.behind] if searched else []),
                "kept" if row.step.action == "keep" else row.result.wall,
            ]
        )
    return heads, cells


def _shortened(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= MESSAGE_MAX else f"{line[: MESSAGE_MAX - 3]}..."


REASONS_MAX = 20
"""The largest number of reasons that are told one by one before anything is flown."""

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

    def __init__(self, stream: TextIO, clock: Clock = time.monotonic) -> None:
        self._stream = stream
        self._clock = clock
        self._began = clock()
        self._done = self._total = 0

    def begun(self, plan: BatchPlan) -> None:
        self._total = sum(step.known is None for step in plan.steps)
        self._line(plan_line(plan))
        for line in reason_lines(plan):
            self._line(line)

    def started(self, step: PlannedJob, attempt: int, where: str) -> None:
        self._line(f"{step.name}: started{_circumstances(attempt, where)}")

    def stage_started(self, step: PlannedJob, stage: str) -> None:
        self._line(f"{step.name}: {stage} started")

    def stage_finished(self, step: PlannedJob, event: StageFinished) -> None:
        self._line(f"{step.name}: {stage_words(event)}")

    def retried(self, step: PlannedJob, reason: str) -> None:
        self._line(f"{step.name}: tried again: {reason}")

    def ended(self, step: PlannedJob, result: JobResult) -> None:
        self._done += 1
        self._line(f"{step.name}: {ending_words(result)} ({self._done} of {self._total})")

    def _line(self, text: str) -> None:
        print(f"[{self._clock() - self._began:7.1f} s] {text}", file=self._stream, flush=True)


@record
class _Seen:
    """A job under way."""

    since: float
    attempt: int
    where: str
    stage: str = ""
    state: str = "starting"
    race_time: float | None = None


class LiveTable(Watcher):
    """A watcher that shows the jobs under way as a live table; those that ended scroll away above it."""

    def __init__(self, console: Console, clock: Clock = time.monotonic) -> None:
        self._clock = clock
        self._began = clock()
        self._console = console
        self._seen: dict[str, _Seen] = {}
        self._total = 0
        self._ended: dict[str, int] = {}
        self.live = Live(
            console=console,
            get_renderable=self._render,
            refresh_per_second=4,
            transient=True,
            redirect_stdout=False,  # stdout is data
        )

    def begun(self, plan: BatchPlan) -> None:
        self._total = sum(step.known is None for step in plan.steps)
        for line in (plan_line(plan), *reason_lines(plan)):
            self.live.console.print(Text(line))

    def started(self, step: PlannedJob, attempt: int, where: str) -> None:
        self._seen = {**self._seen, step.name: _Seen(self._clock(), attempt, where)}

    def stage_started(self, step: PlannedJob, stage: str) -> None:
        self._change(step, stage=stage, state="flying")

    def stage_finished(self, step: PlannedJob, event: StageFinished) -> None:
        self._change(step, stage=event.stage, state=event.status, race_time=event.race_time)

    def retried(self, step: PlannedJob, reason: str) -> None:
        self._forget(step)
        self.live.console.print(Text(f"{step.name}: tried again: {reason}"))

    def ended(self, step: PlannedJob, result: JobResult) -> None:
        self._forget(step)
        state = STATES.get(result.code, "failed")
        self._ended = {**self._ended, state: self._ended.get(state, 0) + 1}
        self.live.console.print(Text(f"{step.name}: {ending_words(result)}"))

    # The view is drawn from another thread: what it reads is replaced as a whole, never changed.
    def _change(self, step: PlannedJob, **fields: str | float | None) -> None:
        if step.name in self._seen:
            # Any: the fields of `_Seen`, named by the callers above.
            self._seen = {**self._seen, step.name: replace(self._seen[step.name], **fields)}  # pyright: ignore[reportArgumentType]

    def _forget(self, step: PlannedJob) -> None:
        self._seen = {name: seen for name, seen in self._seen.items() if name != step.name}

    def _render(self) -> RenderableType:
        now, seen, counts = self._clock(), self._seen, self._ended
        table = RichTable(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for name in ("job", "stage", "race time s", "state", "elapsed s"):
            table.add_column(name, justify="right" if name.endswith(" s") else "left", no_wrap=True, style="none")
        shown = list(seen.items())[: max(1, self._console.height - 4)]
        for name, one in shown:
            race_time = "-" if one.race_time is None else f"{one.race_time:.3f}"
            state = f"{one.state}{_circumstances(one.attempt, one.where)}"
            table.add_row(Text(name), one.stage or "-", race_time, Text(state), f"{now - one.since:.0f}")
        ended = sum(counts.values())
        told = ", ".join(f"{number} {state}" for state, number in counts.items())
        line = f"{ended} of {self._total} done{f' ({told})' if told else ''}, {len(seen)} under way"
        return Group(table, Text(f"{line}, {now - self._began:.0f} s", style="bold"))


def plan_line(plan: BatchPlan) -> str:
    """Return the plan in a line, e.g. `8 jobs: 3 kept, 5 to fly`."""
    actions = [step.action for step in plan.steps]
    told = {"keep": "kept", "fly": "to fly", "refuse": "with invalid input"}
    parts = [f"{actions.count(action)} {words}" for action, words in told.items() if action in actions]
    return f"{len(actions)} job{'' if len(actions) == 1 else 's'}: {', '.join(parts) or 'none'}"


def reason_lines(plan: BatchPlan) -> list[str]:
    """Return why jobs that are not new are flown again, one line for each."""
    again = [f"{step.name}: again ({step.reason})" for step in plan.steps if step.reason not in ("", "new")]
    more = [f"and {len(again) - REASONS_MAX} more again (--dry-run tells all)"] if len(again) > REASONS_MAX else []
    return [*again[:REASONS_MAX], *more]


def stage_words(event: StageFinished) -> str:
    """Return a finished stage in words."""
    race_time = "" if event.race_time is None else f", race time {event.race_time:.3f} s"
    return f"{event.stage} {event.status}{race_time}"


def ending_words(result: JobResult) -> str:
    """Return the end of a job in words."""
    race_time = "" if result.race_time is None else f", race time {result.race_time:.3f} s"
    state, said = STATES.get(result.code, "failed"), " ".join(result.message.split())
    message = f": {said}" if said not in ("", state) else ""
    return f"{state}{race_time}, {result.wall:.1f} s{message}"


def _circumstances(attempt: int, where: str) -> str:
    parts = [*([f"attempt {attempt}"] if attempt > 1 else []), *([f"on {where}"] if where else [])]
    return f" ({', '.join(parts)})" if parts else ""
