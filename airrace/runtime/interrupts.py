"""Ctrl-C and SIGTERM as one request to stop, repeated until it is acknowledged.

A signal raises KeyboardInterrupt at any line of the main thread. casadi swallows it, or turns it into an error of its
own, while it parses its arguments. So the request is stored: it is raised again until it is acknowledged, and an error
after it counts as its consequence. While a KeyboardInterrupt propagates, and processes and files are cleaned up, it is
not raised a second time, however often Ctrl-C is pressed.

Only the entry points of the program listen; the library leaves signals as they are, and defers them during calls of
other libraries that would swallow them.
"""

import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

REPEAT_INTERVAL = 0.3
"""The time after which a request is repeated, s: a command should end within two seconds, and casadi swallows about one
request in three."""

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))
"""The signals that ask to stop; SIGBREAK is all that one process of Windows can send another."""


EXIT_CODE = 130
"""The exit code of a command that was asked to stop: 128 and SIGINT, as shells have it."""


class _Request:
    """The one request of this process."""

    listening = False
    pending = False
    acknowledged = False


def listen() -> None:
    """Handle Ctrl-C and SIGTERM as the same request from now on; neither is ignored in the background."""
    _Request.listening, _Request.pending, _Request.acknowledged = True, False, False
    for number in SIGNALS:
        signal.signal(number, _request)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _request)
    sys.unraisablehook = _report_unraisable


def listening() -> bool:
    """Tell whether requests are repeated until they are acknowledged."""
    return _Request.listening and signal.getsignal(signal.SIGINT) is _request


def caused(error: BaseException) -> bool:
    """Tell whether an error is a request to stop, or a consequence of one."""
    return isinstance(error, KeyboardInterrupt) or _Request.pending


def acknowledge() -> None:
    """Stop repeating the request, and ignore the next one."""
    if _Request.pending or _Request.listening:
        _Request.acknowledged = True
        _set_alarm(0.0)


def acknowledged() -> bool:
    """Tell whether the request was acknowledged."""
    return _Request.acknowledged


def close() -> None:
    """Ignore further requests: the process ends by itself."""
    if _Request.listening:
        _Request.acknowledged = True
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        _set_alarm(0.0)


def _request(number: int, frame: FrameType | None) -> None:
    """Raise the request, unless it was acknowledged or propagates already."""
    if not _Request.acknowledged:
        _Request.pending = True
        _set_alarm(REPEAT_INTERVAL)
        if not _is_interrupt(sys.exc_info()[1]):
            raise KeyboardInterrupt


def _report_unraisable(arguments: "sys.UnraisableHookArgs") -> None:
    """Print nothing of a request that was raised where it cannot propagate, as in a finalizer: it is repeated."""
    if not (_Request.pending and _is_interrupt(arguments.exc_value)):
        sys.__unraisablehook__(arguments)


def _is_interrupt(error: BaseException | None) -> bool:
    """Tell whether an error, or one of its contexts, is an interrupt."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def _set_alarm(seconds: float) -> None:
    """Repeat the request after a time, by SIGALRM; 0 for never."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


@contextmanager
def defer_signals(stop: Callable[[], None] | None = None) -> Generator[None]:
    """Turn Ctrl-C into a request to stop, and handle the signal after the block.

    Python would raise KeyboardInterrupt at the begin of a callback, before anything there can catch it, and ctypes
    would drop it; casadi drops it while it parses its arguments. Without `stop` nothing is deferred where requests are
    repeated until they are acknowledged, for then none is lost.

    Args:
        stop: called within the block, from a callback or between two of them.
    """
    if threading.current_thread() is not threading.main_thread() or (stop is None and listening()):
        yield
        return
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    deferred: list[tuple[int, FrameType | None]] = []

    def defer(number: int, frame: FrameType | None) -> None:
        deferred.append((number, frame))
        if stop is not None:
            stop()

    for number in handlers:
        signal.signal(number, defer)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    for number, frame in deferred[:1]:
        handlers[signal.Signals(number)](number, frame)
