"""The functions of one shooting interval with first and second derivatives, for many intervals at once.

Every kernel maps `(y, own, shared)` to values c, with y the unknowns, `own` what differs from call to call and `shared`
what does not:

    step: y = (x, u, T), own = the interval's share of the duration T, shared = p    -> x at the interval's end
    path: y = (x, u), own empty, shared = p                                          -> path quantities
    observe: y = x, own = the parameters of the place, shared empty                  -> what is observed there

The native interpreter evaluates them, the step composed of the derivatives of its stages (`step.c`), the Hessian of an
observation direction by direction. Without the native library, or for an operation that it does not know, casadi
evaluates the graphs of the whole functions.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import casadi as ca
import numpy as np

from airrace.errors import KernelError, SolverCrash
from airrace.optimal_control.native.interpreter import BatchFunction, Interpreter, interpreter
from airrace.optimal_control.runge_kutta import RungeKutta, scheme_numbers, step_parts, step_tables
from airrace.optimal_control.system import System
from airrace.optimal_control.trajectory import Array

logger = logging.getLogger(__name__)

MAP_IN_THREADS = 64
"""The number of calls of a kernel from which they are spread over threads; twice as many if it has lanes.

Handing calls to two threads and collecting them takes 40 to 60 microseconds more than one thread needs for its loop, a
fifth of what 128 intervals of the cheapest derivative take in lanes, the Jacobian of a point mass's step. For fewer
calls little of the gain would be left.
"""


class Part(IntEnum):
    """The functions of a kernel, by the order of the derivatives that they evaluate."""

    VALUES = 0
    JACOBIAN = 1
    HESSIAN = 2


BoundCall = tuple[Callable[[], None], list[Array]]
"""A call of a function with its arguments in arrays that stay, and the arrays that it writes its results to."""


@dataclass(frozen=True, eq=False)
class Kernel:
    """A function and its derivatives in y as casadi's functions, shapes (n_y,), (n_own,), (n_shared,) -> (n_c,).

    Attributes:
        value: (y, own, shared) -> c.
        jacobian: (y, own, shared) -> c, dc/dy.
        hessian: (y, own, shared, lam) -> gradient (n_y,) and upper triangle of the Hessian of lam . c.
    """

    value: ca.Function
    jacobian: ca.Function
    hessian: ca.Function
    lanes = 1

    @property
    def values(self) -> int:
        """The number of values."""
        return self.value.size1_out(0)

    @property
    def jacobian_pattern(self) -> ca.Sparsity:
        """The pattern of the Jacobian."""
        return self.jacobian.sparsity_out(1)

    @property
    def hessian_pattern(self) -> ca.Sparsity:
        """The pattern of the Hessian's upper triangle."""
        return self.hessian.sparsity_out(1)

    def bind(
        self, part: Part, calls: int, threads: int, arguments: Sequence[Array], counting: int | None = None
    ) -> BoundCall:
        """Return all calls of a function at once.

        Where threads do not have equally many calls each, casadi copies everything, which takes as much memory again.
        So what is left over is called after the rest.

        Args:
            part: which function.
            calls: number of calls, each with as many intervals as there are lanes.
            threads: number of threads that the calls are spread over.
            arguments: (y, own, shared[, lam]) of all intervals; `shared` once per call.
            counting: how many of the intervals count; what is left of the lanes of the last call may stay zero.

        Raises:
            SolverCrash: an argument has another size; by the call, where the function could not be evaluated.
        """
        function = (self.value, self.jacobian, self.hessian)[part]
        threads = _threads_for(calls, self.lanes, threads)
        results = [np.zeros(calls * function.nnz_out(place)) for place in range(function.n_out())]
        divisible = calls - calls % threads
        pieces: list[Callable[[], None]] = []

        def cut(arrays: Sequence[Array], first: int, end: int) -> list[Array]:
            """Return what belongs to some of the calls, not copied."""
            parts: list[Array] = []
            for array in arrays:
                size = array.size // calls
                last = end * size if end < calls else None  # the last piece takes a remainder, too
                parts.append(array.reshape(-1)[first * size : last])
            return parts

        for first, end, count in ((0, divisible, threads), (divisible, calls, 1)):
            if first < end:
                mapped = map_calls(function, end - first, count)
                pieces.append(bind(mapped, cut(arguments, first, end), cut(results, first, end))[0])

        def call() -> None:
            for piece in pieces:
                piece()

        return call, results


@dataclass(frozen=True, eq=False)
class DirectionalHessian:
    """The Hessian of lam . c from the derivative of its gradient along one unknown at a time, all calls at once.

    Of the room beside a pylon the graph of the whole Hessian has 31,000 to 54,000 operations, this one 5,400 to 7,300,
    which the interpreter translates in an eighth of the time; and the lanes are full for a single pylon, too.

    Attributes:
        along: (y, own, shared, (lam, direction)) -> gradient, its derivative along the direction.
        sizes: of one interval's y, own, shared and lam.
        pattern: of the Hessian's upper triangle.
        lanes: number of intervals in a call.
    """

    along: BatchFunction
    sizes: tuple[int, int, int, int]
    pattern: ca.Sparsity
    lanes: int

    def bind(
        self, arguments: Sequence[Array], results: Sequence[Array], threads: int, intervals: int
    ) -> Callable[[], None]:
        """Return the evaluation of so many intervals, as `BatchFunction.bind` does."""
        n_y, n_own, _, n_lam = self.sizes
        rows, columns = (np.array(places, dtype=np.intp) for places in self.pattern.get_triplet())
        unknowns, direction = np.unique(columns, return_inverse=True)
        count = max(len(unknowns), 1)
        batches = -(-count * intervals // self.lanes)

        def every(size: int) -> tuple[Array, Array]:
            """Return numbers of all intervals in all directions, as they are evaluated and by direction."""
            flat = np.zeros((batches * self.lanes, size))
            return flat, flat[: count * intervals].reshape(count, intervals, size)

        (all_y, y), (all_own, own), (all_weights, weights) = every(n_y), every(n_own), every(n_lam + n_y)
        (all_gradients, gradients), (all_changes, changes) = every(n_y), every(n_y)
        for number, unknown in enumerate(unknowns):
            weights[number, :, n_lam + unknown] = 1.0
        inputs, outputs = (all_y, all_own, np.zeros(0), all_weights), (all_gradients, all_changes)
        evaluate = self.along.bind(inputs, outputs, _threads_for(batches, self.lanes, threads), batches)
        total = arguments[0].size // n_y
        given_y, given_own, given_lam = (arguments[at].reshape(total, self.sizes[at])[:intervals] for at in (0, 1, 3))
        gradient, hessian = results[0].reshape(total, n_y)[:intervals], results[1].reshape(total, len(rows))[:intervals]

        def call() -> None:
            y[:], own[:], weights[:, :, :n_lam] = given_y, given_own, given_lam
            evaluate()
            gradient[:] = gradients[0]
            hessian.T[:] = changes[direction, :, rows]

        return call


@dataclass(frozen=True, eq=False)
class NativeKernel:
    """A kernel that the native interpreter evaluates.

    Attributes:
        name: for messages.
        lanes: number of intervals in a call.
        sizes: of one interval's y, own, shared and lam.
        jacobian_pattern, hessian_pattern: of the derivatives.
        entries: of values, Jacobian and Hessian.
        hessian_is_complete: whether the results of the Hessian are followed by those of the Jacobian.
    """

    name: str
    lanes: int
    sizes: tuple[int, int, int, int]
    jacobian_pattern: ca.Sparsity
    hessian_pattern: ca.Sparsity
    entries: tuple[BatchFunction, BatchFunction, BatchFunction | DirectionalHessian]
    hessian_is_complete: bool = False

    @property
    def values(self) -> int:
        """The number of values."""
        return self.jacobian_pattern.size1()

    def bind(
        self, part: Part, calls: int, threads: int, arguments: Sequence[Array], counting: int | None = None
    ) -> BoundCall:
        """Return all calls of a function at once, as `Kernel.bind` does."""
        intervals = calls * self.lanes
        for place, (array, size) in enumerate(zip(arguments, self.sizes, strict=False)):
            if array.size != size * (calls if place == 2 else intervals):
                raise SolverCrash(f"{self.name}: argument {place} has another size")
        linear = [self.values, self.jacobian_pattern.nnz()]
        sizes = {
            Part.VALUES: [self.values],
            Part.JACOBIAN: linear,
            Part.HESSIAN: [self.sizes[0], self.hessian_pattern.nnz(), *(linear if self.hessian_is_complete else [])],
        }
        results, entry = [np.zeros(intervals * size) for size in sizes[part]], self.entries[part]
        if isinstance(entry, DirectionalHessian):
            return entry.bind(arguments, results, threads, intervals if counting is None else counting), results
        return entry.bind(arguments, results, _threads_for(calls, self.lanes, threads), calls), results


Callee = Kernel | NativeKernel
"""A kernel as the evaluation of a program sees it: what it takes and returns stands interval after interval."""


def _threads_for(calls: int, lanes: int, threads: int) -> int:
    return threads if calls * lanes >= (MAP_IN_THREADS if lanes == 1 else 2 * MAP_IN_THREADS) else 1


def map_calls(function: ca.Function, calls: int, threads: int) -> ca.Function:
    """Return a function of casadi for all calls at once."""
    return function.map(calls, "thread", threads) if threads > 1 else function.map(calls)


def bind(function: ca.Function, arguments: Sequence[Array], results: Sequence[Array] | None = None) -> BoundCall:
    """Return a call of a function of casadi, and its results.

    Args:
        function: what is called.
        arguments: from where it reads, contiguous.
        results: to where it writes, contiguous; None for new arrays.

    Raises:
        SolverCrash: an argument has another size; by the call, where the function could not be evaluated.
    """
    buffer, evaluate = function.buffer()
    sizes = [function.nnz_out(place) for place in range(function.n_out())]
    outputs = [np.zeros(size) for size in sizes] if results is None else list(results)
    # casadi's stubs ask for the buffers' sizes, its code takes them from the buffers.
    for place, array in enumerate(arguments):
        if array.size != function.nnz_in(place):
            raise SolverCrash(f"{function.name()}: argument {place} has another size")
        buffer.set_arg(place, array.data)  # pyright: ignore[reportCallIssue]
    for place, array in enumerate(outputs):
        buffer.set_res(place, array.data)  # pyright: ignore[reportCallIssue]

    # casadi keeps addresses alone: the call keeps the arrays.
    def call(owned: object = (*arguments, *outputs)) -> None:
        evaluate()
        if buffer.ret():
            raise SolverCrash(f"{function.name()} could not be evaluated")

    return call, outputs


class Observations:
    """The kernels of what is observed of a system, each made once and kept.

    The pieces and windows of a race are problems of their own that share a few observations; to differentiate them for
    each took a fifth of a homotopy.

    Args:
        native: the interpreter, or None.
    """

    def __init__(self, native: Interpreter | None = None) -> None:
        self._native = native
        self._kernels: dict[ca.Function, Callee] = {}

    def kernel(self, values: ca.Function) -> Callee:
        """Return the kernel of the values (x, b) that a problem observes."""
        if values not in self._kernels:
            self._kernels[values] = self._make(values)
        return self._kernels[values]

    def _make(self, values: ca.Function) -> Callee:
        if self._native is not None:
            try:
                return native_observation(self._native, values)
            except KernelError as error:
                logger.warning("casadi evaluates an observation, slower: %s", error)
        return casadi_observation(values)


def native_observation(native: Interpreter, values: ca.Function) -> NativeKernel:
    """Return the kernel of an observation's values (x, b) for the native interpreter.

    Raises:
        KernelError: the values have an operation that the interpreter does not know.
    """
    y, own = (ca.SX.sym(name, values.size1_in(place)) for place, name in enumerate("xb"))
    c, none = values(y, own), ca.SX.sym("none", 0)
    lam, direction = ca.SX.sym("lam", c.numel()), ca.SX.sym("direction", y.numel())
    gradient = ca.gradient(ca.dot(lam, c), y)
    pattern = ca.triu(ca.jacobian_sparsity(gradient, y))
    value, jacobian = _value_and_jacobian("observe", y, own, none, c)
    derivatives = [ca.densify(gradient), ca.densify(ca.jtimes(gradient, y, direction))]
    along = ca.Function("observe_along", [y, own, none, ca.vertcat(lam, direction)], derivatives)
    sizes = y.numel(), own.numel(), 0, lam.numel()
    hessian = DirectionalHessian(native.function(along), sizes, pattern, native.lanes)
    entries = native.function(value), native.function(jacobian), hessian
    return NativeKernel("observe", native.lanes, sizes, jacobian.sparsity_out(1), pattern, entries)


def casadi_observation(values: ca.Function) -> Kernel:
    """Return the kernel of an observation's values (x, b) as casadi's functions."""
    x, own = (ca.SX.sym(name, values.size1_in(place)) for place, name in enumerate("xb"))
    return Kernel(*_differentiate("observe", x, own, ca.SX.sym("none", 0), values(x, own)))


@dataclass(frozen=True)
class Kernels:
    """The kernels of a system.

    Attributes:
        step: of one interval.
        path: of the path quantities; None for a system without.
        observations: of the system.
    """

    step: Callee
    path: Callee | None
    observations: Observations


def build_kernels(system: System, scheme: RungeKutta) -> Kernels:
    """Return the kernels of a system: native where possible, else casadi's."""
    native = interpreter()
    if native is None:
        return casadi_kernels(system, scheme)
    try:
        return native_kernels(native, system, scheme)
    except KernelError as error:
        logger.warning("casadi evaluates %s, slower: %s", system.name, error)
        return casadi_kernels(system, scheme)


def native_kernels(native: Interpreter, system: System, scheme: RungeKutta) -> Kernels:
    """Return the kernels of a system for the native interpreter.

    Raises:
        KernelError: the system has an operation that the interpreter does not know.
    """
    parts, path = step_parts(system, scheme), path_functions(system)
    n_x, n_p = len(system.states), len(system.parameters)
    step = NativeKernel(
        name="step",
        lanes=native.lanes,
        sizes=(n_x + len(system.controls) + 1, 1, n_p, n_x),
        jacobian_pattern=parts.jacobian,
        hessian_pattern=parts.hessian,
        entries=native.step(step_tables(parts), scheme_numbers(scheme), [parts.alone, *parts.generated]),
        hessian_is_complete=True,
    )
    return Kernels(step, _native_kernel(native, path) if path else None, Observations(native))


def _native_kernel(native: Interpreter, functions: Sequence[ca.Function]) -> NativeKernel:
    """Return the native kernel of casadi's value, Jacobian and Hessian.

    Raises:
        KernelError: one has an operation that the interpreter does not know.
    """
    value, jacobian, hessian = functions
    y, own, shared, lam = (hessian.nnz_in(place) for place in range(4))
    patterns = jacobian.sparsity_out(1), hessian.sparsity_out(1)
    entries = native.function(value), native.function(jacobian), native.function(hessian)
    return NativeKernel(value.name(), native.lanes, (y, own, shared, lam), *patterns, entries)


def casadi_kernels(system: System, scheme: RungeKutta) -> Kernels:
    """Return the kernels of a system as casadi's functions."""
    n_x = len(system.states)
    y, p = ca.SX.sym("y", n_x + len(system.controls) + 1), ca.SX.sym("p", len(system.parameters))
    fraction = ca.SX.sym("fraction")
    x_next: ca.SX = scheme.advance(system.rates, y[:n_x], y[n_x:-1], p, y[-1] * fraction)
    if system.projection is not None:
        x_next = system.projection(x_next)
    path = path_functions(system)
    step = Kernel(*_differentiate("step", y, fraction, p, x_next))
    return Kernels(step, Kernel(*path) if path else None, Observations())


def path_functions(system: System) -> list[ca.Function]:
    """Return value, Jacobian and Hessian of a system's path quantities; nothing for a system without."""
    if system.path_values is None:
        return []
    n_x = len(system.states)
    y, p = ca.SX.sym("y", n_x + len(system.controls)), ca.SX.sym("p", len(system.parameters))
    return _differentiate("path", y, ca.SX.sym("none", 0), p, system.path_values(y[:n_x], y[n_x:], p))


def _differentiate(name: str, y: ca.SX, own: ca.SX, shared: ca.SX, c: ca.SX) -> list[ca.Function]:
    """Return the functions of a kernel, `name`, `name_jacobian` and `name_hessian`."""
    lam = ca.SX.sym("lam", c.numel())
    hessian, gradient = ca.hessian(ca.dot(lam, c), y)
    curved = [ca.densify(gradient), ca.triu(hessian)]
    return [
        *_value_and_jacobian(name, y, own, shared, c),
        ca.Function(f"{name}_hessian", [y, own, shared, lam], curved),
    ]


def _value_and_jacobian(name: str, y: ca.SX, own: ca.SX, shared: ca.SX, c: ca.SX) -> list[ca.Function]:
    """Return the functions of a kernel without second derivatives, `name` and `name_jacobian`."""
    arguments = [y, own, shared]
    return [
        ca.Function(name, arguments, [ca.densify(c)]),
        ca.Function(f"{name}_jacobian", arguments, [ca.densify(c), ca.jacobian(c, y)]),
    ]
