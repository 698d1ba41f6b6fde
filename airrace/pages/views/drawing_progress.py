"""The progress of a film on a terminal: one line that is written over, elsewhere a line for every tenth."""

import math
import time
from collections.abc import Callable

from airrace.pages.views.plain_text import SafeStream

STEP = 0.1
"""The share of the pictures after which a line is written where no line can be written over."""
SHORTEST = 2.0
"""The time after which the time left is told, s: by then it is known roughly."""


class DrawingProgress:
    """What is being done, how far it is, and how long it will take."""

    def __init__(
        self, doing: str, stream: SafeStream, *, in_place: bool, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._doing = doing
        self._stream = stream
        self._in_place = in_place
        self._clock = clock
        self._first: tuple[float, float] | None = None  # when the first share was done, and which
        self._told = -STEP

    def say(self, text: str) -> None:
        """Tell what is being done."""
        self._write(text, ends=False)

    def show(self, share: float) -> None:
        """Tell which share is done; the clock starts with the first picture, for programs that draw start slowly."""
        now = self._clock()
        if self._first is None and share > 0.0:
            self._first = now, share
        if not self._in_place and share < 1.0 and share - self._told < STEP - 1e-9:
            return
        self._told = share
        text = f"{self._doing}: {share:4.0%}"
        if self._first is not None and share < 1.0:
            begun, first = self._first
            if now - begun >= SHORTEST:
                text += f", {duration_text((now - begun) * (1.0 - share) / (share - first))} left"
        self._write(text, ends=share >= 1.0)

    def _write(self, text: str, *, ends: bool) -> None:
        line = f"\r{text:<44}" + "\n" * ends if self._in_place else f"{text}\n"
        print(line, end="", file=self._stream, flush=True)


def duration_text(seconds: float) -> str:
    """Return a duration in round words, never less than it is."""
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
