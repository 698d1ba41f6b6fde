"""The facts that are told of every leg: time, load factors, heights, speeds, roll rate, energy, and clearances."""

import math

import numpy as np

from airrace.records import record
from airrace.results.clearance import Clearance, distances, least
from airrace.results.flight import Flight
from airrace.results.legs import Leg, legs_of


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
    """Return the facts of all legs in order; the ranges of a leg that was not flown are NaN."""
    known = distances(flight)
    return tuple(_facts(flight, leg, least(flight, leg, known) if leg.flown else ()) for leg in legs_of(flight))


def _facts(flight: Flight, leg: Leg, clearances: tuple[Clearance, ...]) -> LegFacts:
    roll = _range(flight, leg, "p_Kbar")
    return LegFacts(
        leg=leg,
        n_z=_range(flight, leg, "n_z"),
        height=_range(flight, leg, "height"),
        V_K=_range(flight, leg, "V_K"),
        V_A=_range(flight, leg, "V_A"),
        V_I=_range(flight, leg, "V_I"),
        roll_rate=max(-roll.least, roll.greatest),
        energy_in=leg.before.value("h_E"),
        energy_out=leg.after.value("h_E"),
        clearances=clearances,
    )


def _range(flight: Flight, leg: Leg, name: str) -> Range:
    values = flight.values(name)[leg.rows]
    values = values[np.isfinite(values)]
    return Range(float(values.min()), float(values.max())) if len(values) else Range(math.nan, math.nan)
