"""The C source through which the functions of several intervals at once are called.

casadi loads them as functions of matrices, one column per interval: (y, own, shared[, lam]) with one `shared` for all.
The replay calls them row by row, see `compiled_rates.py`.
"""

from collections.abc import Mapping, Sequence

import casadi as ca

from airrace.optimal_control.c_tables import encoded, integers, library_function_text, read_text
from airrace.optimal_control.lane_code import header
from airrace.records import record
from airrace.system import System


@record
class Shape:
    """The patterns of a function of one interval, whose third argument is shared."""

    inputs: Sequence[ca.Sparsity]
    outputs: Sequence[ca.Sparsity]


def shape_of(function: ca.Function) -> Shape:
    """Return the patterns of a casadi function."""
    return Shape(
        [function.sparsity_in(place) for place in range(function.n_in())],
        [function.sparsity_out(place) for place in range(function.n_out())],
    )


def interface_text() -> str:
    """Return the part of the source that is the same for all models."""
    return read_text("lane_copies.h") + library_function_text() + read_text("lane_interface.c")


def interface_source(shapes: Mapping[str, Shape], rows: Mapping[str, int], system: System, lanes: int) -> str:
    """Return the source of the functions `name` and `name_rows`.

    The former call `name_of_lanes`, the latter have so many rows of values.
    """
    n_x, n_u = len(system.states), len(system.controls)
    return "\n".join(
        [
            header(lanes),
            f"#define NX {n_x}",
            f"#define NZ {n_x + n_u}",
            f"#define NP {len(system.parameters)}",
            *(line for name, shape in shapes.items() for line in _tables(name, shape, lanes)),
            interface_text(),
            *(f"SEVERAL_AT_ONCE({name}, {len(one.inputs)}, {len(one.outputs)})" for name, one in shapes.items()),
            *(f"ROW_BY_ROW({name}, {values})" for name, values in rows.items()),
            "",
        ]
    )


def _tables(name: str, shape: Shape, lanes: int) -> list[str]:
    lines: list[str] = []
    for kind, patterns in (("IN", shape.inputs), ("OUT", shape.outputs)):
        several = [
            pattern if kind == "IN" and place == 2 else ca.repmat(pattern, 1, lanes)
            for place, pattern in enumerate(patterns)
        ]
        sizes = [pattern.nnz() for pattern in patterns]
        names = [f"{name}_{kind}_{place}" for place in range(len(patterns))]
        lines += [
            integers(f"{name}_SIZE_{kind}", sizes),
            f"#define {name}_NUMBERS_{kind} {sum(sizes)}",
            *(encoded(one, pattern) for one, pattern in zip(names, several, strict=True)),
            f"static const integer *const {name}_{kind}[] = {{{', '.join(names)}}};",
        ]
    return lines
