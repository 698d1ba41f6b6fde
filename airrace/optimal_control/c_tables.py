"""Parts of a library's source: tables, the answers to what casadi asks, and texts that are the same for all."""

from collections.abc import Sequence
from pathlib import Path

import casadi as ca


def read_text(name: str) -> str:
    """Return the content of a C file that stands beside this one."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def integers(name: str, values: Sequence[int]) -> str:
    """Return a table of integers; C has none without entries, so an empty one holds a zero."""
    return f"static const int {name}[] = {{{', '.join(map(str, values or [0]))}}};"


def encoded(name: str, sparsity: ca.Sparsity) -> str:
    """Return a pattern as casadi encodes it: rows, columns, starts of the columns, rows of the nonzeros."""
    numbers = [*sparsity.shape, *sparsity.colind(), *sparsity.row()]
    return f"static const long long int {name}[] = {{{', '.join(map(str, numbers))}}};"


def library_function_text() -> str:
    """Return the macro of what casadi asks about a function of a library; the function's patterns stand in tables."""
    return read_text("library_function.h")
