"""Reach of an aircraft that loses its power: the best glide straight on, and behind a turn.

With the polar `C_D = C_D0 + k (C_L - C_L_minD)^2` the glide is flattest at `C_L = sqrt(C_D0 / k + C_L_minD^2)`, where
`E = C_L / C_D`, at the speed `V = sqrt(2 m g / (rho S C_L))`. The energy above that of the glide on the ground,

    e = h + (V_A^2 - V^2) / (2 g)

carries the aircraft `E e` far through the air straight on: no flight at one g comes farther, for its drag is nowhere
less than `m g / E`. A turn loses least height per angle at that lift and 45 degrees of bank, where the load factor is
`sqrt(2)`, the radius `r = sqrt(2) V^2 / g`, and the loss `2 V^2 / (E g)` per radian. The wind displaces it all.

Bounds, not predictions: the propeller's drag is not in the polar, speed is traded for height without loss, the pilot
reacts at once, and the glide is the best one in still air.
"""

import math

import numpy as np

from airrace.aircraft import Aircraft
from airrace.environment import g0
from airrace.records import record
from airrace.safety.falling import AirColumn, States
from airrace.trajectory import Array


@record
class GlideSettings:
    """The turns that are looked at.

    Attributes:
        turn: the largest to either side, rad; a pilot turns back at most.
        headings: how many, an odd number: 10 degrees apart.
    """

    turn: float = math.pi
    headings: int = 37


@record
class Glide:
    """The best glide of an aircraft in still air.

    Attributes:
        ratio: way over height.
        speed: true airspeed, m/s.
    """

    ratio: float
    speed: float

    @property
    def radius(self) -> float:
        """The radius of the turn that loses least height per angle, m."""
        return math.sqrt(2.0) * self.speed**2 / g0

    @property
    def turn_loss(self) -> float:
        """The height that this turn loses, m/rad."""
        return 2.0 * self.speed**2 / (self.ratio * g0)


@record
class Reach:
    """The ground within reach without power.

    Attributes:
        straight: where a glide straight on touches down, north and east, m, shape (n, 2).
        turned: likewise behind turns from the left to the right, m, shape (n, headings, 2); where the height does not
            last for a turn, where it ends.
        distance: of the glide straight on through the air, m, shape (n,).
    """

    straight: Array
    turned: Array
    distance: Array


def best_glide(aircraft: Aircraft, density: float, ratio: float | None = None) -> Glide:
    """Return the best glide of an aircraft, whose propeller has no drag.

    Args:
        aircraft: mass, wing and polar.
        density: of the air, kg/m3.
        ratio: that of the handbook; None for that of the polar.
    """
    drag = aircraft.drag
    C_L = min(math.sqrt(drag.C_D0 / drag.k + drag.C_L_minD**2), aircraft.lift.C_L_max)
    C_D = drag.C_D0 + drag.k * (C_L - drag.C_L_minD) ** 2
    speed = math.sqrt(2.0 * aircraft.airframe.m * g0 / (density * aircraft.airframe.S * C_L))
    return Glide(C_L / C_D if ratio is None else ratio, speed)


def reach(
    states: States, air: AirColumn, glide: Glide, *, ground: float = 0.0, settings: GlideSettings | None = None
) -> Reach:
    """Return where the aircraft can touch down when its power is gone.

    Args:
        states: of the instants at which it is lost.
        air: the wind; that at half the height displaces the glide.
        glide: the best one of the aircraft.
        ground: height of the ground, m.
        settings: which turns; None for all.
    """
    settings = settings or GlideSettings()
    height, place = states.place[:, 2] - ground, states.place[:, :2]
    flow = states.velocity - np.pad(air.wind(states.place[:, 2]), ((0, 0), (0, 1)))
    energy = np.maximum(height + (np.sum(flow**2, axis=1) - glide.speed**2) / (2.0 * g0), 0.0)
    drift = air.wind(ground + 0.5 * np.maximum(height, 0.0))[:, None]
    course = np.arctan2(flow[:, 1], flow[:, 0])[:, None]
    most = energy[:, None] / glide.turn_loss
    turn = np.clip(np.linspace(-settings.turn, settings.turn, settings.headings), -most, most)
    way = glide.ratio * np.maximum(energy[:, None] - glide.turn_loss * np.abs(turn), 0.0)
    along = glide.radius * np.sin(np.abs(turn)) + way * np.cos(turn)
    across = np.sign(turn) * glide.radius * (1.0 - np.cos(turn)) + way * np.sin(turn)
    seconds = glide.radius * np.abs(turn) / (2.0**0.25 * glide.speed) + way / glide.speed
    north = along * np.cos(course) - across * np.sin(course)
    east = along * np.sin(course) + across * np.cos(course)
    turned = place[:, None] + np.stack([north, east], axis=-1) + seconds[..., None] * drift
    return Reach(turned[:, settings.headings // 2], turned, glide.ratio * energy)
