"""Limits of one's own: quantities along a flight with bounds, one registration each, which hold in every model.

    register(Limit(Quantity("energy_height", "m", 100.0, upper=250.0, text="energy height"), energy_height))

`energy_height` is a function of an `Instant`, with casadi's operations, twice differentiable.
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from airrace.errors import UsageError
from airrace.model.aircraft import AircraftParameters
from airrace.optimal_control.quantities import Quantity, Scalar
from airrace.runtime.extensions import load_extensions

UNITS = ("1", "1/s", "m", "m/s", "rad", "rad/s")
"""The units in which a certificate has a tolerance for what is limited along a flight."""


@dataclass(frozen=True)
class Instant:
    """What every model knows of an instant of a flight, in symbols; SI, rad, g.

    Attributes:
        north, east, height: from the origin.
        V_K, V_A: speed over ground, and relative to the air.
        sin_climb: sine of the climb angle.
        rho: density of the air, kg/m3.
        n_z, n_y: load factors, 1 and 0 in level flight.
        p_Kbar: roll rate about the velocity.
        C_L: lift coefficient.
        beta_A: sideslip.
        delta_T: throttle, 0 to 1.
        aircraft: its numbers.
    """

    north: Scalar
    east: Scalar
    height: Scalar
    V_K: Scalar
    V_A: Scalar
    sin_climb: Scalar
    rho: Scalar
    n_z: Scalar
    n_y: Scalar
    p_Kbar: Scalar
    C_L: Scalar
    beta_A: Scalar
    delta_T: Scalar
    aircraft: AircraftParameters[Scalar]


@dataclass(frozen=True)
class Limit:
    """A limit along the whole flight.

    Attributes:
        quantity: its name, unit, typical size and bounds.
        value: its value at an instant.
    """

    quantity: Quantity
    value: Callable[[Instant], Scalar]

    @property
    def file(self) -> Path:
        """The file of the function, for messages."""
        return Path(inspect.getfile(self.value))


_limits: dict[str, Limit] = {}


def register(limit: Limit) -> Limit:
    """Add a limit, which then holds in every flight, and return it.

    A file that calls this is all that a limit of one's own takes: import it, name it in `AIRRACE_EXTENSIONS`, or make
    it an entry point of a package.

    Raises:
        ValueError: there is a limit of this name, it limits nothing, or certificates know no tolerance in its unit.
    """
    quantity = limit.quantity
    if quantity.name in _limits:
        raise ValueError(f"there is a limit {quantity.name} already")
    if not quantity.lower < quantity.upper:
        raise ValueError(f"no value of {quantity.name} lies between {quantity.lower:g} and {quantity.upper:g}")
    if quantity.unit not in UNITS:
        raise ValueError(f"the unit of {quantity.name} must be one of {', '.join(UNITS)}; is {quantity.unit!r}")
    _limits[quantity.name] = limit
    return limit


def limits() -> tuple[Limit, ...]:
    """Return all limits that were registered, those of extensions included."""
    load_extensions()
    return tuple(_limits.values())


def require_new_names(own: tuple[Limit, ...], names: set[str], model: str) -> None:
    """Refuse a limit that is called like a quantity of a model.

    Raises:
        UsageError: one is.
    """
    for limit in own:
        if limit.quantity.name in names:
            raise UsageError(f"{model} has a quantity {limit.quantity.name} of its own; call your limit otherwise")
