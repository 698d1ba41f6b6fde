"""What the air is like on the day: deviations from the standard atmosphere, wind, thermals (numbers only)."""

import math
from dataclasses import dataclass
from enum import Enum


class Profile(Enum):
    """How the static wind changes with height."""

    CONSTANT = "constant"
    POWER = "power"
    LOG = "log"


@dataclass(frozen=True)
class StaticWind:
    """Wind from `origin` (azimuth it blows from, rad) with `speed` (m/s) at `reference_height` (m).

    `exponent` belongs to the power law, `roughness` (m) to the logarithmic one.
    """

    origin: float
    speed: float
    profile: Profile = Profile.CONSTANT
    reference_height: float = 10.0
    exponent: float = 1.0 / 7.0
    roughness: float = 0.03

    @property
    def north(self) -> float:
        """Northward component at the reference height, m/s."""
        return -self.speed * math.cos(self.origin)

    @property
    def east(self) -> float:
        """Eastward component at the reference height, m/s."""
        return -self.speed * math.sin(self.origin)


@dataclass(frozen=True)
class Thermal:
    """An updraft after Allen (2006): centre (m), convective velocity scale `w_star` (m/s), mixing-layer depth (m)."""

    north: float
    east: float
    w_star: float
    mixing_height: float


@dataclass(frozen=True)
class Air:
    """Offsets from ISA at sea level (K, Pa) and the wind field. `wind` is None in still air."""

    temperature_offset: float = 0.0
    pressure_offset: float = 0.0
    elevation: float = 0.0
    wind: StaticWind | None = None
    thermals: tuple[Thermal, ...] = ()
