"""Flight without lift, and without power: where a fall meets flat ground, and how far a glide reaches.

An aircraft that falls is a point of mass `m` without lift and without thrust. With `C_D A` its drag area, `w` the wind,

    m dv/dt = m g - 1/2 rho C_D A |v - w| (v - w)

In vacuum the fall is a parabola, `t = [v_up + sqrt(v_up^2 + 2 g h)] / g`, from level flight `d = V sqrt(2 h / g)` long.
With drag it is integrated by the classical Runge-Kutta scheme, all states side by side; the instant at which the ground
is met is that of a cubic through heights and climb rates at both ends of the last step. The wind is that of its profile
at the height of the moment; thermals are left out.

An aircraft that loses its power glides straight on, or behind a turn. With the polar
`C_D = C_D0 + k (C_L - C_L_minD)^2` the glide is flattest at `C_L = sqrt(C_D0 / k + C_L_minD^2)`, where
`E = C_L / C_D`, at the speed `V = sqrt(2 m g / (rho S C_L))`. The energy above that of the glide on the ground,

    e = h + (V_A^2 - V^2) / (2 g)

carries the aircraft `E e` far through the air straight on: no flight at one g comes farther, for its drag is nowhere
less than `m g / E`. A turn loses least height per angle at that lift and 45 degrees of bank, where the load factor is
`sqrt(2)`, the radius `r = sqrt(2) V^2 / g`, and the loss `2 V^2 / (E g)` per radian. The wind displaces it all.

Glides are bounds, not predictions: the propeller's drag is not in the polar, speed is traded for height without loss,
the pilot reacts at once, and the glide is the best one in still air.
"""

import math
from dataclasses import dataclass

import numpy as np

from airrace.flights.results.derivation import wind_along
from airrace.flights.results.flight import Flight
from airrace.model.aircraft import Aircraft
from airrace.model.environment import Air, atmosphere_parameters, density, g0
from airrace.optimal_control.trajectory import Array

STEP = 0.05
"""The step of the integration, s; falls from 200 m then end within a millimetre of where they do with a tenth of it."""
FALL_TIME_MAX = 120.0
"""A time longer than any fall from a race, s."""


@dataclass(frozen=True, eq=False)
class AirColumn:
    """Wind and density over height, which are the same at every place; linear between the heights.

    Attributes:
        height: above the track's origin, rising, m, shape (k,).
        north, east: components of the wind, m/s, likewise.
        density: kg/m3, likewise.
    """

    height: Array
    north: Array
    east: Array
    density: Array

    @classmethod
    def from_air(cls, air: Air, top: float) -> "AirColumn":
        """Return the air of a day without its thermals, metre by metre from the ground up to a height, m."""
        height = np.linspace(0.0, max(top, 1.0), 2 + math.ceil(max(top, 1.0)))
        still = Air(air.temperature_offset, air.pressure_offset, air.elevation, air.wind)
        nowhere = np.zeros_like(height)
        north, east, _ = wind_along(still, nowhere, nowhere, -height)
        rho = np.asarray(density(-height, atmosphere_parameters(air)), np.float64).reshape(height.shape)
        return cls(height, north, east, rho)

    def wind(self, height: Array) -> Array:
        """Return the wind, north and east, m/s, shape (..., 2)."""
        return np.stack([np.interp(height, self.height, component) for component in (self.north, self.east)], axis=-1)


@dataclass(frozen=True, eq=False)
class States:
    """Instants of one flight or of many, whose order does not matter here.

    Attributes:
        place: north, east, height above the track's origin, m, shape (n, 3).
        velocity: over ground: north, east, up, m/s, shape (n, 3).
    """

    place: Array
    velocity: Array

    @classmethod
    def from_flight(cls, flight: Flight, times: Array) -> "States":
        """Return the states of a flight at some times; NaN where it knows neither height nor velocity.

        Velocities are interpolated by their components, for course and bank jump where a flight is vertical.

        Args:
            flight: one that has `x`, `y`, `height`, `V_K`, `chi` and `gamma`.
            times: s, shape (n,).
        """
        level = flight["V_K"] * np.cos(flight["gamma"])
        velocity = (
            level * np.cos(flight["chi"]),
            level * np.sin(flight["chi"]),
            flight["V_K"] * np.sin(flight["gamma"]),
        )
        columns = [
            np.interp(times, flight.time, history)
            for history in (flight["x"], flight["y"], flight["height"], *velocity)
        ]
        return cls(np.stack(columns[:3], axis=1), np.stack(columns[3:], axis=1))

    @property
    def speed(self) -> Array:
        """The speed over ground along the path, m/s, shape (n,)."""
        return np.linalg.norm(self.velocity, axis=1)


@dataclass(frozen=True, eq=False)
class Impacts:
    """Where and how falls end.

    Attributes:
        place: north and east, m, shape (n, 2).
        time: of the fall, s, shape (n,).
        speed: over ground, m/s, shape (n,).
    """

    place: Array
    time: Array
    speed: Array


def level_fall_distance(speed: Array, height: Array) -> Array:
    """Return `V sqrt(2 h / g)`, the way of a free fall from level flight in vacuum, m; zero below the ground."""
    return speed * np.sqrt(2.0 * np.maximum(height, 0.0) / g0)


def fall_in_vacuum(states: States) -> Impacts:
    """Return where the aircraft falls to without air; at once where it is below the ground already.

    Args:
        states: of the instants at which it begins to fall.
    """
    above, up = states.place[:, 2], states.velocity[:, 2]
    time = np.where(above > 0.0, (up + np.sqrt(up**2 + 2.0 * g0 * np.maximum(above, 0.0))) / g0, 0.0)
    end = states.velocity - np.outer(time, [0.0, 0.0, g0])
    return Impacts(states.place[:, :2] + time[:, None] * states.velocity[:, :2], time, np.linalg.norm(end, axis=1))


def fall_with_drag(states: States, air: AirColumn, *, mass: float, drag_area: float, h: float = STEP) -> Impacts:
    """Return where the aircraft falls to through the air; at once where it is below the ground already.

    Args:
        states: of the instants at which it begins to fall.
        air: wind and density.
        mass: kg.
        drag_area: C_D A, m2.
        h: step of the integration, s.
    """
    place, velocity = states.place.copy(), states.velocity.copy()
    time = np.zeros(len(place))
    falling = np.flatnonzero(place[:, 2] > 0.0)

    def rates(y: Array) -> Array:
        wind = air.wind(y[:, 2])
        flow = y[:, 3:] - np.concatenate([wind, np.zeros((len(y), 1))], axis=1)
        rho = np.interp(y[:, 2], air.height, air.density)
        slowing = 0.5 * drag_area / mass * rho * np.linalg.norm(flow, axis=1)
        return np.concatenate([y[:, 3:], -slowing[:, None] * flow - [0.0, 0.0, g0]], axis=1)

    while len(falling) and time[falling].max() < FALL_TIME_MAX:
        y = np.concatenate([place[falling], velocity[falling]], axis=1)
        k1 = rates(y)
        k2 = rates(y + 0.5 * h * k1)
        k3 = rates(y + 0.5 * h * k2)
        k4 = rates(y + h * k3)
        end = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        share = np.ones(len(y))
        landing = end[:, 2] <= 0.0
        share[landing] = _crossing(y[landing], end[landing], h)
        s = share[:, None]
        place[falling] = _hermite(y[:, :3], end[:, :3], h * y[:, 3:], h * end[:, 3:], s)
        velocity[falling] = _hermite(y[:, 3:], end[:, 3:], h * k1[:, 3:], h * rates(end)[:, 3:], s)
        time[falling] += h * share
        falling = falling[~landing]
    return Impacts(place[:, :2], time, np.linalg.norm(velocity, axis=1))


def _crossing(begin: Array, end: Array, h: float) -> Array:
    """Return the share of a step after which the ground is met, by bisection."""
    low, high = np.zeros(len(begin)), np.ones(len(begin))
    for _ in range(40):  # to the last digits
        middle = 0.5 * (low + high)
        above = _hermite(begin[:, 2], end[:, 2], h * begin[:, 5], h * end[:, 5], middle) > 0.0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return high


def _hermite(a: Array, b: Array, slope_a: Array, slope_b: Array, s: Array) -> Array:
    """Return the cubic with given values and slopes at 0 and 1."""
    return (
        a * (1.0 + 2.0 * s) * (1.0 - s) ** 2
        + b * s**2 * (3.0 - 2.0 * s)
        + slope_a * s * (1.0 - s) ** 2
        - slope_b * s**2 * (1.0 - s)
    )


TURN, HEADINGS = math.pi, 37
"""The largest turn of a glide to either side, rad: a pilot turns back at most; and how many turns, an odd number: they
are 10 degrees apart."""


@dataclass(frozen=True)
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


@dataclass(frozen=True, eq=False)
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


def reach(states: States, air: AirColumn, glide: Glide) -> Reach:
    """Return where the aircraft can touch down when its power is gone.

    Args:
        states: of the instants at which it is lost.
        air: the wind; that at half the height displaces the glide.
        glide: the best one of the aircraft.
    """
    height, place = states.place[:, 2], states.place[:, :2]
    flow = states.velocity - np.pad(air.wind(states.place[:, 2]), ((0, 0), (0, 1)))
    energy = np.maximum(height + (np.sum(flow**2, axis=1) - glide.speed**2) / (2.0 * g0), 0.0)
    drift = air.wind(0.5 * np.maximum(height, 0.0))[:, None]
    course = np.arctan2(flow[:, 1], flow[:, 0])[:, None]
    most = energy[:, None] / glide.turn_loss
    turn = np.clip(np.linspace(-TURN, TURN, HEADINGS), -most, most)
    way = glide.ratio * np.maximum(energy[:, None] - glide.turn_loss * np.abs(turn), 0.0)
    along = glide.radius * np.sin(np.abs(turn)) + way * np.cos(turn)
    across = np.sign(turn) * glide.radius * (1.0 - np.cos(turn)) + way * np.sin(turn)
    seconds = glide.radius * np.abs(turn) / (2.0**0.25 * glide.speed) + way / glide.speed
    north = along * np.cos(course) - across * np.sin(course)
    east = along * np.sin(course) + across * np.cos(course)
    turned = place[:, None] + np.stack([north, east], axis=-1) + seconds[..., None] * drift
    return Reach(turned[:, HEADINGS // 2], turned, glide.ratio * energy)
