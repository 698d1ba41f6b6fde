"""The flow that a flight meets: the wind along it, and the indicated airspeed that follows from the true one."""

import functools

import casadi as ca
import numpy as np

from airrace.environment import (
    Air,
    WindField,
    atmosphere_parameters,
    calibrated_airspeed,
    density,
    pressure,
)
from airrace.quantities import Quantity
from airrace.system import at_points, column, named_symbols
from airrace.trajectory import Array


def wind(air: Air, x: Array, y: Array, z: Array) -> Array:
    """Return the north, east and down components of the wind at places of the track's frame (m), shape (3, n), m/s."""
    field = WindField.of(air)
    if not field.present:
        return np.zeros((3, len(x)))
    return at_points(_wind_function(field), np.stack([x, y, z]), np.array(field.values(air)))


def indicated_airspeed(V_A: Array, z: Array, air: Air) -> Array:
    """Return what an airspeed indicator without errors shows (calibrated airspeed), m/s, shape (n,).

    Args:
        V_A: true airspeed, m/s.
        z: down from the track's origin, m.
        air: of the day.
    """
    day = atmosphere_parameters(air)
    p, rho = (np.asarray(law(z, day), np.float64).reshape(z.shape) for law in (pressure, density))
    return np.asarray(calibrated_airspeed(V_A, p, rho), np.float64)


@functools.lru_cache(maxsize=16)
def _wind_function(field: WindField) -> ca.Function:
    place = named_symbols([Quantity(name, "m") for name in ("x", "y", "z")])
    numbers = named_symbols(field.parameters)
    velocity = field.velocity(place["x"], place["y"], place["z"], list(numbers.values()))
    return ca.Function("wind", [column(place.values()), column(numbers.values())], [column(velocity)], {"cse": True})
