"""Observers of runs: the one that suits stderr is live on a terminal, prints lines without one, or nothing if quiet."""

import logging
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import TextIO, cast

from airrace.errors import debugging
from airrace.pages.views.plain_text import SafeStream
from airrace.pages.views.progress_lines import PlainLines
from airrace.procedure.result import Progress, Silent
from airrace.procedure.stage import Stage


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
        from airrace.pages.views.terminal import LiveView, PlainConsole

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
