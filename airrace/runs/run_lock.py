"""The lock of a run that is being flown: two of them at a time would write the same file in turn."""

import contextlib
import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from airrace.errors import UsageError


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
    if path is None:
        yield
        return
    target = Path(os.path.realpath(path))
    lock = target.with_name(f".{target.name[:200]}.lock")
    descriptor = _locked(lock, path)
    try:
        yield
    finally:
        if descriptor is not None:
            with contextlib.suppress(OSError):
                lock.unlink()
            os.close(descriptor)


def _locked(lock: Path, path: Path) -> int | None:
    """Return the descriptor of a lock that is held; None where there is nothing to hold."""
    while True:
        try:
            descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError:
            return None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if lock.exists() and os.path.samestat(os.fstat(descriptor), lock.stat()):
                return descriptor
        except BlockingIOError:
            os.close(descriptor)
            raise UsageError(f"{path} is being flown by another process; wait for it, or name another file") from None
        except OSError:  # a file system without locks, or a lock that has just been removed
            os.close(descriptor)
            return None
        os.close(descriptor)  # whoever held it has removed it since it was opened
