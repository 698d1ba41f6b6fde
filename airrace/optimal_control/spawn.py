"""The start of the solver process.

Nothing heavy is imported here, so that it can start before everything else is loaded.
"""

import atexit
import os
import subprocess
import sys
from multiprocessing.connection import Connection

from airrace.process import python_command
from airrace.records import record

_spares: "list[WorkerProcess]" = []


@record
class WorkerProcess:
    """A solver process: requests go to its standard input, its answers arrive on `replies`."""

    process: subprocess.Popen[bytes]
    replies: Connection


def start() -> WorkerProcess:
    """Start a solver process in a session of its own.

    A terminal's Ctrl-C reaches this process alone, which stops the solver process.
    """
    reading, writing = os.pipe()
    process = subprocess.Popen(
        python_command("airrace.memory", "airrace.optimal_control.worker", str(writing)),
        stdin=subprocess.PIPE,
        pass_fds=(writing,),
        start_new_session=True,
    )
    os.close(writing)
    return WorkerProcess(process, Connection(reading, writable=False))


def available_cores() -> int:
    """Return the number of cores that this process may use, which can be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def start_early(count: int = 1) -> None:
    """Start processes for the next calls of `take`, to load while the caller does something else.

    Those that nobody takes end with this process.
    """
    if not _spares:
        atexit.register(_discard)
    while len(_spares) < count:
        _spares.append(start())


def take() -> WorkerProcess:
    """Return a process that was started early, else a new one."""
    while _spares:
        taken = _spares.pop(0)
        if taken.process.poll() is None:
            return taken
    return start()


def _discard() -> None:
    """End the processes that nobody took."""
    for spare in _spares:
        spare.process.kill()
        spare.process.communicate()
        spare.replies.close()
