"""The demands of a program's evaluation on a kernel: one of its functions for all of its calls at once.

casadi's functions are mapped over the calls here.
"""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Protocol

import casadi as ca
import numpy as np

from airrace.errors import SolverCrash
from airrace.trajectory import Array

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


Bound = tuple[Callable[[], None], list[Array]]
"""A call of a function with its arguments in arrays that stay, and the arrays that it writes its results to."""


class Callee(Protocol):
    """A kernel as the evaluation of a program sees it: what it takes and returns stands interval after interval."""

    @property
    def lanes(self) -> int:
        """The number of intervals in a call."""
        ...

    @property
    def values(self) -> int:
        """The number of values."""
        ...

    @property
    def jacobian_pattern(self) -> ca.Sparsity:
        """The pattern of the Jacobian."""
        ...

    @property
    def hessian_pattern(self) -> ca.Sparsity:
        """The pattern of the Hessian's upper triangle."""
        ...

    def bound(self, part: Part, calls: int, threads: int, given: Sequence[Array]) -> Bound:
        """Return all calls of a function at once.

        Args:
            part: which function.
            calls: number of calls, each with as many intervals as there are lanes.
            threads: number of threads that the calls are spread over.
            given: (y, own, shared[, lam]) of all intervals; `shared` once per call.

        Raises:
            SolverCrash: an argument has another size; by the call, where the function could not be evaluated.
        """
        ...


def spread(calls: int, lanes: int, threads: int) -> int:
    """Return over how many threads so many calls are to be spread."""
    return threads if calls * lanes >= (MAP_IN_THREADS if lanes == 1 else 2 * MAP_IN_THREADS) else 1


def mapped(function: ca.Function, calls: int, threads: int) -> ca.Function:
    """Return a function of casadi for all calls at once."""
    return function.map(calls, "thread", threads) if threads > 1 else function.map(calls)


def bound(function: ca.Function, arguments: Sequence[Array], results: Sequence[Array] | None = None) -> Bound:
    """Return a call of a function of casadi, and its results.

    Args:
        function: what is called.
        arguments: from where it reads, contiguous.
        results: to where it writes, contiguous; None for new arrays.

    Raises:
        SolverCrash: an argument has another size; by the call, where the function could not be evaluated.
    """
    buffer, evaluate = function.buffer()
    found = _new(function, 1) if results is None else list(results)
    # casadi's stubs ask for the buffers' sizes, its code takes them from the buffers.
    for place, array in enumerate(arguments):
        if array.size != function.nnz_in(place):
            raise SolverCrash(f"{function.name()}: argument {place} has another size")
        buffer.set_arg(place, array.data)  # pyright: ignore[reportCallIssue]
    for place, array in enumerate(found):
        buffer.set_res(place, array.data)  # pyright: ignore[reportCallIssue]

    def call() -> None:
        evaluate()
        if buffer.ret():
            raise SolverCrash(f"{function.name()} could not be evaluated")

    return call, found


def bound_to_all(function: ca.Function, calls: int, threads: int, arguments: Sequence[Array]) -> Bound:
    """Return all calls of a function of casadi at once, and their results, one call's after another's.

    Where threads do not have equally many calls each, casadi copies everything, which takes as much memory again. So
    what is left over is called after the rest.

    Raises:
        SolverCrash: as `bound`.
    """
    whole = calls - calls % threads
    if whole in (0, calls):
        return bound(mapped(function, calls, threads if whole else 1), arguments)
    results = _new(function, calls)
    parts: list[Callable[[], None]] = []
    for first, end, of in ((0, whole, threads), (whole, calls, 1)):
        given, found = ([_part(one, calls, first, end) for one in arrays] for arrays in (arguments, results))
        parts.append(bound(mapped(function, end - first, of), given, found)[0])

    def call() -> None:
        for part in parts:
            part()

    return call, results


def _new(function: ca.Function, calls: int) -> list[Array]:
    return [np.zeros(calls * function.nnz_out(place)) for place in range(function.n_out())]


def _part(array: Array, calls: int, first: int, end: int) -> Array:
    """Return what belongs to some of the calls, not copied."""
    return array.reshape(calls, -1)[first:end].reshape(-1)
