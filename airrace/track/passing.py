"""Passings of gates and pylons: how strictly they are flown, and what they tolerate."""

import math
from enum import Enum

import numpy as np

from airrace.quantities import Interval
from airrace.records import record
from airrace.track.element import Standing
from airrace.trajectory import Array

POSITIVE = Interval(lower=0.0)
NOT_POSITIVE = Interval(upper=0.0)
ZERO = Interval.exactly(0.0)
STEP = math.radians(10.0)
"""The angle from one course to the next among those that a plan chooses from, rad."""


class Passing(Enum):
    """The strictness with which a gate is passed: exactly (the paper), or anywhere inside its window (the rules)."""

    POINT = "point"
    WINDOW = "window"


@record
class Tolerances:
    """The tolerances of a `window` passing at a gate; `point` passings ignore all but `climb` and `crossing`.

    Attributes:
        clearance: least distance of the wing tips from a pylon, m.
        height: legal heights of the aircraft at the gate above the track's origin, m.
        bank: largest deviation from the prescribed bank, rad.
        climb: allowed kinematic climb angles, rad.
        crossing: largest horizontal angle between the path and the gate's axis, rad (below pi/2).
    """

    clearance: float
    height: Interval
    bank: float
    climb: Interval
    crossing: float


class Tolerant(Standing):
    """An element that stands somewhere and is passed by the rules.

    A kind declares `passing` and `tolerances` besides.
    """

    passing: Passing
    tolerances: Tolerances

    @property
    def heights(self) -> Interval:
        return Interval.exactly(self.height) if self.passing is Passing.POINT else self.tolerances.height

    @property
    def climbs(self) -> Interval:
        return Interval() if self.passing is Passing.POINT else self.tolerances.climb


def offsets(most: int, crossing: float) -> Array:
    """Return courses beside an axis, rad: up to `most` steps to either side, within the largest crossing angle."""
    found = STEP * np.arange(-most, most + 1)
    return np.asarray(found[np.abs(found) <= crossing + 1e-9], dtype=np.float64)
