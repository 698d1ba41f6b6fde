"""The functions of a system at many points, evaluated by casadi's virtual machine: nothing is compiled or looked up."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from airrace.errors import KernelError
from airrace.points import dense
from airrace.trajectory import Array

AtPoints = Callable[[Array], Array]
"""A function from states (n_x, n) to values (n_v, n), a new array."""


def interpreted(function: ca.Function, control: Array, p: Array) -> AtPoints:
    """Return a function (x, u, p) -> values in casadi's virtual machine; shapes as in `compiled_rates.py`.

    Raises:
        KernelError: on a call, if the function reports a failure.
    """
    count = control.shape[1]
    mapped = dense(function).map(count)
    # one point after another, as casadi stores them
    given = (
        np.zeros((count, function.size1_in(0))),
        np.ascontiguousarray(control.T, dtype=np.float64),
        np.tile(p, (count, 1)),
    )
    found = np.zeros((count, function.size1_out(0)))
    buffer, evaluate = mapped.buffer()
    for place, array in enumerate(given):
        if array.size:
            buffer.set_arg(place, array.data)  # pyright: ignore[reportCallIssue] as in `points.py`
    buffer.set_res(0, found.data)  # pyright: ignore[reportCallIssue]

    def at(states: Array, kept: tuple[Array, ...] = given) -> Array:  # the buffer does not keep its arrays alive
        kept[0][:] = states.T
        evaluate()
        if buffer.ret():
            raise KernelError(f"{function.name()} could not be evaluated")
        return found.T.copy()  # of a single point the transpose is contiguous, and would be written over

    return at
