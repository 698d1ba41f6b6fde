"""The air of the day as numbers (its deviations from the standard, wind, thermals), and the atmosphere's equations.

The temperature of the International Standard Atmosphere's troposphere falls from `T_0` at mean sea level by `LAPSE` per
metre; the pressure follows from hydrostatic balance, `dp/dh = -rho g0`, starting from `p_0` at mean sea level. Both are
shifted to the temperature and pressure of the day:

    T = T_0 - LAPSE h,   p = p_0 (T / T_0)^(g0 / (R LAPSE)),   rho = p / (R T)

With `T_0 = 288.15 K` and `p_0 = 101325 Pa` this is ISO 2533 below 11 km.
"""

import math
from enum import Enum

from airrace.environment.elementary import power
from airrace.frames import Scalar
from airrace.quantities import T, Vector, quantity, vector
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


g0 = 9.80665
"""The standard acceleration of gravity, m/s2."""
R_AIR = 287.05287
"""The specific gas constant of dry air, J/(kg K) [ISO 2533]."""
LAPSE = 0.0065
"""The temperature lapse rate of the troposphere, K/m [ISO 2533]."""
T_ISA = 288.15
"""The standard temperature at mean sea level, K."""
P_ISA = 101325.0
"""The standard pressure at mean sea level, Pa."""
RHO_ISA = P_ISA / (R_AIR * T_ISA)
"""The standard density at mean sea level, kg/m3 (1.225)."""
KAPPA = 1.4
"""The ratio of the specific heats of air."""
PRESSURE_EXPONENT = g0 / (R_AIR * LAPSE)
"""The exponent of the pressure in the temperature ratio, `g0 / (R LAPSE)` (5.256)."""


@vector
class AtmosphereParameters(Vector[T]):
    """The numbers that distinguish the air of one day and place from another."""

    T_0: T = quantity("K", scale=T_ISA, text="temperature at mean sea level")
    p_0: T = quantity("Pa", scale=P_ISA, text="pressure at mean sea level")
    elevation: T = quantity("m", scale=100.0, text="height of the track's origin above mean sea level")


def atmosphere_parameters(air: Air) -> AtmosphereParameters[float]:
    """Return the numbers of a day: ISA at sea level plus the day's offsets."""
    return AtmosphereParameters(
        T_0=T_ISA + air.temperature_offset, p_0=P_ISA + air.pressure_offset, elevation=air.elevation
    )


def temperature(z: Scalar, air: AtmosphereParameters[Scalar]) -> Scalar:
    """Return the air temperature (K) at `z` (m, down from the track's origin)."""
    return air.T_0 - LAPSE * (air.elevation - z)


def pressure(z: Scalar, air: AtmosphereParameters[Scalar]) -> Scalar:
    """Return the air pressure (Pa) at `z` (m, down from the track's origin)."""
    return air.p_0 * power(temperature(z, air) / air.T_0, PRESSURE_EXPONENT)


def density(z: Scalar, air: AtmosphereParameters[Scalar]) -> Scalar:
    """Return the air density `rho = p / (R T)` (kg/m3) at `z` (m, down from the track's origin)."""
    return pressure(z, air) / (R_AIR * temperature(z, air))


def calibrated_airspeed(V_A: Scalar, p: Scalar, rho: Scalar) -> Scalar:
    """Return what an airspeed indicator without errors shows, m/s.

    It shows the speed at which the standard atmosphere at sea level has the same impact pressure:

        q_c = p [(1 + (kappa - 1)/2 M^2)^(kappa/(kappa - 1)) - 1]      and the inverse with p_0, a_0

    Args:
        V_A: true airspeed, m/s.
        p: pressure, Pa.
        rho: density, kg/m3.
    """
    M2 = V_A**2 * rho / (KAPPA * p)
    impact = p * ((1.0 + 0.5 * (KAPPA - 1.0) * M2) ** (KAPPA / (KAPPA - 1.0)) - 1.0)
    a_02 = KAPPA * P_ISA / RHO_ISA
    ratio = (impact / P_ISA + 1.0) ** ((KAPPA - 1.0) / KAPPA) - 1.0
    return (2.0 / (KAPPA - 1.0) * a_02 * ratio) ** 0.5
