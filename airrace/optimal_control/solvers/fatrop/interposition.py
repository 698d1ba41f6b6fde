"""Symbol interposition: fatrop gets memory and products of small matrices from the native library, not from blasfeo.

fatrop sets up several times what a solve needs. In the arena (`arena.c`) what it never writes takes no memory, and what
a solve has used is reused for the next one: of 16 laps of `sixteen_phases` the solver process takes 293 MB instead of
465 MB. The blasfeo that casadi brings along is built for any processor, and fatrop spends half of its own time in three
of its functions; those for vector registers (`products.c`) have the same bits and save a twentieth of a ladder or more.

Only Linux's dynamic linker takes the first function of a name that it finds. Elsewhere, without the native library, or
with a blasfeo that computes otherwise, everything stays as it is.
"""

import ctypes
import logging
import os
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from airrace.native.library import library, library_path
from airrace.records import record
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

LARGE = 2**28
"""The memory in all from which pages of zeros are given back to the system, bytes."""
PRODUCTS = {"gemm_nt": "kernel_dgemm_nt_4x4_lib4", "gemv_n": "kernel_dgemv_n_4_lib4", "gemv_t": "kernel_dgemv_t_4_lib4"}
"""The native library's names of the products, and blasfeo's."""

_ASKED = ("blasfeo_memsize_dmat", "blasfeo_memsize_dvec", "blasfeo_create_dmat", "blasfeo_create_dvec")
"""The functions of blasfeo that the arena asks, in the order of the struct in `arena.c`."""

# Any: ctypes makes functions up.
Product = Any


@record
class Use:
    """The memory that is handed out, the most that ever was, and what was given back to the system so far, bytes."""

    in_use: int
    most: int
    returned: int


@cache
def install() -> bool:
    """Let fatrop and blasfeo call the native library's functions, and return whether they do.

    The linker looks for functions when fatrop is loaded, so this has to come before.
    """
    path, native = library_path(), library()
    if not sys.platform.startswith("linux") or native is None or path is None:
        return False
    try:
        own, loaded = load_lazily(), ctypes.CDLL(str(path))
        products = [getattr(native.evaluator, name) for name in PRODUCTS]
        if not same_bits(products, [own[name] for name in PRODUCTS.values()]):
            logger.info("this blasfeo computes otherwise, and keeps its functions")
            return False
        begin_arena(loaded, LARGE, 2**28)  # bytes retained for the next solve
        loaded.products_begin(ctypes.byref(native.evaluator))
        ctypes.CDLL(str(path), ctypes.RTLD_GLOBAL)
    except (OSError, AttributeError) as error:  # AttributeError: another blasfeo
        logger.info("blasfeo keeps its functions: %s", error)
        return False
    return True


def begin_arena(native: ctypes.CDLL, large: int, retained: int) -> None:
    """Tell the native library blasfeo's functions and the limits of its memory, bytes.

    Raises:
        OSError: there is no blasfeo.
        AttributeError: it has no such functions.
    """
    own = load_lazily()
    addresses = [ctypes.cast(own[name], ctypes.c_void_p).value for name in _ASKED]
    native.arena_begin.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
    native.arena_begin((ctypes.c_void_p * len(addresses))(*addresses), large, retained)


def use_of(native: ctypes.CDLL) -> Use:
    """Return what the memory of a loaded native library amounts to."""
    numbers = (ctypes.c_size_t * 3)()
    native.arena_use(numbers)
    return Use(*numbers)


def same_bits(products: Sequence[Product], others: Sequence[Product]) -> bool:
    """Return whether products in the order of `PRODUCTS` give the same bits, for panels of all lengths."""
    random = np.random.default_rng(1)
    for kmax in range(25):  # columns of the panels
        panels = max(4, kmax) // 4 + 2  # of four rows each, as many as rows from any offset need
        A, B = (random.normal(size=16 * panels) for _ in range(2))
        C, x = random.normal(size=16), random.normal(size=max(4, kmax))
        for alpha, beta in ((1.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (0.3, -0.7)):
            factors = np.array([alpha, beta])
            calls: list[tuple[int, list[int | Array]]] = [
                (0, [kmax, factors[:1], A, B, factors[1:], C]),
                (1, [kmax, factors[:1], A, x, factors[1:], C]),
                *((2, [kmax, factors[:1], offset, A[offset:], 4, x, factors[1:], C]) for offset in range(4)),
            ]
            if not all(
                np.array_equal(_result(products[number], given), _result(others[number], given))
                for number, given in calls
            ):
                return False
    return True


def _result(product: Product, given: Sequence[int | Array]) -> Array:
    """Return the last argument of a product, which it writes."""
    result = np.zeros(16)
    arguments = [one if isinstance(one, int) else ctypes.c_void_p(one.ctypes.data) for one in (*given, result)]
    product(*arguments)
    return result


@cache
def load_lazily() -> ctypes.CDLL:
    """Return blasfeo, loaded so that its calls are bound when they are made first; ctypes itself binds them at once.

    Raises:
        OSError: there is none.
    """
    path = str(Path(ca.__file__).parent / "libblasfeo.so.0")
    load = ctypes.pythonapi.dlopen
    load.argtypes, load.restype = (ctypes.c_char_p, ctypes.c_int), ctypes.c_void_p
    handle: int | None = load(path.encode(), os.RTLD_LAZY)
    if handle is None:
        raise OSError(f"{path} cannot be loaded")
    return ctypes.CDLL(path, handle=handle)
