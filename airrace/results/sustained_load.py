"""The load factors that a flight sustains for longer than pilots tolerate them: a check of a flight, not a limit.

The durations are those of the table of tolerances of experienced persons in S. R. Mohler, *G effects on the pilot
during aerobatics*, FAA-AM-72-28, July 1972; at 8 g it names a blackout, at -3 g pain.
"""

import numpy as np

from airrace.records import record
from airrace.results.flight import Flight
from airrace.trajectory import Array

SOURCE = "FAA-AM-72-28"
TOLERATED = ((8.0, 15.0), (6.0, 20.0), (5.0, 30.0), (4.0, 60.0), (-3.0, 30.0))
"""Load factors (g), and for how long each is tolerated (s)."""


@record
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
            f"tolerate that for {self.tolerated:g} s ({SOURCE})"
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
    found: list[SustainedLoad] = []
    for level, tolerated in TOLERATED:
        begin, duration = longest_stretch(time, np.sign(level) * n_z, abs(level))
        if duration > tolerated:
            found.append(SustainedLoad(level, begin, duration, tolerated))
    return tuple(found)


def longest_stretch(time: Array, values: Array, level: float) -> tuple[float, float]:
    """Return when the longest stretch with values of at least a level begins, and how long it lasts, s."""
    over = np.isfinite(values) & (np.nan_to_num(values, nan=-np.inf) >= level)
    turns = np.flatnonzero(np.diff(np.concatenate([[False], over, [False]]).astype(np.int8)))
    best = (float(time[0]), 0.0)
    for first, end in turns.reshape(-1, 2).tolist():
        begin = _crossing(time, values, level, first - 1, first)
        duration = _crossing(time, values, level, end, end - 1) - begin
        best = max(best, (begin, duration), key=lambda one: one[1])
    return best


def _crossing(time: Array, values: Array, level: float, outside: int, inside: int) -> float:
    """Return when values cross a level between two neighbours; the one inside where nothing is known outside."""
    if not 0 <= outside < len(time) or not np.isfinite(values[outside]):
        return float(time[inside])
    share = (level - values[inside]) / (values[outside] - values[inside])
    return float(time[inside] + share * (time[outside] - time[inside]))
