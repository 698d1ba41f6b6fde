"""A flight model: a controlled system together with the numbers of one aircraft in one air."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.frames import Scalar, normalised
from airrace.quantities import Quantity
from airrace.records import record
from airrace.system import System

_vertcat: Callable[..., ca.SX] = ca.vertcat  # casadi overloads it by the type of its arguments
ATTITUDE = ("q0", "q1", "q2", "q3")


@record
class FlightModel:
    """A model ready to fly: a system and the numbers of one aircraft in one air.

    Attributes:
        system: states, controls and equations; the same equations serve every aircraft and air of equal structure.
        parameter_values: values of `system.parameters`, shape (n_p,).
        at_rest: names of the states of the inner loop whose rates are zero in a steady flight.
        brisk: by name, the controls that are measured by a brisk value of their own (in their unit) where their cost is
            weighed; the others are measured by half of what their bounds allow.
    """

    system: System
    parameter_values: NDArray[np.float64]
    at_rest: tuple[str, ...] = ()
    brisk: Mapping[str, float] = field(default_factory=dict[str, float])


def named_symbols(declared: Sequence[Quantity]) -> dict[str, Scalar]:
    """Return one scalar symbol per quantity, by name and in order."""
    return {one.name: ca.SX.sym(one.name) for one in declared}


def column(entries: Iterable[Scalar]) -> ca.SX:
    """Return the entries stacked into one column."""
    return _vertcat(*entries)


def attitude_projection(states: Sequence[Quantity]) -> ca.Function:
    """Return the function `x -> x` that brings the quaternion `q0 ... q3` back to unit length."""
    x = named_symbols(states)
    unit = dict(zip(ATTITUDE, normalised([x[name] for name in ATTITUDE]), strict=True))
    return ca.Function("projection", [column(x.values())], [column((x | unit).values())], {"cse": True})
