"""The start of the solver process.

Nothing heavy is imported here, so that it can start before everything else is loaded.
"""

import atexit
import os
import subprocess
import sys
from dataclasses import dataclass
from multiprocessing.connection import Connection

_spare: "WorkerProcess | None" = None


@dataclass(frozen=True)
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
        [sys.executable, "-m", "airrace.memory", "airrace.optimal_control.worker", str(writing)],
        stdin=subprocess.PIPE,
        pass_fds=(writing,),
        start_new_session=True,
    )
    os.close(writing)
    return WorkerProcess(process, Connection(reading, writable=False))


def start_early() -> None:
    """Start a process for the next `take`, to load while the caller does something else.

    If nobody takes it, it ends with this process.
    """
    global _spare
    if _spare is None:
        _spare = start()
        atexit.register(_discard)


def take() -> WorkerProcess:
    """Return the process that was started early, else a new one."""
    global _spare
    taken, _spare = _spare, None
    return taken if taken is not None and taken.process.poll() is None else start()


def _discard() -> None:
    """End the process that nobody took."""
    if _spare is not None:
        _spare.process.kill()
        _spare.process.communicate()
        _spare.replies.close()
