"""Memory for fatrop's matrices and vectors, in the place of blasfeo's, see `arena.c`.

fatrop sets up several times what a solve needs. What it never writes takes no memory here, and what a solve has used is
kept for the next one. Without a compiler or on other systems than Linux everything stays as it is.
"""

import ctypes
import logging
import sys
from functools import cache
from pathlib import Path

from airrace.errors import KernelError
from airrace.optimal_control import own_code
from airrace.optimal_control.fatrop.products import blasfeo
from airrace.records import record

logger = logging.getLogger(__name__)

FILE = Path(__file__).with_name("arena.c")
FLAGS = ("-O2", "-fvisibility=hidden")

_FUNCTIONS = ("blasfeo_memsize_dmat", "blasfeo_memsize_dvec", "blasfeo_create_dmat", "blasfeo_create_dvec")
"""The functions of blasfeo that are asked, in the order of the struct in `arena.c`."""

_installed: list[ctypes.CDLL] = []


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
    if sys.platform != "linux":
        return False
    try:
        path = own_code.compiled(FILE, FLAGS)
        introduce(ctypes.CDLL(str(path)))
        _installed.append(ctypes.CDLL(str(path), ctypes.RTLD_GLOBAL))
    except (KernelError, OSError, AttributeError) as error:  # AttributeError: a library without that function
        logger.info("fatrop keeps the memory of blasfeo: %s", error)
        return False
    return True


def introduce(library: ctypes.CDLL) -> None:
    """Tell a library of `arena.c` the functions of blasfeo that it asks.

    Raises:
        OSError: there is no blasfeo.
        AttributeError: it has no such functions.
    """
    own = blasfeo()
    addresses = [ctypes.cast(own[name], ctypes.c_void_p).value for name in _FUNCTIONS]
    library.arena_begin((ctypes.c_void_p * len(addresses))(*addresses))


def use() -> Use | None:
    """Return what fatrop's memory amounts to, None where it is not taken from here."""
    return use_of(_installed[0]) if _installed else None


def use_of(library: ctypes.CDLL) -> Use:
    """Return what the memory of a library of `arena.c` amounts to."""
    numbers = (ctypes.c_size_t * 3)()
    library.arena_use(numbers)
    return Use(*numbers)
