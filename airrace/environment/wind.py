"""The wind field: static wind and thermals together. Its structure is fixed by the air, its numbers are parameters."""

import dataclasses
from collections.abc import Sequence

from airrace.environment.air import Air, Profile
from airrace.environment.static_wind import StaticWindParameters, static_wind, static_wind_parameters
from airrace.environment.thermals import ThermalParameters, thermal_parameters, updraft
from airrace.frames import Scalar
from airrace.quantities import Quantity
from airrace.records import record


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
