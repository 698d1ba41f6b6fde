"""The air of the day: deviations from the standard atmosphere, wind and thermals (numbers only)."""

import math
from enum import Enum

from airrace.records import record


class Profile(Enum):
    """The law by which the static wind changes with height."""

    CONSTANT = "constant"
    POWER = "power"
    LOG = "log"


@record
class StaticWind:
    """A wind from `origin` (the azimuth it blows from, rad) with `speed` (m/s) at `reference_height` (m).

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
        """The northward component at the reference height, m/s."""
        return -self.speed * math.cos(self.origin)

    @property
    def east(self) -> float:
        """The eastward component at the reference height, m/s."""
        return -self.speed * math.sin(self.origin)


@record
class Thermal:
    """An updraft after Allen (2006): centre (m), convective velocity scale `w_star` (m/s), mixing-layer depth (m)."""

    north: float
    east: float
    w_star: float
    mixing_height: float


@record
class Air:
    """The air of the day: offsets from ISA at sea level (K, Pa), the elevation of the track's origin (m) and the wind.

    `wind` is None without static wind.
    """

    temperature_offset: float = 0.0
    pressure_offset: float = 0.0
    elevation: float = 0.0
    wind: StaticWind | None = None
    thermals: tuple[Thermal, ...] = ()
