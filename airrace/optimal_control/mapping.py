"""The mapping of a kernel's function over all of its calls, on several threads where that pays."""

from collections.abc import Callable

import casadi as ca

from airrace.optimal_control.assembly import Calls
from airrace.optimal_control.kernels import Kernel

MAP_IN_THREADS = 64
"""The number of calls of a kernel from which they are spread over threads; twice as many if it has lanes.

Handing calls to two threads and collecting them takes 40 to 60 microseconds more than one thread needs for its loop,
a fifth of the 280 microseconds that 64 calls of the cheapest derivative take, the compiled Jacobian of a point mass's
step, or 128 intervals in lanes. For fewer calls little of the gain would be left.
"""

Part = Callable[[Kernel], ca.Function]
"""A choice of one of a kernel's functions: `value_of`, `jacobian_of` or `hessian_of`."""


def value_of(kernel: Kernel) -> ca.Function:
    """Return the function of the values."""
    return kernel.value


def jacobian_of(kernel: Kernel) -> ca.Function:
    """Return the function of values and Jacobian."""
    return kernel.jacobian


def hessian_of(kernel: Kernel) -> ca.Function:
    """Return the function of gradient and Hessian."""
    return kernel.hessian


def mapped(part: Part, calls: Calls, threads: int) -> ca.Function:
    """Return one of a kernel's functions for all batches of its calls at once."""
    kernel = calls.kernel
    function = part(kernel.several or kernel)
    enough = MAP_IN_THREADS if kernel.lanes == 1 else 2 * MAP_IN_THREADS
    if threads > 1 and len(calls.inputs) >= enough:
        return function.map(calls.batches, "thread", threads)
    return function.map(calls.batches)
