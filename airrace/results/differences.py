"""The differences between two flights on the same leg, in words and numbers."""

import math
from collections.abc import Callable

import numpy as np

from airrace.quantities import KNOT
from airrace.records import record
from airrace.results.flight import Flight
from airrace.results.history import Basis
from airrace.results.legs import Leg, way

ROLLING = 1.0
"""The roll rate from which the aircraft is said to roll, rad/s."""
MOST = 4
"""The greatest number of differences that are told of one leg."""


@record
class Difference:
    """One thing that two flights do otherwise on a leg.

    Attributes:
        name: what it is, e.g. `roll_begins`.
        reference, other: its values in the one and in the other flight.
        unit: of both.
        text: the difference in words, said of the other flight, e.g. "rolls 0.06 s later".
        weight: the difference over the least that is worth telling; at least 1.
    """

    name: str
    reference: float
    other: float
    unit: str
    text: str
    weight: float


@record
class Measure:
    """The way in which one thing is measured on a leg.

    Attributes:
        name: of the difference.
        of: from a flight and its leg to the value; NaN where it cannot be told.
        unit: of the value.
        least: the smallest difference worth telling, in that unit.
        more, less: what is said of a flight whose value is larger or smaller; `{}` stands for the difference.
        digits: decimals of the difference in words.
        most: a larger difference is not told: something else has been measured in the one flight than in the other.
    """

    name: str
    of: Callable[[Flight, Leg], float]
    unit: str
    least: float
    more: str
    less: str
    digits: int
    most: float = math.inf


def differences(reference: Flight, before: Leg, other: Flight, after: Leg) -> tuple[Difference, ...]:
    """Return what the other flight does otherwise on a leg that both have flown; the most telling first, at most
    `MOST`.

    Args:
        reference, before: the flight that is compared with, and its leg.
        other, after: the flight that is told of, and the same leg of it.
    """
    told: list[Difference] = []
    for measure in MEASURES:
        first, second = measure.of(reference, before), measure.of(other, after)
        apart = abs(second - first)
        if not measure.least <= apart <= measure.most:  # NaN is no difference
            continue
        words = measure.more if second > first else measure.less
        text = words.format(f"{apart:.{measure.digits}f}")
        told.append(Difference(measure.name, first, second, measure.unit, text, apart / measure.least))
    return tuple(sorted(told, key=lambda one: -one.weight)[:MOST])


def _roll_begins(flight: Flight, leg: Leg) -> float:
    """Return when the aircraft first rolls fast, s after the passing that begins the leg; NaN where it never does."""
    rolling = np.abs(flight.values("p_Kbar")[leg.rows]) >= ROLLING
    if not rolling.any():
        return math.nan
    return float(flight.time[leg.rows][int(np.argmax(rolling))]) - leg.before.time


def _way(flight: Flight, leg: Leg) -> float:
    """Return the length of the way flown on the leg, m."""
    return float(way(flight, leg)[-1])


def _highest(flight: Flight, leg: Leg) -> float:
    return float(flight.values("height")[leg.rows].max())


def _mean_load_factor(flight: Flight, leg: Leg) -> float:
    time, n_z = flight.time[leg.rows], flight.values("n_z")[leg.rows]
    return float(np.sum(0.5 * (n_z[1:] + n_z[:-1]) * np.diff(time)) / (time[-1] - time[0]))


def _greatest_load_factor(flight: Flight, leg: Leg) -> float:
    """Return the greatest load factor, g; NaN where it is derived from a recording, for that flattens its peaks."""
    if not flight.source.stage and "n_z" in flight and flight.basis("n_z") is Basis.DERIVED:
        return math.nan
    return float(flight.values("n_z")[leg.rows].max())


def _entry_speed(flight: Flight, leg: Leg) -> float:
    """Return the speed over ground at the passing that begins the leg, kt."""
    return leg.before.value("V_K") / KNOT


def _slowest(flight: Flight, leg: Leg) -> float:
    """Return the least speed over ground on the leg, kt."""
    return float(flight.values("V_K")[leg.rows].min()) / KNOT


def _energy_lost(flight: Flight, leg: Leg) -> float:
    """Return the energy height that is lost from the beginning of the leg to its end, m."""
    return leg.before.value("h_E") - leg.after.value("h_E")


MEASURES = (
    Measure("roll_begins", _roll_begins, "s", 0.02, "rolls {} s later", "rolls {} s earlier", 2, most=1.0),
    Measure("speed_in", _entry_speed, "kt", 0.5, "{} kt faster in", "{} kt slower in", 1),
    Measure("least_speed", _slowest, "kt", 1.0, "slowest {} kt faster", "slowest {} kt slower", 1),
    Measure("way", _way, "m", 1.0, "{} m longer way", "{} m shorter way", 0),
    Measure("greatest_height", _highest, "m", 1.0, "{} m higher", "{} m lower", 0),
    Measure("mean_load_factor", _mean_load_factor, "g", 0.1, "{} g more on average", "{} g less on average", 1),
    Measure("greatest_load_factor", _greatest_load_factor, "g", 0.2, "pulls {} g more", "pulls {} g less", 1),
    Measure("energy_lost", _energy_lost, "m", 3.0, "loses {} m more energy", "loses {} m less energy", 0),
)
"""The measures that are taken on every leg."""
