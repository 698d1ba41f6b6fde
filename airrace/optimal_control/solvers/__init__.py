"""Solvers of programs, and the start of solver processes ahead of their use.

Nothing heavy is imported here: a process that is started before everything else loads beside it, which saves 0.3 s of a
command.
"""

import atexit
import subprocess

from airrace.runtime import process

INTERIOR_POINT, IPOPT = "interior-point", "ipopt"
"""The names of the solvers."""

_idle: list[subprocess.Popen[bytes]] = []


def start() -> "subprocess.Popen[bytes]":
    """Start a solver process: requests go to its standard input, its replies come from its standard output."""
    command = process.python_command("airrace.runtime.process", "airrace.optimal_control.solvers.worker")
    return process.spawn_detached(command)


def start_early(count: int = 1) -> None:
    """Start processes for the next calls of `acquire`; those left over end with this process."""
    if not _idle:
        atexit.register(_discard)
    while len(_idle) < count:
        _idle.append(start())


def acquire() -> "subprocess.Popen[bytes]":
    """Return a process that was started early, else a new one."""
    while _idle:
        idle = _idle.pop(0)
        if idle.poll() is None:
            return idle
        idle.communicate()
    return start()


def _discard() -> None:
    for idle in _idle:
        idle.kill()
        idle.communicate()
