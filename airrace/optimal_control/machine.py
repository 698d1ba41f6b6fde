"""One machine for all models: it evaluates their functions from tables, before a compiler has seen them.

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

from airrace.errors import KernelError
from airrace.optimal_control import own_code
from airrace.optimal_control.bytecode import bytecode
from airrace.optimal_control.c_tables import read_text
from airrace.optimal_control.kernel_library import is_intact
from airrace.optimal_control.lane_code import LANE_BY_LANE, OPERATORS, VECTOR_FLAGS, header
from airrace.optimal_control.lanes import InstructionSet, instruction_set
from airrace.optimal_control.machine_tables import Tables
from airrace.optimal_control.mapping import Part
from airrace.records import record
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

_TEXTS = ("tables.h", "interpreter.c", "step_driver.c", "model_tables.c", "lane_copies.h", "machine.c")
FLAGS = ("-O1", "-fstrict-aliasing", "-fschedule-insns2", *VECTOR_FLAGS)
"""The compiler flags for the machine.

With -O2 derivatives take the same time within 3 %, and the machine takes half as long again to compile; without the
last of the first three a Hessian takes up to 7 % longer, with -O1 alone up to 12 %.
"""

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

    def step(self, tables: Tables, part: Part) -> "Entry":
        """Return what evaluates one of a step's functions."""
        library = self._library
        room: int = library.step_room(_reader(tables), int(part))

        def calls(reader: _Reader, of: _Calls, first: int, end: int) -> None:
            library.step_calls(reader, int(part), of, first, end)

        return Entry(tables, room * self.lanes, calls)

    def rows(self, function: ca.Function, control: Array, p: Array) -> Callable[[Array], Array]:
        """Return a function (x, u, p) -> values of the states (n_x, n), see `compiled_rates.py`.

        Raises:
            KernelError: it has an operation that the machine does not know.
        """
        tables = function_tables(function)
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

    def function(self, tables: Tables) -> "Entry":
        """Return what evaluates a function that stands for itself."""
        room: int = self._library.function_room(_reader(tables))
        return Entry(tables, room * self.lanes, self._library.function_calls)


@record
class Entry:
    """An evaluation of a function for many intervals.

    Attributes:
        tables: of the function.
        room: the memory that one thread asks for, in numbers.
        calls: evaluates some of the calls.
    """

    tables: Tables
    room: int
    calls: Range

    def bound(self, given: Sequence[Array], found: Sequence[Array], parts: int, calls: int) -> Callable[[], None]:
        """Return all calls at once, in parts that go side by side, with arguments and results in arrays that stay."""
        of = _Calls()
        for place, array in enumerate(given):  # of what is shared the first is read
            of.given[place] = array.ctypes.data
        for place, array in enumerate(found):
            of.found[place] = array.ctypes.data
        ends = [calls * number // parts for number in range(parts + 1)]
        memory = [_aligned(self.room) for _ in range(parts)]
        readers = [_reader(self.tables, array) for array in memory]
        works = [partial(self.calls, reader, of, *part) for reader, part in zip(readers, pairwise(ends), strict=True)]
        kept = (given, found, memory)  # nobody else holds what the machine works on

        def call(kept: object = kept) -> None:
            others = [_threads(len(works) - 1).submit(work) for work in works[1:]]
            works[0]()
            for other in others:
                other.result()

        return call


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


@lru_cache(maxsize=32)
def function_tables(function: ca.Function) -> Tables:
    """Return the tables of a function that stands for itself.

    Raises:
        KernelError: it has an operation that the machine does not know.
    """
    return Tables.of([], [], [bytecode(function)])


@cache
def _threads(count: int) -> ThreadPoolExecutor:
    """Return threads that wait for calls; ctypes lets them run beside each other."""
    return ThreadPoolExecutor(count)


def _reader(tables: Tables, memory: Array | None = None) -> _Reader:
    begins = [array.ctypes.data for array in (tables.tables, tables.code, tables.numbers)]
    return _Reader(*begins, None if memory is None else memory.ctypes.data, 0)


def _aligned(count: int) -> Array:
    """Return memory for so many numbers that begins where a vector may begin."""
    memory = np.empty(count + _ALIGNED // 8)
    first = -memory.ctypes.data % _ALIGNED // 8
    return memory[first : first + count]
