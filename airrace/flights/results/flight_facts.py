"""Facts of a flight in numbers: its legs, and the load factors that it sustains for longer than pilots tolerate them.

Sustained load factors are a check of a flight and no limit. Their durations are those of the table of tolerances of
experienced persons in S. R. Mohler, *G effects on the pilot during aerobatics*, FAA-AM-72-28, July 1972; at 8 g it
names a blackout, at -3 g pain.
"""

import math
from dataclasses import dataclass

import numpy as np

from airrace.flights.results.clearances import Clearance, distances, least
from airrace.flights.results.flight import Flight, Leg, legs_of
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class Range:
    """The least and the greatest value on a leg; NaN where the flight does not have it."""

    least: float
    greatest: float


@dataclass(frozen=True)
class LegFacts:
    """One leg in numbers, SI units and radians.

    Attributes:
        leg: which one.
        n_z: load factor, g.
        height: above the track's origin, m.
        V_K, V_A, V_I: speed over ground, true and indicated airspeed, m/s.
        roll_rate: the greatest magnitude, about the velocity, rad/s.
        energy_in, energy_out: energy height at both ends, m.
        clearances: least distances on the leg, that with the least margin first.
    """

    leg: Leg
    n_z: Range
    height: Range
    V_K: Range
    V_A: Range
    V_I: Range
    roll_rate: float
    energy_in: float
    energy_out: float
    clearances: tuple[Clearance, ...]


def leg_facts(flight: Flight) -> tuple[LegFacts, ...]:
    """Return the facts of all legs in order; the ranges of an incomplete leg are NaN."""
    measured, facts = distances(flight), list[LegFacts]()
    for leg in legs_of(flight):
        n_z, height, V_K, V_A, V_I, roll = (
            _range(flight, leg, name) for name in ("n_z", "height", "V_K", "V_A", "V_I", "p_Kbar")
        )
        roll_rate, energies = max(-roll.least, roll.greatest), (leg.before.value("h_E"), leg.after.value("h_E"))
        clearances = least(flight, leg, measured) if leg.is_complete else ()
        facts.append(LegFacts(leg, n_z, height, V_K, V_A, V_I, roll_rate, *energies, clearances))
    return tuple(facts)


def _range(flight: Flight, leg: Leg, name: str) -> Range:
    values = flight.values(name)[leg.rows]
    finite = values[np.isfinite(values)]
    return Range(float(finite.min()), float(finite.max())) if len(finite) else Range(math.nan, math.nan)


LOADS_SOURCE = "FAA-AM-72-28"
TOLERATED_LOADS = ((8.0, 15.0), (6.0, 20.0), (5.0, 30.0), (4.0, 60.0), (-3.0, 30.0))
"""Load factors (g), and for how long each is tolerated (s)."""


@dataclass(frozen=True)
class SustainedLoad:
    """A load factor that is sustained for too long.

    Attributes:
        n_z: the load factor of the table, g; the flight's is as large or larger in magnitude throughout.
        begin: when that begins, s.
        duration: how long it lasts, s.
        tolerated: for how long it is tolerated, s.
    """

    n_z: float
    begin: float
    duration: float
    tolerated: float

    @property
    def text(self) -> str:
        """The finding as a clause."""
        beyond = "more" if self.n_z > 0.0 else "less"
        return (
            f"{self.n_z:g} g or {beyond} for {self.duration:.1f} s from {self.begin:.2f} s on; experienced pilots "
            f"tolerate that for {self.tolerated:g} s ({LOADS_SOURCE})"
        )


def sustained_loads(flight: Flight) -> tuple[SustainedLoad, ...]:
    """Return the load factors of the table that a flight sustains for longer than is tolerated; most are none."""
    if "n_z" not in flight or len(flight.time) < 2:
        return ()
    return sustained(flight.time, flight["n_z"])


def sustained(time: Array, n_z: Array) -> tuple[SustainedLoad, ...]:
    """Return what is sustained too long of a load factor (g) at times (s), linear between them; both of shape (n,).

    A time at which nothing is known ends a stretch.
    """
    loads: list[SustainedLoad] = []
    for level, tolerated in TOLERATED_LOADS:
        begin, duration = longest_stretch(time, np.sign(level) * n_z, abs(level))
        if duration > tolerated:
            loads.append(SustainedLoad(level, begin, duration, tolerated))
    return tuple(loads)


def longest_stretch(time: Array, values: Array, level: float) -> tuple[float, float]:
    """Return when the longest stretch with values of at least a level begins, and how long it lasts, s."""
    over = np.isfinite(values) & (np.nan_to_num(values, nan=-np.inf) >= level)
    turns = np.flatnonzero(np.diff(np.concatenate([[False], over, [False]]).astype(np.int8)))
    best = (float(time[0]), 0.0)
    for first, end in turns.reshape(-1, 2).tolist():
        begin = _crossing(time, values, level, first - 1, first)
        duration = _crossing(time, values, level, end, end - 1) - begin
        best = max(best, (begin, duration), key=lambda stretch: stretch[1])
    return best


def _crossing(time: Array, values: Array, level: float, outside: int, inside: int) -> float:
    """Return when values cross a level between two neighbours; the one inside where nothing is known outside."""
    if not 0 <= outside < len(time) or not np.isfinite(values[outside]):
        return float(time[inside])
    share = (level - values[inside]) / (values[outside] - values[inside])
    return float(time[inside] + share * (time[outside] - time[inside]))
