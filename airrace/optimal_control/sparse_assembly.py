"""Sparse matrices whose nonzeros are weighted sums of the outputs of kernels; the pattern is found once.

`SparseAssembly` holds the sums of a whole program, `StageAssembly` one pattern for all stages that are alike, which the
processor's cache holds. The native library adds up straight from the arrays that kernels write to (`library.c`), else
numpy does, in the same order and with the same bits.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.native.library import library
from airrace.optimal_control.trajectory import Array, Indices


def unique_rows(keys: Indices) -> tuple[Indices, Indices]:
    """Return which rows of an array (n, m) are equal: the kind of each row, and the first row of each kind."""
    table = np.ascontiguousarray(keys, dtype=np.int64)
    rows = table.view(np.dtype((np.void, table.itemsize * table.shape[1]))).ravel()
    _, first, kind = np.unique(rows, return_index=True, return_inverse=True)
    return kind, first


@dataclass(frozen=True, eq=False)
class SparseAssembly:
    """A sparse matrix of n sums `weights * values[sources]`, drawn from blocks of values one behind the other.

    Attributes:
        shape: rows and columns.
        rows, columns: of the nonzeros in casadi's order, column by column; shape (n,).
        begins: the summands of nonzero i are those from `begins[i]` to `begins[i + 1]`; shape (n + 1,).
        weights, sources: of the summands.
        block_ends: of the blocks of values, shape (blocks,).
        block_begins: where the values that belong to each stage begin, shape (blocks, stages); empty if unknown.
    """

    shape: tuple[int, int]
    rows: Indices
    columns: Indices
    begins: NDArray[np.int32]
    weights: Array
    sources: NDArray[np.int32]
    block_ends: Indices
    block_begins: Indices

    def of(self, values: Array) -> Array:
        """Return the nonzeros for these values, shape (n,)."""
        result = np.empty(len(self.rows))
        self.into(values, result, np.arange(len(result)))
        return result

    def column(self, values: Array) -> Array:
        """Return the only column of the matrix with its zeros, shape (rows,)."""
        result = np.zeros(self.shape[0])
        self.into(values, result, self.rows)
        return result

    def into(self, values: Array, memory: Array, places: Indices) -> bool:
        """Write the nonzeros to `memory[places]`, and return whether all are finite; all arrays are contiguous."""
        native = library()
        if native is None:
            result = np.zeros(len(self.rows))
            for turn, (nonzeros, weights, sources) in enumerate(self.turns):
                summands = values[sources] * weights
                result[nonzeros] = result[nonzeros] + summands if turn else summands
            memory[places] = result
            return bool(np.isfinite(result).all())
        arrays = (self.begins, self.weights, self.sources, values, places, memory)
        return bool(native.add_up(len(self.rows), *(array.ctypes.data for array in arrays)))

    @cached_property
    def turns(self) -> list[tuple[Indices, Array, Indices]]:
        """(nonzeros, weights, sources) of the summands that come first in their sums, then of the second, and so on."""
        counts = np.diff(self.begins)
        turns: list[tuple[Indices, Array, Indices]] = []
        for turn in range(int(counts.max(initial=1))):
            nonzeros = np.flatnonzero(counts > turn)
            own = self.begins[nonzeros] + turn
            turns.append((nonzeros, self.weights[own], self.sources[own].astype(np.int64)))
        return turns

    def choose(self, numbers: Indices, factors: Array) -> "SparseAssembly":
        """Return some of the nonzeros, each times a factor; a nonzero may be chosen several times."""
        counts: Indices = np.diff(self.begins.astype(np.int64))[numbers]
        begins: Indices = np.concatenate([[0], np.cumsum(counts)])
        shifts: Indices = self.begins[numbers] - begins[:-1]
        own: Indices = np.repeat(shifts, counts) + np.arange(int(begins[-1]))
        weights: Array = self.weights[own] * np.repeat(factors, counts)
        return SparseAssembly(
            shape=self.shape,
            rows=self.rows[numbers],
            columns=self.columns[numbers],
            begins=begins.astype(np.int32),
            weights=weights,
            sources=self.sources[own],
            block_ends=self.block_ends,
            block_begins=self.block_begins,
        )

    @cached_property
    def sparsity(self) -> ca.Sparsity:
        """The pattern of the nonzeros."""
        begins = np.searchsorted(self.columns, np.arange(self.shape[1] + 1))
        return ca.Sparsity(*self.shape, begins.tolist(), self.rows.tolist())


class COOBuilder:
    """A collection of contributions `weight * values[source]` at (row, column) that make a matrix at once.

    In a `symmetric` matrix each pair (i, j), (j, i) is contributed to once and both are stored.
    """

    def __init__(self, rows: int, columns: int, *, symmetric: bool = False) -> None:
        self._shape = (rows, columns)
        self._symmetric = symmetric
        self._ends = [0]
        self._begins: list[Indices] = []
        self._entries: list[tuple[Indices, Indices, Array, Indices]] = []

    def add_block(self, size: int, begins: Indices | None = None) -> None:
        """Go on to the next block of values, from which the following contributions are drawn.

        Args:
            size: of the block.
            begins: where those of each stage begin within it, shape (stages,); None where that is not needed.
        """
        if begins is not None:
            self._begins.append(self._ends[-1] + begins)
        self._ends.append(self._ends[-1] + size)

    def add(self, rows: Indices, columns: Indices, weights: Array, sources: Indices) -> None:
        """Add contributions from the block; those that meet at one place add up. All shapes are (n,)."""
        sources = sources + self._ends[-2]
        self._entries.append((rows, columns, weights, sources))
        if self._symmetric:
            mirrored = rows != columns  # all but the diagonal
            self._entries.append((columns[mirrored], rows[mirrored], weights[mirrored], sources[mirrored]))

    def build(self) -> SparseAssembly:
        """Return the matrix that they make."""
        rows, columns, weights, sources = (np.concatenate(parts) for parts in zip(*self._entries, strict=True))
        places = columns * self._shape[0] + rows
        order = np.argsort(places, kind="stable")
        places = places[order]
        first = np.flatnonzero(np.concatenate([[True], places[1:] != places[:-1]])[: len(places)])  # of none: none
        leading = order[first]
        return SparseAssembly(
            shape=self._shape,
            rows=rows[leading],
            columns=columns[leading],
            begins=np.append(first, len(order)).astype(np.int32),
            weights=weights[order],
            sources=sources[order].astype(np.int32),
            block_ends=np.array(self._ends[1:]),
            block_begins=np.stack(self._begins) if self._begins else np.zeros((0, 0), dtype=np.int64),
        )


@dataclass(frozen=True, eq=False)
class Entries:
    """The places that n nonzeros go to; all shapes are (n,).

    Attributes:
        stages: to which they belong.
        offsets: within the matrix.
        families: the number of the family of matrices, which has one matrix per stage; None for the only one.
    """

    stages: Indices
    offsets: Indices
    families: Indices | None = None


@dataclass(frozen=True, eq=False)
class Memory:
    """Matrices that are written to: the memory, and where those of each stage begin, shape (stages, families)."""

    doubles: Array
    begins: Indices


class StageAssembly:
    """The sums of all stages, found for one stage of each kind.

    Most stages of a program are alike: their derivatives are the same sums of the same results of their own kernel
    calls, and go to the same places of their own matrices.

    Args:
        sums: those of the first stage of each kind.
        entries: where they go.
        kind: of each stage, shape (stages,).
    """

    def __init__(self, sums: SparseAssembly, entries: Entries, kind: Indices) -> None:
        order = np.argsort(kind[entries.stages], kind="stable")
        flat = sums.choose(order, np.ones(len(order)))
        stage = np.repeat(entries.stages[order], np.diff(flat.begins))
        block = np.searchsorted(sums.block_ends, flat.sources, side="right")
        zeros = np.zeros(len(order), dtype=np.int64)
        families = zeros if entries.families is None else entries.families
        first = np.searchsorted(kind[entries.stages[order]], np.arange(int(kind.max()) + 2))
        self._kind, self._first = kind.astype(np.int32), first.astype(np.int32)
        self._begins, self._weights, self._blocks = flat.begins, flat.weights, block.astype(np.int32)
        self._sources: NDArray[np.int32] = (flat.sources - sums.block_begins[block, stage]).astype(np.int32)
        self._families, self._offsets = families[order].astype(np.int32), entries.offsets[order].astype(np.int32)
        self._block_begins = np.ascontiguousarray(sums.block_begins.T)

    def write(self, values: Array, memory: Memory) -> bool:
        """Write the nonzeros for these values, and return whether all are finite."""
        native = library()
        if native is None:
            return self._write_by_numpy(values, memory)
        arrays = (
            *(self._kind, self._first, self._begins, self._weights, self._sources, self._blocks),
            *(self._families, self._offsets, self._block_begins, memory.begins, values, memory.doubles),
        )
        sizes = len(self._kind), self._block_begins.shape[1], memory.begins.shape[1]
        return bool(native.add_up_repeated(*sizes, *(array.ctypes.data for array in arrays)))

    def _write_by_numpy(self, values: Array, memory: Memory) -> bool:
        finite = True
        for entries, stages, places in self._by_kind(memory):
            begins = self._begins[entries]
            counts = self._begins[entries + 1] - begins
            result = np.empty((len(stages), len(entries)))
            for turn in range(int(counts.max(initial=0))):
                remaining = np.flatnonzero(counts > turn)
                number = begins[remaining] + turn
                at = self._block_begins[np.ix_(stages, self._blocks[number])] + self._sources[number]
                summands = values[at] * self._weights[number]
                result[:, remaining] = result[:, remaining] + summands if turn else summands
            memory.doubles[places] = result
            finite = finite and bool(np.isfinite(result).all())
        return finite

    def _by_kind(self, memory: Memory) -> Iterator[tuple[Indices, Indices, Indices]]:
        """Yield the entries of each kind, the stages that are of it, and the places, of shape (stages, entries)."""
        for kind in range(len(self._first) - 1):
            entries: Indices = np.arange(int(self._first[kind]), int(self._first[kind + 1]))
            stages = np.flatnonzero(self._kind == kind)
            begins = memory.begins[np.ix_(stages, self._families[entries])]
            yield entries, stages, begins + self._offsets[entries]
