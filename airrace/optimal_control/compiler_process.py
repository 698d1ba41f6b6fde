"""A process that compiles kernels, one system after another: `python -m airrace.optimal_control.compiler_process`.

`background_compilation.py` starts it and writes environments, systems and schemes to its standard input, pickled.
Ended early, it takes its compilers and temporary files along, and leaves what is compiled of a library to the next one.
"""

import contextlib
import ctypes
import os
import pickle
import signal
import sys
from pathlib import Path
from types import FrameType

from airrace.errors import KernelError
from airrace.optimal_control.kernels import compile_kernels

PRIORITY = 10
"""The decrement of the process's priority, as of `nice`, from 0 to 19: compiling takes what the solver leaves."""

AUTOGROUP = Path("/proc/self/autogroup")
"""The file through which Linux tells and takes the priority of this process's session."""

_PR_SET_PDEATHSIG = 1


def _give_way() -> None:
    """Lower the priority of this process and its compilers.

    Where Linux groups processes by their sessions (autogroup, see sched(7)), a priority counts within a session only.
    Then that of the session is lowered, too, if it is this process's own.
    """
    os.nice(PRIORITY)
    if os.getsid(0) == os.getpid():
        with contextlib.suppress(OSError):  # there are no such groups
            AUTOGROUP.write_text(str(PRIORITY))


def _leave(number: int, frame: FrameType | None) -> None:
    sys.exit(128 + number)


def main() -> int:
    """Compile the kernels that standard input asks for until it ends; return 1 if some could not be, else 0."""
    signal.signal(signal.SIGTERM, _leave)
    if sys.platform == "linux":  # elsewhere it finishes the few seconds of its work
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    _give_way()
    failures = 0
    with contextlib.suppress(EOFError):
        while True:
            environment, system, scheme = pickle.load(sys.stdin.buffer)
            os.environ.clear()
            os.environ.update(environment)  # which names the compiler and the folder
            try:
                compile_kernels(system, scheme, at_once=1)
            except KernelError:
                failures += 1  # whoever needs the kernels will find out why
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
