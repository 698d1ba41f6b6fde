"""The facts of every leg: time, load factors, heights, speeds, roll rate, energy, and clearances."""

import math

import numpy as np

from airrace.records import record
from airrace.results.clearances import Clearance, distances, least
from airrace.results.flight import Flight, Leg, legs_of


@record
class Range:
    """The least and the greatest value on a leg; NaN where the flight does not tell."""

    least: float
    greatest: float


@record
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
    known, found = distances(flight), list[LegFacts]()
    for leg in legs_of(flight):
        n_z, height, V_K, V_A, V_I, roll = (
            _range(flight, leg, name) for name in ("n_z", "height", "V_K", "V_A", "V_I", "p_Kbar")
        )
        roll_rate, energies = max(-roll.least, roll.greatest), (leg.before.value("h_E"), leg.after.value("h_E"))
        clearances = least(flight, leg, known) if leg.is_complete else ()
        found.append(LegFacts(leg, n_z, height, V_K, V_A, V_I, roll_rate, *energies, clearances))
    return tuple(found)


def _range(flight: Flight, leg: Leg, name: str) -> Range:
    values = flight.values(name)[leg.rows]
    known = values[np.isfinite(values)]
    return Range(float(known.min()), float(known.max())) if len(known) else Range(math.nan, math.nan)
