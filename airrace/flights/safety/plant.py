"""The aircraft with six degrees of freedom and what disturbs it, evaluated for many flights at once.

The equations are those of `airrace.model.dynamics.six_dof`, with a wind on top of that of the day, and with mass, power
and density off by a share. Disturbances follow the controls in one array, so that every flight has its own.

Gusts are those after Dryden at low altitude, MIL-F-8785C (1980), 3.7.3: forming filters, discretised exactly. At the
height h in feet (10 to 1000 ft) and with the wind W20 at 20 ft,

    sigma_w = 0.1 W20,   sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4
    L_w = h,             L_u = L_v = h / (0.177 + 0.000823 h)^1.2

u is along the course over ground, v to its right, w down. With T = L / V and the airspeed V, white noise of unit
density drives

    H_u = sigma_u sqrt(2 T_u) / (1 + T_u s)
    H_v = sigma_v sqrt(T_v) (1 + sqrt(3) T_v s) / (1 + T_v s)^2,   H_w alike

The states of the filters are scaled such that their stationary covariance does not depend on T: of the first order 1,
of the second I / 4, with the output (1, sqrt(3)). So they stay stationary where speed and height change.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from airrace.flights.safety.disturbances import Gusts
from airrace.model.aircraft import InnerLoopParameters
from airrace.model.dynamics.aerodynamics import airflow
from airrace.model.dynamics.limits import SurfaceControl
from airrace.model.dynamics.six_dof import SixDofState, build_six_dof, six_dof
from airrace.model.environment import AtmosphereParameters, Weather, WindField
from airrace.model.frames import rotation
from airrace.optimal_control.quantities import FOOT, Scalar, T, Vector, quantity, vector
from airrace.optimal_control.replay import function_at_points
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.system import System, column, named_symbols
from airrace.optimal_control.trajectory import Array
from airrace.race import Race


@vector
class Disturbance(Vector[T]):
    """What disturbs a flight at one instant; zero in the flight that was optimised."""

    W_N: T = quantity("m/s", text="wind besides that of the day, to the north")
    W_E: T = quantity("m/s", text="wind besides that of the day, to the east")
    W_D: T = quantity("m/s", text="wind besides that of the day, down")
    mass: T = quantity("1", text="share by which the mass is larger")
    power: T = quantity("1", text="share by which the power is larger")
    density: T = quantity("1", text="share by which pressure and density of the air are larger")


STATES, CONTROLS, DISTURBANCES = SixDofState.size(), SurfaceControl.size(), Disturbance.size()
STATE = {name: row for row, name in enumerate(SixDofState.names())}
"""The rows of the states by name."""


class _DisturbedField(WindField):
    """A wind field with one more wind, the last three of its parameters."""

    @property
    def present(self) -> bool:
        return True

    def velocity(self, x: Scalar, y: Scalar, z: Scalar, p: Any) -> list[Scalar]:  # Any: symbols
        return [
            component + disturbance
            for component, disturbance in zip(super().velocity(x, y, z, p[:-3]), p[-3:], strict=True)
        ]


@dataclass(frozen=True, eq=False)
class DisturbedPlant:
    """An aircraft in the air of a day, disturbed.

    Attributes:
        system: states, controls and their bounds, undisturbed.
        numbers: values of its parameters, shape (n_p,).
        rates, path, airspeed: SX functions (x, (u, d), p) -> x_dot, path quantities, m/s.
    """

    system: System
    numbers: Array
    rates: ca.Function
    path: ca.Function
    airspeed: ca.Function

    @classmethod
    def from_race(cls, race: Race) -> "DisturbedPlant":
        """Return the aircraft of a race.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        model = build_six_dof(race.aircraft, race.course.rules, race.air)
        field = WindField.from_air(race.air)
        return cls(model.system, model.parameter_values, *_functions(field.profile, field.thermals))

    def rates_of(self, inputs: Array) -> Callable[[Array], Array]:
        """Return the rates of states (17, n) with controls and disturbances (10, n), an array that may change."""
        return function_at_points(self.rates, inputs, self.numbers)

    def path_of(self, inputs: Array) -> Callable[[Array], Array]:
        """Return the path quantities of states (17, n), as `rates_of`."""
        return function_at_points(self.path, inputs, self.numbers)

    def airspeed_of(self, state: Array) -> Array:
        """Return the airspeeds (n,) of states (17, n), undisturbed, m/s."""
        inputs = np.zeros((CONTROLS + DISTURBANCES, state.shape[1]))
        return function_at_points(self.airspeed, inputs, self.numbers)(state)[0]

    def path_row(self, name: str) -> int:
        """Return the row of a path quantity."""
        return [quantity.name for quantity in self.system.path].index(name)


def advance(rates: Callable[[Array], Array], state: Array, seconds: float) -> Array:
    """Return the states (17, n) after one step of the classical scheme, attitudes of unit length."""
    end: Array = RK4.advance(lambda x, _, __: rates(x), state, None, None, seconds)
    end[4:8] /= np.sqrt(np.sum(end[4:8] * end[4:8], axis=0))
    return end


@functools.lru_cache(maxsize=8)
def _functions(profile: Any, thermals: int) -> tuple[ca.Function, ca.Function, ca.Function]:  # Any: a profile or None
    plain, field = WindField(profile, thermals), _DisturbedField(profile, thermals)
    x, u, d = (named_symbols(part.quantities()) for part in (SixDofState, SurfaceControl, Disturbance))
    declared = (*InnerLoopParameters.quantities(), *AtmosphereParameters.quantities(), *plain.parameters)
    p = named_symbols(declared)
    aircraft = InnerLoopParameters[Scalar](**{name: p[name] for name in InnerLoopParameters.names()})
    aircraft = replace(aircraft, m=aircraft.m * (1.0 + d["mass"]), P=aircraft.P * (1.0 + d["power"]))
    atmosphere = AtmosphereParameters[Scalar](**{name: p[name] for name in AtmosphereParameters.names()})
    atmosphere = replace(atmosphere, p_0=atmosphere.p_0 * (1.0 + d["density"]))
    wind = [*(p[parameter.name] for parameter in plain.parameters), d["W_N"], d["W_E"], d["W_D"]]
    state, weather = SixDofState[Scalar](**x), Weather(atmosphere, field, wind)
    rates, path = six_dof(state, SurfaceControl[Scalar](**u), aircraft=aircraft, weather=weather)
    arguments = [column(x.values()), column([*u.values(), *d.values()]), column(p.values())]
    return (
        ca.Function("disturbed_rates", arguments, [column(rates.join())], {"cse": True}),
        ca.Function("disturbed_path", arguments, [column(path.join())], {"cse": True}),
        ca.Function("disturbed_airspeed", arguments, [airflow(state, rotation(state.q), weather).V_A], {"cse": True}),
    )


GUST_STATES = 5
"""The number of states of the filters: one of u, two each of v and w."""
STATIONARY_GUSTS = np.diag([1.0, 0.25, 0.25, 0.25, 0.25])
"""The stationary covariance of these states."""


@dataclass(frozen=True, eq=False)
class GustFilter:
    """The filters along a flight, for N steps of equal time.

    Attributes:
        step: F of every step, shape (N, 5, 5).
        noise: a square root of the covariance of what a step adds, shape (N, 5, 5).
        output: standard deviations and shape: (u, v, w) of the states, m/s, shape (N, 3, 5).
    """

    step: Array
    noise: Array
    output: Array

    @classmethod
    def of(cls, gusts: Gusts, height: Array, speed: Array, seconds: float) -> "GustFilter":
        """Return the filters at heights (m) and airspeeds (m/s), each of shape (N,), for steps of so many seconds."""
        sigma, length = intensity(gusts, height)
        scaled = seconds * speed / length  # steps in units of T, shape (3, N)
        count = len(speed)
        step, noise, output = (np.zeros((count, rows, GUST_STATES)) for rows in (GUST_STATES, GUST_STATES, 3))
        step[:, 0, 0] = np.exp(-scaled[0])
        noise[:, 0, 0] = np.sqrt(-np.expm1(-2.0 * scaled[0]))
        output[:, 0, 0] = sigma[0]
        for axis, first in ((1, 1), (2, 3)):
            s = scaled[axis]
            block = np.exp(-s)[:, None, None] * np.moveaxis(np.array([[1.0 + s, s], [-s, 1.0 - s]]), 2, 0)
            part = slice(first, first + 2)
            step[:, part, part] = block
            noise[:, part, part] = np.linalg.cholesky(0.25 * (np.eye(2) - block @ np.swapaxes(block, 1, 2)))
            output[:, axis, part] = sigma[axis][:, None] * np.array([1.0, np.sqrt(3.0)])
        return cls(step, noise, output)

    def draw(self, generators: Sequence[np.random.Generator]) -> Array:
        """Return histories of (u, v, w), m/s, shape (N, 3, n), stationary from their start, one per generator."""
        count = len(self.step)
        white = np.stack([generator.standard_normal((count + 1, GUST_STATES)) for generator in generators], axis=2)
        state, velocity = np.sqrt(np.diag(STATIONARY_GUSTS))[:, None] * white[0], np.empty((count, 3, len(generators)))
        for k in range(count):
            velocity[k] = _times(self.output[k], state)
            state = _times(self.step[k], state) + _times(self.noise[k], white[k + 1])
        return velocity


def _times(matrix: Array, columns: Array) -> Array:
    """Return a product whose bits do not depend on the number of columns."""
    return np.sum(matrix[:, :, None] * columns, axis=1)


def intensity(gusts: Gusts, height: Array) -> tuple[Array, Array]:
    """Return standard deviations (m/s) and lengths (m) of u, v, w at heights (m); each of shape (3, n)."""
    h = np.clip(height / FOOT, 10.0, 1000.0)
    ratio, sigma = 0.177 + 0.000823 * h, 0.1 * gusts.wind_at_20_ft
    level, long = sigma / ratio**0.4, h * FOOT / ratio**1.2
    return np.stack([level, level, np.full_like(h, sigma)]), np.stack([long, long, h * FOOT])
