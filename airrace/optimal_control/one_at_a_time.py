"""A lock that processes hold one after another; the system gives it back if its holder dies."""

import contextlib
import fcntl
import os
from collections.abc import Generator
from pathlib import Path


@contextlib.contextmanager
def alone(path: Path) -> Generator[None]:
    """Wait until no other process holds the file of this name, and hold it; it is removed in the end.

    On a file system without locks nobody waits.

    Raises:
        OSError: the file cannot be made.
    """
    descriptor = _held(path)
    try:
        yield
    finally:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        os.close(descriptor)


def _held(path: Path) -> int:
    """Return the descriptor of the file once it is held."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        with contextlib.suppress(OSError):  # there are no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(path.stat(), os.fstat(descriptor)):
                return descriptor
        os.close(descriptor)  # whoever held it has removed it since it was opened
