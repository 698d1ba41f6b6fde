"""The airspeed at one instant, true or indicated, as an observation of the states."""

import functools

import casadi as ca

from airrace.dynamics.aerodynamics import wind_airflow
from airrace.dynamics.outer_loop import ATTITUDE
from airrace.environment.air import Air
from airrace.environment.atmosphere import (
    AtmosphereParameters,
    atmosphere_parameters,
    calibrated_airspeed,
    density,
    pressure,
)
from airrace.environment.wind import WindField
from airrace.frames import Scalar, rotation
from airrace.quantities import Quantity
from airrace.system import Observation, column, named_symbols

AIRSPEED = Quantity("airspeed", "m/s", scale=50.0, text="airspeed")


@functools.lru_cache(maxsize=32)
def airspeed_observation(states: tuple[Quantity, ...], field: WindField, *, indicated: bool) -> Observation:
    """Return the observation for a model whose states include `x, y, z, V_K, q0, q1, q2, q3`.

    Its parameters are those of the atmosphere and of the wind, see `airspeed_values`.
    """
    declared = (*AtmosphereParameters.quantities(), *field.parameters)
    x, b = named_symbols(states), named_symbols(declared)
    numbers = list(b.values())
    air = AtmosphereParameters[Scalar].split(numbers[: AtmosphereParameters.size()])
    wind = field.velocity(x["x"], x["y"], x["z"], numbers[AtmosphereParameters.size() :])
    V_A = wind_airflow(x["V_K"], rotation([x[name] for name in ATTITUDE]), wind).V_A
    speed = calibrated_airspeed(V_A, pressure(x["z"], air), density(x["z"], air)) if indicated else V_A
    function = ca.Function("airspeed", [column(x.values()), column(numbers)], [column([speed])], {"cse": True})
    return Observation("airspeed", (AIRSPEED,), declared, function)


def airspeed_values(air: Air) -> tuple[float, ...]:
    """Return the values of the parameters of `airspeed_observation` in the air of a day."""
    return (*atmosphere_parameters(air).join(), *WindField.of(air).values(air))
