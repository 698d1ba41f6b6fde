"""The measurements of an optimum from which its certificate is made and its next mesh is chosen."""

import math
from dataclasses import dataclass

from airrace.optimal_control.certificate import Curvature, Item, SecondOrder
from airrace.optimal_control.constraint_check import ConstraintCheck
from airrace.optimal_control.replay import Replay
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True, eq=False)
class Evidence:
    """The measurements of an optimum, apart from the solver's own claims.

    Attributes:
        replay: its controls integrated again.
        check: limits and gates on that flight.
        drift: how far the Hamiltonian is from what it should be all along, shape (N,); of a race from -1.
        integration: what each interval's error of integration takes off the objective, in its unit; shape (N,).
    """

    replay: Replay
    check: ConstraintCheck
    drift: Array
    integration: Array


def negative_curvature(second_order: SecondOrder | None, unit: str = "s") -> Item:
    """Return the item of the curvature by which an optimum is a saddle: nothing where it is none, NaN where unknown."""
    if second_order is None:
        return Item("negative_curvature", math.nan, 0.0, unit, "")
    indefinite = second_order.curvature is Curvature.INDEFINITE
    value, where = (-second_order.least, second_order.where) if indefinite else (0.0, "")
    return Item("negative_curvature", value, second_order.saddle, unit, where)
