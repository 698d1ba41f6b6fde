"""The start of the solver process.

Nothing heavy is imported here, so that it can start before everything else is loaded.
"""

import atexit
import subprocess

from airrace import process

_idle: list[subprocess.Popen[bytes]] = []


def start() -> "subprocess.Popen[bytes]":
    """Start a solver process: requests go to its standard input, its replies come from its standard output."""
    command = process.python_command("airrace.memory", "airrace.optimal_control.solvers.process.worker")
    return process.started_apart(command)


def start_early(count: int = 1) -> None:
    """Start processes for the next calls of `acquire`, to load while the caller does something else.

    Those that nobody takes end with this process.
    """
    if not _idle:
        atexit.register(_discard)
    while len(_idle) < count:
        _idle.append(start())


def acquire() -> "subprocess.Popen[bytes]":
    """Return a process that was started early, else a new one."""
    while _idle:
        taken = _idle.pop(0)
        if taken.poll() is None:
            return taken
        taken.communicate()
    return start()


def _discard() -> None:
    """End the processes that nobody took."""
    for spare in _idle:
        spare.kill()
        spare.communicate()
