"""The interpreter of casadi's functions: their tables made, their evaluation bound to numpy's arrays.

It does casadi's operations in casadi's order (as far as they depend on each other), for `lanes` intervals at once, so
its results have the bits of casadi's own evaluation.
"""

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache, partial
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.native.bytecode import NOTHING, Bytecode, bytecode
from airrace.native.library import Batches, Kernel, Library, library
from airrace.records import record
from airrace.trajectory import Array

FUNCTIONS = 5
"""The number of functions in the tables of a step: f, and Jacobian and Hessian of f and of the projection."""

_ALIGNMENT = 64  # bytes of the widest vector

Table = Sequence[int]


@record
class Tables:
    """The arrays that `tables.h` reads: tables, each behind its length, instructions, and constants."""

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

    def kernel(self, memory: Array | None = None) -> Kernel:
        """Return the tables and working memory for a call; both must live as long as it is used."""
        begins = [array.ctypes.data for array in (self.tables, self.code, self.constants)]
        return Kernel(*begins, None if memory is None else memory.ctypes.data)


@record
class Entry:
    """A function of the interpreter for many batches of intervals.

    Attributes:
        tables: of the function.
        memory: that one thread works in, numbers.
        evaluate: of (kernel, batches, first, end).
    """

    tables: Tables
    memory: int
    evaluate: Callable[[Kernel, object, int, int], None]

    def bound(self, given: Sequence[Array], found: Sequence[Array], threads: int, batches: int) -> Callable[[], None]:
        """Return the evaluation of all batches, split over threads, with arguments and results in arrays that stay."""
        arrays = Batches()
        for place, array in enumerate(given):
            arrays.given[place] = array.ctypes.data
        for place, array in enumerate(found):
            arrays.found[place] = array.ctypes.data
        ends = [batches * number // threads for number in range(threads + 1)]
        memory = [_aligned(self.memory) for _ in range(threads)]
        kernels = [self.tables.kernel(array) for array in memory]
        of = ctypes.addressof(arrays)
        parts = [partial(self.evaluate, one, of, *part) for one, part in zip(kernels, pairwise(ends), strict=True)]
        owned = (given, found, arrays, memory, self.tables)

        def call(owned: object = owned) -> None:
            others = [_pool(len(parts) - 1).submit(part) for part in parts[1:]]
            parts[0]()
            for other in others:
                other.result()

        return call


class Interpreter:
    """The interpreter of a variant of the library."""

    def __init__(self, library: Library) -> None:
        self.lanes = library.lanes
        self._evaluator = library.evaluator

    def step(
        self, tables: Sequence[Table], constants: Sequence[float], functions: Sequence[ca.Function]
    ) -> list[Entry]:
        """Return a step's values, Jacobian and Hessian.

        Args:
            tables, constants: of the model, see `step_tables.py`.
            functions: f, Jacobian and Hessian of f, and those of the projection, if there is one.

        Raises:
            KernelError: the interpreter does not know one of their operations.
        """
        coded = [bytecode(function) for function in functions]
        of = Tables.of(tables, constants, [*coded, *[NOTHING] * (FUNCTIONS - len(coded))])
        evaluate, kernel = self._evaluator.evaluate_step, of.kernel()

        def step(order: int) -> Entry:
            return Entry(
                of,
                self._evaluator.step_memory(kernel, order),
                lambda kernel, batches, first, end: evaluate(kernel, order, batches, first, end),
            )

        return [step(order) for order in range(3)]

    def function(self, function: ca.Function) -> Entry:
        """Return the evaluation of a function of up to four arguments, the third of which all intervals share.

        Raises:
            KernelError: the interpreter does not know one of its operations.
        """
        tables = function_tables(function)
        memory = self._evaluator.function_memory(tables.kernel())
        return Entry(tables, memory, self._evaluator.evaluate_function)

    def at_points(self, function: ca.Function, control: Array, p: Array) -> Callable[[Array], Array]:
        """Return a function (x, u, p) -> values of the states (n_x, n) at n points, see `point_functions.py`.

        Raises:
            KernelError: the interpreter does not know one of its operations.
        """
        tables = function_tables(function)
        memory = _aligned(self._evaluator.function_memory(tables.kernel()))
        u, count, values = np.ascontiguousarray(control, dtype=np.float64), control.shape[1], function.nnz_out(0)
        evaluate, kernel = self._evaluator.evaluate_points, tables.kernel(memory)

        def at(x: Array, owned: object = (tables, memory)) -> Array:
            states, found = np.ascontiguousarray(x, dtype=np.float64), np.empty((values, count))
            if states.ndim != 2 or states.shape[1] != count:
                raise ValueError(f"states of shape {states.shape} for {count} points")
            evaluate(kernel, states.ctypes.data, u.ctypes.data, p.ctypes.data, found.ctypes.data, count)
            return found

        return at


@cache
def interpreter() -> Interpreter | None:
    """Return the interpreter; None without the native library."""
    found = library()
    return None if found is None else Interpreter(found)


@lru_cache(maxsize=32)
def function_tables(function: ca.Function) -> Tables:
    """Return the tables of a function that stands for itself.

    Raises:
        KernelError: the interpreter does not know one of its operations.
    """
    return Tables.of([], [], [bytecode(function)])


@cache
def _pool(count: int) -> ThreadPoolExecutor:
    """Return threads that wait for calls; ctypes lets them run beside each other."""
    return ThreadPoolExecutor(count)


def _aligned(count: int) -> Array:
    """Return memory for so many numbers that begins where a vector may begin."""
    memory = np.empty(count + _ALIGNMENT // 8)
    first = -memory.ctypes.data % _ALIGNMENT // 8
    return memory[first : first + count]
