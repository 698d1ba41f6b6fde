"""Sparse matrices whose nonzeros are weighted sums of the outputs of kernels; the pattern is found once.

`SparseAssembly` holds the sums of a whole program, `StageAssembly` one pattern for all stages that are alike, which the
processor's cache holds. The native library adds up straight from the arrays that kernels write to (`sums.c`), else
numpy does, in the same order and with the same bits.
"""

from collections.abc import Iterator
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.native.library import library
from airrace.records import record
from airrace.trajectory import Array

Indices = NDArray[np.int64]


@record
class Summands:
    """One summand of each of some nonzeros: `weights * drawn[sources]` is added to `values[nonzeros]`.

    The numbers of the nonzeros ascend.
    """

    nonzeros: Indices
    weights: Array
    sources: Indices


@record
class Flat:
    """The summands of n nonzeros, one behind the other: those of nonzero i from `begins[i]` to `begins[i + 1]`."""

    begins: NDArray[np.int32]
    weights: Array
    sources: NDArray[np.int32]


@record
class Blocks:
    """The blocks of drawn numbers, one behind the other.

    Attributes:
        ends: of the blocks, shape (blocks,).
        at: where the numbers that belong to each stage begin, shape (blocks, stages).
    """

    ends: Indices
    at: Indices


@record
class SparseAssembly:
    """A sparse matrix of sums.

    Attributes:
        shape: rows and columns.
        rows, columns: of the nonzeros in casadi's order, column by column; shape (n,).
        flat: their summands.
        blocks: that are drawn from, where their stages are known; else without any.
    """

    shape: tuple[int, int]
    rows: Indices
    columns: Indices
    flat: Flat
    blocks: Blocks

    def of(self, drawn: Array) -> Array:
        """Return the nonzeros for drawn numbers, shape (n,)."""
        values = np.empty(len(self.rows))
        self.into(drawn, values, np.arange(len(values)))
        return values

    def into(self, drawn: Array, memory: Array, places: Indices) -> bool:
        """Write the nonzeros for drawn numbers to `memory[places]`, and return whether all are finite.

        Args:
            drawn: the numbers, contiguous.
            memory: contiguous.
            places: of the nonzeros, contiguous, shape (n,).
        """
        native = library()
        if native is None:
            values = self._by_numpy(drawn)
            memory[places] = values
            return bool(np.isfinite(values).all())
        flat = self.flat
        arrays = (flat.begins, flat.weights, flat.sources, drawn, places, memory)
        return bool(native.add_up(len(self.rows), *(array.ctypes.data for array in arrays)))

    def _by_numpy(self, drawn: Array) -> Array:
        first, *others = self.turns
        values = drawn[first.sources] * first.weights
        for one in others:
            values[one.nonzeros] += drawn[one.sources] * one.weights
        return values

    def chosen(self, numbers: Indices, factors: Array) -> "SparseAssembly":
        """Return some of the nonzeros, each times a factor; a nonzero may be chosen several times."""
        flat = self.flat
        counts: Indices = np.diff(flat.begins.astype(np.int64))[numbers]
        begins: Indices = np.concatenate([[0], np.cumsum(counts)])
        shifts: Indices = flat.begins[numbers] - begins[:-1]
        own: Indices = np.repeat(shifts, counts) + np.arange(int(begins[-1]))
        weights: Array = flat.weights[own] * np.repeat(factors, counts)
        chosen = Flat(begins.astype(np.int32), weights, flat.sources[own])
        return SparseAssembly(self.shape, self.rows[numbers], self.columns[numbers], chosen, self.blocks)

    @cached_property
    def turns(self) -> tuple[Summands, ...]:
        """The summands that come first in their sums, then those that come second, and so on."""
        begins = self.flat.begins.astype(np.int64)
        counts = np.diff(begins)
        turns: list[Summands] = []
        for turn in range(int(counts.max(initial=1))):
            nonzeros = np.flatnonzero(counts > turn)
            own = begins[nonzeros] + turn
            turns.append(Summands(nonzeros, self.flat.weights[own], self.flat.sources[own].astype(np.int64)))
        return tuple(turns)

    def column(self, drawn: Array) -> Array:
        """Return the only column of the matrix with its zeros, shape (rows,)."""
        values = np.zeros(self.shape[0])
        self.into(drawn, values, self.rows)
        return values

    @cached_property
    def sparsity(self) -> ca.Sparsity:
        """The pattern of the nonzeros."""
        begins = np.searchsorted(self.columns, np.arange(self.shape[1] + 1))
        return ca.Sparsity(*self.shape, begins.tolist(), self.rows.tolist())


class COOBuilder:
    """A collection of contributions `weight * drawn[source]` at (row, column) that make a matrix at once.

    Numbers are drawn from blocks that lie one behind the other. In a `symmetric` matrix each pair (i, j), (j, i) is
    contributed to once and both are kept.
    """

    def __init__(self, rows: int, columns: int, *, symmetric: bool = False) -> None:
        self._shape = (rows, columns)
        self._symmetric = symmetric
        self._offset = 0
        self._ends: list[int] = []
        self._at: list[Indices] = []
        self._entries: list[tuple[Indices, Indices, Array, Indices]] = []

    def draw_from(self, size: int, at: Indices | None = None) -> None:
        """Go on to the next block of numbers, from which the following contributions are drawn.

        Args:
            size: of the block.
            at: where those of each stage begin within the block, shape (stages,); None where that is not asked for.
        """
        self._offset = self._ends[-1] if self._ends else 0
        self._ends.append(self._offset + size)
        if at is not None:
            self._at.append(self._offset + at)

    def add(self, rows: Indices, columns: Indices, weights: Array, sources: Indices) -> None:
        """Add contributions; those that meet at one place add up. All shapes are (n,)."""
        self._entries.append((rows, columns, weights, sources + self._offset))
        if self._symmetric:
            off = rows != columns
            self._entries.append((columns[off], rows[off], weights[off], sources[off] + self._offset))

    def sums(self) -> SparseAssembly:
        """Return the matrix that they make."""
        rows, columns, weights, sources = (np.concatenate(parts) for parts in zip(*self._entries, strict=True))
        places = columns * self._shape[0] + rows
        order = np.argsort(places, kind="stable")
        places = places[order]
        first = np.flatnonzero(np.concatenate([[True], places[1:] != places[:-1]]))
        leading = order[first]
        begins = np.append(first, len(order)).astype(np.int32)
        flat = Flat(begins, weights[order], sources[order].astype(np.int32))
        at = np.stack(self._at) if self._at else np.zeros((0, 0), dtype=np.int64)
        return SparseAssembly(self._shape, rows[leading], columns[leading], flat, Blocks(np.array(self._ends), at))


def unique_rows(told: Indices) -> tuple[Indices, Indices]:
    """Return which rows of an array are equal, shape (n, m): the kind of each row, and the first row of each kind."""
    whole = np.ascontiguousarray(told, dtype=np.int64)
    rows = whole.view(np.dtype((np.void, whole.itemsize * whole.shape[1]))).ravel()
    _, first, kind = np.unique(rows, return_index=True, return_inverse=True)
    return kind, first


def chosen(first: Indices, count: int) -> NDArray[np.bool_]:
    """Return a mask of so many stages that holds for the first ones of all kinds."""
    mask = np.zeros(count, dtype=np.bool_)
    mask[first] = True
    return mask


@record
class Entries:
    """The places that nonzeros go to, as many as there are sums; all shapes are (n,).

    Attributes:
        stages: to which they belong.
        families: the number of the family of matrices, which has one matrix per stage.
        offsets: within the matrix.
        factors: the place of a factor behind that of the stage's first one; -1 for none.
    """

    stages: Indices
    families: Indices
    offsets: Indices
    factors: Indices


@record
class Memory:
    """Matrices that are written to.

    Attributes:
        doubles: the memory in which they lie.
        begins: of each stage's matrices, shape (stages, families).
    """

    doubles: Array
    begins: Indices


@record
class Factors:
    """Factors of some nonzeros, and where those of each stage begin, shape (stages,)."""

    values: Array
    begins: Indices


NO_FACTORS = Factors(np.ones(1), np.zeros(0, dtype=np.int64))


class StageAssembly:
    """The sums of all stages.

    Args:
        sums: those of the first stage of each kind.
        entries: where they go.
        kind: of each stage, shape (stages,).
    """

    def __init__(self, sums: SparseAssembly, entries: Entries, kind: Indices) -> None:
        order = np.argsort(kind[entries.stages], kind="stable")
        flat = sums.chosen(order, np.ones(len(order))).flat
        stage = np.repeat(entries.stages[order], np.diff(flat.begins))
        block = np.searchsorted(sums.blocks.ends, flat.sources, side="right")
        self._kind = kind.astype(np.int32)
        ends = np.arange(int(kind.max()) + 2)
        self._first: NDArray[np.int32] = np.searchsorted(kind[entries.stages[order]], ends).astype(np.int32)
        self._begins, self._weights, self._blocks = flat.begins, flat.weights, block.astype(np.int32)
        self._sources = (flat.sources - sums.blocks.at[block, stage]).astype(np.int32)
        self._families = entries.families[order].astype(np.int32)
        self._offsets = entries.offsets[order].astype(np.int32)
        self._factors = entries.factors[order].astype(np.int32)
        self._at = np.ascontiguousarray(sums.blocks.at.T)
        self.order = order

    def write(self, drawn: Array, memory: Memory, factors: Factors = NO_FACTORS) -> bool:
        """Write the nonzeros for drawn numbers, and return whether all are finite."""
        begins = factors.begins if len(factors.begins) else np.zeros(len(self._kind), dtype=np.int64)
        native = library()
        if native is None:
            return self._by_numpy(drawn, memory, Factors(factors.values, begins))
        arrays = (
            self._kind,
            self._first,
            self._begins,
            self._weights,
            self._sources,
            self._blocks,
            self._families,
            self._offsets,
            self._factors,
            self._at,
            memory.begins,
            begins,
            factors.values,
            drawn,
            memory.doubles,
        )
        sizes = len(self._kind), self._at.shape[1], memory.begins.shape[1]
        return bool(native.add_up_repeated(*sizes, *(array.ctypes.data for array in arrays)))

    def _by_numpy(self, drawn: Array, memory: Memory, factors: Factors) -> bool:
        finite = True
        for entries, stages, places in self._by_kind(memory):
            begins = self._begins[entries]
            counts = self._begins[entries + 1] - begins
            values = np.empty((len(stages), len(entries)))
            for turn in range(int(counts.max(initial=0))):
                taken = np.flatnonzero(counts > turn)
                number = begins[taken] + turn
                at = self._at[np.ix_(stages, self._blocks[number])] + self._sources[number]
                summand = drawn[at] * self._weights[number]
                values[:, taken] = values[:, taken] + summand if turn else summand
            weighed = np.flatnonzero(self._factors[entries] >= 0)
            values[:, weighed] *= factors.values[factors.begins[stages, None] + self._factors[entries[weighed]]]
            memory.doubles[places] = values
            finite = finite and bool(np.isfinite(values).all())
        return finite

    def fill(self, values: Array, memory: Memory) -> None:
        """Write the same numbers to the nonzeros of all stages that are alike, one per sum that was given."""
        ordered = values[self.order]
        for entries, _, places in self._by_kind(memory):
            memory.doubles[places] = ordered[entries]

    def clean(self, memory: Memory) -> None:
        """Write zeros in the place of nonzeros that are not finite."""
        for _, _, places in self._by_kind(memory):
            memory.doubles[places] = np.nan_to_num(memory.doubles[places], posinf=0.0, neginf=0.0)

    def _by_kind(self, memory: Memory) -> Iterator[tuple[Indices, Indices, Indices]]:
        """Yield the entries of each kind, the stages that are of it, and the places, of shape (stages, entries)."""
        by_kind = np.argsort(self._kind, kind="stable")
        ends = np.searchsorted(self._kind[by_kind], np.arange(len(self._first)))
        for kind in range(len(self._first) - 1):
            entries: Indices = np.arange(int(self._first[kind]), int(self._first[kind + 1]))
            stages = by_kind[ends[kind] : ends[kind + 1]]
            begins = memory.begins[np.ix_(stages, self._families[entries])]
            yield entries, stages, begins + self._offsets[entries]
