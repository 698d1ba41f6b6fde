"""What is written to matrices is what blasfeo finds in them."""

import ctypes

import numpy as np
import pytest
from numpy.typing import NDArray

from airrace.errors import SolverCrash
from airrace.optimal_control.solvers.fatrop.library import blasfeo, fatrop
from airrace.optimal_control.solvers.fatrop.matrices import MatrixFamily, entry_offsets, memory_of, struct_size

Array = NDArray[np.int64]
SHAPES = [(1, 1), (3, 2), (5, 0), (9, 8), (3, 2), (4, 4), (18, 13)]


class Matrices:
    """Matrices that blasfeo created in an array of structs."""

    def __init__(self, shapes: list[tuple[int, int]]) -> None:
        self.shapes = shapes
        self.structs = np.zeros(struct_size() * len(shapes), dtype=np.uint8)
        self.address: int = self.structs.ctypes.data
        self.memory: list[NDArray[np.uint8]] = []
        for number, (rows, columns) in enumerate(shapes):
            size: int = fatrop().blasfeo_memsize_dmat(rows, columns)
            self.memory.append(np.zeros(size + 64, dtype=np.uint8))
            start = -(-self.memory[-1].ctypes.data // 64) * 64
            fatrop().blasfeo_create_dmat(rows, columns, self._struct(number), start)

    def _struct(self, number: int) -> int:
        return self.address + number * struct_size()

    def read(self, number: int) -> NDArray[np.float64]:
        """A matrix as blasfeo unpacks it."""
        rows, columns = self.shapes[number]
        result = np.zeros((rows, columns), order="F")
        unpack = blasfeo().blasfeo_unpack_dmat
        unpack.argtypes = [
            ctypes.c_int,
            ctypes.c_int,
            ctypes.c_void_p,
            *[ctypes.c_int] * 2,
            ctypes.c_void_p,
            ctypes.c_int,
        ]
        unpack.restype = None
        unpack(rows, columns, self._struct(number), 0, 0, result.ctypes.data, rows)
        return result


def family(shapes: list[tuple[int, int]]) -> MatrixFamily:
    rows, columns = np.array(shapes, dtype=np.int64).T
    return MatrixFamily(rows, columns)


def every_entry(described: MatrixFamily) -> tuple[Array, Array, Array]:
    """Stage, row and column of all entries, matrix by matrix, column by column."""
    places = [
        (number, row, column)
        for number, (rows, columns) in enumerate(SHAPES)
        for column in range(columns)
        for row in range(rows)
    ]
    assert len(described.rows) == len(SHAPES)
    stage, row, column = np.array(places).T
    return stage, row, column


def written(matrices: Matrices, entries: NDArray[np.float64]) -> None:
    """Write all entries of matrices of these shapes."""
    described = family(SHAPES)
    memory = memory_of([described], [described.addresses(matrices.address)])
    stage, row, column = every_entry(described)
    memory.doubles[memory.begins[stage, 0] + described.offsets(stage, row, column)] = entries


def test_blasfeo_finds_every_entry_where_it_was_written() -> None:
    matrices = Matrices(SHAPES)
    entries = np.random.default_rng(1).normal(size=sum(rows * columns for rows, columns in SHAPES))
    written(matrices, entries)
    first = 0
    for number, (rows, columns) in enumerate(SHAPES):
        own = entries[first : first + rows * columns]
        assert (matrices.read(number) == own.reshape(rows, columns, order="F")).all()
        first += rows * columns


def test_writing_and_clearing_touch_nothing_else() -> None:
    matrices, described = Matrices(SHAPES), family(SHAPES)
    written(matrices, np.ones(sum(rows * columns for rows, columns in SHAPES)))
    for memory, (rows, columns) in zip(matrices.memory, SHAPES, strict=True):
        assert np.count_nonzero(memory.view(np.float64)) == rows * columns
    for one in matrices.memory:
        one.view(np.float64)[one.view(np.float64) == 0.0] = np.pi
    whole = memory_of([described], [described.addresses(matrices.address)])
    described.clear(whole.doubles, whole.begins[:, 0])
    for number, (memory, (rows, columns)) in enumerate(zip(matrices.memory, SHAPES, strict=True)):
        assert np.count_nonzero(memory.view(np.float64) == np.pi) == len(memory) // 8 - rows * columns
        assert not matrices.read(number).any()


def test_families_of_several_lengths_share_a_memory() -> None:
    long, short = family(SHAPES), family(SHAPES[:3])
    one, other = Matrices(SHAPES), Matrices(SHAPES[:3])
    memory = memory_of([long, short], [long.addresses(one.address), short.addresses(other.address)])
    assert memory.begins.shape == (len(SHAPES), 2)
    memory.doubles[memory.begins[1, 0]], memory.doubles[memory.begins[1, 1]] = 2.0, 3.0
    assert (one.read(1)[0, 0], other.read(1)[0, 0]) == (2.0, 3.0)


def test_addresses_tell_matrices_apart() -> None:
    described = family(SHAPES)
    one, other = Matrices(SHAPES), Matrices(SHAPES)
    assert np.flatnonzero(described.addresses(one.address) == 0).tolist() == [2]  # one is empty
    assert set(described.addresses(one.address)).intersection(described.addresses(other.address)) == {0}


def test_matrices_of_other_shapes_are_refused() -> None:
    with pytest.raises(SolverCrash, match="unexpected shapes"):
        family([(3, 2), (2, 2)]).addresses(Matrices([(3, 2), (2, 3)]).address)


@pytest.mark.parametrize("shape", [(1, 1), (7, 3), (12, 12), (33, 5)])
def test_entries_have_a_place_each(shape: tuple[int, int]) -> None:
    offsets = entry_offsets(*shape)
    assert len(set(offsets.tolist())) == shape[0] * shape[1]
    assert offsets.min() == 0
