"""Watching a run: a live view on a terminal, plain lines without one, nothing when quiet. All of it on stderr."""

import logging
import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TextIO

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from airrace.errors import debugging
from airrace.procedure.progress import Iteration, Progress, Silent
from airrace.procedure.result import Outcome, Stage, StageResult

# Seconds between two plain lines about iterations: enough to see that it lives, few enough for a log.
LINE_INTERVAL = 2.0


@contextmanager
def watching(title: str, *, quiet: bool) -> Generator[Progress, None, None]:
    """The observer that suits stderr, for the duration of a run."""
    if quiet:
        with _logged_by(logging.NullHandler()):
            yield Silent()
    elif commands_cursor(sys.stderr):
        view = LiveView(title, Console(stderr=True))
        with view.live, _logged_by(_Lines(view.live.console.print)):
            yield view
    else:
        with _logged_by(_Lines(lambda text: print(text, file=sys.stderr, flush=True))):
            yield PlainLines(sys.stderr)


def outcome_line(result: StageResult) -> str:
    """A finished stage in one line."""
    seconds = f"{result.timings.wall:.1f} s"
    guess = result.certificate is None and result.outcome is Outcome.SOLVED
    certified = "certified" if result.certified else "a guess" if guess else "NOT certified"
    verdict = certified if result.outcome is Outcome.NOT_CERTIFIED else f"{result.outcome.value}, {certified}"
    race_time = f"race time {result.trajectory.race_time:.3f} s, " if result.is_flight else ""
    return f"{result.stage.value}: {verdict}, {race_time}{result.iterations} iterations, {seconds}"


class PlainLines(Progress):
    """One line per event, no control codes; iterations are thinned out."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream = stream
        self._clock = clock
        self._started = clock()
        self._last_line = -LINE_INTERVAL

    def stage_started(self, stage: Stage) -> None:
        self._line(f"{stage.value}: started")

    def activity(self, text: str, done: int, total: int) -> None:
        self._line(f"  {text}")

    def iteration(self, iteration: Iteration) -> None:
        if self._clock() - self._last_line >= LINE_INTERVAL:
            self._line(
                f"  iteration {iteration.number}: objective {iteration.objective:.3f} s, "
                f"infeasibility {iteration.infeasibility:.1e}"
            )

    def stage_finished(self, result: StageResult) -> None:
        self._line(outcome_line(result))

    def _line(self, text: str) -> None:
        self._last_line = self._clock()
        print(f"[{self._last_line - self._started:7.1f} s] {text}", file=self._stream, flush=True)


@dataclass(frozen=True)
class _Seen:
    """What is known of the stage under way."""

    stage: Stage
    activity: str = ""
    done: int = 0
    total: int = 0
    iteration: Iteration | None = None


class LiveView(Progress):
    """A panel that renews itself; finished stages scroll away above it."""

    def __init__(self, title: str, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        self._title = title
        self._clock = clock
        self._started = clock()
        self._seen: _Seen | None = None
        self.live = Live(
            console=console,
            get_renderable=self._render,
            refresh_per_second=8,
            transient=True,
            redirect_stdout=False,  # stdout is data
        )

    def stage_started(self, stage: Stage) -> None:
        self._seen = _Seen(stage)

    def activity(self, text: str, done: int, total: int) -> None:
        if self._seen is not None:
            self._seen = _Seen(self._seen.stage, text, done, total)

    def iteration(self, iteration: Iteration) -> None:
        if self._seen is not None:
            seen = self._seen
            self._seen = _Seen(seen.stage, seen.activity, seen.done, seen.total, iteration)

    def stage_finished(self, result: StageResult) -> None:
        self._seen = None
        self.live.console.print(Text(outcome_line(result)))

    def _render(self) -> RenderableType:
        elapsed = f"{self._clock() - self._started:.1f} s"
        rows = Table.grid(padding=(0, 2))
        rows.add_column(style="dim")
        rows.add_column()
        if self._seen is not None:
            for name, value in _rows(self._seen):
                rows.add_row(name, value)
        rows.add_row("elapsed", elapsed)
        return Panel(Group(rows), title=Text(self._title), title_align="left", expand=False, padding=(0, 1))


def _rows(seen: _Seen) -> Iterator[tuple[str, RenderableType]]:
    yield "stage", Text(seen.stage.value, style="bold")
    yield "doing", Text(seen.activity or "preparing")
    if seen.total:
        yield "", ProgressBar(total=seen.total, completed=seen.done, width=40)
    iteration = seen.iteration
    yield "iteration", Text("-" if iteration is None else str(iteration.number))
    yield "race time", Text("-" if iteration is None else f"{iteration.objective:.3f} s")
    yield "infeasibility", Text("-" if iteration is None else f"{iteration.infeasibility:.1e}")


class _Lines(logging.Handler):
    """Sends the library's log where the progress goes, so that neither spoils the other."""

    def __init__(self, write: Callable[[str], object]) -> None:
        super().__init__(logging.DEBUG if debugging() else logging.WARNING)
        self._write = write

    def emit(self, record: logging.LogRecord) -> None:
        self._write(f"{record.levelname.lower()}: {record.getMessage()}")


@contextmanager
def _logged_by(handler: logging.Handler) -> Generator[None, None, None]:
    logger = logging.getLogger("airrace")
    level, propagate = logger.level, logger.propagate
    logger.addHandler(handler)
    logger.setLevel(handler.level or logging.WARNING)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        logger.propagate = propagate


def commands_cursor(stream: TextIO) -> bool:
    """Whether the stream is a terminal that understands control codes (whatever FORCE_COLOR and the like say)."""
    return stream.isatty() and not Console(file=stream, force_terminal=True).is_dumb_terminal
