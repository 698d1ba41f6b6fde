"""The compilation of kernels in the background, by processes of low priority, while this one does other things."""

import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.system import System

_under_way: dict[Path, "subprocess.Popen[bytes]"] = {}


def start(library: Path, system: System, scheme: RungeKutta) -> None:
    """Start a process that makes this library, unless one is doing so already.

    The process ends with the process that started it.
    """
    if under_way(library):
        return
    with tempfile.TemporaryFile() as order:  # a pipe would fill up before the other side has loaded
        pickle.dump((system, scheme), order)
        order.seek(0)
        _under_way[library] = subprocess.Popen(
            [sys.executable, "-m", "airrace.optimal_control.compiler_process"],
            stdin=order,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # a terminal's Ctrl-C is the starting process's business
        )


def under_way(library: Path) -> bool:
    """Return whether a process started here is making this library."""
    return library in _under_way and _under_way[library].poll() is None


def finish(library: Path) -> None:
    """Wait for the process that makes this library, if there is one.

    Whether it succeeded is seen from the library.
    """
    if (process := _under_way.pop(library, None)) is not None:
        process.wait()
