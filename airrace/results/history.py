"""A history: the values of one quantity over the time axis of a flight, and where they come from."""

from collections.abc import Mapping
from enum import Enum

from airrace.quantities import Quantity
from airrace.records import record
from airrace.trajectory import Array


class Basis(Enum):
    """The origin of the values of a history.

    `SOLVED`: states and controls of an optimum. `MEASURED`: a recording. `DERIVED`: computed from the others.
    """

    SOLVED = "solved"
    MEASURED = "measured"
    DERIVED = "derived"


@record
class History:
    """One quantity over time.

    Attributes:
        quantity: its name, unit (SI and radians), meaning, and the bounds that applied to it.
        values: at the times of the flight it belongs to, shape (n,); NaN where nothing is known.
        basis: where the values come from.
    """

    quantity: Quantity
    values: Array
    basis: Basis


Histories = Mapping[str, History]
"""Histories by the names of their quantities, all over one time axis."""
