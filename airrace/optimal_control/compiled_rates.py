"""The rates and path quantities of a system at many points, called as often as an integrator asks.

They come from the system's compiled kernels if the cache holds them, else from the machine for all models (see
`machine.py`), both for several points at once and without casadi; else casadi's virtual machine evaluates the same
functions. All work on arrays that stay where they are, without the conversions of a call of casadi from Python. Nothing
is compiled here, and all give the same bits, so what is integrated does not depend on what the cache holds.
"""

import contextlib
import ctypes
import logging
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from airrace.errors import KernelError
from airrace.optimal_control.interpreted_rates import AtPoints, interpreted
from airrace.optimal_control.kernels import cached_rows
from airrace.optimal_control.machine import machine_unless_missing
from airrace.optimal_control.problem import Problem
from airrace.points import dense
from airrace.trajectory import Array

logger = logging.getLogger(__name__)


class PointFunctions:
    """The functions of a problem's system with the problem's parameters.

    What they take from the cache is looked up once, when they are made.
    """

    def __init__(self, problem: Problem) -> None:
        self._system = problem.system
        self._p = np.ascontiguousarray(problem.parameters, dtype=np.float64)
        self._library = _loaded(cached_rows(problem.system, problem.scheme))
        self._machine = machine_unless_missing() if self._library is None else None

    def rates(self, control: Array) -> AtPoints:
        """Return the rates under the controls (n_u, n) as a function of the states, one column per point.

        Raises:
            KernelError: on a call, if the compiled functions report a failure.
        """
        return self._at(self._system.rates, "rates", control)

    def path(self, control: Array) -> AtPoints:
        """Return the path quantities under the controls (n_u, n) as a function of the states.

        The system must have some.
        """
        assert self._system.path_values is not None
        return self._at(self._system.path_values, "path", control)

    def _at(self, function: ca.Function, name: str, control: Array) -> AtPoints:
        if self._library is not None:
            return compiled_rows(self._library, name, function.size1_out(0), control, self._p)
        if self._machine is not None:
            with contextlib.suppress(KernelError):  # it does not know an operation
                return self._machine.rows(dense(function), control, self._p)
        return interpreted(function, control, self._p)


def _loaded(library: Path | None) -> ctypes.CDLL | None:
    """Return a library; None if the system refuses to load it, as from a folder whose files may not be executed."""
    try:
        return None if library is None else ctypes.CDLL(str(library))
    except OSError as error:
        logger.info("%s: %s", library, error)
        return None


def compiled_rows(library: ctypes.CDLL, name: str, values: int, control: Array, p: Array) -> AtPoints:
    """Return a function of a compiled library that holds several lanes, see `lane_interface.c`.

    Args:
        library: of a system's kernels, with lanes.
        name: `rates` or `path`.
        values: number of values at a point.
        control, p: shapes (n_u, n), (n_p,).

    Raises:
        KernelError: on a call, if the function reports a failure.
        ValueError: on a call, if the states are not those of as many points as the controls.
    """
    function: Any = library[f"{name}_rows"]  # Any: ctypes makes it up
    function.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_longlong]
    u, count = np.ascontiguousarray(control, dtype=np.float64), control.shape[1]

    def at(x: Array) -> Array:
        states, found = np.ascontiguousarray(x, dtype=np.float64), np.empty((values, count))
        if states.ndim != 2 or states.shape[1] != count:
            raise ValueError(f"states of shape {states.shape} for {count} points")
        if function(states.ctypes.data, u.ctypes.data, p.ctypes.data, found.ctypes.data, count):
            raise KernelError(f"{name} could not be evaluated")
        return found

    return at
