"""How far one flight is behind another, place by place along the course.

Places are compared leg by leg: a place is the passing that was made last and the share of the way to the next one that
has been flown since. So the difference of time at a passing is the difference of the times of that passing, and between
them it is continuous, however much wider one of the two flights goes.
"""

import math
from collections.abc import Sequence

import numpy as np

from airrace.errors import UsageError
from airrace.flights import Flight
from airrace.report.contents import Difference
from airrace.trajectory import Array


def differences_of(flights: Sequence[Flight]) -> list[Difference]:
    """Of all other flights to the first.

    Raises:
        UsageError: a flight is of a course with other passings.
    """
    return [_difference(flights[0], flight, number) for number, flight in enumerate(flights[1:], start=1)]


def behind(first: Flight, other: Flight) -> tuple[Array, Array]:
    """Times of the first flight (s, shape (n,)), and how much later the other one was at the same places (s).

    Times lie between the first and the last passing that both flights have made, and the start counts as no time lost.

    Raises:
        UsageError: the flights have other passings, or fewer than two of them in common.
    """
    pairs = list(zip(first.crossings, other.crossings, strict=False))
    if [one.name for one in first.crossings] != [one.name for one in other.crossings]:
        raise UsageError(f"{other.label} has other passings than {first.label}")
    made = [(one.time, two.time) for one, two in pairs if math.isfinite(one.time) and math.isfinite(two.time)]
    if len(made) < 2:
        raise UsageError(f"{other.label} and {first.label} have fewer than two passings in common")
    at_first = np.array([one for one, _ in made])
    at_other = np.array([two for _, two in made])
    inside = first.time[(first.time > at_first[0]) & (first.time < at_first[-1])]
    time = np.unique(np.concatenate([inside, at_first]))
    way, other_way = _way(first), _way(other)
    # Of both flights the way up to every passing; between passings one is stretched to the length of the other.
    flown = np.interp(time, first.time, way)
    knots = np.interp(at_first, first.time, way)
    other_knots = np.interp(at_other, other.time, other_way)
    there = np.interp(np.interp(flown, knots, other_knots), other_way, other.time)
    return time, (there - at_other[0]) - (time - at_first[0])


def started(flight: Flight) -> float:
    """When the clock of a flight starts, s: at its first passing, or where that is missing at its first time."""
    found = flight.crossings and flight.crossings[0].found
    return flight.crossings[0].time if found else float(flight.time[0])


def _difference(first: Flight, other: Flight, number: int) -> Difference:
    time, later = behind(first, other)
    return Difference(number, time - started(first), later)


def _way(flight: Flight) -> Array:
    """The way flown up to every time, m."""
    steps = np.diff(np.stack([flight["x"], flight["y"], flight["z"]]), axis=1)
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=0))])
