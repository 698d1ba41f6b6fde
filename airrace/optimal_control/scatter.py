"""Sparse matrices whose nonzeros are weighted sums of entries of casadi expressions."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


class Scatter:
    """Collects contributions `weight * expression[source]` at (row, column), then builds the matrix at once.

    Of a `symmetric` matrix each pair (i, j), (j, i) is contributed to once and both are kept.
    """

    def __init__(self, rows: int, columns: int, *, symmetric: bool = False) -> None:
        self._shape = (rows, columns)
        self._symmetric = symmetric
        self._expressions: list[ca.MX] = []
        self._offset = 0
        self._entries: list[tuple[Indices, Indices, NDArray[np.float64], Indices]] = []

    def draw_from(self, expression: ca.MX) -> None:
        """The dense column that the following contributions take their sources from."""
        self._offset = sum(one.numel() for one in self._expressions)
        self._expressions.append(ca.densify(expression))

    def add(self, rows: Indices, columns: Indices, weights: NDArray[np.float64], sources: Indices) -> None:
        """Add contributions; those that meet at one place add up. All shapes (n,)."""
        self._entries.append((rows, columns, weights, sources + self._offset))
        if self._symmetric:
            off = rows != columns
            self._entries.append((columns[off], rows[off], weights[off], sources[off] + self._offset))

    def matrix(self) -> ca.MX:
        """The matrix as a sparse expression."""
        rows, columns, weights, sources = (np.concatenate(parts) for parts in zip(*self._entries, strict=True))
        places, nonzero = np.unique(columns * self._shape[0] + rows, return_inverse=True)
        column_of, row_of = np.divmod(places, self._shape[0])
        pattern = ca.Sparsity.triplet(*self._shape, row_of.tolist(), column_of.tolist())
        total = sum(one.numel() for one in self._expressions)
        weight = ca.DM.triplet(nonzero.tolist(), sources.tolist(), ca.DM(weights), len(places), total)
        return ca.MX(pattern, ca.mtimes(ca.MX(weight), ca.vertcat(*self._expressions)))
