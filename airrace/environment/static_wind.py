"""The static wind: one direction, and a speed that depends on the height above ground alone.

    W(h) = W_ref f(h) / f(h_ref)     f = 1 | h^exponent | ln(h / roughness)

Near and below the ground a smooth maximum holds the height above a floor, so that wind and derivatives stay finite.
"""

from airrace.environment.air import Profile, StaticWind
from airrace.environment.elementary import log, power, smooth_maximum
from airrace.frames import Scalar
from airrace.quantities import T, Vector, quantity, vector

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
