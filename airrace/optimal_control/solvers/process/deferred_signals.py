"""The handling of Ctrl-C during calls of a library that would lose the signal, or be lost by it."""

import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

from airrace import interrupts


def _nothing() -> None:
    """Do nothing: nobody has to hear of it at once."""


@contextmanager
def defer_signals(stop: Callable[[], None] = _nothing) -> Generator[None]:
    """Turn Ctrl-C into a request to stop, and handle the signal after the block.

    Python would raise KeyboardInterrupt as soon as a callback of fatrop begins, before anything there can catch it, and
    ctypes would drop it. casadi drops it while it finds out what its arguments are. SIGTERM is held back likewise where
    something is to be done about it. Where requests to stop are repeated until they are heard, see
    `airrace/interrupts.py`, none is lost, and one that nothing is to be done about need not wait.

    Args:
        stop: called within the block, from a callback or between two of them.
    """
    if threading.current_thread() is not threading.main_thread() or (stop is _nothing and interrupts.listening()):
        yield
        return
    previous = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    held = {number: handler for number, handler in previous.items() if callable(handler)}
    pressed: list[tuple[int, FrameType | None]] = []

    def hold_back(number: int, frame: FrameType | None) -> None:
        pressed.append((number, frame))
        stop()

    for number in held:
        signal.signal(number, hold_back)
    try:
        yield
    finally:
        for number, handler in held.items():
            signal.signal(number, handler)
    for number, frame in pressed[:1]:
        held[signal.Signals(number)](number, frame)
