"""Ctrl-C and SIGTERM as one request to stop, repeated until it is acknowledged.

A signal raises KeyboardInterrupt wherever the main thread is. casadi loses it, or turns it into an error of its own,
if that is while it finds out what its arguments are. So the request is stored: it is raised again until it is
acknowledged, and an error that comes after it counts as its consequence. While an interrupt is on its way, and
processes and files are put in order, it is not raised a second time, however often Ctrl-C is pressed.

Only the edges of the program listen; a library leaves signals as they are, and defers them during calls of other
libraries that would lose them, or be lost by them.
"""

import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

REMINDER = 0.3
"""The time after which a request that is not acknowledged is repeated, s.

A command should end within two seconds, and casadi loses about one request in three.
"""

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))
"""The signals that ask to stop; SIGBREAK is all that one process of Windows can send another."""


class _Request:
    """The one request of this process."""

    listening = False
    made = False
    acknowledged = False


def listen() -> None:
    """Take Ctrl-C and SIGTERM for the same request from now on; neither is ignored in the background."""
    _Request.listening, _Request.made, _Request.acknowledged = True, False, False
    for number in SIGNALS:
        signal.signal(number, _request)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _request)
    sys.unraisablehook = _report_unraisable


def listening() -> bool:
    """Tell whether requests are repeated until they are acknowledged."""
    return _Request.listening and signal.getsignal(signal.SIGINT) is _request


def caused(error: BaseException) -> bool:
    """Tell whether an error is a request to stop, or what became of one."""
    return isinstance(error, KeyboardInterrupt) or _Request.made


def acknowledge() -> None:
    """Acknowledge the request: it is not repeated, and the next one is not needed."""
    if _Request.made or _Request.listening:
        _Request.acknowledged = True
        _remind_in(0.0)


def acknowledged() -> bool:
    """Tell whether the request is acknowledged."""
    return _Request.acknowledged


def close() -> None:
    """Ignore further requests: the process ends by itself."""
    if _Request.listening:
        _Request.acknowledged = True
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        _remind_in(0.0)


def _request(number: int, frame: FrameType | None) -> None:
    """Raise the request, unless it is acknowledged already or on its way."""
    if not _Request.acknowledged:
        _Request.made = True
        _remind_in(REMINDER)
        if not _is_interrupt(sys.exc_info()[1]):
            raise KeyboardInterrupt


def _report_unraisable(ended: "sys.UnraisableHookArgs") -> None:
    """Say nothing of a request that was raised where Python cannot hand it on, as in a finalizer: it is repeated."""
    if not (_Request.made and _is_interrupt(ended.exc_value)):
        sys.__unraisablehook__(ended)


def _is_interrupt(error: BaseException | None) -> bool:
    """Tell whether an error, or one from which it came, is an interrupt."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def _remind_in(seconds: float) -> None:
    """Set the alarm clock of the process, which `_request` answers; 0 for never."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _nothing() -> None:
    """Do nothing; the default of `defer_signals`."""


@contextmanager
def defer_signals(stop: Callable[[], None] = _nothing) -> Generator[None]:
    """Turn Ctrl-C into a request to stop, and handle the signal after the block.

    Python would raise KeyboardInterrupt as soon as a callback begins, before anything there can catch it, and ctypes
    would drop it. casadi drops it while it finds out what its arguments are. SIGTERM is held back likewise where
    something is to be done about it. Where requests to stop are repeated until they are acknowledged, none is lost, and
    one that nothing is to be done about need not wait.

    Args:
        stop: called within the block, from a callback or between two of them.
    """
    if threading.current_thread() is not threading.main_thread() or (stop is _nothing and listening()):
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
