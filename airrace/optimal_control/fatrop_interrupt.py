"""Ctrl-C while fatrop is at work."""

import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def interrupts_held_back(stop: Callable[[], None]) -> Generator[None]:
    """Turn Ctrl-C into a request to stop; what was to be done about it is done after the block.

    Python would raise KeyboardInterrupt as soon as a callback begins, before anything there can catch it, and ctypes
    would drop it.

    Args:
        stop: called within the block, from a callback or between two of them.
    """
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield
        return
    pressed: list[FrameType | None] = []

    def hold_back(_: int, frame: FrameType | None) -> None:
        pressed.append(frame)
        stop()

    signal.signal(signal.SIGINT, hold_back)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
    if pressed:
        previous(signal.SIGINT, pressed[0])
