"""What one test has computed is kept for all others of the same `pytest` command, in whichever process they run."""

import functools
import hashlib
import os
import pickle
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

from filelock import FileLock

P = ParamSpec("P")
T = TypeVar("T")
FOLDER = "AIRRACE_TESTS_CACHE"
"""Environment variable that tells the processes of one command their common folder."""


def open_folder() -> None:
    """Make the folder, in the process that starts all others; it holds nothing of an earlier command."""
    os.environ[FOLDER] = tempfile.mkdtemp(prefix="airrace-tests-")


def remove_folder() -> None:
    shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True)


def cached_across_workers(function: Callable[P, T]) -> Callable[P, T]:
    """Call a function once for equal arguments; a process that wants what another one is computing waits for it.

    The arguments need hashes and a `repr` that tells them apart; the result is pickled.
    """
    name = f"{function.__module__}.{function.__qualname__}"

    @functools.cache
    def recalled(*args: P.args, **kwargs: P.kwargs) -> T:
        if FOLDER not in os.environ:  # imported by a script, which is one process
            return function(*args, **kwargs)
        key = hashlib.sha256(repr((name, args, sorted(kwargs.items()))).encode()).hexdigest()[:32]
        path = Path(os.environ[FOLDER]) / f"{key}.pickle"
        with FileLock(path.with_suffix(".lock")):
            if not path.exists():
                result = function(*args, **kwargs)
                path.write_bytes(pickle.dumps(result))
                return result
        return pickle.loads(path.read_bytes())

    return functools.wraps(function)(recalled)
