"""The interpreter of casadi's functions: their tables made, their evaluation bound to numpy's arrays.

A function is a list of elementary operations on numbers that have places: constants, arguments, results, and what lies
between, one after another. An operation takes two numbers and writes a third. Operations of one kind are brought
together as far as their arguments allow, ten to twenty on average: grouping avoids branch mispredictions (1.4 to 2
times faster), and the order of operations that do not depend on each other changes no bit of a result. They are done
for `lanes` intervals at once, and have the bits of casadi's own evaluation.
"""

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from itertools import accumulate, pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.errors import KernelError
from airrace.optimal_control.native.library import Batches, KernelTables, Library, library
from airrace.optimal_control.trajectory import Array

PLACES = 2**16
"""The number of places that an instruction can address."""
FUNCTIONS = 5
"""The number of functions in the tables of a step: f, and Jacobian and Hessian of f and of the projection."""
_ARGUMENTS, _RESULTS = 4, 2  # of a function, at most
_ALIGNMENT = 64  # bytes of the widest vector
_LOAD, _STORE = -1, -2  # kinds of rows of `translator.c` beside operations

Table = Sequence[int]


@dataclass(frozen=True, eq=False)
class Bytecode:
    """A function for the interpreter.

    Attributes:
        tables: sizes, and where arguments and results begin and how many numbers they have, see `interpreter.h`.
        code: instructions (to, a, b), and before each run of one kind (kind, how often it follows, 0).
        constants: the numbers that stand in the first places.
    """

    tables: list[list[int]]
    code: NDArray[np.uint16]
    constants: list[float]


NOTHING = Bytecode(
    [[0, 0, 0], [0] * _ARGUMENTS, [0] * _ARGUMENTS, [0] * _RESULTS, [0] * _RESULTS], np.zeros((0, 3), np.uint16), []
)
"""The function that a model does not have."""


@cache
def operation_numbers() -> dict[int, int]:
    """Return the interpreter's numbers of casadi's operations; the next number ends a function."""
    native = library()
    assert native is not None
    return {getattr(ca, f"OP_{name}"): number for number, name in enumerate(native.operations)}


def bytecode(function: ca.Function) -> Bytecode:
    """Return an SX function for the interpreter.

    Raises:
        KernelError: it has an operation that is not known, or too many numbers.
    """
    kinds = [function.instruction_id(number) for number in range(function.n_instructions())]
    written = [float(function.instruction_constant(n)) for n, kind in enumerate(kinds) if kind == ca.OP_CONST]
    constants = {repr(constant): constant for constant in written}
    sizes = [
        [function.nnz_in(place) for place in range(function.n_in())],
        [function.nnz_out(place) for place in range(function.n_out())],
    ]
    *arguments, end = accumulate(sizes[0], initial=len(constants))
    *results, fixed = accumulate(sizes[1], initial=end)
    at, numbers = {text: place for place, text in enumerate(constants)}, operation_numbers()
    rows: list[tuple[int, int, int, int]] = []  # kind, arguments, result, see `translator.c`
    for n, kind in enumerate(kinds):
        operands, outputs = function.instruction_input(n), function.instruction_output(n)
        if kind == ca.OP_OUTPUT:
            rows.append((_STORE, operands[0], 0, results[outputs[0]] + outputs[1]))
        elif kind == ca.OP_INPUT:
            rows.append((_LOAD, arguments[operands[0]] + operands[1], 0, outputs[0]))
        elif kind == ca.OP_CONST:
            rows.append((_LOAD, at[repr(float(function.instruction_constant(n)))], 0, outputs[0]))
        elif kind in numbers:
            rows.append((numbers[kind], operands[0], operands[-1], outputs[0]))
        else:
            raise KernelError(f"{function.name()}: operation {kind} is not known to the interpreter")
    code, places = _translate(np.array(rows, dtype=np.int32).reshape(-1, 4), fixed)
    if places >= PLACES:
        raise KernelError(f"{function.name()} has too many numbers for the interpreter")
    tables = [
        [len(code), len(constants), places],
        *([*row, *[0] * (_ARGUMENTS - len(row))] for row in (arguments, sizes[0])),
        *([*row, *[0] * (_RESULTS - len(row))] for row in (results, sizes[1])),
    ]
    return Bytecode(tables, code, list(constants.values()))


def _translate(rows: NDArray[np.int32], fixed: int) -> tuple[NDArray[np.uint16], int]:
    """Return the instructions of rows in casadi's order, shape (n, 3), and the number of places."""
    native, places = library(), ctypes.c_int32()
    assert native is not None
    code = np.empty((2 * len(rows) + 2, 3), dtype=np.uint16)
    variables = int(rows[:, 3].max(initial=0)) + 1
    counts = len(rows), variables, fixed
    written = native.translate(*counts, rows.ctypes.data, code.ctypes.data, ctypes.addressof(places))
    if written < 0:
        raise MemoryError
    return code[:written], places.value


@dataclass(frozen=True, eq=False)
class Tables:
    """The arrays that `interpreter.h` reads: tables, each behind its length, instructions, and constants."""

    tables: NDArray[np.int32]
    code: NDArray[np.uint16]
    constants: Array

    @classmethod
    def of(cls, tables: Sequence[Table], constants: Sequence[float], functions: Sequence[Bytecode]) -> "Tables":
        """Return tables and constants, followed by those of functions."""
        every = [*tables, *(table for function in functions for table in function.tables)]
        return cls(
            np.array([number for table in every for number in (len(table), *table)], dtype=np.int32),
            np.concatenate([np.zeros((0, 3), dtype=np.uint16), *(function.code for function in functions)]),
            np.array([*constants, *(number for function in functions for number in function.constants)]),
        )

    def kernel(self, memory: Array | None = None) -> KernelTables:
        """Return the tables and working memory for a call; both must live as long as it is used."""
        begins = [array.ctypes.data for array in (self.tables, self.code, self.constants)]
        return KernelTables(*begins, None if memory is None else memory.ctypes.data)


@dataclass(frozen=True)
class BatchFunction:
    """A function of the interpreter for many batches of intervals.

    Attributes:
        tables: of the function.
        memory: that one thread works in, numbers.
        evaluate: of (kernel, batches, first, end).
    """

    tables: Tables
    memory: int
    evaluate: Callable[[KernelTables, object, int, int], None]

    def bind(
        self, arguments: Sequence[Array], results: Sequence[Array], threads: int, batches: int
    ) -> Callable[[], None]:
        """Return the evaluation of all batches, split over threads, with arguments and results in arrays that stay."""
        arrays = Batches()
        for place, array in enumerate(arguments):
            arrays.arguments[place] = array.ctypes.data
        for place, array in enumerate(results):
            arrays.results[place] = array.ctypes.data
        ends = [batches * number // threads for number in range(threads + 1)]
        memory = [_allocate(self.memory) for _ in range(threads)]
        kernels = [self.tables.kernel(array) for array in memory]
        of = ctypes.addressof(arrays)
        parts = [
            partial(self.evaluate, kernel, of, *part) for kernel, part in zip(kernels, pairwise(ends), strict=True)
        ]
        owned = (arguments, results, arrays, memory, self.tables)

        def call(owned: object = owned) -> None:
            futures = [_pool(len(parts) - 1).submit(part) for part in parts[1:]]
            parts[0]()
            for future in futures:
                future.result()

        return call


class Interpreter:
    """The interpreter of a variant of the library.

    Its methods raise KernelError where a function has an operation that the interpreter does not know.
    """

    def __init__(self, library: Library) -> None:
        self.lanes = library.lanes
        self._evaluator = library.evaluator

    def step(
        self, tables: Sequence[Table], constants: Sequence[float], functions: Sequence[ca.Function]
    ) -> tuple[BatchFunction, BatchFunction, BatchFunction]:
        """Return a step's values, Jacobian and Hessian.

        Args:
            tables, constants: of the model, see `runge_kutta.py`.
            functions: f, Jacobian and Hessian of f, and those of the projection, if there is one.
        """
        coded = [bytecode(function) for function in functions]
        of = Tables.of(tables, constants, [*coded, *[NOTHING] * (FUNCTIONS - len(coded))])
        evaluate, kernel = self._evaluator.evaluate_step, of.kernel()

        def step(order: int) -> BatchFunction:
            return BatchFunction(
                of,
                self._evaluator.step_memory(kernel, order),
                lambda kernel, batches, first, end: evaluate(kernel, order, batches, first, end),
            )

        return step(0), step(1), step(2)

    def function(self, function: ca.Function) -> BatchFunction:
        """Return the evaluation of a function of up to four arguments, the third of which all intervals share."""
        tables = function_tables(function)
        return BatchFunction(
            tables, self._evaluator.function_memory(tables.kernel()), self._evaluator.evaluate_function
        )

    def at_points(self, function: ca.Function, control: Array, p: Array) -> Callable[[Array], Array]:
        """Return a function (x, u, p) -> values of the states (n_x, n) at n points, see `function_at_points`."""
        tables = function_tables(function)
        memory = _allocate(self._evaluator.function_memory(tables.kernel()))
        u, count, values = np.ascontiguousarray(control, dtype=np.float64), control.shape[1], function.nnz_out(0)
        evaluate, kernel = self._evaluator.evaluate_points, tables.kernel(memory)

        def at(x: Array, owned: object = (tables, memory)) -> Array:
            states, result = np.ascontiguousarray(x, dtype=np.float64), np.empty((values, count))
            if states.ndim != 2 or states.shape[1] != count:
                raise ValueError(f"states of shape {states.shape} for {count} points")
            evaluate(kernel, states.ctypes.data, u.ctypes.data, p.ctypes.data, result.ctypes.data, count)
            return result

        return at


@cache
def interpreter() -> Interpreter | None:
    """Return the interpreter; None without the native library."""
    native = library()
    return None if native is None else Interpreter(native)


@lru_cache(maxsize=32)
def function_tables(function: ca.Function) -> Tables:
    """Return the tables of a single function."""
    return Tables.of([], [], [bytecode(function)])


@cache
def _pool(count: int) -> ThreadPoolExecutor:
    """Return threads that wait for calls; ctypes lets them run beside each other."""
    return ThreadPoolExecutor(count)


def _allocate(count: int) -> Array:
    """Return memory for so many numbers that begins where a vector may begin."""
    memory = np.empty(count + _ALIGNMENT // 8)
    first = -memory.ctypes.data % _ALIGNMENT // 8
    return memory[first : first + count]
