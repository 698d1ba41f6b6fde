"""The planets JSBSim may fly over: its own Earth, and one that comes close to the flat ground of the flight model.

JSBSim's Earth is the ellipsoid WGS84 with gravity of second order (J2), and it turns: angular accelerations differ by
up to 5e-4 rad/s2 (its own rate of 7e-5 rad/s, times a roll rate), and a second's flight by some millimetres. The flat
one is a sphere that does not turn, so large that neither its curvature nor the decrease of gravity with height shows;
its ground has the gravity `g0`.
"""

from airrace.crosscheck.expressions import Element, element
from airrace.crosscheck.units import FOOT
from airrace.environment.atmosphere import g0
from airrace.records import record

FLAT_RADIUS = 1e9
"""The radius of the flat planet, m; positions of 1e9 m still resolve 1e-7 m, and gravity falls by 2e-6 over 1000 m."""


@record
class Planet:
    """A planet: its name, whether it is JSBSim's own Earth, and the geodetic `latitude` (rad) of the flights."""

    name: str
    turning: bool
    latitude: float


EARTH = Planet("WGS84", turning=True, latitude=0.7941)  # 45.5 degrees, where gravity on the rotating Earth is g0
FLAT = Planet("flat", turning=False, latitude=0.0)


def planet_element(planet: Planet) -> Element | None:
    """Return what the model's file says of the planet; None for JSBSim's own Earth."""
    if planet.turning:
        return None
    radius, gravity = FLAT_RADIUS / FOOT, g0 / FOOT
    values = {
        "semimajor_axis": ("FT", radius),
        "semiminor_axis": ("FT", radius),
        "rotation_rate": ("RAD/SEC", 0.0),
        "GM": ("FT3/SEC2", gravity * radius * radius),
    }
    quantities = [element(tag, text=repr(value), unit=unit) for tag, (unit, value) in values.items()]
    return element("planet", *quantities, element("J2", text="0.0"), name=planet.name)
