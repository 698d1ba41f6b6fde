"""Sparse matrices whose nonzeros are weighted sums of drawn numbers, the pattern and the summands found once.

The derivatives of a program are such sums of what its kernels return. The native library adds them up straight from the
arrays that kernels write to (`sums.c`), else numpy does, in the same order and with the same bits.
"""

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
class Sums:
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

    def chosen(self, numbers: Indices, factors: Array) -> "Sums":
        """Return some of the nonzeros, each times a factor; a nonzero may be chosen several times."""
        flat = self.flat
        counts: Indices = np.diff(flat.begins.astype(np.int64))[numbers]
        begins: Indices = np.concatenate([[0], np.cumsum(counts)])
        shifts: Indices = flat.begins[numbers] - begins[:-1]
        own: Indices = np.repeat(shifts, counts) + np.arange(int(begins[-1]))
        weights: Array = flat.weights[own] * np.repeat(factors, counts)
        chosen = Flat(begins.astype(np.int32), weights, flat.sources[own])
        return Sums(self.shape, self.rows[numbers], self.columns[numbers], chosen, self.blocks)

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


class Contributions:
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

    def sums(self) -> Sums:
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
        return Sums(self._shape, rows[leading], columns[leading], flat, Blocks(np.array(self._ends), at))
