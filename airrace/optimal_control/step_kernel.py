"""The C sources of a compiled step and its derivatives: those of f, and a driver that composes them.

The graph of a whole Runge-Kutta step's Hessian takes a compiler minutes. Here only f, its Jacobian and the Hessian of
lam . f are written out. `step_driver.c` says how the step and its derivatives follow from them; the tables that it
reads are those of `step_tables.py`.
"""

from collections.abc import Sequence

import casadi as ca

from airrace.optimal_control.c_tables import encoded, integers, library_function_text, read_text
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.step_tables import StepParts, scheme_numbers, step_parts, step_tables
from airrace.records import record
from airrace.system import System

_TEXTS = ("tables.h", "compiled_functions.c", "step_driver.c", "model_tables.c", "step_kernel.c")


@record
class StepSources:
    """The sources of the library's functions `step`, `step_jacobian` and `step_hessian`.

    Attributes:
        rates: f as a casadi function, which the driver calls as `rates`, on lanes as `rates_of_lanes`.
        generated: further casadi functions that the driver calls, each by its own name.
        driver: the driver's C source, tables included, to follow `lanes.h` or `one_lane.h`.
        jacobian, hessian: patterns of the results.
    """

    rates: ca.Function
    generated: list[ca.Function]
    driver: str
    jacobian: ca.Sparsity
    hessian: ca.Sparsity


def driver_text() -> str:
    """Return the driver without tables, which is the same for all models."""
    return library_function_text() + "".join(read_text(name) for name in _TEXTS)


def step_sources(system: System, scheme: RungeKutta, *, lanes: int = 1) -> StepSources:
    """Return the sources of one step of a system and its derivatives, for so many intervals at once."""
    parts = step_parts(system, scheme)
    tables = [number for table in step_tables(parts) for number in (len(table), *table)]
    lines = [
        f"#define PROJECTED_END {int(parts.projection is not None)}",
        f"#define RATES_ALONE {'rates' if lanes == 1 else 'rates_of_lanes'}",
        *_room([parts.alone, *parts.generated]),
        integers("TABLES", tables),
        f"static const double NUMBERS[] = {{{', '.join(map(repr, scheme_numbers(scheme)))}}};",
        *_patterns(parts),
    ]
    text = "\n".join(lines) + "\n\n" + driver_text()
    return StepSources(parts.alone, parts.generated, text, parts.jacobian, parts.hessian)


def _room(functions: Sequence[ca.Function]) -> list[str]:
    """Return how many arguments, results, integers and numbers the largest of the called functions asks for."""
    room = {
        "ARGUMENTS": max(4, *(function.sz_arg() for function in functions)),
        "RESULTS": max(2, *(function.sz_res() for function in functions)),
        "INTEGERS": max(1, *(function.sz_iw() for function in functions)),
        "REALS": max(1, *(function.sz_w() for function in functions)),
    }
    return [f"#define ROOM_FOR_{name} {size}" for name, size in room.items()]


def _patterns(parts: StepParts) -> list[str]:
    """Return the patterns of arguments and results."""
    system = parts.system
    return [
        encoded("PATTERN_Y", ca.Sparsity.dense(len(system.states) + len(system.controls) + 1)),
        encoded("PATTERN_SCALAR", ca.Sparsity.dense(1)),
        encoded("PATTERN_P", ca.Sparsity.dense(len(system.parameters))),
        encoded("PATTERN_X", ca.Sparsity.dense(len(system.states))),
        encoded("PATTERN_JACOBIAN", parts.jacobian),
        encoded("PATTERN_HESSIAN", parts.hessian),
    ]
