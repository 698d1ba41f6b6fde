"""The settings of a process of airrace, its memory, and how it starts others and ends with them.

A process that only works for another one is started as `python -m airrace.process MODULE`. It reads what it is asked
from its standard input and answers on its standard output: every system has these two, and their end tells each side
that the other one is gone.

Lack of memory is reported in one sentence, with one exit code. A limit of the address space (`ulimit -v`) is met
wherever a library is loaded, in threads and in other processes as well, each of which would print a traceback. With
hardly any address space OpenBLAS asks the system for memory again and again, without an end: then nothing is loaded
at all.
"""

import contextlib
import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import IO, TYPE_CHECKING

from airrace.errors import is_lack_of_memory

if TYPE_CHECKING:
    import subprocess

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment variables that keep libraries for linear algebra to one thread.

What is computed with them here is small. Threads of theirs would wait for work on the cores that the solvers need,
and the last bits of results would depend on their number.
"""
COLLECTION_THRESHOLD = 200_000
"""The number of new objects after which Python looks for cycles among them that nothing refers to any more.

With its own value of 700 it does so nearly two hundred times while the libraries are loaded, and finds next to nothing.
"""
MEMORY_MIN = 256 * 2**20
"""The smallest address space with which anything is begun, bytes; to check a course takes 200 MiB."""
SYSTEM_ERROR = 8
"""The exit code of a process that lacks memory, as `ExitCode.SYSTEM` has it, which takes too long to import."""
NOT_ON_THIS_SYSTEM = (AttributeError, OSError, TypeError)
"""Errors of a function that another C library lacks, or of a system (Windows) that has no one library."""


def configure() -> None:
    """Keep linear algebra to one thread, in processes that are started from this one too, and look for garbage rarely.

    What the user has set stays.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    gc.set_threshold(COLLECTION_THRESHOLD)


def ensure_memory() -> None:
    """Refuse to begin in an address space in which the libraries cannot be loaded.

    Raises:
        MemoryError: it is limited to less than `MEMORY_MIN`.
    """
    try:
        import resource
    except ModuleNotFoundError:  # a system without such limits
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < MEMORY_MIN:
        raise MemoryError


def keep_freed_memory() -> None:
    """Let the allocator keep what is freed for what is to come, where it can.

    glibc returns arrays of more than 128 kB to the system each time, and fetches them again page by page: of a run, a
    fifth of the time that the system itself takes.
    """
    import ctypes

    with contextlib.suppress(*NOT_ON_THIS_SYSTEM):
        allocator = ctypes.CDLL(None)
        # M_TRIM_THRESHOLD and M_MMAP_THRESHOLD (the largest allowed), bytes.
        for option, value in {-1: 256 * 2**20, -3: 32 * 2**20}.items():
            allocator.mallopt(option, value)


def return_freed_memory() -> None:
    """Give memory back to the system that this process has used and does not need now, where the allocator can."""
    import ctypes

    with contextlib.suppress(*NOT_ON_THIS_SYSTEM):
        ctypes.CDLL(None).malloc_trim(0)


def omit_memory_tracebacks() -> None:
    """Keep threads that end for lack of memory from printing tracebacks; whatever waits for them sees the error."""
    before = threading.excepthook

    def hook(ended: threading.ExceptHookArgs) -> None:
        if ended.exc_value is None or not is_lack_of_memory(ended.exc_value):
            before(ended)

    threading.excepthook = hook


def python_command(module: str, *arguments: str) -> tuple[str, ...]:
    """Return the command that runs a module in another process of this Python.

    It never looks for modules in the current folder (`-P`): files there may come from anybody.
    """
    return (sys.executable, "-P", "-m", module, *arguments)


def spawn_detached(
    command: Sequence[str], stderr: IO[bytes] | None = None, environment: Mapping[str, str] | None = None
) -> "subprocess.Popen[bytes]":
    """Start a process to talk with, which a terminal's Ctrl-C does not reach: its starter stops it."""
    import subprocess

    return subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=stderr,
        env=environment,
        start_new_session=True,
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),  # Windows has no sessions
    )


def claim_stdio() -> tuple[IO[bytes], IO[bytes]]:
    """Take standard input and output for what the starter asks and is answered.

    Whatever else this process reads is empty from now on, and whatever else it prints goes to stderr.
    """
    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return asked, answers


def end_with_parent() -> None:
    """Have the system end this process with the thread that started it, where it can (Linux).

    Elsewhere, and if that thread has ended already, the end of standard input says so.
    """
    import ctypes
    import signal

    with contextlib.suppress(*NOT_ON_THIS_SYSTEM):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def available_cores(membership: str = "/proc/self/cgroup", groups: str = "/sys/fs/cgroup") -> int:
    """Return the number of cores that this process may use, which can be fewer than the computer has.

    It may be bound to some of them, and a container may have a quota of their time (`docker run --cpus`).
    """
    count: Callable[[], int | None] = getattr(os, "process_cpu_count", _bound_cores)  # Python 3.13
    return min([count() or 1, *_quotas(membership, groups)])


def _bound_cores() -> int | None:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def _quotas(membership: str, groups: str) -> Iterator[int]:
    """Yield the quotas of the control groups to which this process belongs, version 1 or 2, in whole cores."""
    for _, controllers, path in (line.split(":", 2) for line in _text(membership).splitlines()):
        if controllers and "cpu" not in controllers.split(","):
            continue
        folder = os.path.join(groups, controllers)  # version 2 names no controllers
        for name in ("", *path.strip("/").split("/")):
            folder = os.path.join(folder, name)
            version_1 = f"{_text(folder, 'cpu.cfs_quota_us')} {_text(folder, 'cpu.cfs_period_us')}"
            quota, _, period = (_text(folder, "cpu.max") or version_1).partition(" ")
            if quota.isdecimal() and period.isdecimal():  # neither `max` nor -1
                yield max(1, -(-int(quota) // int(period)))


def _text(*path: str) -> str:
    """Return the content of a file of the system, stripped; nothing where there is no such file."""
    try:
        with open(os.path.join(*path), encoding="utf-8") as file:
            return file.read().strip()
    except OSError:
        return ""


def main() -> None:
    """Run the module that is named by the first argument, with the others."""
    import runpy

    omit_memory_tracebacks()
    configure()
    name = sys.argv.pop(1)
    try:
        ensure_memory()
        runpy.run_module(name, run_name="__main__", alter_sys=True)
    except Exception as error:
        if not is_lack_of_memory(error):
            raise
        sys.exit(SYSTEM_ERROR)


if __name__ == "__main__":
    main()
