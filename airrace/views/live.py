"""Views of a run: a live one on a terminal, plain lines without one, nothing when quiet. All of it is on stderr."""

import logging
import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TextIO, cast

from rich.console import Console, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from airrace.errors import debugging
from airrace.procedure.progress import Iteration, Progress, Silent
from airrace.procedure.result import Outcome, Stage, StageResult, State
from airrace.views.plain_console import PlainConsole
from airrace.views.streams import Watched

BOX_WIDTH = 76
"""The width of the live view, columns, as long as the terminal has them."""
NAME_WIDTH = 13
"""The width of the names in the live view, columns."""
ROWS = ("stage", "doing", "", "iteration", "race time", "infeasibility")
# Seconds between two plain lines about iterations: often enough to show progress, rare enough for a log.
LINE_INTERVAL = 2.0


@contextmanager
def watching(title: str, stages: Sequence[Stage] = (), *, quiet: bool) -> Generator[Progress, None, None]:
    """Provide the observer that suits stderr, for the duration of a run.

    Args:
        title: the title of the run.
        stages: all stages of the run in their order, those that are kept as well.
        quiet: whether nothing is shown at all.
    """
    if quiet:
        with _logged_by(logging.NullHandler()):
            yield Silent()
    elif commands_cursor(sys.stderr):
        view = LiveView(title, PlainConsole(file=cast(TextIO, Watched(sys.stderr, commanded=True))), stages)
        with view.live, _logged_by(_Lines(view.live.console.print)):
            yield view
    else:
        stream = cast(TextIO, Watched(sys.stderr))
        with _logged_by(_Lines(lambda text: print(text, file=stream, flush=True))):
            yield PlainLines(stream, stages)


_VERDICTS = {
    State.CERTIFIED: "certified",
    State.SOLVED: "checked on one mesh",
    State.GUESS: "a guess",
}


def outcome_line(result: StageResult) -> str:
    """Return a finished stage in one line."""
    seconds = f"{result.timings.wall:.1f} s"
    certified = _VERDICTS.get(result.state, "NOT certified")
    verdict = certified if result.outcome is Outcome.NOT_CERTIFIED else f"{result.outcome.value}, {certified}"
    race_time = f"race time {result.trajectory.race_time:.3f} s, " if result.is_flight else ""
    return f"{result.stage.value}: {verdict}, {race_time}{result.iterations} iterations, {seconds}"


class PlainLines(Progress):
    """An observer that prints one line per event, without control codes; iterations are thinned out."""

    def __init__(
        self, stream: TextIO, stages: Sequence[Stage] = (), clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stream = stream
        self._stages = stages
        self._clock = clock
        self._started = clock()
        self._last_line = -LINE_INTERVAL

    def stage_started(self, stage: Stage) -> None:
        number = place(stage, self._stages)
        self._line(f"{stage.value}: started{number and f' ({number})'}")

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
    """The stage under way: which one, its number in the run, since when, and what it is doing."""

    stage: Stage
    number: str
    since: float
    activity: str = ""
    done: int = 0
    total: int = 0
    iteration: Iteration | None = None


class LiveView(Progress):
    """An observer that shows a live panel; finished stages scroll away above it."""

    def __init__(
        self,
        title: str,
        console: Console,
        stages: Sequence[Stage] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._title = title
        self._console = console
        self._stages = stages
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
        self._seen = _Seen(stage, place(stage, self._stages), self._clock())

    def activity(self, text: str, done: int, total: int) -> None:
        if self._seen is not None:
            self._seen = replace(self._seen, activity=text, done=done, total=total, iteration=None)

    def iteration(self, iteration: Iteration) -> None:
        if self._seen is not None:
            self._seen = replace(self._seen, iteration=iteration)

    def stage_finished(self, result: StageResult) -> None:
        self._seen = None
        self.live.console.print(Text(outcome_line(result)))

    def _render(self) -> RenderableType:
        now = self._clock()
        rows = Table.grid(padding=(0, 2), expand=True)
        rows.add_column(style="dim", width=NAME_WIDTH)
        rows.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
        for name, value in _rows(self._seen, now):
            rows.add_row(name, value)
        rows.add_row("elapsed", _duration(now - self._started))
        # A box of the same size whatever happens in it, so that nothing jumps.
        width = min(BOX_WIDTH, self._console.width)
        return Panel(rows, title=Text(self._title), title_align="left", width=width, padding=(0, 1))


def place(stage: Stage, stages: Sequence[Stage]) -> str:
    """Return the number of a stage in a run as `stage 3 of 6`; empty if that is not known."""
    return f"stage {stages.index(stage) + 1} of {len(stages)}" if stage in stages else ""


def _rows(seen: _Seen | None, now: float) -> Iterator[tuple[str, RenderableType]]:
    """Yield always the same rows; without a stage they are empty."""
    if seen is None:
        yield from ((name, Text("")) for name in ROWS)
        return
    iteration = seen.iteration
    measured = ("-", "-", "-")
    if iteration is not None:
        measured = (str(iteration.number), f"{iteration.objective:.3f} s", f"{iteration.infeasibility:.1e}")
    number = f", {seen.number}" if seen.number else ""
    done = ProgressBar(total=seen.total, completed=seen.done, width=40) if seen.total else Text("")
    values = (
        Text.assemble((seen.stage.value, "bold"), f"{number}, {_duration(now - seen.since)}"),
        Text(seen.activity or "preparing"),
        done,
        *(Text(one) for one in measured),
    )
    yield from zip(ROWS, values, strict=True)


def _duration(seconds: float) -> str:
    """Return seconds as a text, from a minute on as minutes and seconds."""
    return f"{seconds:.1f} s" if seconds < 60.0 else f"{int(seconds) // 60}:{int(seconds) % 60:02d} min"


class _Lines(logging.Handler):
    """A handler that sends the library's log where the progress goes, so that neither spoils the other."""

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
    """Return whether the stream is a terminal that understands control codes, whatever FORCE_COLOR says."""
    return stream.isatty() and not Console(file=stream, force_terminal=True).is_dumb_terminal
