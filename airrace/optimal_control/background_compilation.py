"""The compilation of kernels in the background, by one process of low priority, while this one does other things.

Nobody waits for it: what is not compiled yet is evaluated by the machine, see `machine_kernels.py`. The process ends
with this one; what it has not finished then is compiled by a later run.
"""

import contextlib
import pickle
import queue
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO

from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.records import record
from airrace.system import System


@record
class _Compiler:
    """A process that compiles what it is sent, one library after another."""

    process: "subprocess.Popen[bytes]"
    orders: "queue.SimpleQueue[bytes]"
    ordered: set[Path]


_running: list[_Compiler] = []
_starting = threading.Lock()


def order(library: Path, system: System, scheme: RungeKutta) -> None:
    """Let a library be compiled, unless that is ordered already."""
    with _starting:
        if _running and _running[0].process.poll() is not None:
            _running.clear()
        if not _running:
            _running.append(_started())
        if library not in _running[0].ordered:
            _running[0].ordered.add(library)
            _running[0].orders.put(pickle.dumps((system, scheme)))


def _started() -> _Compiler:
    process = subprocess.Popen(
        [sys.executable, "-m", "airrace.optimal_control.compiler_process"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # a terminal's Ctrl-C is the starting process's business
    )
    assert process.stdin is not None  # it is a pipe
    orders: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_deliver, args=(orders, process.stdin), daemon=True).start()
    return _Compiler(process, orders, set())


def _deliver(orders: "queue.SimpleQueue[bytes]", to: IO[bytes]) -> None:
    """Write orders as they come; a pipe fills up while the other side loads or compiles."""
    with contextlib.suppress(OSError):  # the process has ended
        while True:
            to.write(orders.get())
            to.flush()
