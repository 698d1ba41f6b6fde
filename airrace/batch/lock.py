"""The lock of a batch's folder: two batches at a time would write the same files."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from airrace.errors import StorageError, UsageError
from airrace.runs.run_lock import held

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
    except (FileExistsError, NotADirectoryError) as error:
        raise UsageError(f"{folder} is not a folder; name one with --out-dir") from error
    except OSError as error:
        raise StorageError(f"cannot write to the folder {folder}: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise StorageError(f"cannot write to the folder {folder}: permission denied")
    with held(folder / NAME) as refused:
        if refused:
            raise UsageError(f"another batch is at work in {folder}; wait for it, or give --out-dir")
        yield
