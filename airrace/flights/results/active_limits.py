"""The limits that a flight reaches: which of them, for how long, and on which leg for longest.

A solver ends on the inner side of a bound, by far less than anything that is measured; what is within a thousandth of
a quantity's scale of its bound counts as at it. How much a limit costs is another question, which
`airrace.flights.sensitivity` answers.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from airrace.flights.results.clearances import distances, least_of_all
from airrace.flights.results.flight import Flight, legs_of, passings_around
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array

NEAR = 1e-3
"""The distance from a bound within which a value counts as at it, in scales of its quantity."""
TOUCHED = 0.02
"""The margin within which a distance counts as reached, m: twice the length by which certificates let it be missed."""
SHORTEST = 0.01
"""The share of the race below which a limit of a history is left out, as of rolls that only begin at it."""
REDUNDANT = frozenset({"z", "height", "delta_T_cmd"})
"""Histories whose limits appear elsewhere: as distances from floor and ceiling, and as that of the throttle."""

LOAD_FACTORS = frozenset({"n_z", "n_y", "n_z_cmd", "n_y_cmd"})
"""Histories whose values people give in g."""


@dataclass(frozen=True)
class ActiveLimit:
    """A limit that a flight reaches.

    Attributes:
        text: what is limited, in words, e.g. `load factor`, or what is kept away from, e.g. `pylon g3`.
        unit: of the value, SI and radians; g for load factors.
        value: the limit, or the required distance; of floor and ceiling their height.
        duration: how long the flight keeps to it, s; of a distance NaN, for it is reached at instants.
        leg: the leg on which it does for longest, by the name of the passing that this ends in.
    """

    text: str
    unit: str
    value: float
    duration: float
    leg: str


def active_limits(flight: Flight) -> tuple[ActiveLimit, ...]:
    """Return the limits that a flight reaches: those of histories, the longest first, then those of distances.

    A flight that misses a passing reaches none, for it is no optimum.
    """
    if not all(crossing.found for crossing in flight.crossings):
        return ()
    limits = sorted(_limits_of_histories(flight), key=lambda limit: -limit.duration)
    clearances = least_of_all(flight, distances(flight))
    height = flight.course.rules.height
    values = {"floor": height.lower, "ceiling": height.upper}
    for clearance in sorted(clearances, key=lambda clearance: clearance.margin):
        if clearance.margin <= TOUCHED:
            value = values.get(clearance.kind, clearance.required)
            leg = passings_around(flight, clearance.time)[1].name
            limits.append(ActiveLimit(clearance.text, "m", value, math.nan, leg))
    return tuple(limits)


def _limits_of_histories(flight: Flight) -> Iterator[ActiveLimit]:
    """Yield the limits of histories that are kept to for long enough, each bound by itself.

    Bounds of the same size to both sides are one limit: how far the stick goes to either side.
    """
    for name, history in flight.histories.items():
        quantity = history.quantity
        if name in REDUNDANT or name.startswith("distance_") or quantity.rate_of:
            continue
        for bound, values in _bounds(quantity, history.values):
            weights = _durations(flight.time) * (np.abs(values - bound) <= NEAR * quantity.scale)
            total = float(weights.sum())
            if total >= SHORTEST * flight.race_time:
                longest = max(legs_of(flight), key=lambda leg: float(weights[leg.rows].sum()))
                text, unit = quantity.text.partition(",")[0] or name, quantity.unit
                yield ActiveLimit(text, "g" if name in LOAD_FACTORS else unit, bound, total, longest.name)


def _bounds(quantity: Quantity, values: Array) -> Iterator[tuple[float, Array]]:
    """Yield the finite bounds of a quantity, each with the values to compare with it."""
    if math.isfinite(quantity.upper) and quantity.lower == -quantity.upper:
        yield quantity.upper, np.abs(values)
        return
    for bound in (quantity.lower, quantity.upper):
        if math.isfinite(bound):
            yield bound, values


def _durations(time: Array) -> Array:
    """Return the time that each of the instants stands for, half of the steps beside it, s, shape (n,)."""
    steps = np.diff(time)
    return 0.5 * (np.append(steps, 0.0) + np.insert(steps, 0, 0.0))
