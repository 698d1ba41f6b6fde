"""The matrices of a program's stages: second derivatives, gaps and rows, dense, written anew for every point."""

import numpy as np

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.sparse_assembly import Entries, Memory, StageAssembly, unique_rows
from airrace.trajectory import Array, Indices

MOST_UNKNOWNS = 64
"""The largest number of unknowns of a stage for which the native library has room, `dense.h`."""


class StageMatrices:
    """The matrices of a program (n_w unknowns, n_r rows, n_y gaps), which lie one behind the other.

    Attributes:
        states: number of states of every stage, the duration among them, m.
        sizes: number of unknowns n_k of every stage; shape (N + 1,).
        row_counts: number of rows of every stage; shape (N + 1,).
        unknowns, gaps, rows: n_w, n_y, n_r.
        hessian: of each stage, (n_k, n_k).
        constraints: of each interval the derivatives of its end, (m, n_k), column by column; behind them those of each
            stage's rows, row by row.
        gap_size: number of all entries of the former.
    """

    def __init__(self, assembly: Assembly) -> None:
        layout = assembly.layout
        sizes = layout.stage_states + layout.stage_controls
        self.states = int(layout.stage_states[0])
        self.sizes, self.row_counts = sizes.astype(np.int32), layout.stage_rows.astype(np.int32)
        self.unknowns, self.gaps, self.rows = layout.unknowns, layout.gap_index.size, len(layout.row_index)
        dynamics, rows = self.states * sizes[:-1], layout.stage_rows * sizes
        self.hessian = Memory(np.zeros(int((sizes**2).sum())), begins_of(sizes**2)[:, None])
        self.gap_size = int(dynamics.sum())
        begins = np.stack([np.append(begins_of(dynamics), 0), self.gap_size + begins_of(rows)], axis=1)
        self.constraints = Memory(np.zeros(self.gap_size + int(rows.sum())), begins)
        place = np.arange(self.unknowns) - begins_of(sizes)[layout.stage_of_unknown]
        begins, size = self.hessian.begins[layout.stage_of_unknown, 0], sizes[layout.stage_of_unknown]
        self._diagonal = begins + place * (size + 1)
        self._hessian = self._hessian_assembly(assembly, sizes, place)
        self._jacobian = self._jacobian_assembly(assembly, sizes, place)

    def _hessian_assembly(self, assembly: Assembly, sizes: Indices, place: Indices) -> StageAssembly:
        kind, first = unique_rows(assembly.structure_keys(rows=False))
        sums = assembly.hessian_of(first)
        stage = assembly.layout.stage_of_unknown[sums.rows]
        return StageAssembly(sums, Entries(stage, place[sums.columns] * sizes[stage] + place[sums.rows]), kind)

    def _jacobian_assembly(self, assembly: Assembly, sizes: Indices, place: Indices) -> StageAssembly:
        """The Jacobian: of the gaps with the other sign and without the next states, of the rows as it is."""
        layout = assembly.layout
        kind, first = unique_rows(assembly.structure_keys(rows=True))
        sums = assembly.jacobian_of(first)
        number, stage_of, is_row = (np.zeros(layout.constraints, dtype=np.int64) for _ in range(3))
        number[layout.gap_index] = np.arange(self.states)
        number[layout.row_index] = np.arange(self.rows) - begins_of(layout.stage_rows)[layout.rows.node]
        stage_of[layout.gap_index] = np.arange(layout.intervals)[:, None]
        stage_of[layout.row_index] = layout.rows.node
        is_row[layout.row_index] = 1
        own = np.flatnonzero(layout.stage_of_unknown[sums.columns] == stage_of[sums.rows])
        constraint, column = sums.rows[own], place[sums.columns[own]]
        stage, family = stage_of[constraint], is_row[constraint]
        as_row = number[constraint] * sizes[stage] + column
        as_gap = column * self.states + number[constraint]
        entries = Entries(stage, np.where(family == 1, as_row, as_gap), family)
        return StageAssembly(sums.choose(own, np.where(family == 1, 1.0, -1.0)), entries, kind)

    def write(self, linear: Array, curved: Array) -> bool:
        """Take the derivatives at a point, as `Evaluation` returns them; return whether all are finite."""
        finite = self._jacobian.write(linear, self.constraints)
        return self._hessian.write(curved, self.hessian) and finite

    def write_identity(self, linear: Array) -> bool:
        """Take the Jacobian alone, with ones in the place of the Hessian; return whether all are finite."""
        self.clear()
        self.hessian.doubles[self._diagonal] = 1.0
        return self._jacobian.write(linear, self.constraints)

    def clear(self) -> None:
        """Write zeros to the matrices of second derivatives, which keep what no second derivative is written to."""
        self.hessian.doubles[:] = 0.0


def begins_of(sizes: Indices) -> Indices:
    """Return where blocks of these sizes begin that lie one behind the other."""
    return np.cumsum(sizes) - sizes
