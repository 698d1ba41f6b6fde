"""Columns of a table for people: a header that names quantity and unit, and values in that unit."""

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from airrace.export.sampling import QUATERNION, Samples
from airrace.frames import rotation
from airrace.quantities import KNOT, Quantity
from airrace.records import record
from airrace.trajectory import Array, Trajectory

DEGREE = math.pi / 180.0  # rad
SPEEDS = ("V_K", "V_A", "V_I")

# Further columns: a declaration, and its values from the sampled states and controls, in the declared unit.
Derived = Mapping[Quantity, Callable[[Mapping[str, Array]], Array]]


@record
class Column:
    """A column of a table: its header and its values, shape (n,)."""

    header: str
    values: Array


def columns_of(trajectory: Trajectory, samples: Samples, derived: Derived) -> list[Column]:
    """Return time, states, controls, what follows from position and attitude, and `derived`, in this order."""
    columns = [Column("time_s", samples.time)]
    for quantity in (*trajectory.states, *trajectory.controls):
        columns.extend(displayed(quantity, samples.histories[quantity.name]))
    columns.extend(_height(samples.histories))
    columns.extend(_angles(samples.histories))
    for quantity, function in derived.items():
        columns.extend(displayed(quantity, function(samples.histories)))
    return columns


def displayed(quantity: Quantity, values: Array) -> Iterator[Column]:
    """Yield the columns of a quantity in units for people: angles in degrees; speeds in m/s and in knots."""
    unit = quantity.unit
    if unit == "rad" or unit.startswith("rad/"):
        unit, values = unit.replace("rad", "deg", 1), values / DEGREE
    suffix = unit_suffix(unit)
    yield Column(f"{quantity.name}_{suffix}" if suffix else quantity.name, values)
    if quantity.name in SPEEDS:
        yield Column(f"{quantity.name}_kt", values / KNOT)


def unit_suffix(unit: str) -> str:
    """Return a unit in letters, digits and underscores: `m/s^2` is `m_s2`, `1/s` is `per_s`, no unit is nothing."""
    if unit in ("", "1", "-"):
        return ""
    if unit.startswith("1/"):
        unit = "per_" + unit[2:]
    for symbol, letters in (("%", "percent"), ("^", ""), ("²", "2"), ("³", "3"), ("°", "deg")):
        unit = unit.replace(symbol, letters)
    return "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in unit)


def _height(histories: Mapping[str, Array]) -> Iterator[Column]:
    if "z" in histories:
        yield Column("height_m", -histories["z"])


def _angles(histories: Mapping[str, Array]) -> Iterator[Column]:
    """Yield course, climb and bank of Kbar: `chi = atan2(R21, R11)`, `gamma = -asin(R31)`, `mu = atan2(R32, R33)`."""
    if all(name in histories for name in QUATERNION):
        R = rotation([histories[name] for name in QUATERNION])
        yield Column("chi_deg", np.arctan2(R[1][0], R[0][0]) / DEGREE)
        yield Column("gamma_deg", -np.arcsin(np.clip(R[2][0], -1.0, 1.0)) / DEGREE)
        yield Column("mu_deg", np.arctan2(R[2][1], R[2][2]) / DEGREE)
