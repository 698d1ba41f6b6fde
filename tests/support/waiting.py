"""Waiting for what other processes do: as long as a busy machine needs, and no longer than a test may hang."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

PATIENCE = 120.0
"""The time after which something is considered to hang, s."""


def instant(seconds: float) -> float:
    """The time, by `time.monotonic`, so many seconds from now."""
    return time.monotonic() + seconds


def has_passed(instant: float) -> bool:
    return time.monotonic() >= instant


def wait_until(holds: Callable[[], Any]) -> Any:
    """Wait until something holds, and return it."""
    deadline = instant(PATIENCE)
    while not (held := holds()):
        assert not has_passed(deadline), "it never came about"
        time.sleep(0.02)
    return held


def text_of(path: Path) -> str:
    """The text of a file, as soon as there is one."""
    return wait_until(lambda: path.exists() and path.read_text())


def alive(process: int) -> bool:
    """Whether a process runs (Linux); one that waits to be buried does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def wait_until_gone(*processes: int) -> None:
    """Wait until processes have ended."""
    wait_until(lambda: not any(map(alive, processes)))
