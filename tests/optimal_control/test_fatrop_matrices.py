"""What is written to matrices is what blasfeo finds in them."""

import ctypes

import numpy as np
import pytest
from numpy.typing import NDArray

from airrace.errors import SolverCrash
from airrace.optimal_control.fatrop.library import fatrop
from airrace.optimal_control.fatrop.matrices import MatrixFamily, destination, entry_offsets, struct_size

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
        unpack = fatrop().blasfeo_unpack_dmat
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


def test_blasfeo_finds_every_entry_where_it_was_written() -> None:
    matrices, described = Matrices(SHAPES), family(SHAPES)
    entries = np.random.default_rng(1).normal(size=described.entries)
    destination(described.entry_addresses(matrices.address)).write(entries)
    for number, (rows, columns) in enumerate(SHAPES):
        written = entries[described.starts[number] : described.starts[number + 1]]
        assert (matrices.read(number) == written.reshape(rows, columns, order="F")).all()


def test_writing_touches_nothing_else() -> None:
    matrices, described = Matrices(SHAPES), family(SHAPES)
    destination(described.entry_addresses(matrices.address)).write(np.ones(described.entries))
    for memory, (rows, columns) in zip(matrices.memory, SHAPES, strict=True):
        assert np.count_nonzero(memory.view(np.float64)) == rows * columns


def test_addresses_tell_matrices_apart() -> None:
    described = family(SHAPES)
    one, other = Matrices(SHAPES), Matrices(SHAPES)
    assert len(described.addresses(one.address)) == len(SHAPES) - 1  # one is empty
    assert set(described.addresses(one.address)).isdisjoint(described.addresses(other.address))


def test_matrices_of_other_shapes_are_refused() -> None:
    with pytest.raises(SolverCrash, match="unexpected shapes"):
        family([(3, 2), (2, 2)]).entry_addresses(Matrices([(3, 2), (2, 3)]).address)


@pytest.mark.parametrize("shape", [(1, 1), (7, 3), (12, 12), (33, 5)])
def test_entries_have_a_place_each(shape: tuple[int, int]) -> None:
    offsets = entry_offsets(*shape)
    assert len(set(offsets.tolist())) == shape[0] * shape[1]
    assert offsets.min() == 0
