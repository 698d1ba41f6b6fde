"""Faster products of small matrices for fatrop, in the place of those in blasfeo.

The blasfeo that casadi brings along is built for any processor, and fatrop spends a third of its own time in one of its
functions. `products.c` is that function for vector registers. It is compiled once per machine like the kernels,
compared with blasfeo's bit by bit, and loaded so that the dynamic linker finds it first. Without a compiler, on other
systems than Linux, or with a blasfeo that computes otherwise, everything stays as it is.
"""

import ctypes
import logging
import os
import sys
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
FUNCTION = "kernel_dgemm_nt_4x4_lib4"
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
        if not same_bits(ctypes.CDLL(str(library)), _blasfeo()):
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
    """Return whether the function of two libraries gives the same bits, for panels of all lengths."""
    random = np.random.default_rng(1)
    for kmax in range(_LONGEST + 1):
        A, B, C = (random.normal(size=4 * max(4, kmax)) for _ in range(3))
        for alpha, beta in ((1.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (0.3, -0.7)):
            here, there = (_product(library, kmax, alpha, A, B, beta, C) for library in (one, other))
            if not np.array_equal(here, there):
                return False
    return True


def _product(library: ctypes.CDLL, kmax: int, alpha: float, A: Array, B: Array, beta: float, C: Array) -> Array:
    function = library[FUNCTION]
    function.argtypes, function.restype = (ctypes.c_int, *[ctypes.c_void_p] * 6), None
    factors, D = np.array([alpha, beta]), np.empty(16)
    places = (factors.ctypes.data, A.ctypes.data, B.ctypes.data, factors.ctypes.data + 8, C.ctypes.data, D.ctypes.data)
    function(kmax, *places)
    return D


def _blasfeo() -> ctypes.CDLL:
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
