"""The aircraft with six degrees of freedom and what disturbs it, evaluated for many flights at once.

The equations are those of `airrace.dynamics.six_dof`, with a wind on top of that of the day, and with mass, power and
density off by a share. Disturbances follow the controls in one array, so that every flight has its own.
"""

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from airrace.aircraft import InnerLoopParameters
from airrace.dynamics.aerodynamics import airflow
from airrace.dynamics.limits import SurfaceControl
from airrace.dynamics.six_dof import SixDofState, build_six_dof, six_dof
from airrace.environment import AtmosphereParameters, Weather, WindField
from airrace.frames import Scalar, rotation
from airrace.optimal_control.replay import function_at_points
from airrace.optimal_control.runge_kutta import RK4
from airrace.planning.plan import Race
from airrace.quantities import T, Vector, quantity, vector
from airrace.records import record
from airrace.system import System, column, named_symbols
from airrace.trajectory import Array


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
        return [one + more for one, more in zip(super().velocity(x, y, z, p[:-3]), p[-3:], strict=True)]


@record
class Plant:
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
    def of(cls, race: Race) -> "Plant":
        """Return the aircraft of a race.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        model = build_six_dof(race.aircraft, race.course.rules, race.air)
        field = WindField.of(race.air)
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
        return [one.name for one in self.system.path].index(name)


def advance(rates: Callable[[Array], Array], state: Array, seconds: float) -> Array:
    """Return the states (17, n) after one step of the classical scheme, attitudes of unit length."""
    end: Array = RK4.advance(lambda x, _, __: rates(x), state, None, None, seconds)
    end[4:8] /= np.sqrt(np.sum(end[4:8] * end[4:8], axis=0))
    return end


@functools.lru_cache(maxsize=8)
def _functions(profile: Any, thermals: int) -> tuple[ca.Function, ca.Function, ca.Function]:  # Any: a profile or None
    plain, field = WindField(profile, thermals), _DisturbedField(profile, thermals)
    x, u, d = (named_symbols(one.quantities()) for one in (SixDofState, SurfaceControl, Disturbance))
    declared = (*InnerLoopParameters.quantities(), *AtmosphereParameters.quantities(), *plain.parameters)
    p = named_symbols(declared)
    aircraft = InnerLoopParameters[Scalar](**{name: p[name] for name in InnerLoopParameters.names()})
    aircraft = replace(aircraft, m=aircraft.m * (1.0 + d["mass"]), P=aircraft.P * (1.0 + d["power"]))
    atmosphere = AtmosphereParameters[Scalar](**{name: p[name] for name in AtmosphereParameters.names()})
    atmosphere = replace(atmosphere, p_0=atmosphere.p_0 * (1.0 + d["density"]))
    wind = [*(p[one.name] for one in plain.parameters), d["W_N"], d["W_E"], d["W_D"]]
    state, weather = SixDofState[Scalar](**x), Weather(atmosphere, field, wind)
    rates, path = six_dof(state, SurfaceControl[Scalar](**u), aircraft=aircraft, weather=weather)
    arguments = [column(x.values()), column([*u.values(), *d.values()]), column(p.values())]
    return (
        ca.Function("disturbed_rates", arguments, [column(rates.join())], {"cse": True}),
        ca.Function("disturbed_path", arguments, [column(path.join())], {"cse": True}),
        ca.Function("disturbed_airspeed", arguments, [airflow(state, rotation(state.q), weather).V_A], {"cse": True}),
    )
