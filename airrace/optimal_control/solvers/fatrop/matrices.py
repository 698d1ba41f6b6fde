"""The layout of blasfeo's matrices in memory, found out by trying.

blasfeo packs matrices in panels whose height depends on how it was built, and so does its `struct blasfeo_dmat`. A
matrix that is filled by blasfeo with the number of every entry tells where each one went.
"""

import ctypes
from collections.abc import Iterator, Sequence
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from airrace.errors import SolverCrash
from airrace.optimal_control.solvers.fatrop.library import doubles_at, fatrop
from airrace.optimal_control.sparse_assembly import Memory, unique_rows
from airrace.trajectory import Array, Indices

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
