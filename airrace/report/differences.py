"""The time that other flights are behind the first, place by place along the course, on the first one's clock."""

import numpy as np

from airrace.report.contents import Difference
from airrace.results import Flight
from airrace.results.comparison import SHARES, Comparison
from airrace.results.legs import Leg, way
from airrace.trajectory import Array


def started(flight: Flight) -> float:
    """Return when the clock of a flight starts, s: at its first passing, or where that is missing at its first time."""
    found = flight.crossings and flight.crossings[0].found
    return flight.crossings[0].time if found else float(flight.time[0])


def difference_of(comparison: Comparison, number: int) -> Difference:
    """Return what the other flight has lost along the course, and when the reference was there.

    Args:
        comparison: of two flights.
        number: of the other flight.
    """
    reference = comparison.reference
    times = [np.array([reference.crossings[0].time]), *(_times(reference, leg.reference) for leg in comparison.legs)]
    time, lost = np.concatenate(times), comparison.progress.difference
    known = np.isfinite(time)
    return Difference(number, time[known] - started(reference), lost[known])


def _times(flight: Flight, leg: Leg) -> Array:
    """Return when the shares of a leg were flown, its beginning left out, s; NaN where the leg was not flown."""
    if not leg.flown:
        return np.full(len(SHARES) - 1, np.nan)
    flown = way(flight, leg)
    return np.interp(SHARES[1:], flown / flown[-1], flight.time[leg.rows])
