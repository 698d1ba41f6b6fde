"""Legs and laps of a flight: from passing to passing, and from lap to lap."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from airrace.records import record
from airrace.results.flight import Flight, TimedCrossing
from airrace.trajectory import Array


@record
class Leg:
    """The part of a flight from one passing to the next.

    Attributes:
        number: counts from 1; leg `i` ends in passing `i`.
        before, after: the passings at its ends.
        rows: indices into the flight's time axis of the times from end to end, both included, shape (m,); empty where
            one of the passings is missing.
    """

    number: int
    before: TimedCrossing
    after: TimedCrossing
    rows: NDArray[np.int64]

    @property
    def name(self) -> str:
        """The name of the passing that it ends in."""
        return self.after.name

    @property
    def lap(self) -> int:
        """The lap that it belongs to."""
        return self.after.lap

    @property
    def time(self) -> float:
        """The time that the leg takes, s; NaN where one of the passings is missing."""
        return self.after.time - self.before.time

    @property
    def is_complete(self) -> bool:
        """Whether both passings were made."""
        return math.isfinite(self.time)


@record
class Lap:
    """One lap: from the last passing before it to its own last one.

    Attributes:
        number: counts from 1.
        legs: of it, in order.
    """

    number: int
    legs: tuple[Leg, ...]

    @property
    def time(self) -> float:
        """The time that the lap takes, s; NaN where its first or its last passing is missing."""
        return self.legs[-1].after.time - self.legs[0].before.time


def legs_of(flight: Flight) -> tuple[Leg, ...]:
    """Return all legs in order, also incomplete ones."""
    pairs = itertools.pairwise(flight.crossings)
    return tuple(_leg(flight, number, *pair) for number, pair in enumerate(pairs, start=1))


def laps_of(flight: Flight) -> tuple[Lap, ...]:
    """Return all laps in order; a single one where the course has no laps."""
    grouped = itertools.groupby(legs_of(flight), key=lambda leg: leg.lap)
    return tuple(Lap(number, tuple(legs)) for number, legs in grouped)


def passings_around(flight: Flight, time: float) -> tuple[TimedCrossing, TimedCrossing]:
    """Return the passings between which a time (s) lies, of a flight that has made them all."""
    last = int(np.searchsorted([one.time for one in flight.crossings], time, "right")) - 1
    last = min(max(last, 0), len(flight.crossings) - 2)
    return flight.crossings[last], flight.crossings[last + 1]


def way(flight: Flight, leg: Leg) -> Array:
    """Return the distance from the start of a leg, at its rows, m, shape (m,)."""
    places = np.stack([flight[name][leg.rows] for name in ("x", "y", "z")])
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=1), axis=0))])


def _leg(flight: Flight, number: int, before: TimedCrossing, after: TimedCrossing) -> Leg:
    if not before.found or not after.found:
        return Leg(number, before, after, np.zeros(0, np.int64))
    first, end = np.searchsorted(flight.time, before.time), np.searchsorted(flight.time, after.time, "right")
    return Leg(number, before, after, np.arange(first, end))
