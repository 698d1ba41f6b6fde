"""Two flights of the same passings on one clock: the difference of time along the course, leg by leg.

Progress is the way flown, counted leg by leg: at a share `s` of a leg both flights have flown that share of their own
way through it. So the difference of time

    D(s) = t_other(s) - t_reference(s),        D(start) = 0,        D(finish) = difference of the race times

is zero for a flight and itself, and changes its sign when the flights change places. A leg takes `t = L w` with its
way `L` and the mean `w` of the time per metre, so what is lost on it is, exactly,

    t' - t = (L' - L) (w + w')/2 + (w' - w) (L + L')/2        by the longer way and by the lower speed
"""

import math
from collections.abc import Sequence

import numpy as np

from airrace.errors import UsageError
from airrace.procedure.passings import passings_of
from airrace.records import record
from airrace.results.differences import Difference, differences
from airrace.results.flight import Flight
from airrace.results.legs import Lap, Leg, laps_of, legs_of, way
from airrace.trajectory import Array

TIE = 0.005
"""The difference of time below which two flights are a tie, s.

Race times are certified to a few thousandths of a second (`race_time_change`).
"""
SHARES = np.linspace(0.0, 1.0, 41)
"""The shares of every leg at which the difference of time is told."""


@record
class LegComparison:
    """One leg in two flights.

    Attributes:
        reference, other: the leg in the one and in the other.
        cumulative: what the other has lost from the start up to the end of this leg, s; negative where it has won.
        by_way, by_speed: what it loses on the leg by its longer way and by its lower speed, s; they add up.
        differences: what it flies otherwise, the most telling first.
    """

    reference: Leg
    other: Leg
    cumulative: float
    by_way: float
    by_speed: float
    differences: tuple[Difference, ...]

    @property
    def name(self) -> str:
        """The name of the passing that the leg ends in."""
        return self.reference.name

    @property
    def difference(self) -> float:
        """The time that the other loses on the leg, s; negative where it wins, NaN where one of them did not fly it."""
        return self.other.time - self.reference.time

    @property
    def tie(self) -> bool:
        """Whether the leg takes both equally long, within `TIE`."""
        return abs(self.difference) <= TIE


@record
class Progress:
    """The difference of time along the course.

    Attributes:
        distance: way of the reference from the start, m, rising, shape (k,); of a leg that it lacks, that of the other.
        difference: what the other has lost up to there, s, shape (k,); NaN on legs that one of them lacks.
        passings: at which distance the passings are made, m, shape (n,).
    """

    distance: Array
    difference: Array
    passings: Array


@record
class Comparison:
    """One flight held against a reference.

    Attributes:
        reference, other: the flights.
        legs: in the order flown.
        progress: the difference of time along the course.
    """

    reference: Flight
    other: Flight
    legs: tuple[LegComparison, ...]
    progress: Progress

    @property
    def difference(self) -> float:
        """The time that the other loses in all, s; negative where it is faster, NaN where one has no race time."""
        return self.other.race_time - self.reference.race_time

    @property
    def tie(self) -> bool:
        """Whether the race takes both equally long, within `TIE`."""
        return abs(self.difference) <= TIE

    @property
    def by_loss(self) -> tuple[LegComparison, ...]:
        """The legs, first the one on which the other loses most; those that were not flown last."""
        return tuple(sorted(self.legs, key=lambda leg: math.inf if math.isnan(leg.difference) else -leg.difference))

    @property
    def laps(self) -> tuple[tuple[Lap, Lap], ...]:
        """Every lap of the reference with that of the other."""
        return tuple(zip(laps_of(self.reference), laps_of(self.other), strict=True))


def compared(reference: Flight, other: Flight) -> Comparison:
    """Hold one flight against another of the same passings.

    Aircraft, rules, wind and fidelity may differ, and so may the places of the gates.

    Raises:
        UsageError: the courses have other passings; names the first that differs.
    """
    ensure_comparable(reference, other)
    legs: list[LegComparison] = []
    for before, after in zip(legs_of(reference), legs_of(other), strict=True):
        by_way, by_speed = _shares(_length(reference, before), before.time, _length(other, after), after.time)
        so_far = (after.after.time - other.crossings[0].time) - (before.after.time - reference.crossings[0].time)
        told = differences(reference, before, other, after) if before.flown and after.flown else ()
        legs.append(LegComparison(before, after, so_far, by_way, by_speed, told))
    return Comparison(reference, other, tuple(legs), _progress(reference, other, legs))


def ensure_comparable(reference: Flight, other: Flight) -> None:
    """Refuse flights of courses with other passings.

    Raises:
        UsageError: naming the first passing that differs.
    """
    here, there = (passings_of(flight.course) for flight in (reference, other))
    for number, (mine, its) in enumerate(zip(here, there, strict=False)):
        if mine != its:
            first, second = (f"{name} ({kind})" for name, kind in (its, mine))
            raise UsageError(
                f"{other.label} and {reference.label} cannot be compared: passing {number} "
                f"is {first} in the one and {second} in the other"
            )
    if len(here) != len(there):
        raise UsageError(
            f"{other.label} and {reference.label} cannot be compared: "
            f"the one has {len(there)} passings, the other {len(here)}"
        )


def _length(flight: Flight, leg: Leg) -> float:
    return float(way(flight, leg)[-1]) if leg.flown else math.nan


def _shares(L: float, t: float, L_other: float, t_other: float) -> tuple[float, float]:
    w, w_other = t / L, t_other / L_other
    return (L_other - L) * 0.5 * (w + w_other), (w_other - w) * 0.5 * (L + L_other)


def _progress(reference: Flight, other: Flight, legs: Sequence[LegComparison]) -> Progress:
    """Return the difference of time, leg by leg at the same shares of both ways."""
    starts = reference.crossings[0].time, other.crossings[0].time
    distance, difference, passings = [np.zeros(1)], [np.zeros(1)], [0.0]
    for leg in legs:
        lengths = [_length(*pair) for pair in ((reference, leg.reference), (other, leg.other))]
        length = next((one for one in lengths if math.isfinite(one)), 0.0)
        distance.append((passings[-1] + SHARES * length)[1:])
        passings.append(passings[-1] + length)
        lost = np.full(len(SHARES), np.nan)
        if leg.reference.flown and leg.other.flown:
            mine, its = _time_at_shares(reference, leg.reference), _time_at_shares(other, leg.other)
            lost = (its - starts[1]) - (mine - starts[0])
        difference.append(lost[1:])
    return Progress(np.concatenate(distance), np.concatenate(difference), np.array(passings))


def _time_at_shares(flight: Flight, leg: Leg) -> Array:
    flown = way(flight, leg)
    return np.interp(SHARES, flown / flown[-1], flight.time[leg.rows])
