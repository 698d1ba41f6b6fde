"""The compilation of kernels in the background, by one process of low priority, while this one does other things.

Nobody waits for it: what is not compiled yet is evaluated by the machine, see `machine_kernels.py`. The process ends
with this one; what it has not finished then is compiled by a later run.
"""

import contextlib
import os
import pickle
import queue
import subprocess
import threading
import time
from pathlib import Path

from airrace.optimal_control.kernel_library import cache_folder
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.process import python_command
from airrace.system import System

HEAD_START = 3.0
"""The time for which the first run on a machine is left alone, s.

It has to compile what no run can do without, and flies on the machine for all models; a short race is over by then.
Later runs have their models compiled from the beginning.
"""
FIRST_RUN = 60.0
"""The age of the oldest library in the cache up to which a run is taken for the first, s."""

_orders: "queue.SimpleQueue[bytes]" = queue.SimpleQueue()
_ordered: set[Path] = set()
_ordering = threading.Lock()


def order(library: Path, system: System, scheme: RungeKutta) -> None:
    """Let a library be compiled, unless that is ordered already."""
    with _ordering:
        if library in _ordered:
            return
        if not _ordered:  # the thread lives as long as this process, and with it what it starts
            threading.Thread(target=_deliver, daemon=True).start()
        _ordered.add(library)
    _orders.put(pickle.dumps((dict(os.environ), system, scheme)))


def _deliver() -> None:
    """Start a process, and write to it what is ordered; a pipe fills up while the other side loads or compiles.

    One that has ended is followed by another. Where the system has none to give, later runs will compile.
    """
    time.sleep(HEAD_START if is_first_run() else 0.0)
    with contextlib.suppress(OSError):
        process = _started()
        while True:
            text = _orders.get()
            try:
                _write(text, process)
            except OSError:
                process.wait()
                process = _started()
                _write(text, process)


def is_first_run() -> bool:
    """Return whether the cache has only just begun to be filled."""
    now = time.time()
    with contextlib.suppress(OSError):  # a library was removed meanwhile: it is no new cache
        return now - min((one.stat().st_mtime for one in cache_folder().glob("*.so")), default=now) < FIRST_RUN
    return False


def _write(text: bytes, process: "subprocess.Popen[bytes]") -> None:
    assert process.stdin is not None  # it is a pipe
    process.stdin.write(text)
    process.stdin.flush()


def _started() -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        python_command("airrace.optimal_control.compiler_process"),
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # a terminal's Ctrl-C is the starting process's business
    )
