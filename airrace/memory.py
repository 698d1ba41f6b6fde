"""Too little memory, told as that: in one sentence, with one exit code, and before a library waits for it forever.

A limit of the address space (`ulimit -v`) is met wherever a library is loaded, in threads and in processes that load
libraries on their own as well. Each of them would print a traceback beside the sentence of the command. With hardly any
address space OpenBLAS asks the system for memory again and again, without an end: then nothing is loaded at all.

A process that only works for another one is started as `python -m airrace.memory MODULE ARGUMENTS...`, which is
`python -m MODULE ARGUMENTS...` without such tracebacks.
"""

import contextlib
import runpy
import sys
import threading

from airrace import process
from airrace.errors import is_lack_of_memory

LEAST = 256 * 2**20
"""The smallest address space with which anything is begun, bytes; to check a course takes 200 MiB."""
CODE = 8
"""The exit code of a process that lacks memory, as `ExitCode.SYSTEM` has it, which takes too long to import."""


KEPT = 256 * 2**20
"""The memory that `keep` lets the allocator keep, bytes."""
LARGEST_KEPT = 32 * 2**20
"""The largest piece that it keeps, bytes: as large as glibc allows."""
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's mallopt
LACKING = (AttributeError, OSError, TypeError)
"""Errors of a function that another C library than glibc lacks, or of a system (Windows) that has no one library."""


def ensure_enough() -> None:
    """Refuse to begin in an address space in which the libraries cannot be loaded.

    Raises:
        MemoryError: it is limited to less than `LEAST`.
    """
    try:
        import resource
    except ModuleNotFoundError:  # a system without such limits
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < LEAST:
        raise MemoryError


def keep() -> None:
    """Let the allocator keep what is freed for what is to come, where it can.

    glibc returns arrays of more than 128 kB to the system each time, and fetches them again page by page: of a run, a
    fifth of the time that the system itself takes.
    """
    import ctypes  # which not every command loads

    with contextlib.suppress(*LACKING):
        allocator = ctypes.CDLL(None)
        allocator.mallopt(_TRIM_THRESHOLD, KEPT)
        allocator.mallopt(_MMAP_THRESHOLD, LARGEST_KEPT)


def give_back() -> None:
    """Give memory back to the system that this process has used and does not need now, where the allocator can."""
    import ctypes  # which not every command loads

    with contextlib.suppress(*LACKING):
        ctypes.CDLL(None).malloc_trim(0)


def tell_no_traceback() -> None:
    """Keep threads that end for lack of memory from printing tracebacks; whoever needs their work finds that out."""
    before = threading.excepthook

    def hook(ended: threading.ExceptHookArgs) -> None:
        if ended.exc_value is None or not is_lack_of_memory(ended.exc_value):
            before(ended)

    threading.excepthook = hook


def main() -> None:
    """Run the module that is named by the first argument, with the others."""
    tell_no_traceback()
    process.settle()
    name = sys.argv[1]
    del sys.argv[1]
    try:
        ensure_enough()
        runpy.run_module(name, run_name="__main__", alter_sys=True)
    except Exception as error:
        if not is_lack_of_memory(error):
            raise
        sys.exit(CODE)


if __name__ == "__main__":
    main()
