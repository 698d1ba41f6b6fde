"""The Newton step of a program of stages by the native Riccati recursion, `riccati.c`.

The matrices of all stages are dense and lie one behind the other. Constraints besides the gaps (rows) and simple bounds
enter with weights, which an interior point method has for inequalities and a penalty for equalities.
"""

import ctypes

import numpy as np
from numpy.typing import NDArray

from airrace.native.library import library
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.constraint_rows import Indices
from airrace.optimal_control.sparse_assembly import Entries, Memory, StageAssembly, unique_rows
from airrace.trajectory import Array

MOST_UNKNOWNS = 64
"""The largest number of unknowns of a stage, for which `riccati.c` has room."""


def available(assembly: Assembly) -> bool:
    """Return whether the steps of a program can be solved here."""
    layout = assembly.layout
    return library() is not None and int((layout.stage_states + layout.stage_controls).max()) <= MOST_UNKNOWNS


class StageSystem:
    """The linear system of a program's Newton steps (n_w unknowns, n_r rows, n_y gaps), written anew for every step."""

    def __init__(self, assembly: Assembly) -> None:
        layout = assembly.layout
        native = library()
        assert native is not None  # see `available`
        self._native = native.evaluator
        sizes = layout.stage_states + layout.stage_controls
        self._states = int(layout.stage_states[0])
        self._sizes, self._rows = sizes.astype(np.int32), layout.stage_rows.astype(np.int32)
        self.unknowns, self.gaps, self.rows = layout.unknowns, layout.gap_index.size, len(layout.row_index)
        dynamics, rows = self._states * sizes[:-1], layout.stage_rows * sizes
        self._matrices = Memory(np.zeros(int((sizes**2).sum())), _begins(sizes**2)[:, None])
        self._dynamics = int(dynamics.sum())
        begins = np.stack([np.append(_begins(dynamics), 0), self._dynamics + _begins(rows)], axis=1)
        self._constraints = Memory(np.zeros(self._dynamics + int(rows.sum())), begins)
        self._factors = np.zeros_like(self._matrices.doubles)
        self._first = np.zeros(self._states**2)
        self._room = np.zeros(self.unknowns), np.zeros(self._states * len(sizes))
        place = np.arange(self.unknowns) - _begins(sizes)[layout.stage_of_unknown]
        begins, size = self._matrices.begins[layout.stage_of_unknown, 0], sizes[layout.stage_of_unknown]
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
        number[layout.gap_index] = np.arange(self._states)
        number[layout.row_index] = np.arange(self.rows) - _begins(layout.stage_rows)[layout.rows.node]
        stage_of[layout.gap_index] = np.arange(layout.intervals)[:, None]
        stage_of[layout.row_index] = layout.rows.node
        is_row[layout.row_index] = 1
        own = np.flatnonzero(layout.stage_of_unknown[sums.columns] == stage_of[sums.rows])
        constraint, column = sums.rows[own], place[sums.columns[own]]
        stage, family = stage_of[constraint], is_row[constraint]
        as_row = number[constraint] * sizes[stage] + column
        as_gap = column * self._states + number[constraint]
        entries = Entries(stage, np.where(family == 1, as_row, as_gap), family)
        return StageAssembly(sums.choose(own, np.where(family == 1, 1.0, -1.0)), entries, kind)

    def write(self, linear: Array, curved: Array) -> bool:
        """Take the derivatives at a point, as `Evaluation` returns them; return whether all are finite."""
        finite = self._jacobian.write(linear, self._constraints)
        return self._hessian.write(curved, self._matrices) and finite

    def write_identity(self, linear: Array) -> bool:
        """Take the Jacobian alone, with ones in the place of the Hessian; return whether all are finite."""
        self.clear()
        self._matrices.doubles[self._diagonal] = 1.0
        return self._jacobian.write(linear, self._constraints)

    def clear(self) -> None:
        """Write zeros to the matrices of second derivatives, which keep what no second derivative is written to."""
        self._matrices.doubles[:] = 0.0

    def factorise(self, weights: Array) -> bool:
        """Factorise, with the weights of rows and simple bounds, shape (n_r + n_w,).

        Returns:
            Whether the step leads to a minimum: the matrix has the inertia that it has at one.
        """
        of_rows, of_bounds = np.split(np.ascontiguousarray(weights), [self.rows])
        constraints = self._constraints.doubles
        arrays = (self._sizes, self._matrices.doubles, constraints, self._rows, constraints[self._dynamics :])
        arrays = (*arrays, of_rows, of_bounds, self._factors, self._first)
        wrong: int = self._native.riccati_factorise(len(self._sizes), self._states, *map(_address, arrays))
        return wrong == 0

    def solve(self, stationarity: Array, gaps: Array) -> tuple[Array, Array]:
        """Return the unknowns (n_w,) and the multipliers of the gaps (n_y,) for right-hand sides of the same shapes."""
        step, multipliers = np.empty(self.unknowns), np.empty(self.gaps)
        arrays = (self._sizes, self._constraints.doubles, self._factors, self._first)
        arrays = (*arrays, np.ascontiguousarray(stationarity), np.ascontiguousarray(gaps), *self._room)
        self._native.riccati_solve(len(self._sizes), self._states, *map(_address, (*arrays, step, multipliers)))
        return step, multipliers

    def values(self, step: Array) -> Array:
        """Return the changes of rows and unknowns with a step, shape (n_r + n_w,)."""
        result = np.concatenate([np.empty(self.rows), step])
        arrays = (self._sizes, self._rows, self._constraints.doubles[self._dynamics :], result[self.rows :], result)
        self._native.riccati_rows(len(self._sizes), *map(_address, arrays))
        return result

    def transpose_multiply(self, values: Array) -> Array:
        """Return the transpose of `values` times multipliers of rows and unknowns, shape (n_w,)."""
        result, multipliers = values[self.rows :].copy(), np.ascontiguousarray(values)
        arrays = (self._sizes, self._rows, self._constraints.doubles[self._dynamics :], multipliers, result)
        self._native.riccati_rows_transposed(len(self._sizes), *map(_address, arrays))
        return result


def _begins(sizes: Indices) -> Indices:
    return np.cumsum(sizes) - sizes


def _address(array: Array | NDArray[np.int32]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
