"""The wind field: static wind and thermals together, and the weather in which a model flies.

A static wind has one direction, and a speed that depends on the height above ground alone:

    W(h) = W_ref f(h) / f(h_ref)     f = 1 | h^exponent | ln(h / roughness)

Near and below the ground a smooth maximum holds the height above a floor, so that wind and derivatives stay finite.
"""

import dataclasses
from collections.abc import Sequence

from airrace.environment.air import Air, Profile, StaticWind
from airrace.environment.atmosphere import AtmosphereParameters
from airrace.environment.elementary import log, power, smooth_maximum
from airrace.environment.thermals import ThermalParameters, thermal_parameters, updraft
from airrace.frames import Scalar
from airrace.quantities import Quantity, T, Vector, quantity, vector
from airrace.records import record

HEIGHT_FLOOR = 2.0
"""The height below which the profiles stop falling, m; far below any legal flight."""
HEIGHT_BLEND = 1.0
"""The width of the smooth transition to the floor, m."""


@vector
class StaticWindParameters(Vector[T]):
    """The wind at its reference height and the numbers of its profile; a profile ignores those it does not need."""

    north: T = quantity("m/s", scale=10.0, text="northward static wind at the reference height")
    east: T = quantity("m/s", scale=10.0, text="eastward static wind at the reference height")
    reference_height: T = quantity("m", scale=10.0, text="height at which the static wind is given")
    exponent: T = quantity("1", text="exponent of the power-law profile")
    roughness: T = quantity("m", text="roughness length of the logarithmic profile")


def static_wind_parameters(wind: StaticWind) -> StaticWindParameters[float]:
    """Return the numbers of a static wind."""
    return StaticWindParameters(
        north=wind.north,
        east=wind.east,
        reference_height=wind.reference_height,
        exponent=wind.exponent,
        roughness=wind.roughness,
    )


def static_wind(profile: Profile, h: Scalar, wind: StaticWindParameters[Scalar]) -> tuple[Scalar, Scalar]:
    """Return the static wind `(W_N, W_E)` in m/s at the height `h` (m) above ground."""
    match profile:
        case Profile.CONSTANT:
            return wind.north, wind.east
        case Profile.POWER:
            ratio = _bounded(h, HEIGHT_FLOOR) / _bounded(wind.reference_height, HEIGHT_FLOOR)
            factor = power(ratio, wind.exponent)
        case Profile.LOG:
            # a floor above the roughness length keeps the logarithm positive
            floor = HEIGHT_FLOOR + wind.roughness
            reference = log(_bounded(wind.reference_height, floor) / wind.roughness)
            factor = log(_bounded(h, floor) / wind.roughness) / reference
    return wind.north * factor, wind.east * factor


def _bounded(h: Scalar, floor: Scalar) -> Scalar:
    return smooth_maximum(h, floor, HEIGHT_BLEND)


@record
class WindField:
    """The structure of the wind, i.e. which kinds of wind blow; fields of equal structure share one model.

    Attributes:
        profile: profile of the static wind, None without static wind.
        thermals: how many thermals there are.
    """

    profile: Profile | None
    thermals: int

    @classmethod
    def of(cls, air: Air) -> "WindField":
        """Return the structure of the wind in `air`."""
        return cls(air.wind.profile if air.wind is not None else None, len(air.thermals))

    @property
    def present(self) -> bool:
        """Whether any wind blows; without it `velocity` is exactly zero and there are no parameters."""
        return self.profile is not None or self.thermals > 0

    @property
    def label(self) -> str:
        """The name of the structure, e.g. `wind(power)+thermals(2)`; empty in still air."""
        parts = [f"wind({self.profile.value})"] if self.profile is not None else []
        if self.thermals:
            parts.append(f"thermals({self.thermals})")
        return "+".join(parts)

    @property
    def parameters(self) -> tuple[Quantity, ...]:
        """The declarations of the field's numbers, in the order of `values`."""
        static = _prefixed("wind", StaticWindParameters.quantities()) if self.profile is not None else ()
        thermals = [
            _prefixed(f"thermal{number}", ThermalParameters.quantities()) for number in range(1, self.thermals + 1)
        ]
        return sum(thermals, static)

    def values(self, air: Air) -> list[float]:
        """Return the numbers of the wind in `air`, in the order of `parameters`.

        Args:
            air: the air of a day, with a wind of this field's structure.

        Raises:
            ValueError: the wind in `air` is of another structure.
        """
        if WindField.of(air) != self:
            raise ValueError(f"the air holds {WindField.of(air)}, not {self}")
        numbers = [number for thermal in air.thermals for number in thermal_parameters(thermal).join()]
        return [*static_wind_parameters(air.wind).join(), *numbers] if air.wind is not None else numbers

    def velocity(self, x: Scalar, y: Scalar, z: Scalar, p: Sequence[Scalar]) -> list[Scalar]:
        """Return `V_W,O = [W_N, W_E, W_D]` (m/s) at a point of the track's frame (m), given the field's parameters."""
        north, east, down = 0.0, 0.0, 0.0
        remaining = list(p)
        if self.profile is not None:
            size = StaticWindParameters.size()
            north, east = static_wind(self.profile, -z, StaticWindParameters[Scalar].split(remaining[:size]))
            remaining = remaining[size:]
        size = ThermalParameters.size()
        for first in range(0, self.thermals * size, size):
            down -= updraft(x, y, -z, ThermalParameters[Scalar].split(remaining[first : first + size]))
        return [north, east, down]


def _prefixed(prefix: str, quantities: tuple[Quantity, ...]) -> tuple[Quantity, ...]:
    return tuple(dataclasses.replace(one, name=f"{prefix}_{one.name}") for one in quantities)


@record
class Weather:
    """The air and the wind as the equations of a model see them, in symbols or numbers.

    Attributes:
        atmosphere: the numbers of the day's atmosphere.
        field: the structure of the wind, which equations depend on.
        wind: the values of `field.parameters`, which equations do not depend on.
    """

    atmosphere: AtmosphereParameters[Scalar]
    field: WindField
    wind: Sequence[Scalar] = ()
