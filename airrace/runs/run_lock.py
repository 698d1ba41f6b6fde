"""The lock of a run that is being flown: two of them at a time would write the same file in turn."""

import contextlib
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from airrace.errors import UsageError

PATIENCE = 0.1
"""The time for which a lock is tried, s: whoever holds it may just be removing it."""


@contextmanager
def flown_alone(path: Path | None) -> Generator[None, None, None]:
    """Hold the lock of a run's file while it is flown.

    It lies beside the file, for that is replaced after every stage. The system releases it when this process ends in
    any way; where the folder takes no files, or knows no locks, there is nothing to hold.

    Args:
        path: the checkpoint; None for a run that is kept in memory alone.

    Raises:
        UsageError: another process holds it.
    """
    target = None if path is None else Path(os.path.realpath(path))
    if target is None or not target.parent.is_dir():
        yield
        return
    with held(target.with_name(f".{target.name[:200]}.lock")) as refused:
        if refused:
            raise UsageError(f"{path} is being flown by another process; wait for it, or name another file")
        yield


@contextmanager
def held(lock: Path) -> Generator[bool, None, None]:
    """Hold a lock that is a file of its own, and tell whether it is refused since another process holds it.

    Where its folder takes no files, or knows no locks, nobody holds it.
    """
    from filelock import FileLock, Timeout  # which not every command loads

    own = FileLock(lock)
    refused = False
    try:
        own.acquire(timeout=PATIENCE, poll_interval=PATIENCE / 4)
    except Timeout:
        refused = True
    except (OSError, NotImplementedError):
        pass
    try:
        yield refused
    finally:
        if own.is_locked:
            with contextlib.suppress(OSError):  # Windows removes it when it is released
                lock.unlink()
            own.release()
