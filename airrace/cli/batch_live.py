"""Views of a batch: a live table on a terminal, plain lines without one, nothing when quiet. All of it is on stderr."""

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from typing import TextIO, cast

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from airrace.batch.executor import StageFinished
from airrace.batch.plan import BatchPlan, JobResult, PlannedJob
from airrace.batch.ranking import STATES
from airrace.batch.supervision import Watcher
from airrace.cli.batch_answer import plan_line
from airrace.records import record
from airrace.views.plain_console import PlainConsole
from airrace.views.progress_view import commands_cursor
from airrace.views.streams import SafeStream

REASONS_MAX = 20
"""The largest number of reasons that are told one by one before anything is flown."""

Clock = Callable[[], float]


@contextmanager
def watching_batch(*, quiet: bool) -> Generator[Watcher, None, None]:
    """Provide the watcher that suits stderr, for the duration of a batch."""
    if quiet:
        yield Unwatched()
    elif commands_cursor(sys.stderr):
        view = LiveTable(PlainConsole(file=cast(TextIO, SafeStream(sys.stderr, commanded=True))))
        with view.live:
            yield view
    else:
        yield BatchLines(cast(TextIO, SafeStream(sys.stderr)))


class Unwatched:
    """A watcher that shows nothing."""

    def begun(self, plan: BatchPlan) -> None: ...

    def started(self, step: PlannedJob, attempt: int, where: str) -> None: ...

    def stage_started(self, step: PlannedJob, stage: str) -> None: ...

    def stage_finished(self, step: PlannedJob, event: StageFinished) -> None: ...

    def retried(self, step: PlannedJob, reason: str) -> None: ...

    def ended(self, step: PlannedJob, result: JobResult) -> None: ...

    def idle(self) -> None: ...


class BatchLines:
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

    def idle(self) -> None: ...

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


class LiveTable:
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

    def idle(self) -> None: ...

    # The view is drawn from another thread: what it reads is replaced as a whole, never changed.
    def _change(self, step: PlannedJob, **fields: str | float | None) -> None:
        if step.name in self._seen:
            # Any: the fields of `_Seen`, named by the callers above.
            self._seen = {**self._seen, step.name: replace(self._seen[step.name], **fields)}  # pyright: ignore[reportArgumentType]

    def _forget(self, step: PlannedJob) -> None:
        self._seen = {name: seen for name, seen in self._seen.items() if name != step.name}

    def _render(self) -> RenderableType:
        now, seen, counts = self._clock(), self._seen, self._ended
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
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
