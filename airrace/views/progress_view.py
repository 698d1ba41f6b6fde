"""Observers of runs: the one that suits stderr is live on a terminal, prints lines without one, or nothing if quiet."""

import logging
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import TextIO, cast

from airrace.errors import debugging
from airrace.procedure.result import Iteration, Progress, Silent, StageResult, Status
from airrace.procedure.stage import Stage
from airrace.views.plain_text import SafeStream


@contextmanager
def watching(title: str, stages: Sequence[Stage] = (), *, quiet: bool) -> Generator[Progress, None, None]:
    """Provide the observer that suits stderr, for the duration of a run.

    Args:
        title: the title of the run.
        stages: all stages of the run in their order, reused ones as well.
        quiet: whether nothing is shown at all.
    """
    if quiet:
        with _logged_by(logging.NullHandler()):
            yield Silent()
    elif commands_cursor(sys.stderr):
        # Imported here: what draws takes a twentieth of a second to load, and most runs have no terminal.
        from airrace.views.terminal import LiveView, PlainConsole

        view = LiveView(title, PlainConsole(file=cast(TextIO, SafeStream(sys.stderr, commanded=True))), stages)
        with view.live, _logged_by(_Lines(view.live.console.print)):
            yield view
    else:
        stream = cast(TextIO, SafeStream(sys.stderr))
        with _logged_by(_Lines(lambda text: print(text, file=stream, flush=True))):
            yield PlainLines(stream, stages)


class _Lines(logging.Handler):
    """A handler that sends the library's log where the progress goes, so that neither spoils the other."""

    def __init__(self, write: Callable[[str], object]) -> None:
        super().__init__()
        self._write = write

    def emit(self, record: logging.LogRecord) -> None:
        self._write(f"{record.levelname.lower()}: {record.getMessage()}")


@contextmanager
def _logged_by(handler: logging.Handler) -> Generator[None, None, None]:
    logger = logging.getLogger("airrace")
    level, propagate = logger.level, logger.propagate
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG if debugging() else level)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        logger.propagate = propagate


def commands_cursor(stream: TextIO) -> bool:
    """Return whether the stream is a terminal that understands control codes, whatever FORCE_COLOR says."""
    if not stream.isatty():
        return False
    from rich.console import Console  # imported here, as above

    return not Console(file=stream, force_terminal=True).is_dumb_terminal


LINE_INTERVAL = 2.0
"""The time between two plain lines about iterations, s: often enough to show progress, rare enough for a log."""

_VERDICTS = {
    Status.CERTIFIED: "certified",
    Status.SOLVED: "on one mesh",
    Status.GUESS: "a guess",
}


def outcome_line(result: StageResult) -> str:
    """Return a finished stage in one line."""
    seconds = f"{result.timings.wall:.1f} s"
    certified = _VERDICTS.get(result.status, "NOT certified")
    verdict = certified if result.outcome is Status.NOT_CERTIFIED else f"{result.outcome.value}, {certified}"
    race_time = f"race time {result.trajectory.race_time:.3f} s, " if result.has_race_time else ""
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
        number = stage_number(stage, self._stages)
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

    def remark(self, text: str) -> None:
        self._line(text)

    def _line(self, text: str) -> None:
        self._last_line = self._clock()
        print(f"[{self._last_line - self._started:7.1f} s] {text}", file=self._stream, flush=True)


def stage_number(stage: Stage, stages: Sequence[Stage]) -> str:
    """Return the number of a stage in a run as `stage 3 of 6`; empty if that is not known."""
    return f"stage {stages.index(stage) + 1} of {len(stages)}" if stage in stages else ""
