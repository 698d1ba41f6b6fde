"""The linear algebra of fatrop, blasfeo: where its matrices lie in memory, and stand-ins for some of its functions.

blasfeo packs matrices in panels whose height depends on how it was built, and so does its `struct blasfeo_dmat`. A
matrix that is filled by blasfeo with the number of every entry tells where each one went.

By symbol interposition fatrop gets memory and products of small matrices from the native library. It sets up several
times what a solve needs. In the arena (`blasfeo.c`) what it never writes takes no memory, and what a solve has used is
reused for the next one: of 16 laps of `sixteen_phases` the solver process takes 293 MB instead of 465 MB. The blasfeo
that casadi brings along is built for any processor, and fatrop spends half of its own time in three of its functions;
those for vector registers (`products.c`) have the same bits and save a twentieth of a ladder or more. Only Linux's
dynamic linker takes the first function of a name that it finds. Elsewhere, without the native library, or with a
blasfeo that computes otherwise, everything stays as it is.
"""

import ctypes
import logging
import os
import sys
from collections.abc import Iterator, Sequence
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.errors import SolverCrash
from airrace.native.library import library, library_path
from airrace.optimal_control.solvers.fatrop.library import doubles_at, fatrop
from airrace.optimal_control.sparse_assembly import Memory, unique_rows
from airrace.trajectory import Array, Indices

logger = logging.getLogger(__name__)

_ALIGNMENT = 64  # bytes, a cache line, as blasfeo asks for
_DOUBLE = 8
_POINTER_WORD = 1  # `pA` is the second pointer of the struct


@cache
def struct_size() -> int:
    """Return the size of `struct blasfeo_dmat` in bytes: as far as blasfeo writes when it creates a matrix."""
    low, high = (_create(9, 7, filler)[0] for filler in (0x55, 0xAA))
    return int(np.flatnonzero((low != 0x55) | (high != 0xAA))[-1]) + 1


@cache
def entry_offsets(rows: int, columns: int) -> Indices:
    """Return where the entries of a matrix lie, in doubles after `pA`.

    They are in the order column by column, shape (rows * columns,).

    Raises:
        SolverCrash: blasfeo does not keep its matrices as expected.
    """
    struct, memory = _create(rows, columns, 0)
    numbers = np.arange(1.0, rows * columns + 1)
    fatrop().blasfeo_pack_dmat(rows, columns, numbers.ctypes.data, rows, struct.ctypes.data, 0, 0)
    start = int(struct.view(np.int64)[_POINTER_WORD])
    room = (memory.ctypes.data + memory.size - start) // _DOUBLE
    found = doubles_at(start, room)
    used = np.flatnonzero(found)
    offsets = used[np.argsort(found[used])]
    if not np.array_equal(found[offsets], numbers):
        raise SolverCrash("the library blasfeo keeps its matrices in an unknown way")
    return offsets


def _create(rows: int, columns: int, filler: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return a struct, filled with `filler` before blasfeo created a matrix in it, and that matrix's memory, zero."""
    struct = np.full(128, filler, dtype=np.uint8)  # bytes, more than any struct blasfeo_dmat
    memory = np.zeros(fatrop().blasfeo_memsize_dmat(rows, columns) + _ALIGNMENT, dtype=np.uint8)
    start = -(-memory.ctypes.data // _ALIGNMENT) * _ALIGNMENT
    fatrop().blasfeo_create_dmat(rows, columns, struct.ctypes.data, start)
    return struct, memory


class MatrixFamily:
    """A sequence of matrices of given shapes, one per stage, handed over as one array of `struct blasfeo_dmat`."""

    def __init__(self, rows: Indices, columns: Indices) -> None:
        self.rows = rows
        self.columns = columns
        self._nonempty = np.flatnonzero(rows * columns)
        self._word = struct_size() // _DOUBLE

    def addresses(self, structs: int) -> Indices:
        """Return the addresses of the numbers of every matrix, 0 of those that have none.

        Args:
            structs: address of the array of structs.

        Raises:
            SolverCrash: the matrices have other shapes.
        """
        count = len(self.rows)
        words = np.ctypeslib.as_array((ctypes.c_int64 * (count * self._word)).from_address(structs))
        words = words.reshape(count, self._word)[self._nonempty]
        # `m` and `n` follow after three pointers.
        shapes = np.ascontiguousarray(words[:, 3]).view(np.int32).reshape(-1, 2)
        if not (
            np.array_equal(shapes[:, 0], self.rows[self._nonempty])
            and np.array_equal(shapes[:, 1], self.columns[self._nonempty])
        ):
            raise SolverCrash("fatrop hands over matrices of unexpected shapes")
        result = np.zeros(count, dtype=np.int64)
        result[self._nonempty] = words[:, _POINTER_WORD]
        return result

    def offsets(self, stages: Indices, rows: Indices, columns: Indices) -> Indices:
        """Return where entries lie in doubles after the start of their matrices; all shapes are (n,)."""
        result = np.empty(len(stages), dtype=np.int64)
        for (m, n), here in self._by_shape(stages):
            result[here] = entry_offsets(m, n)[columns[here] * m + rows[here]]
        return result

    @cached_property
    def extents(self) -> Indices:
        """The number of doubles from the first to the last entry of each matrix, 0 of those that have none."""
        result = np.zeros(len(self.rows), dtype=np.int64)
        for (m, n), here in self._by_shape(self._nonempty):
            result[self._nonempty[here]] = entry_offsets(m, n).max() + 1
        return result

    def clear(self, doubles: Array, begins: Indices) -> None:
        """Write zeros to all entries of matrices that begin at these places."""
        for (m, n), here in self._by_shape(self._nonempty):
            stages = self._nonempty[here]
            # A thousand at once: the places of their entries take memory, too.
            for some in np.array_split(stages, -(-len(stages) // 1000)):
                doubles[begins[some, None] + entry_offsets(m, n)] = 0.0

    def _by_shape(self, stages: Indices) -> Iterator[tuple[tuple[int, int], Indices]]:
        """Yield every shape of the matrices of some stages, and which of the stages have it."""
        kind, first = unique_rows(np.stack([self.rows[stages], self.columns[stages]], axis=1))
        by_kind = np.argsort(kind, kind="stable")
        ends = np.searchsorted(kind[by_kind], np.arange(len(first) + 1))
        for number, one in enumerate(stages[first].tolist()):
            shape = int(self.rows[one]), int(self.columns[one])
            yield shape, by_kind[ends[number] : ends[number + 1]]


def memory_of(families: Sequence[MatrixFamily], addresses: Sequence[Indices]) -> Memory:
    """Return the memory of the matrices that are at these addresses, one array of them per family."""
    stages = max(len(family.rows) for family in families)
    known = np.concatenate([one[one > 0] for one in addresses])
    first = int(known.min(initial=np.iinfo(np.int64).max))
    begins, end = np.zeros((stages, len(families)), dtype=np.int64), 0
    for number, (family, at) in enumerate(zip(families, addresses, strict=True)):
        begins[: len(at), number] = np.where(at > 0, (at - first) // _DOUBLE, 0)
        end = max(end, int((begins[: len(at), number] + family.extents).max(initial=0)))
    doubles = doubles_at(first, end) if len(known) else np.empty(0)
    return Memory(doubles, begins)


LARGE = 2**28
"""The memory in all from which pages of zeros are given back to the system, bytes."""
PRODUCTS = {"gemm_nt": "kernel_dgemm_nt_4x4_lib4", "gemv_n": "kernel_dgemv_n_4_lib4", "gemv_t": "kernel_dgemv_t_4_lib4"}
"""The native library's names of the products, and blasfeo's."""

_ASKED = ("blasfeo_memsize_dmat", "blasfeo_memsize_dvec", "blasfeo_create_dmat", "blasfeo_create_dvec")
"""The functions of blasfeo that the arena asks, in the order of the struct in `blasfeo.c`."""

# Any: ctypes makes functions up.
Product = Any


@cache
def interpose() -> bool:
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
