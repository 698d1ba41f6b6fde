"""The derivation of what follows from the given histories of a flight: heights, airspeeds, angles and attitudes.

Each rule says what it needs and what it gives. A rule is followed where all it needs is there, and what a source has
stored itself is never computed again; so a recording of positions and speeds gets airspeeds, and an optimum attitudes.
"""

import functools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from airrace.flights.results import attitude
from airrace.flights.results.flight import (
    BODY_ATTITUDE,
    GLOSSARY,
    Basis,
    Flight,
    Histories,
    History,
    Source,
    TimedCrossing,
)
from airrace.model.dynamics.limits import Limits, flight_limits
from airrace.model.environment import (
    Air,
    WindField,
    atmosphere_parameters,
    calibrated_airspeed,
    density,
    g0,
    pressure,
)
from airrace.model.frames import QUATERNION
from airrace.model.track.course import geodetic
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.system import at_points, column, named_symbols
from airrace.optimal_control.trajectory import Array
from airrace.procedure import stored_stages
from airrace.procedure.result import StageResult
from airrace.race import Race

Values = Mapping[str, Array]
"""Histories by name, SI units and radians, each of shape (n,)."""


@dataclass(frozen=True, eq=False)
class Rule:
    """One derivation.

    Attributes:
        needs: names of the histories that it starts from.
        gives: names of those that it yields, in the order in which `derive` returns them.
        derive: from the race and the histories by name to the new ones, each of shape (n,).
        applies: whether it makes sense in a race at all.
    """

    needs: tuple[str, ...]
    gives: tuple[str, ...]
    derive: Callable[[Race, Values], Sequence[Array]]
    applies: Callable[[Race], bool] = lambda _: True


def complete_histories(race: Race, histories: Histories) -> Histories:
    """Return the histories of a flight with all that follows from them.

    Args:
        race: course, aircraft and air.
        histories: over one time axis.
    """
    complete = dict(histories)
    for rule in RULES:
        missing = [name for name in rule.gives if name not in complete]
        if not missing or not rule.applies(race) or any(name not in complete for name in rule.needs):
            continue
        values = rule.derive(race, {name: history.values for name, history in complete.items()})
        for name, value in zip(rule.gives, values, strict=True):
            if name in missing:
                complete[name] = History(GLOSSARY[name], np.asarray(value), Basis.DERIVED)
    return _with_limits(complete, flight_limits(race.aircraft, race.course.rules))


def table_columns(race: Race, names: Collection[str]) -> Mapping[Quantity, Callable[[Values], Array]]:
    """Return what tables of a flight hold besides its states: airspeeds, and where it is on the globe.

    Args:
        race: course, aircraft and air.
        names: of the states that the flight has.

    Returns:
        Declarations, each with a function of the named histories of the states, of shape (n,) -> (n,); none where
        nothing follows from these states.
    """
    needed = ("x", "y", "z", "V_K", *QUATERNION)
    if not set(needed) <= set(names):
        return {}
    columns = ("V_A", "V_I", *(("latitude", "longitude") if race.course.origin.has_coordinates else ()))

    def column(name: str) -> Callable[[Values], Array]:
        def values(samples: Values) -> Array:
            states = {state: History(Quantity(state, ""), samples[state], Basis.SOLVED) for state in needed}
            return complete_histories(race, states)[name].values

        return values

    return {GLOSSARY[name]: column(name) for name in columns}


def _with_limits(histories: Histories, limits: Limits) -> Histories:
    """Return the histories with the bounds that aircraft and rules set, where a source has brought none of its own."""
    bounds = {
        "height": Interval(-limits.z.upper, -limits.z.lower),
        "V_K": limits.V_K,
        "n_z": limits.n_z,
        "p_Kbar": limits.p_Kbar,
        "C_L": limits.C_L,
        "beta_A": limits.beta_A,
    }
    bounded = dict(histories)
    for name in bounds.keys() & histories.keys():
        quantity = histories[name].quantity
        if not Interval(quantity.lower, quantity.upper).constrained:
            quantity = replace(quantity, lower=bounds[name].lower, upper=bounds[name].upper)
            bounded[name] = replace(histories[name], quantity=quantity)
    return bounded


def wind_along(air: Air, x: Array, y: Array, z: Array) -> Array:
    """Return the north, east and down components of the wind at places of the track's frame (m), shape (3, n), m/s."""
    field = WindField.from_air(air)
    if not field.present:
        return np.zeros((3, len(x)))
    return at_points(_wind_function(field), np.stack([x, y, z]), np.array(field.values(air)))


def indicated_airspeed(V_A: Array, z: Array, air: Air) -> Array:
    """Return what an airspeed indicator without errors shows (calibrated airspeed), m/s, shape (n,).

    Args:
        V_A: true airspeed, m/s.
        z: down from the track's origin, m.
        air: of the day.
    """
    day = atmosphere_parameters(air)
    p, rho = (np.asarray(law(z, day), np.float64).reshape(z.shape) for law in (pressure, density))
    return np.asarray(calibrated_airspeed(V_A, p, rho), np.float64)


@functools.lru_cache(maxsize=16)
def _wind_function(field: WindField) -> ca.Function:
    place = named_symbols([Quantity(name, "m") for name in ("x", "y", "z")])
    numbers = named_symbols(field.parameters)
    velocity = field.velocity(place["x"], place["y"], place["z"], list(numbers.values()))
    return ca.Function("wind", [column(place.values()), column(numbers.values())], [column(velocity)], {"cse": True})


def _R_OKbar(samples: Values) -> attitude.Axes:
    return attitude.path_axes([samples[name] for name in QUATERNION])


def _velocity_in_air(race: Race, samples: Values) -> Array:
    """Return the velocity relative to the air, components in O, m/s, shape (3, n)."""
    chi, gamma = samples["chi"], samples["gamma"]
    e = np.stack([np.cos(gamma) * np.cos(chi), np.cos(gamma) * np.sin(chi), -np.sin(gamma)])
    return samples["V_K"] * e - wind_along(race.air, samples["x"], samples["y"], samples["z"])


def _attitude_from_air(race: Race, samples: Values) -> Sequence[Array]:
    R_OA = attitude.air_axes(_R_OKbar(samples), _velocity_in_air(race, samples))
    return attitude.quaternions(attitude.body_axes(R_OA, samples["alpha_A"], samples["beta_A"]))


_PATH = ("x", "y", "z", "V_K", "chi", "gamma")

RULES = (
    Rule(("height",), ("z",), lambda _, samples: (-samples["height"],)),
    Rule(("z",), ("height",), lambda _, samples: (-samples["z"],)),
    Rule(("height",), ("altitude",), lambda race, samples: (samples["height"] + race.course.origin.elevation,)),
    Rule(
        ("x", "y"),
        ("latitude", "longitude"),
        lambda race, samples: geodetic(samples["x"], samples["y"], race.course.origin),
        lambda race: race.course.origin.has_coordinates,
    ),
    Rule(("height", "V_K"), ("h_E",), lambda _, samples: (samples["height"] + samples["V_K"] ** 2 / (2.0 * g0),)),
    Rule(QUATERNION, ("chi", "gamma", "mu"), lambda _, samples: attitude.euler_angles(_R_OKbar(samples))),
    Rule(_PATH, ("V_A",), lambda race, samples: (np.linalg.norm(_velocity_in_air(race, samples), axis=0),)),
    Rule(
        ("V_A", "z"),
        ("V_I",),
        lambda race, samples: (indicated_airspeed(samples["V_A"], samples["z"], race.air),),
    ),
    Rule(
        ("C_L",),
        ("alpha_A",),
        lambda race, samples: (attitude.angle_of_attack(samples["C_L"], race.aircraft.lift),),
    ),
    Rule(
        (*QUATERNION, "alpha_K", "beta_K"),
        BODY_ATTITUDE,
        lambda _, samples: attitude.quaternions(
            attitude.body_axes(_R_OKbar(samples), samples["alpha_K"], samples["beta_K"])
        ),
    ),
    Rule((*_PATH, *QUATERNION, "alpha_A", "beta_A"), BODY_ATTITUDE, _attitude_from_air),
    Rule(QUATERNION, BODY_ATTITUDE, lambda _, samples: [samples[name] for name in QUATERNION]),
    Rule(
        BODY_ATTITUDE,
        ("psi", "theta", "phi"),
        lambda _, samples: attitude.euler_angles(attitude.path_axes([samples[name] for name in BODY_ATTITUDE])),
    ),
)
"""The rules in the order in which they are followed: a later one may need what an earlier one gives.

A source that knows no angles of the flow has the attitude of its path as that of the body.
"""
LONGEST_STEP = 0.02
"""The longest time between two samples, s.

At 10 g a straight line cuts a corner by `a t^2 / 8`, which is 5 mm; at 6 rad/s the attitude turns by 7 degrees.
"""


def flight_of(race: Race, result: StageResult, source: Source) -> Flight:
    """Return the optimum of a stage as a flight; its time axis holds the nodes of the mesh, and so all crossings.

    Args:
        race: course, aircraft and air.
        result: a stage that found a flight.
        source: what it is called.
    """
    read = stored_stages.continuous(race, result, LONGEST_STEP)
    stored = {quantity.name: History(quantity, values, Basis.SOLVED) for quantity, values in read.solved.items()}
    stored |= {quantity.name: History(quantity, values, Basis.DERIVED) for quantity, values in read.derived.items()}
    histories = complete_histories(race, stored)
    crossings: list[TimedCrossing] = []
    nodes = result.trajectory.first_node.tolist()
    for passage, node in zip(race.course.passages, nodes, strict=True):
        time = float(result.trajectory.time[node])
        row = int(np.searchsorted(read.time, time))
        crossings.append(
            TimedCrossing(passage, time, {name: float(history.values[row]) for name, history in histories.items()})
        )
    return Flight(race, source, read.time, histories, tuple(crossings))
