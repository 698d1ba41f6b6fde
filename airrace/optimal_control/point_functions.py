"""The rates and path quantities of a system at many points, called as often as an integrator asks.

The native interpreter evaluates them, or casadi; both work on arrays that stay where they are, without the conversions
of a call of casadi from Python, and give the same bits.
"""

import logging
from collections.abc import Callable

import casadi as ca
import numpy as np

from airrace.errors import KernelError
from airrace.native.interpreter import interpreter
from airrace.points import dense
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

AtPoints = Callable[[Array], Array]
"""A function from states (n_x, n) to values (n_v, n), a new array."""


def function_at_points(function: ca.Function, control: Array, p: Array) -> AtPoints:
    """Return a function (x, u, p) -> values as a function of the states alone.

    Args:
        function: of SX, with one result.
        control, p: shapes (n_u, n), (n_p,).

    Raises:
        ValueError: on a call, if the states are not those of as many points as the controls.
    """
    parameters = np.ascontiguousarray(p, dtype=np.float64)
    native = interpreter()
    if native is not None:
        try:
            return native.at_points(dense(function), control, parameters)
        except KernelError as error:
            logger.info("casadi evaluates %s: %s", function.name(), error)
    return casadi_function_at_points(function, control, parameters)


def casadi_function_at_points(function: ca.Function, control: Array, p: Array) -> AtPoints:
    """Return the same, evaluated by casadi.

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

    def at(states: Array, owned: tuple[Array, ...] = given) -> Array:  # the buffer does not keep its arrays alive
        owned[0][:] = states.T
        evaluate()
        if buffer.ret():
            raise KernelError(f"{function.name()} could not be evaluated")
        return found.T.copy()  # of a single point the transpose is contiguous, and would be written over

    return at
