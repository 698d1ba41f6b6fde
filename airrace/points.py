"""Functions at many points, evaluated by casadi on numpy's arrays.

A call of casadi from Python turns every array into a matrix of casadi's, which takes several times as long as
evaluating a flight model at all these points.
"""

import casadi as ca
import numpy as np

from airrace.trajectory import Array


def at_points(function: ca.Function, *arguments: Array) -> Array:
    """Return the only result of a function at n points.

    Args:
        function: of columns, to a column; of SX, which cannot fail.
        arguments: one column per point, shape (k, n), or what is the same at all points, shape (k,); the first is one
            column per point.

    Returns:
        One column per point, shape (n_v, n).

    Raises:
        ValueError: an argument has another number of rows than the function takes.
    """
    count = arguments[0].shape[1]
    buffer, evaluate = dense(function).map(count).buffer()
    given = [_by_point(argument, count) for argument in arguments]
    found = np.zeros((count, function.size1_out(0)))
    for place, array in enumerate(given):
        if array.shape != (count, function.size1_in(place)):
            raise ValueError(f"argument {place} of {function.name()} has {array.shape[1]} rows at {len(array)} points")
        if array.size:  # casadi's stubs ask for the buffers' sizes, its code takes them from the buffers
            buffer.set_arg(place, array.data)  # pyright: ignore[reportCallIssue]
    buffer.set_res(0, found.data)  # pyright: ignore[reportCallIssue]
    evaluate()
    return np.ascontiguousarray(found.T)


def dense(function: ca.Function) -> ca.Function:
    """Return a function with its only result dense."""
    if function.sparsity_out(0).is_dense():
        return function
    symbols = [ca.SX.sym(f"i{place}", function.size1_in(place)) for place in range(function.n_in())]
    return ca.Function("dense", symbols, [ca.densify(function(*symbols))])


def _by_point(argument: Array, count: int) -> Array:
    """Return an argument one point after another, as casadi stores it, shape (n, k)."""
    rows = np.tile(argument, (count, 1)) if argument.ndim == 1 else argument.T
    return np.ascontiguousarray(rows, dtype=np.float64)
