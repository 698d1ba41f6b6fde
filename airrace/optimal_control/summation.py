"""The sums of `sums.py` in machine code: `sums.c`, compiled once per machine like the kernels.

numpy passes through memory for every step of all sums, C once. Both have the same bits, so that without a compiler
numpy does it alone.
"""

import ctypes
import logging
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import cast

from airrace.errors import KernelError
from airrace.optimal_control import own_code

logger = logging.getLogger(__name__)

FILE = Path(__file__).with_name("sums.c")
_FLAGS = ("-O2",)

AddUp = Callable[[int, int, int, int, int, int, int], int]
"""The function of `sums.c`: of the number of sums, and the addresses of all arrays."""
AddUpRepeated = Callable[..., int]
"""The other function of `sums.c`: of three numbers, and the addresses of fifteen arrays."""

_installed: list[tuple[AddUp, AddUpRepeated]] = []


@cache
def install() -> bool:
    """Let sums be added up by machine code from now on in this process, and return whether they are."""
    try:
        library = ctypes.CDLL(str(own_code.compiled(FILE, _FLAGS)))
        function, repeated = library.add_up, library.add_up_repeated
    except (KernelError, OSError, AttributeError) as error:  # AttributeError: a library without that function
        logger.info("numpy adds up the derivatives: %s", error)
        return False
    function.argtypes, function.restype = (ctypes.c_int64, *[ctypes.c_void_p] * 6), ctypes.c_int
    repeated.argtypes, repeated.restype = (*[ctypes.c_int64] * 3, *[ctypes.c_void_p] * 15), ctypes.c_int
    _installed.append((cast(AddUp, function), cast(AddUpRepeated, repeated)))
    return True


def add_up() -> AddUp | None:
    """Return the function, None where it is not installed."""
    return _installed[0][0] if _installed else None


def repeated() -> AddUpRepeated | None:
    """Return the function for sums that repeat, None where it is not installed."""
    return _installed[0][1] if _installed else None
