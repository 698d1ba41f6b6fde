"""Constant tables written in C."""

from collections.abc import Sequence

import casadi as ca


def integers(name: str, values: Sequence[int]) -> str:
    """Return a table of integers; C has none without entries, so an empty one holds a zero."""
    return f"static const int {name}[] = {{{', '.join(map(str, values or [0]))}}};"


def encoded(name: str, sparsity: ca.Sparsity) -> str:
    """Return a pattern as casadi encodes it: rows, columns, starts of the columns, rows of the nonzeros."""
    numbers = [*sparsity.shape, *sparsity.colind(), *sparsity.row()]
    return f"static const long long int {name}[] = {{{', '.join(map(str, numbers))}}};"
