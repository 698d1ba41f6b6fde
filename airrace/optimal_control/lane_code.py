"""The C code of straight-line functions on vectors that hold one number of each of several intervals.

casadi writes C for single numbers. Its SX functions are lists of elementary operations, which are written here once
more: sums and products as the compiler's operators on vectors, all others as loops over the lanes, see `lanes.h`.
Operations, their order and the functions of the C library are those of casadi's own code, so the results are, too.
"""

import math
from collections.abc import Mapping

import casadi as ca

from airrace.errors import KernelError
from airrace.optimal_control.c_tables import read_text

VECTOR_FLAGS = ("-fno-math-errno", "-fvisibility=hidden", "-fexpensive-optimizations")
"""The compiler flags for code on vectors, whose parts call only each other.

The last flag belongs to -O2. With -O1 alone gcc does not clear the upper halves of the vector registers before it calls
the C library, and everything took three times as long.
"""

OPERATORS = {
    ca.OP_ASSIGN: "{x}",
    ca.OP_ADD: "{x} + {y}",
    ca.OP_SUB: "{x} - {y}",
    ca.OP_MUL: "{x} * {y}",
    ca.OP_DIV: "{x} / {y}",
    ca.OP_NEG: "-{x}",
    ca.OP_SQ: "{x} * {x}",
    ca.OP_TWICE: "2.0 * {x}",
    ca.OP_INV: "1.0 / {x}",
}
"""The operations that are operators on vectors."""

LANE_BY_LANE = {
    ca.OP_EXP: ("exp", "exp(a)"),
    ca.OP_LOG: ("log", "log(a)"),
    ca.OP_POW: ("pow", "pow(a, b)"),
    ca.OP_CONSTPOW: ("pow", "pow(a, b)"),
    ca.OP_SQRT: ("sqrt", "sqrt(a)"),
    ca.OP_SIN: ("sin", "sin(a)"),
    ca.OP_COS: ("cos", "cos(a)"),
    ca.OP_TAN: ("tan", "tan(a)"),
    ca.OP_ASIN: ("asin", "asin(a)"),
    ca.OP_ACOS: ("acos", "acos(a)"),
    ca.OP_ATAN: ("atan", "atan(a)"),
    ca.OP_LT: ("less", "a < b"),
    ca.OP_LE: ("at_most", "a <= b"),
    ca.OP_EQ: ("equal", "a == b"),
    ca.OP_NE: ("unequal", "a != b"),
    ca.OP_NOT: ("not", "!a"),
    ca.OP_AND: ("and", "a && b"),
    ca.OP_OR: ("or", "a || b"),
    ca.OP_FLOOR: ("floor", "floor(a)"),
    ca.OP_CEIL: ("ceil", "ceil(a)"),
    ca.OP_FMOD: ("fmod", "fmod(a, b)"),
    ca.OP_FABS: ("fabs", "fabs(a)"),
    ca.OP_SIGN: ("sign", "a < 0 ? -1 : a > 0 ? 1 : a"),
    ca.OP_COPYSIGN: ("copysign", "copysign(a, b)"),
    ca.OP_IF_ELSE_ZERO: ("if_else_zero", "a ? b : 0"),
    ca.OP_FMIN: ("fmin", "fmin(a, b)"),
    ca.OP_FMAX: ("fmax", "fmax(a, b)"),
    ca.OP_SINH: ("sinh", "sinh(a)"),
    ca.OP_COSH: ("cosh", "cosh(a)"),
    ca.OP_TANH: ("tanh", "tanh(a)"),
    ca.OP_ASINH: ("asinh", "asinh(a)"),
    ca.OP_ACOSH: ("acosh", "acosh(a)"),
    ca.OP_ATANH: ("atanh", "atanh(a)"),
    ca.OP_ATAN2: ("atan2", "atan2(a, b)"),
    ca.OP_LOG1P: ("log1p", "log1p(a)"),
    ca.OP_EXPM1: ("expm1", "expm1(a)"),
    ca.OP_HYPOT: ("hypot", "hypot(a, b)"),
}
"""The operations that are loops over the lanes: name, and expression in the numbers a and b of one lane."""

_KNOWN = {*OPERATORS, *LANE_BY_LANE, ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT}


def has_lanes(function: ca.Function) -> bool:
    """Return whether all operations of an SX function are known here."""
    return all(function.instruction_id(number) in _KNOWN for number in range(function.n_instructions()))


def header(lanes: int) -> str:
    """Return the text that stands before all code on vectors."""
    return f"#define LANES {lanes}\n{read_text('lanes.h')}\n"


def lane_functions(functions: Mapping[str, ca.Function]) -> str:
    """Return SX functions as C functions `name(arg, res, iw, w, mem)` on vectors, to follow the header.

    Args:
        functions: by the names that they have in C.

    Raises:
        KernelError: one contains an operation that is not known here.
    """
    operations = {one.instruction_id(number) for one in functions.values() for number in range(one.n_instructions())}
    loops = dict(LANE_BY_LANE[one] for one in sorted(operations & LANE_BY_LANE.keys()))
    lines = [f"LANE_BY_LANE({loop}, {expression})" for loop, expression in loops.items()]
    for name, function in functions.items():
        lines += _function(function, name)
    return "\n".join(lines)


def _function(function: ca.Function, name: str) -> list[str]:
    variables = ", ".join(f"w{number}" for number in range(max(1, function.sz_w())))
    return [
        f"int {name}(const real **arg, real **res, integer *iw, real *w, int mem)",
        "{",
        f"    real {variables};",
        *(f"    {_line(function, number)}" for number in range(function.n_instructions())),
        "    return 0;",
        "}",
        "",
    ]


def _line(function: ca.Function, number: int) -> str:
    operation = function.instruction_id(number)
    given, found = function.instruction_input(number), function.instruction_output(number)
    if operation == ca.OP_OUTPUT:
        return f"if (res[{found[0]}]) res[{found[0]}][{found[1]}] = w{given[0]};"
    if operation == ca.OP_INPUT:
        return f"w{found[0]} = arg[{given[0]}] ? arg[{given[0]}][{given[1]}] : all(0.0);"
    return f"w{found[0]} = {_value(function, number, operation, given)};"


def _value(function: ca.Function, number: int, operation: int, given: list[int]) -> str:
    if operation == ca.OP_CONST:
        return f"all({_constant(float(function.instruction_constant(number)))})"
    x, y = (f"w{place}" for place in (given[0], given[-1]))
    if operation in OPERATORS:
        return OPERATORS[operation].format(x=x, y=y)
    if operation in LANE_BY_LANE:
        return f"{LANE_BY_LANE[operation][0]}_of_lanes({x}, {y})"
    raise KernelError(f"{function.name()}: operation {operation} has no form for several intervals at once")


def _constant(number: float) -> str:
    if math.isnan(number):
        return "NAN"
    return repr(number) if math.isfinite(number) else f"{'-' if number < 0 else ''}INFINITY"
