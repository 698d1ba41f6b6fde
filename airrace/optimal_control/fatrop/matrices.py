"""The layout of blasfeo's matrices in memory, found out by trying.

blasfeo packs matrices in panels whose height depends on how it was built, and so does its `struct blasfeo_dmat`. A
matrix that is filled by blasfeo with the number of every entry tells where each one went.
"""

import ctypes
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from airrace.errors import SolverCrash
from airrace.optimal_control.fatrop.library import doubles_at, fatrop
from airrace.optimal_control.layout import Indices
from airrace.optimal_control.sums import Sums
from airrace.trajectory import Array

_ROOM = 128  # bytes, more than any struct blasfeo_dmat
_ALIGNMENT = 64  # bytes, a cache line, as blasfeo asks for
_DOUBLE = 8
_POINTER_WORD = 1  # `pA` is the second pointer of the struct
_SHAPE_WORD = 3  # `m` and `n` follow after three pointers


@cache
def struct_size() -> int:
    """Return the size of `struct blasfeo_dmat` in bytes: as far as blasfeo writes when it creates a matrix."""
    low, high = (_created(9, 7, filler)[0] for filler in (0x55, 0xAA))
    return int(np.flatnonzero((low != 0x55) | (high != 0xAA))[-1]) + 1


@cache
def entry_offsets(rows: int, columns: int) -> Indices:
    """Return where the entries of a matrix lie, in doubles after `pA`.

    They are in the order column by column, shape (rows * columns,).

    Raises:
        SolverCrash: blasfeo does not keep its matrices as expected.
    """
    struct, memory = _created(rows, columns, 0)
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


def _created(rows: int, columns: int, filler: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return a struct, filled with `filler` before blasfeo created a matrix in it, and that matrix's memory, zero."""
    struct = np.full(_ROOM, filler, dtype=np.uint8)
    memory = np.zeros(fatrop().blasfeo_memsize_dmat(rows, columns) + _ALIGNMENT, dtype=np.uint8)
    start = -(-memory.ctypes.data // _ALIGNMENT) * _ALIGNMENT
    fatrop().blasfeo_create_dmat(rows, columns, struct.ctypes.data, start)
    return struct, memory


@dataclass(frozen=True)
class Destination:
    """The places of some entries of matrices: `memory[places]`."""

    memory: Array
    places: Indices

    def write(self, entries: Array) -> None:
        """Write these entries."""
        self.memory[self.places] = entries

    def write_sums(self, sums: Sums, drawn: Array) -> bool:
        """Write the nonzeros of sums of drawn numbers, and return whether all are finite."""
        return sums.into(drawn, self.memory, self.places)

    def among(self, entries: Indices) -> "Destination":
        """Return the places of some of these entries, by their numbers."""
        return Destination(self.memory, self.places[entries])


class MatrixFamily:
    """A sequence of matrices of given shapes that fatrop hands over as one array of `struct blasfeo_dmat`."""

    def __init__(self, rows: Indices, columns: Indices) -> None:
        self.rows = rows
        self.columns = columns
        sizes = rows * columns
        self.starts = np.concatenate([[0], np.cumsum(sizes)])
        self._nonempty = np.flatnonzero(sizes)
        self._word = struct_size() // _DOUBLE

    @property
    def entries(self) -> int:
        """The number of entries of all matrices together."""
        return int(self.starts[-1])

    def addresses(self, structs: int) -> Indices:
        """Return the addresses of the numbers of every matrix that has any.

        Args:
            structs: address of the array of structs.
        """
        return self._words(structs)[self._nonempty, _POINTER_WORD].copy()

    def entry_addresses(self, structs: int) -> Indices:
        """Return the addresses of all entries, matrix by matrix, column by column.

        Raises:
            SolverCrash: the matrices have other shapes.
        """
        words = self._words(structs)[self._nonempty]
        shapes = np.ascontiguousarray(words[:, _SHAPE_WORD]).view(np.int32).reshape(-1, 2)
        rows, columns = self.rows[self._nonempty], self.columns[self._nonempty]
        if not np.array_equal(shapes, np.stack([rows, columns], axis=1)):
            raise SolverCrash("fatrop hands over matrices of unexpected shapes")
        result = np.empty(self.entries, dtype=np.int64)
        first = self.starts[:-1][self._nonempty]
        for m, n in {(int(m), int(n)) for m, n in zip(rows, columns, strict=True)}:
            of_shape = np.flatnonzero((rows == m) & (columns == n))
            places = first[of_shape, None] + np.arange(m * n)
            result[places] = words[of_shape, _POINTER_WORD, None] + _DOUBLE * entry_offsets(m, n)
        return result

    def _words(self, structs: int) -> Indices:
        count = len(self.rows)
        words = np.ctypeslib.as_array((ctypes.c_int64 * (count * self._word)).from_address(structs))
        return words.reshape(count, self._word)


def destination(addresses: Indices) -> Destination:
    """Return the destination of entries at these addresses."""
    if not len(addresses):
        return Destination(np.empty(0), addresses)
    first = int(addresses.min())
    memory = doubles_at(first, (int(addresses.max()) - first) // _DOUBLE + 1)
    return Destination(memory, (addresses - first) // _DOUBLE)
