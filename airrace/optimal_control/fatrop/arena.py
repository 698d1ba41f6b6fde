"""Memory for fatrop's matrices and vectors, in the place of blasfeo's, see `arena.c` of the native library.

fatrop sets up several times what a solve needs. What it never writes takes no memory here, and what a solve has used is
kept for the next one: of 16 laps of `sixteen_phases` the solver process takes 293 MB instead of 465 MB. Only Linux's
dynamic linker takes the first function of a name that it finds; elsewhere, and without the native library, blasfeo's
memory is used.
"""

import ctypes
import logging
import sys
from functools import cache

from airrace.native.library import library, library_path
from airrace.optimal_control.fatrop.library import blasfeo
from airrace.records import record

logger = logging.getLogger(__name__)

LARGE = 2**28
"""The memory in all from which pages of zeros are given back to the system, bytes."""
KEPT = 2**28
"""The memory that is kept for the next solve, bytes."""

_FUNCTIONS = ("blasfeo_memsize_dmat", "blasfeo_memsize_dvec", "blasfeo_create_dmat", "blasfeo_create_dvec")
"""The functions of blasfeo that are asked, in the order of the struct in `arena.c`."""


@record
class Use:
    """The memory that is handed out, the most that ever was, and what was given back to the system so far, bytes."""

    in_use: int
    most: int
    returned: int


@cache
def install() -> bool:
    """Let fatrop take its memory from here, and return whether it does.

    The linker looks for functions when fatrop is loaded, so this has to come before.
    """
    path = library_path()
    if not sys.platform.startswith("linux") or library() is None or path is None:
        return False
    try:
        begin(ctypes.CDLL(str(path), ctypes.RTLD_GLOBAL), LARGE, KEPT)
    except (OSError, AttributeError) as error:  # AttributeError: another blasfeo
        logger.info("fatrop keeps the memory of blasfeo: %s", error)
        return False
    return True


def begin(native: ctypes.CDLL, large: int, kept: int) -> None:
    """Tell the native library blasfeo's functions and the limits of its memory, bytes.

    Raises:
        OSError: there is no blasfeo.
        AttributeError: it has no such functions.
    """
    own = blasfeo()
    addresses = [ctypes.cast(own[name], ctypes.c_void_p).value for name in _FUNCTIONS]
    native.arena_begin.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
    native.arena_begin((ctypes.c_void_p * len(addresses))(*addresses), large, kept)


def use() -> Use | None:
    """Return what fatrop's memory amounts to, None where it is not taken from here."""
    path = library_path()
    return None if path is None or not install() else use_of(ctypes.CDLL(str(path)))


def use_of(native: ctypes.CDLL) -> Use:
    """Return what the memory of a loaded native library amounts to."""
    numbers = (ctypes.c_size_t * 3)()
    native.arena_use(numbers)
    return Use(*numbers)
