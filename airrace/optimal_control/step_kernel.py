"""The C sources of a step and its derivatives: those of f as casadi writes them, and a driver that composes them.

The graph of a whole Runge-Kutta step's Hessian takes a compiler minutes. Here only f, its Jacobian and the Hessian of
lam . f are written out. `step_kernel.c` says how the step and its derivatives follow from them; this file writes the
tables that it reads: sizes, scheme and patterns.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from airrace.optimal_control.c_tables import encoded, integers, library_function_text
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.step_patterns import Derivatives, Pattern, StepPatterns, derivatives, step_patterns
from airrace.records import record
from airrace.system import System

GROUP = 4
"""The multiple of numbers to which rows of a single interval's sensitivities are padded.

The compiler makes vectors of them: four doubles fill a register of AVX2. Where every number is a vector already,
nothing is padded.
"""


@record
class StepSources:
    """The sources of the library's functions `step`, `step_jacobian` and `step_hessian`.

    Attributes:
        rates: f as a casadi function, which the driver calls as `rates`, on lanes as `rates_of_lanes`.
        generated: further casadi functions that the driver calls, each by its own name.
        driver: the driver's C source, tables included.
        jacobian, hessian: patterns of the results.
    """

    rates: ca.Function
    generated: list[ca.Function]
    driver: str
    jacobian: ca.Sparsity
    hessian: ca.Sparsity


def driver_text() -> str:
    """Return the driver without tables, which is the same for all models."""
    return library_function_text() + Path(__file__).with_name("step_kernel.c").read_text(encoding="utf-8")


def step_sources(system: System, scheme: RungeKutta, *, lanes: int = 1) -> StepSources:
    """Return the sources of one step of a system and its derivatives, for so many intervals at once."""
    x, u = ca.SX.sym("x", len(system.states)), ca.SX.sym("u", len(system.controls))
    p = ca.SX.sym("p", len(system.parameters))
    values = system.rates(x, u, p)
    alone = ca.Function("rates", [x, u, p], [ca.densify(values)], {"cse": True})
    rates = derivatives("rates", [x, u, p], ca.vertcat(x, u), values)
    projection = None
    if system.projection is not None:
        projection = derivatives("projection", [x], x, system.projection(x))
    parts = [rates] if projection is None else [rates, projection]
    generated = [function for part in parts for function in (part.linear, part.curved)]
    patterns = step_patterns(scheme, rates, projection)
    padded = _padded(patterns, lanes)
    lines = [
        *_sizes(scheme, parts, patterns),
        *_room([alone, *generated]),
        f"#define GROUP {_group(lanes)}",
        f"#define PADDED {padded}",
        *_scheme(scheme),
        *_places(parts[0], patterns),
        *(
            line
            for part, seen in zip(parts, (patterns.stage, patterns.end), strict=False)
            for line in _derivative_tables(part, seen[:, patterns.active])
        ),
        *_results(len(system.states), len(system.parameters), patterns, padded),
    ]
    text = "\n".join(lines) + "\n\n" + driver_text()
    return StepSources(alone, generated, text, _sparsity(patterns.jacobian), _sparsity(patterns.hessian))


def _sizes(scheme: RungeKutta, parts: Sequence[Derivatives], patterns: StepPatterns) -> list[str]:
    n_x, n_z = parts[0].jacobian.shape
    sizes = {
        "NX": n_x,
        "NU": n_z - n_x,
        "STAGES": len(scheme.a),
        "STEPS": scheme.steps,
        "COLUMNS": len(patterns.active),
        "ACTING_STATES": len(_acting(parts[0])),
        "JACOBIAN_NONZEROS": int(patterns.jacobian.sum()),
        "HESSIAN_NONZEROS": int(patterns.hessian.sum()),
        "PROJECTED": len(parts) - 1,
    }
    for part in parts:
        prefix = part.name.upper()
        sizes[f"{prefix}_JACOBIAN_NONZEROS"] = max(1, part.linear.nnz_out(1))
        sizes[f"{prefix}_HESSIAN_NONZEROS"] = max(1, part.curved.nnz_out(0))
        sizes[f"{prefix}_VARIABLES"] = len(_variables(part))
    return [f"#define {name} {size}" for name, size in sizes.items()]


def _room(functions: Sequence[ca.Function]) -> list[str]:
    """Return how many arguments, results, integers and numbers the largest of the called functions asks for."""
    room = {
        "ARGUMENTS": max(4, *(function.sz_arg() for function in functions)),
        "RESULTS": max(2, *(function.sz_res() for function in functions)),
        "INTEGERS": max(1, *(function.sz_iw() for function in functions)),
        "REALS": max(1, *(function.sz_w() for function in functions)),
    }
    return [f"#define {name} {size}" for name, size in room.items()]


def _scheme(scheme: RungeKutta) -> list[str]:
    stages = len(scheme.a)
    rows = [", ".join(repr(weight) for weight in (*row, *[0.0] * (stages - len(row)))) for row in scheme.a]
    return [
        f"static const double A[][{stages}] = {{{', '.join(f'{{{row}}}' for row in rows)}}};",
        f"static const double B[] = {{{', '.join(map(repr, scheme.b))}}};",
    ]


def _places(rates: Derivatives, patterns: StepPatterns) -> list[str]:
    """Return the tables of the column of each entry of y, -1 for none, and of the states that f depends on."""
    place = {entry: number for number, entry in enumerate(patterns.active)}
    return [
        integers("COLUMN_OF", [place.get(entry, -1) for entry in range(len(patterns.hessian))]),
        integers("ACTING_STATE", _acting(rates)),
    ]


def _derivative_tables(part: Derivatives, sensitivity: Pattern) -> list[str]:
    """Return the tables of a function's Jacobian and Hessian.

    They include, by column, the curved arguments that depend on it.
    """
    variables, prefix = _variables(part), part.name.upper()
    number = {variable: place for place, variable in enumerate(variables)}
    jacobian = [(row, column, source) for source, (row, column) in enumerate(_entries(part.linear.sparsity_out(1)))]
    upper = [
        (number[row], number[column], source)
        for source, (row, column) in enumerate(_entries(part.curved.sparsity_out(0)))
    ]
    lower = [(column, row, source) for row, column, source in upper if row != column]
    columns, dependent = np.nonzero(sensitivity[variables].T)
    return [
        integers(f"{prefix}_VARIABLE", variables),
        *_compressed(f"{prefix}_JACOBIAN", len(part.jacobian), jacobian),
        *_compressed(f"{prefix}_HESSIAN", len(variables), upper + lower),
        *_compressed(
            f"{prefix}_DEPENDENT",
            sensitivity.shape[1],
            [(int(column), int(variable), 0) for column, variable in zip(columns, dependent, strict=True)],
        ),
    ]


def _results(n_x: int, n_p: int, patterns: StepPatterns, padded: int) -> list[str]:
    """Return the tables of the sources of the results' nonzeros, and the patterns of arguments and results."""
    n_y = len(patterns.hessian)
    place = {entry: number for number, entry in enumerate(patterns.active)}
    jacobian, hessian = _sparsity(patterns.jacobian), _sparsity(patterns.hessian)
    drawn = [row * padded + place[column] if column in place else -1 for row, column in _entries(jacobian)]
    return [
        integers("JACOBIAN_SOURCE", drawn),
        integers("HESSIAN_SOURCE", [place[row] * padded + place[column] for row, column in _entries(hessian)]),
        encoded("PATTERN_Y", ca.Sparsity.dense(n_y)),
        encoded("PATTERN_SCALAR", ca.Sparsity.dense(1)),
        encoded("PATTERN_P", ca.Sparsity.dense(n_p)),
        encoded("PATTERN_X", ca.Sparsity.dense(n_x)),
        encoded("PATTERN_JACOBIAN", jacobian),
        encoded("PATTERN_HESSIAN", hessian),
    ]


def _group(lanes: int) -> int:
    return GROUP if lanes == 1 else 1


def _padded(patterns: StepPatterns, lanes: int) -> int:
    return -(-len(patterns.active) // _group(lanes)) * _group(lanes)


def _acting(rates: Derivatives) -> list[int]:
    """Return the states that f depends on."""
    n_x = len(rates.jacobian)
    return np.flatnonzero(np.any(rates.jacobian[:, :n_x], axis=0)).tolist()


def _variables(part: Derivatives) -> list[int]:
    """Return the arguments in which a function is not linear."""
    return np.flatnonzero(np.any(part.hessian, axis=0)).tolist()


def _entries(sparsity: ca.Sparsity) -> list[tuple[int, int]]:
    """Return the rows and columns of the nonzeros in casadi's order."""
    rows, columns = sparsity.get_triplet()
    return list(zip(rows, columns, strict=True))


def _sparsity(pattern: Pattern) -> ca.Sparsity:
    rows, columns = np.nonzero(pattern)
    return ca.Sparsity.triplet(len(pattern), pattern.shape[1], rows.tolist(), columns.tolist())


def _compressed(name: str, rows: int, entries: Iterable[tuple[int, int, int]]) -> list[str]:
    """Return row-compressed tables of (row, column, source)."""
    ordered = sorted(entries)
    starts = np.searchsorted([row for row, _, _ in ordered], np.arange(rows + 1))
    return [
        integers(f"{name}_START", starts.tolist()),
        integers(f"{name}_COLUMN", [column for _, column, _ in ordered]),
        integers(f"{name}_SOURCE", [source for _, _, source in ordered]),
    ]
