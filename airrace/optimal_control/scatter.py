"""The construction of sparse matrices whose nonzeros are weighted sums of entries of casadi expressions."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


class Scatter:
    """A collection of contributions `weight * expression[source]` at (row, column) that make a matrix at once.

    In a `symmetric` matrix each pair (i, j), (j, i) is contributed to once and both are kept.
    """

    def __init__(self, rows: int, columns: int, *, symmetric: bool = False) -> None:
        self._shape = (rows, columns)
        self._symmetric = symmetric
        self._expressions: list[ca.MX] = []
        self._offset = 0
        self._entries: list[tuple[Indices, Indices, NDArray[np.float64], Indices]] = []

    def draw_from(self, expression: ca.MX) -> None:
        """Set the dense column that the following contributions take their sources from."""
        self._offset = sum(one.numel() for one in self._expressions)
        self._expressions.append(ca.densify(expression))

    def add(self, rows: Indices, columns: Indices, weights: NDArray[np.float64], sources: Indices) -> None:
        """Add contributions; those that meet at one place add up. All shapes are (n,)."""
        self._entries.append((rows, columns, weights, sources + self._offset))
        if self._symmetric:
            off = rows != columns
            self._entries.append((columns[off], rows[off], weights[off], sources[off] + self._offset))

    def matrix(self) -> ca.MX:
        """Return the matrix as a sparse expression.

        Every contribution is picked from its source, and those that meet are added.
        """
        rows, columns, weights, sources = (np.concatenate(parts) for parts in zip(*self._entries, strict=True))
        places = columns * self._shape[0] + rows
        order = np.argsort(places, kind="stable")
        first = np.concatenate([[True], np.diff(places[order]) > 0])
        nonzero = np.cumsum(first) - 1
        turn = np.arange(len(order)) - np.flatnonzero(first)[nonzero]  # how many come before it at the same place
        column_of, row_of = np.divmod(places[order[first]], self._shape[0])
        begins = np.searchsorted(column_of, np.arange(self._shape[1] + 1))
        drawn, count = ca.vertcat(*self._expressions), len(row_of)
        values = ca.MX(0.0)
        for number in range(int(turn.max()) + 1):
            taken = turn == number
            picked = ca.vec(drawn[sources[order[taken]].tolist()]) * ca.DM(weights[order[taken]])  # of a scalar: a row
            at = ca.Sparsity(count, 1, [0, int(taken.sum())], nonzero[taken].tolist())
            values += ca.densify(ca.MX(at, picked)) if number else picked
        return ca.MX(ca.Sparsity(*self._shape, begins.tolist(), row_of.tolist()), values)
