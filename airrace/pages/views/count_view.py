"""How far something is that is done many times, such as closed-loop flights in many winds, with the time left."""

import io
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TextIO, cast

from airrace.pages.views.plain_text import SafeStream, plain
from airrace.pages.views.progress_view import commands_cursor

LINE_INTERVAL = 5.0
"""The time between two lines where there is no terminal, s."""


def duration_text(seconds: float) -> str:
    """Return seconds as a text, from a minute and a half on in minutes."""
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


class CountView:
    """Shows a count within a task within several tasks: one line that is renewed on a terminal, else lines.

    Args:
        stream: stderr.
        renews: whether it is a terminal whose cursor can be moved.
        clock: s.
    """

    def __init__(self, stream: TextIO, *, renews: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._renews, self._clock = stream, renews, clock
        self._title, self._number, self._tasks = "", 0, 1
        self._started = self._begun = clock()
        self._last_line = -LINE_INTERVAL

    def begin(self, title: str, number: int = 0, tasks: int = 1) -> None:
        """Begin a task, the `number`-th from 0 of so many that take as long; one of several is announced."""
        self._title, self._number, self._tasks = title, number, tasks
        self._begun = self._last_line = self._clock()
        if number == 0:
            self._started = self._begun
        if tasks > 1:
            self.remark(title)

    def remark(self, text: str) -> None:
        """Show a line that stays."""
        self.close()
        print(plain(text), file=self._stream, flush=True)

    def watch(self, done: int, total: int, broken: int) -> None:
        """Show how many flights of the task are flown, and how many of these break a rule."""
        self.tell(f"flights {done} of {total}" + f", {broken} break a rule" * bool(done), done, total)

    def tell(self, text: str, done: int, total: int) -> None:
        """Show in a text how much of the task is done, with the time left, unless it was shown only now."""
        now = self._clock()
        if not self._renews and done < total and now - self._last_line < LINE_INTERVAL:
            return
        left = ""
        if done and now > self._begun:
            of_task = (now - self._begun) * (total / done - 1.0)
            usual = (now - self._started + of_task) / (self._number + 1)  # of a task
            left = f", {duration_text(of_task + usual * (self._tasks - self._number - 1))} left"
        self.show(f"{self._title}{': ' if self._title else ''}{text}{left}")

    def close(self) -> None:
        """Remove the line that is renewed."""
        if self._renews:
            print("\r\x1b[2K", end="", file=self._stream, flush=True)

    def show(self, text: str) -> None:
        """Show a text, in place of the one before on a terminal."""
        self._last_line = self._clock()
        begin, end = ("\r\x1b[2K", "") if self._renews else ("", "\n")
        print(f"{begin}{plain(text)}", end=end, file=self._stream, flush=True)


@contextmanager
def counting(*, shown: bool) -> Generator[CountView, None, None]:
    """Provide what shows a count on stderr, or nowhere."""
    renews = shown and commands_cursor(sys.stderr)
    stream = SafeStream(sys.stderr, commanded=renews) if shown else io.StringIO()
    view = CountView(cast(TextIO, stream), renews=renews)
    try:
        yield view
    finally:
        view.close()
