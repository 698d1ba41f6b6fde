"""The lock of a batch's folder: two batches at a time would write the same files."""

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from airrace.errors import StorageError, UsageError

NAME = ".batch.lock"


@contextmanager
def locked(folder: Path) -> Generator[None, None, None]:
    """Create the folder if it is missing, and lock it. The system releases the lock when this process ends in any way.

    Raises:
        UsageError: another batch holds it, or it is no folder.
        StorageError: the system refused.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except (FileExistsError, NotADirectoryError) as error:
        raise UsageError(f"{folder} is not a folder; name one with --output") from error
    except OSError as error:
        raise StorageError(f"cannot write to the folder {folder}: {error.strerror}") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(f"another batch is at work in {folder}; wait for it, or give --output") from None
        except OSError:  # a file system without locks: nothing to hold
            pass
        yield
    finally:
        os.close(descriptor)
