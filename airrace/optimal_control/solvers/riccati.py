"""The Newton step of a program of stages by the native Riccati recursion, `riccati.c`.

The matrices of all stages are dense and lie one behind the other. Constraints besides the gaps (rows) and simple bounds
enter with weights, which an interior point method has for inequalities and a penalty for equalities.
"""

import ctypes

import numpy as np
from numpy.typing import NDArray

from airrace.native.library import library
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.stage_matrices import MOST_UNKNOWNS, StageMatrices
from airrace.trajectory import Array


def available(assembly: Assembly) -> bool:
    """Return whether the steps of a program can be solved here."""
    layout = assembly.layout
    return library() is not None and int((layout.stage_states + layout.stage_controls).max()) <= MOST_UNKNOWNS


class StageSystem(StageMatrices):
    """The linear system of a program's Newton steps (n_w unknowns, n_r rows, n_y gaps), written anew for every step."""

    def __init__(self, assembly: Assembly) -> None:
        super().__init__(assembly)
        native = library()
        assert native is not None  # see `available`
        self._native = native.evaluator
        self._factors = np.zeros_like(self.hessian.doubles)
        self._first = np.zeros(self.states**2)
        self._room = np.zeros(self.unknowns), np.zeros(self.states * len(self.sizes))

    def factorise(self, weights: Array) -> bool:
        """Factorise, with the weights of rows and simple bounds, shape (n_r + n_w,).

        Returns:
            Whether the step leads to a minimum: the matrix has the inertia that it has at one.
        """
        of_rows, of_bounds = np.split(np.ascontiguousarray(weights), [self.rows])
        constraints = self.constraints.doubles
        arrays = (self.sizes, self.hessian.doubles, constraints, self.row_counts, constraints[self.gap_size :])
        arrays = (*arrays, of_rows, of_bounds, self._factors, self._first)
        wrong: int = self._native.riccati_factorise(len(self.sizes), self.states, *map(_address, arrays))
        return wrong == 0

    def solve(self, stationarity: Array, gaps: Array) -> tuple[Array, Array]:
        """Return the unknowns (n_w,) and the multipliers of the gaps (n_y,) for right-hand sides of the same shapes."""
        step, multipliers = np.empty(self.unknowns), np.empty(self.gaps)
        arrays = (self.sizes, self.constraints.doubles, self._factors, self._first)
        arrays = (*arrays, np.ascontiguousarray(stationarity), np.ascontiguousarray(gaps), *self._room)
        self._native.riccati_solve(len(self.sizes), self.states, *map(_address, (*arrays, step, multipliers)))
        return step, multipliers

    def values(self, step: Array) -> Array:
        """Return the changes of rows and unknowns with a step, shape (n_r + n_w,)."""
        result = np.concatenate([np.empty(self.rows), step])
        arrays = (self.sizes, self.row_counts, self.constraints.doubles[self.gap_size :], result[self.rows :], result)
        self._native.riccati_rows(len(self.sizes), *map(_address, arrays))
        return result

    def transpose_multiply(self, values: Array) -> Array:
        """Return the transpose of `values` times multipliers of rows and unknowns, shape (n_w,)."""
        result, multipliers = values[self.rows :].copy(), np.ascontiguousarray(values)
        arrays = (self.sizes, self.row_counts, self.constraints.doubles[self.gap_size :], multipliers, result)
        self._native.riccati_rows_transposed(len(self.sizes), *map(_address, arrays))
        return result


def _address(array: Array | NDArray[np.int32]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
