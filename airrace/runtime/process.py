"""The settings of a process of airrace, its memory, and its child processes.

A worker process is started as `python -m airrace.runtime.process MODULE`. It reads requests from its standard input and
writes results to its standard output, which exist on every system; end of file on either means that the other side
has ended.

Lack of memory is reported in one sentence, with one exit code. A limit of the address space (`ulimit -v`) is met
wherever a library is loaded, in threads and in workers as well, each of which would print a traceback. With hardly any
address space OpenBLAS retries its allocations forever, so nothing is loaded at all then.
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

The matrices are small; further threads would spin on the cores that the solvers need, and the last bits of results
would depend on their number.
"""
COLLECTION_THRESHOLD = 200_000
"""New objects after which the garbage collector runs; with Python's 700 it runs nearly 200 times while libraries are
loaded, and finds next to nothing."""
MEMORY_MIN = 256 * 2**20
"""The smallest address space, bytes; to check a course takes 200 MiB."""
SYSTEM_ERROR = 8
"""The exit code of a process to which the system refuses something, such as memory."""
UNSUPPORTED = (AttributeError, OSError, TypeError)
"""Errors of a function that this system's C library lacks, and of a system without one (Windows)."""


def configure() -> None:
    """Keep linear algebra to one thread, in child processes too, unless the user has set it; collect garbage rarely."""
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    gc.set_threshold(COLLECTION_THRESHOLD)


def ensure_memory() -> None:
    """Raise MemoryError if the address space is limited to less than `MEMORY_MIN`."""
    try:
        import resource
    except ModuleNotFoundError:  # a system without such limits
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < MEMORY_MIN:
        raise MemoryError


def keep_freed_memory() -> None:
    """Let the allocator reuse freed memory, where it can.

    glibc returns arrays of more than 128 kB to the system each time, and fetches them again page by page: a fifth of
    the system time of a run.
    """
    import ctypes

    with contextlib.suppress(*UNSUPPORTED):
        allocator = ctypes.CDLL(None)
        # M_TRIM_THRESHOLD and M_MMAP_THRESHOLD (the largest allowed), bytes.
        for option, value in {-1: 256 * 2**20, -3: 32 * 2**20}.items():
            allocator.mallopt(option, value)


def return_freed_memory() -> None:
    """Return unused memory to the system, where the allocator can."""
    import ctypes

    with contextlib.suppress(*UNSUPPORTED):
        ctypes.CDLL(None).malloc_trim(0)


def omit_memory_tracebacks() -> None:
    """Keep threads that end for lack of memory from printing tracebacks; their callers report it."""
    before = threading.excepthook

    def hook(arguments: threading.ExceptHookArgs) -> None:
        if arguments.exc_value is None or not is_lack_of_memory(arguments.exc_value):
            before(arguments)

    threading.excepthook = hook


def python_command(module: str, *arguments: str) -> tuple[str, ...]:
    """Return the command that runs a module in another process of this Python.

    `-P`: no module is imported from the current folder, whose files may come from anybody.
    """
    return (sys.executable, "-P", "-m", module, *arguments)


def spawn_detached(
    command: Sequence[str], stderr: IO[bytes] | None = None, environment: Mapping[str, str] | None = None
) -> "subprocess.Popen[bytes]":
    """Start a process with pipes, out of reach of a terminal's Ctrl-C: its parent stops it."""
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
    """Claim standard input and output for the requests of the parent process and their results.

    Everything else that reads standard input finds it empty from now on; everything else that is printed goes to
    stderr.
    """
    requests, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    os.dup2(2, 1)
    return requests, results


def set_parent_death_signal() -> None:
    """Have the system kill this process when the thread that started it ends, where it can (Linux).

    Elsewhere, and if that thread has ended already, end of file on standard input shows it.
    """
    import ctypes
    import signal

    with contextlib.suppress(*UNSUPPORTED):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def available_cores(membership: str = "/proc/self/cgroup", groups: str = "/sys/fs/cgroup") -> int:
    """Return the number of cores that this process may use, by its affinity and by its container's quota."""
    count: Callable[[], int | None] = getattr(os, "process_cpu_count", _affine_cores)  # Python 3.13
    return min([count() or 1, *_quotas(membership, groups)])


def _affine_cores() -> int | None:
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
    """Return the stripped content of a file, empty where there is no such file."""
    try:
        with open(os.path.join(*path), encoding="utf-8") as file:
            return file.read().strip()
    except OSError:
        return ""


def main() -> None:
    """Run the module that the first argument names, with the other arguments."""
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
