"""Faster products of small matrices for fatrop, in the place of those in blasfeo.

The blasfeo that casadi brings along is built for any processor, and fatrop spends half of its own time in three of its
functions. `products.c` has them for vector registers. They are compiled once per machine like the kernels, compared
with blasfeo's bit by bit, and loaded so that the dynamic linker finds them first. Without a compiler, on other
systems than Linux, or with a blasfeo that computes otherwise, everything stays as it is.
"""

import ctypes
import logging
import os
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np

from airrace.errors import KernelError
from airrace.optimal_control import own_code
from airrace.optimal_control.lanes import InstructionSet, instruction_set
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

FILE = Path(__file__).with_name("products.c")
MATRICES, COLUMNS, ROWS = "kernel_dgemm_nt_4x4_lib4", "kernel_dgemv_n_4_lib4", "kernel_dgemv_t_4_lib4"
_FLAGS = ("-O3",)
_LONGEST = 24  # columns of the panels with which both functions are compared


@cache
def install() -> bool:
    """Let blasfeo use the faster products, and return whether it does.

    The linker looks for a function when it is called first, so this has to come before the first solve of the process.
    """
    if sys.platform != "linux" or instruction_set().lanes == 1:
        return False
    try:
        library = compiled(instruction_set())
        if not same_bits(ctypes.CDLL(str(library)), blasfeo()):
            return False
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    except (KernelError, OSError, AttributeError) as error:  # AttributeError: a library without that function
        logger.info("fatrop keeps the products of blasfeo: %s", error)
        return False
    return True


def compiled(instructions: InstructionSet) -> Path:
    """Return the compiled library, built unless the cache has it intact.

    Raises:
        KernelError: it cannot be built.
    """
    return own_code.compiled(FILE, (*_FLAGS, *instructions.flags))


def same_bits(one: ctypes.CDLL, other: ctypes.CDLL) -> bool:
    """Return whether the functions of two libraries give the same bits, for panels of all lengths."""
    random = np.random.default_rng(1)
    for kmax in range(_LONGEST + 1):
        panels = max(4, kmax) // 4 + 2  # of four rows each, as many as rows from any offset need
        A, B = (random.normal(size=16 * panels) for _ in range(2))
        C, x = random.normal(size=16), random.normal(size=max(4, kmax))
        for alpha, beta in ((1.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (0.3, -0.7)):
            factors = np.array([alpha, beta])
            calls: list[tuple[str, list[int | Array]]] = [
                (MATRICES, [kmax, factors[:1], A, B, factors[1:], C]),
                (COLUMNS, [kmax, factors[:1], A, x, factors[1:], C]),
                *((ROWS, [kmax, factors[:1], offset, A[offset:], 4, x, factors[1:], C]) for offset in range(4)),
            ]
            if not all(np.array_equal(_result(one, *call), _result(other, *call)) for call in calls):
                return False
    return True


def _result(library: ctypes.CDLL, name: str, given: Sequence[int | Array]) -> Array:
    """Return the last argument of a function, which it writes; the others are given, arrays by their addresses."""
    function, result = library[name], np.zeros(16)
    types = [ctypes.c_int if isinstance(one, int) else ctypes.c_void_p for one in given]
    function.argtypes, function.restype = (*types, ctypes.c_void_p), None
    function(*(one if isinstance(one, int) else one.ctypes.data for one in given), result.ctypes.data)
    return result


def blasfeo() -> ctypes.CDLL:
    """Return the library that fatrop depends on, loaded so that its calls are bound when they are made first.

    ctypes itself would bind them at once, to its own functions.

    Raises:
        OSError: there is none.
    """
    path = str(Path(ca.__file__).parent / "libblasfeo.so.0")
    load = ctypes.CDLL(None).dlopen
    load.argtypes, load.restype = (ctypes.c_char_p, ctypes.c_int), ctypes.c_void_p
    handle: int | None = load(path.encode(), os.RTLD_LAZY)
    if handle is None:
        raise OSError(f"{path} cannot be loaded")
    return ctypes.CDLL(path, handle=handle)
