"""Courses that are possible on paper and hardly in the air: elements in one place, no room for height, steep climbs."""

import math
from collections.abc import Iterator

import numpy as np

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.atmosphere import g0
from airrace.planning.legs import Leg
from airrace.planning.plan import ONE_PLACE
from airrace.planning.planning_model import AIR_DENSITY, top_speed
from airrace.quantities import Interval

NEAR = 0.1
"""The time of flight at the least speed below which two elements may be meant as one, s."""
SAME_DIRECTION = math.radians(30.0)
"""The largest angle between the axes of two elements that may be meant as one, rad; those of a quad stand across."""
LEAST_BAND = 5.0
"""The least room between floor and ceiling that needs no remark, m: the legal heights of a gate span 10 m."""
SHARE_OF_SPEED = 0.5
"""The part of its kinetic energy that an aircraft can give for height (1): what is left has to carry it."""


def one_behind_the_other(leg: Leg, aircraft: Aircraft) -> Iterator[str]:
    """Yield a remark on two elements so close together that one of them may be meant."""
    if _feature(leg.before.element.name) == _feature(leg.after.element.name) or _stand_across(leg):
        return  # passed twice on purpose, as a quad is
    if leg.length < ONE_PLACE:
        yield (
            f"`{leg.after.name}` stands in the same place as `{leg.before.name}`: only a circle or a loop leads from "
            "the one to the other; are they one gate?"
        )
    elif leg.length < NEAR * aircraft.envelope.V.lower:
        yield (
            f"`{leg.after.name}` stands {leg.length:.3g} m from `{leg.before.name}`: that is flown in "
            f"{leg.length / aircraft.envelope.V.lower:.2g} s at the slowest; are they one gate?"
        )


def _feature(name: str) -> str:
    """Return the name of the whole of which an element may be a part: `q` of `q/1`."""
    return name.partition("/")[0]


def _stand_across(leg: Leg) -> bool:
    """Return whether the two elements are passed in different directions."""
    before, after = leg.before.element.axis, leg.after.element.axis
    return before is not None and after is not None and abs(math.sin(after - before)) > math.sin(SAME_DIRECTION)


def narrow_heights(allowed: Interval) -> Iterator[str]:
    """Yield a remark on floor and ceiling between which there is hardly any room."""
    room = allowed.upper - allowed.lower
    if room < LEAST_BAND:
        yield (
            f"there are {room:.3g} m between the floor at {allowed.lower:g} m and the ceiling at {allowed.upper:g} m; "
            "hardly anyone keeps a height so closely"
        )


def climb_beyond_energy(leg: Leg, aircraft: Aircraft) -> Iterator[str]:
    """Yield a remark on a height that neither the engine gains on the way nor the speed is worth."""
    up = leg.after.element.heights.lower - leg.before.element.heights.upper
    V = top_speed(aircraft)
    if not V or not math.isfinite(up):
        return
    engine, speed = climb_rate(aircraft) * leg.length / V, V**2 / (2.0 * g0)
    if up > engine + SHARE_OF_SPEED * speed:
        yield (
            f"from `{leg.before.name}` to `{leg.after.name}` {up:.0f} m are to be climbed: on the way {aircraft.name} "
            f"gains {engine:.0f} m by its engine, and all of its speed is worth {speed:.0f} m"
        )


def climb_rate(aircraft: Aircraft) -> float:
    """Return the best rate of climb at full power, m/s (ISA, sea level); 0 for an aircraft that cannot fly level."""
    propulsion, drag, m, S = aircraft.propulsion, aircraft.drag, aircraft.airframe.m, aircraft.airframe.S
    V = np.linspace(max(aircraft.envelope.V.lower, 1.0), aircraft.envelope.V.upper, 50)
    pressure = 0.5 * AIR_DENSITY * V**2
    C_D = drag.C_D0 + drag.k * (m * g0 / (pressure * S) - drag.C_L_minD) ** 2
    spare = propulsion.eta_p * propulsion.P_max - pressure * S * C_D * V
    return max(0.0, float(spare.max()) / (m * g0))
