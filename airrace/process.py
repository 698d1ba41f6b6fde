"""The settings of a process of airrace, made before it loads a library, and the command that starts another one."""

import gc
import os
import sys

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment variables that keep libraries for linear algebra to one thread.

What is computed with them here is small. Threads of theirs would wait for work on the cores that the solvers need,
and the last bits of results would depend on their number.
"""
CREATED = 200_000
"""The number of new objects after which Python looks for cycles among them that nobody refers to any more.

With its own value of 700 it does so nearly two hundred times while the libraries are loaded, and finds next to nothing.
"""


def settle() -> None:
    """Keep linear algebra to one thread, in processes that are started from this one too, and look for garbage rarely.

    What the user has set stays.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    gc.set_threshold(CREATED)


def python_command(module: str, *arguments: str) -> tuple[str, ...]:
    """Return the command that runs a module in another process of this Python.

    It never looks for modules in the current folder (`-P`): files there may come from anybody.
    """
    return (sys.executable, "-P", "-m", module, *arguments)
