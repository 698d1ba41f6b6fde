"""Near misses: pylons that the wing passes closer than their own passing allows, where no rule of the course looks.

The rules measure the distance of the wing tips from the pylons of a gate at the instant of its passing, along the line
between the pylons. The wing of an aircraft that crosses this line askew reaches it some hundredths of a second before
or after, and may be closer to a pylon then. Nothing at all keeps the wing away from the pylons of other gates.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from airrace.records import record
from airrace.results.clearance import Clearance, Distance, at_row, pylons
from airrace.results.flight import Crossing, Flight
from airrace.results.legs import passings_around

TOLERANCE = 0.1
"""The length by which a clearance is missed before it is told, m: nobody beside the course could see less."""
UNASKED = 0.5
"""The clearance that counts for elements whose passing asks for none, m: that of the rules of 2014 to 2019."""
BESIDE = 0.25
"""The time before and after a passing within which a near miss belongs to it, s."""


@record
class NearMiss:
    """One pylon passed closely.

    Attributes:
        clearance: of the wing from the pylon, and what its passing asks for.
        passing: the passing within `BESIDE` of what stands there, the other gate of a quad included; None where the
            pylon is passed on another leg.
        before, after: the passings between which it happens.
    """

    clearance: Clearance
    passing: Crossing | None
    before: Crossing
    after: Crossing

    @property
    def where(self) -> str:
        """The words that tell when it happens, e.g. `0.02 s after 1:g4`."""
        if self.passing is None:
            return f"on the leg {self.before.name} -> {self.after.name}"
        apart = self.clearance.time - self.passing.time
        if abs(apart) < 0.005:
            return f"at {self.passing.name}"
        return f"{abs(apart):.2f} s {'before' if apart < 0.0 else 'after'} {self.passing.name}"


def near_misses(flight: Flight) -> tuple[NearMiss, ...]:
    """Return all near misses in the order in which they happen; none where the flight does not tell its position, or
    misses a passing.
    """
    if not flight.has("x", "y", "height") or not all(one.found for one in flight.crossings):
        return ()
    found = [_near_miss(flight, one) for distance in pylons(flight) for one in _closest(flight, distance)]
    return tuple(sorted(found, key=lambda one: one.clearance.time))


def _closest(flight: Flight, one: Distance) -> Iterator[Clearance]:
    """Yield the least distance of every stretch on which it is less than the passing asks for."""
    asked = replace(one, required=max(one.required, UNASKED))
    start, finish = flight.crossings[0].time, flight.crossings[-1].time
    racing = (flight.time >= start) & (flight.time <= finish)
    below = racing & (one.values < asked.required - TOLERANCE)  # NaN is not below
    turns = np.flatnonzero(np.diff(np.concatenate([[False], below, [False]]).astype(np.int8)))
    for first, end in turns.reshape(-1, 2).tolist():
        yield at_row(flight, asked, first + int(np.argmin(one.values[first:end])))


def _near_miss(flight: Flight, clearance: Clearance) -> NearMiss:
    time = clearance.time
    (place,) = {one.passage.element.place for one in flight.crossings if one.passage.element.name == clearance.name}
    own = [one for one in flight.crossings if one.passage.element.place == place and abs(one.time - time) <= BESIDE]
    passing = min(own, key=lambda one: abs(one.time - time), default=None)
    return NearMiss(clearance, passing, *passings_around(flight, time))
