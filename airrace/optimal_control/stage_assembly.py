"""Sums that repeat from stage to stage, found for one stage of each kind.

Most stages of a program are alike: their derivatives are the same sums of the same results of their own kernel calls,
and go to the same places of their own matrices. So what is kept is one pattern per kind, which the processor's cache
holds, and for each stage where its numbers begin.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from airrace.native.library import library
from airrace.optimal_control.assembly_sums import Indices, Sums
from airrace.records import record
from airrace.trajectory import Array


def kinds(told: Indices) -> tuple[Indices, Indices]:
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

    def __init__(self, sums: Sums, entries: Entries, kind: Indices) -> None:
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
