"""The air of the day: its numbers, the atmosphere, the wind field, and the weather in which a model flies.

The temperature of the International Standard Atmosphere's troposphere falls from `T_0` at mean sea level by `LAPSE` per
metre; the pressure follows from hydrostatic balance, `dp/dh = -rho g0`, starting from `p_0` at mean sea level. Both are
shifted to the temperature and pressure of the day:

    T = T_0 - LAPSE h,   p = p_0 (T / T_0)^(g0 / (R LAPSE)),   rho = p / (R T)

With `T_0 = 288.15 K` and `p_0 = 101325 Pa` this is ISO 2533 below 11 km.

A static wind has one direction, and a speed that depends on the height above ground alone:

    W(h) = W_ref f(h) / f(h_ref)     f = 1 | h^exponent | ln(h / roughness)

Near and below the ground a smooth maximum holds the height above a floor, so that wind and derivatives stay finite.

Thermals are updrafts in a convective mixing layer [Allen 2006, NASA NTRS 20060004052]. With `zeta = h / zi`, the height
over the depth of the mixing layer:

    r2 = max(10 m, 0.102 zeta^(1/3) (1 - 0.25 zeta) zi)          outer radius
    w_mean = w* zeta^(1/3) (1 - 1.1 zeta)                        mean over the disc of radius r2
    w_peak = 3 w_mean (r2 - r1) r2^2 / (r2^3 - r1^3)             core of a trapezoid of revolution with that mean
    w / w_peak = 1 / (1 + |k1 r/r2 + k3|^k2) + k4 r/r2           bell fitted to the trapezoid

Allen tabulates (k1, k2, k3, k4) for seven ratios r1/r2 and jumps from row to row as r2 grows with height; a jump has no
derivative, so one row serves here at all heights: r1/r2 = 0.36, which his rule r1/r2 = 0.0011 r2 + 0.14 reaches at
r2 = 200 m. Lower down his rule gives smaller ratios (0.2 at r2 = 55 m) and up to a quarter more in the core, with the
same mean. Smooth maxima bound h and r2 from below; the weak linear tail, which would grow without end, is faded out.
"""

import dataclasses
import math
from collections.abc import Sequence
from enum import Enum

from airrace.model.elementary import exp, log, power, smooth_maximum, sqrt
from airrace.optimal_control.quantities import Quantity, Scalar, T, Vector, quantity, vector


class Profile(Enum):
    """The law by which the static wind changes with height."""

    CONSTANT = "constant"
    POWER = "power"
    LOG = "log"


@dataclasses.dataclass(frozen=True)
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


@dataclasses.dataclass(frozen=True)
class Thermal:
    """An updraft after Allen (2006): centre (m), convective velocity scale `w_star` (m/s), mixing-layer depth (m)."""

    north: float
    east: float
    w_star: float
    mixing_height: float


@dataclasses.dataclass(frozen=True)
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


PROFILE_FLOOR = 2.0
"""The height below which profiles of the static wind stop falling, m: far below any legal flight."""
THERMAL_FLOOR = 1.0
"""The height below which a thermal no longer weakens, m: the cube root has no derivative at the ground."""
FLOOR_BLEND = 1.0
"""The width of the transition to either floor, m."""
RADIUS_FLOOR = 10.0
"""The smallest outer radius of a thermal, m [Allen]."""
RADIUS_BLEND = 1.0
"""The width of the transition to it, m."""
STRENGTH_BLEND = 0.02
"""The width within which `1 - 1.1 zeta` is rounded off at zero, at the top of the mixing layer (1)."""
CENTRE_BLEND = 1.0
"""The radius within which the distance from a thermal's centre is rounded off, m."""
BELL_BLEND = 1e-3
"""The width within which the bell's `|k1 r/r2 + k3|` is rounded off at zero (1)."""
FADE = 4.0
"""The distance from the centre at which the updraft has faded to 1/e of the bell, in outer radii."""
R1_OVER_R2 = 0.36
"""The ratio of a thermal's core's radius to its outer radius; one of Allen's seven rows, for the reason given above."""
K1, K2, K3, K4 = 1.4866, 4.8354, -0.0320, 0.0001
"""Allen's shape constants for r1/r2 = 0.36."""
PEAK_OVER_MEAN = 3.0 / (1.0 + R1_OVER_R2 + R1_OVER_R2**2)
"""The ratio `w_peak / w_mean = 3 (r2 - r1) r2^2 / (r2^3 - r1^3)`, with the common factor cancelled."""


@vector
class StaticWindParameters(Vector[T]):
    """The wind at its reference height and the numbers of its profile; a profile ignores those it does not need."""

    north: T = quantity("m/s", scale=10.0, text="northward static wind at the reference height")
    east: T = quantity("m/s", scale=10.0, text="eastward static wind at the reference height")
    reference_height: T = quantity("m", scale=10.0, text="height at which the static wind is given")
    exponent: T = quantity("1", text="exponent of the power-law profile")
    roughness: T = quantity("m", text="roughness length of the logarithmic profile")


@vector
class ThermalParameters(Vector[T]):
    """The place and strength of one thermal."""

    north: T = quantity("m", scale=100.0, text="thermal's centre, north of the origin")
    east: T = quantity("m", scale=100.0, text="thermal's centre, east of the origin")
    w_star: T = quantity("m/s", text="thermal's convective velocity scale")
    mixing_height: T = quantity("m", scale=1000.0, text="depth of the convective mixing layer")


def static_wind(profile: Profile, h: Scalar, wind: StaticWindParameters[Scalar]) -> tuple[Scalar, Scalar]:
    """Return the static wind `(W_N, W_E)` in m/s at the height `h` (m) above ground."""
    if profile is Profile.CONSTANT:
        return wind.north, wind.east
    # for the logarithm a floor above the roughness length keeps it positive
    floor = PROFILE_FLOOR + (wind.roughness if profile is Profile.LOG else 0.0)
    height, reference = (smooth_maximum(value, floor, FLOOR_BLEND) for value in (h, wind.reference_height))
    if profile is Profile.POWER:
        factor = power(height / reference, wind.exponent)
    else:
        factor = log(height / wind.roughness) / log(reference / wind.roughness)
    return wind.north * factor, wind.east * factor


def outer_radius(h: Scalar, mixing_height: Scalar) -> Scalar:
    """Return the outer radius `r2` (m) of a thermal at the height `h` (m) above ground."""
    zeta, root = _relative_height(h, mixing_height)
    radius = 0.102 * root * (1.0 - 0.25 * zeta) * mixing_height
    return smooth_maximum(radius, RADIUS_FLOOR, RADIUS_BLEND)


def mean_updraft(h: Scalar, w_star: Scalar, mixing_height: Scalar) -> Scalar:
    """Return `w_mean` (m/s, up) at the height `h` (m) above ground; nothing is left at the top of the mixing layer."""
    zeta, root = _relative_height(h, mixing_height)
    return w_star * root * smooth_maximum(1.0 - 1.1 * zeta, 0.0, STRENGTH_BLEND)


def updraft(x: Scalar, y: Scalar, h: Scalar, thermal: ThermalParameters[Scalar]) -> Scalar:
    """Return the vertical wind (m/s, positive up) of one thermal at `x` north, `y` east and `h` above ground (m)."""
    north, east = x - thermal.north, y - thermal.east
    r = sqrt(north * north + east * east + CENTRE_BLEND**2)
    w_peak = PEAK_OVER_MEAN * mean_updraft(h, thermal.w_star, thermal.mixing_height)
    return w_peak * shape(r / outer_radius(h, thermal.mixing_height))


def shape(r_over_r2: Scalar) -> Scalar:
    """Return `w / w_peak` at a distance from the centre of a thermal given in outer radii."""
    distance = K1 * r_over_r2 + K3
    # |d|^k2 as a power of d^2 + tiny: the derivatives exist where d = 0
    steepness = power(distance * distance + BELL_BLEND**2, 0.5 * K2)
    square = r_over_r2 * r_over_r2 / FADE**2
    return (1.0 / (1.0 + steepness) + K4 * r_over_r2) * exp(-square * square * square)


def _relative_height(h: Scalar, mixing_height: Scalar) -> tuple[Scalar, Scalar]:
    """Return `zeta` and its cube root, with the height bounded from below."""
    zeta = smooth_maximum(h, THERMAL_FLOOR, FLOOR_BLEND) / mixing_height
    return zeta, power(zeta, 1.0 / 3.0)


@dataclasses.dataclass(frozen=True)
class WindField:
    """The structure of the wind, i.e. which kinds of wind blow; fields of equal structure share one model.

    Attributes:
        profile: profile of the static wind, None without static wind.
        thermals: how many thermals there are.
    """

    profile: Profile | None
    thermals: int

    @classmethod
    def from_air(cls, air: Air) -> "WindField":
        """Return the structure of the wind in `air`."""
        return cls(air.wind.profile if air.wind is not None else None, len(air.thermals))

    @property
    def present(self) -> bool:
        """Whether any wind blows; without it `velocity` is exactly zero and there are no parameters."""
        return self.profile is not None or self.thermals > 0

    @property
    def label(self) -> str:
        """The name of the structure, e.g. `wind(power)+thermals(2)`; empty in still air."""
        static = f"wind({self.profile.value})" if self.profile is not None else ""
        thermals = f"thermals({self.thermals})" if self.thermals else ""
        return "+".join(part for part in (static, thermals) if part)

    @property
    def parameters(self) -> tuple[Quantity, ...]:
        """The declarations of the field's numbers, in the order of `values`."""
        parts = [("wind", StaticWindParameters.quantities())] if self.profile is not None else []
        parts += [(f"thermal{number + 1}", ThermalParameters.quantities()) for number in range(self.thermals)]
        return tuple(
            dataclasses.replace(quantity, name=f"{part}_{quantity.name}")
            for part, declared in parts
            for quantity in declared
        )

    def values(self, air: Air) -> list[float]:
        """Return the numbers of the wind in `air`, in the order of `parameters`.

        Raises:
            ValueError: the wind in `air` is of another structure.
        """
        if WindField.from_air(air) != self:
            raise ValueError(f"the air holds {WindField.from_air(air)}, not {self}")
        parts = [] if air.wind is None else [(air.wind, StaticWindParameters)]
        parts += [(thermal, ThermalParameters) for thermal in air.thermals]
        return [getattr(part, name) for part, declared in parts for name in declared.names()]

    def velocity(self, x: Scalar, y: Scalar, z: Scalar, p: Sequence[Scalar]) -> list[Scalar]:
        """Return `V_W,O = [W_N, W_E, W_D]` (m/s) at a point of the track's frame (m), given the field's parameters."""
        north, east, down, first = 0.0, 0.0, 0.0, 0
        if self.profile is not None:
            first = StaticWindParameters.size()
            north, east = static_wind(self.profile, -z, StaticWindParameters[Scalar].split(p[:first]))
        size = ThermalParameters.size()
        for begin in range(first, first + self.thermals * size, size):
            down -= updraft(x, y, -z, ThermalParameters[Scalar].split(p[begin : begin + size]))
        return [north, east, down]


@dataclasses.dataclass(frozen=True)
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
