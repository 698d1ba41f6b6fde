"""One machine for all models: kernels that are evaluated from tables, before a compiler has seen their model.

The machine (`machine.c` and what stands before it) is compiled once per computer, like all C files that belong to no
model. It does what compiled kernels do, operation by operation and in the same order of all that depends on each other,
so its results have the same bits. In still air a Jacobian takes it 1.2 to 1.5 times as long, a Hessian 1.3 to 1.9.
"""

import ctypes
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from airrace.errors import KernelError, SolverCrash
from airrace.optimal_control import own_code
from airrace.optimal_control.bytecode import NOTHING, bytecode
from airrace.optimal_control.c_tables import read_text
from airrace.optimal_control.kernel_library import is_intact
from airrace.optimal_control.lane_code import LANE_BY_LANE, OPERATORS, VECTOR_FLAGS, header
from airrace.optimal_control.lanes import InstructionSet, instruction_set
from airrace.optimal_control.machine_tables import Tables
from airrace.optimal_control.mapping import Bound, Part, spread
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.step_tables import scheme_numbers, step_parts, step_tables
from airrace.records import record
from airrace.system import System
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

_TEXTS = ("tables.h", "interpreter.c", "step_driver.c", "model_tables.c", "lane_copies.h", "machine.c")
FLAGS = ("-O1", "-fstrict-aliasing", "-fschedule-insns2", *VECTOR_FLAGS)
"""The compiler flags for the machine.

With -O2 derivatives take the same time within 3 %, and the machine takes half as long again to compile; without the
last of the first three a Hessian takes 6 % longer, with -O1 alone 11 %.
"""

FUNCTIONS = 5  # of a model: f, and Jacobian and Hessian of f and of the projection
_ALIGNED = 64  # bytes of the widest vector

Range = Callable[["_Reader", "_Calls", int, int], None]
"""The evaluation of the calls from one number to another."""


class _Reader(ctypes.Structure):
    """`struct reader` of `tables.h`."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("tables", "code", "numbers", "memory")),
        ("functions", ctypes.c_int),
    ]


class _Calls(ctypes.Structure):
    """`struct calls` of `machine.c`."""

    _fields_ = [("given", ctypes.c_void_p * 4), ("found", ctypes.c_void_p * 2)]


class Machine:
    """The compiled machine for so many lanes."""

    def __init__(self, library: Path, lanes: int) -> None:
        self.lanes = lanes
        self._library: Any = ctypes.CDLL(str(library))  # Any: ctypes makes its functions up
        for name, given in (("step", [_Reader, ctypes.c_int]), ("function", [_Reader])):
            room, calls = (getattr(self._library, f"{name}_{what}") for what in ("room", "calls"))
            room.argtypes, room.restype = given, ctypes.c_longlong
            calls.argtypes = [*given, ctypes.POINTER(_Calls), *[ctypes.c_longlong] * 2]
            calls.restype = None
        rows = self._library.function_rows
        rows.argtypes, rows.restype = [_Reader, *[ctypes.c_void_p] * 4, ctypes.c_longlong], None

    def step(self, tables: Tables, part: Part) -> "_Entry":
        """Return what evaluates one of a step's functions."""
        library = self._library
        room: int = library.step_room(_reader(tables), int(part))

        def calls(reader: _Reader, of: _Calls, first: int, end: int) -> None:
            library.step_calls(reader, int(part), of, first, end)

        return _Entry(tables, room * self.lanes, calls)

    def rows(self, function: ca.Function, control: Array, p: Array) -> Callable[[Array], Array]:
        """Return a function (x, u, p) -> values of the states (n_x, n), see `compiled_rates.py`.

        Raises:
            KernelError: it has an operation that the machine does not know.
        """
        tables = _function_tables(function)
        room: int = self._library.function_room(_reader(tables))
        memory = _aligned(room * self.lanes)
        u, count, values = np.ascontiguousarray(control, dtype=np.float64), control.shape[1], function.nnz_out(0)
        rows, reader = self._library.function_rows, _reader(tables, memory)

        def at(x: Array, kept: object = (tables, memory)) -> Array:  # nobody else holds what the machine works on
            states, found = np.ascontiguousarray(x, dtype=np.float64), np.empty((values, count))
            if states.ndim != 2 or states.shape[1] != count:
                raise ValueError(f"states of shape {states.shape} for {count} points")
            rows(reader, states.ctypes.data, u.ctypes.data, p.ctypes.data, found.ctypes.data, count)
            return found

        return at

    def function(self, tables: Tables) -> "_Entry":
        """Return what evaluates a function that stands for itself."""
        room: int = self._library.function_room(_reader(tables))
        return _Entry(tables, room * self.lanes, self._library.function_calls)


@record
class _Entry:
    """An evaluation of a function for many intervals.

    Attributes:
        tables: of the function.
        room: the memory that one thread asks for, in numbers.
        calls: evaluates some of the calls.
    """

    tables: Tables
    room: int
    calls: Range


@record
class MachineKernel:
    """A kernel that the machine evaluates, see `mapping.Callee`.

    Attributes:
        name: for messages.
        lanes: number of intervals in a call.
        sizes: of one interval's y, own, shared and lam.
        jacobian_pattern, hessian_pattern: of the derivatives.
        entries: what evaluates values, Jacobian and Hessian.
    """

    name: str
    lanes: int
    sizes: tuple[int, int, int, int]
    jacobian_pattern: ca.Sparsity
    hessian_pattern: ca.Sparsity
    entries: Sequence[_Entry]

    @property
    def values(self) -> int:
        """The number of values."""
        return self.jacobian_pattern.size1()

    def mapped(self, part: Part, calls: int, threads: int) -> ca.Function:
        """Refuse what the machine does not have: functions of casadi.

        Raises:
            KernelError: always.
        """
        raise KernelError(f"{self.name} is evaluated without functions of casadi")

    def bound(self, part: Part, calls: int, threads: int, given: Sequence[Array]) -> Bound:
        """Return all calls of a function at once.

        Raises:
            SolverCrash: an argument has another size.
        """
        entry, intervals = self.entries[part], calls * self.lanes
        for place, (array, size) in enumerate(zip(given, self.sizes, strict=False)):
            if array.size != size * (calls if place == 2 else intervals):
                raise SolverCrash(f"{self.name}: argument {place} has another size")
        results = [np.zeros(intervals * size) for size in self._results(part)]
        of = _Calls()
        for place, array in enumerate(given):  # of what is shared the first is read
            of.given[place] = array.ctypes.data
        for place, array in enumerate(results):
            of.found[place] = array.ctypes.data
        parts = _parts(calls, spread(calls, self.lanes, threads))
        memory = [_aligned(entry.room) for _ in parts]
        readers = [_reader(entry.tables, array) for array in memory]
        works = [partial(entry.calls, reader, of, *ends) for reader, ends in zip(readers, parts, strict=True)]
        kept = (given, results, memory, entry.tables)  # nobody else holds what the machine works on

        def call(kept: object = kept) -> None:
            others = [_threads(len(works) - 1).submit(work) for work in works[1:]]
            works[0]()
            for other in others:
                other.result()

        return call, results

    def _results(self, part: Part) -> list[int]:
        n_y = self.sizes[0]
        if part is Part.VALUES:
            return [self.values]
        return (
            [self.values, self.jacobian_pattern.nnz()] if part is Part.JACOBIAN else [n_y, self.hessian_pattern.nnz()]
        )


@cache
def machine() -> Machine | None:
    """Return the machine of this computer, compiled if it is not yet; None where that is impossible."""
    instructions = instruction_set()
    if instructions.lanes == 1:
        return None
    try:
        return Machine(compiled(instructions), instructions.lanes)
    except (KernelError, OSError, AttributeError) as error:  # AttributeError: a library without that function
        logger.info("no machine for models that are not compiled: %s", error)
        return None


def machine_unless_missing() -> Machine | None:
    """Return the machine if it is compiled already; nothing is compiled here."""
    instructions = instruction_set()
    library = own_code.library_of(source(instructions.lanes), (*FLAGS, *instructions.flags))
    return machine() if instructions.lanes > 1 and is_intact(library) else None


def compiled(instructions: InstructionSet) -> Path:
    """Return the compiled library, built unless the cache has it intact.

    Raises:
        KernelError: it cannot be built.
    """
    return own_code.compiled_text("machine", source(instructions.lanes), (*FLAGS, *instructions.flags))


def source(lanes: int) -> str:
    """Return the source of the machine for so many lanes."""
    vectors = [(f"operation_{one}", form.format(x="x", y="y")) for one, form in OPERATORS.items()]
    by_lane = [(f"operation_{one}", expression) for one, (_, expression) in LANE_BY_LANE.items()]
    lists = {"ON_VECTORS": vectors, "LANE_AFTER_LANE": by_lane}
    lines = [
        f"#define {name}(EACH) {' '.join(f'EACH({label}, {expression})' for label, expression in operations)}"
        for name, operations in lists.items()
    ]
    return header(lanes) + "\n".join(lines) + "\n\n" + "\n".join(read_text(name) for name in _TEXTS)


def step_kernel(machine: Machine, system: System, scheme: RungeKutta) -> MachineKernel:
    """Return the kernel of a step.

    Raises:
        KernelError: the system has an operation that the machine does not know.
    """
    parts = step_parts(system, scheme)
    functions = [bytecode(function) for function in (parts.alone, *parts.generated)]
    functions += [NOTHING] * (FUNCTIONS - len(functions))
    tables = Tables.of(step_tables(parts), scheme_numbers(scheme), functions)
    n_x, n_p = len(system.states), len(system.parameters)
    sizes = (n_x + len(system.controls) + 1, 1, n_p, n_x)
    entries = [machine.step(tables, part) for part in Part]
    return MachineKernel("step", machine.lanes, sizes, parts.jacobian, parts.hessian, entries)


def function_kernel(machine: Machine, functions: Sequence[ca.Function]) -> MachineKernel:
    """Return the kernel of a function, of its Jacobian and its Hessian.

    Raises:
        KernelError: they have an operation that the machine does not know.
    """
    value, jacobian, hessian = functions
    y, own, shared, lam = (hessian.nnz_in(place) for place in range(4))
    entries = [machine.function(_function_tables(function)) for function in functions]
    patterns = jacobian.sparsity_out(1), hessian.sparsity_out(1)
    return MachineKernel(value.name(), machine.lanes, (y, own, shared, lam), *patterns, entries)


@lru_cache(maxsize=32)
def _function_tables(function: ca.Function) -> Tables:
    return Tables.of([], [], [bytecode(function)])


@cache
def _threads(count: int) -> ThreadPoolExecutor:
    """Return threads that wait for calls; ctypes lets them run beside each other."""
    return ThreadPoolExecutor(count)


def _parts(calls: int, count: int) -> list[tuple[int, int]]:
    """Return where so many parts of the calls begin and end."""
    ends = [calls * number // count for number in range(count + 1)]
    return list(pairwise(ends))


def _reader(tables: Tables, memory: Array | None = None) -> _Reader:
    begins = [array.ctypes.data for array in (tables.tables, tables.code, tables.numbers)]
    return _Reader(*begins, None if memory is None else memory.ctypes.data, 0)


def _aligned(count: int) -> Array:
    """Return memory for so many numbers that begins where a vector may begin."""
    memory = np.empty(count + _ALIGNED // 8)
    first = -memory.ctypes.data % _ALIGNED // 8
    return memory[first : first + count]
