"""A process that compiles the kernels of one system, `python -m airrace.optimal_control.compiler_process`.

`background_compilation.py` starts it and hands over system and scheme, pickled, as standard input. Ended early, it
takes its compilers and temporary files along.
"""

import ctypes
import os
import pickle
import signal
import sys
from types import FrameType

from airrace.errors import KernelError
from airrace.optimal_control.kernels import compile_kernels

PRIORITY = 10
"""The decrement of the process's priority, as of `nice`, from 0 to 19: compiling takes what the solver leaves."""

_PR_SET_PDEATHSIG = 1


def _leave(number: int, frame: FrameType | None) -> None:
    sys.exit(128 + number)


def main() -> int:
    """Compile the kernels that standard input asks for; return 1 if that is impossible, else 0."""
    signal.signal(signal.SIGTERM, _leave)
    if sys.platform == "linux":  # elsewhere it finishes the few seconds of its work
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    os.nice(PRIORITY)
    system, scheme = pickle.load(sys.stdin.buffer)
    try:
        compile_kernels(system, scheme)
    except KernelError:
        return 1  # whoever needs the kernels will find out why
    return 0


if __name__ == "__main__":
    sys.exit(main())
