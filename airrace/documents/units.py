"""Conversions from the units of the documents to SI."""

import math

from airrace.quantities import Interval

KNOT = 1852.0 / 3600.0
"""The knot, m/s."""


def radians_or_none(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def interval(lower: float | None, upper: float | None) -> Interval:
    """Return a range whose absent ends are unbounded."""
    return Interval(-math.inf if lower is None else lower, math.inf if upper is None else upper)


def interval_deg(lower: float | None, upper: float | None) -> Interval:
    """Return a range in radians from ends in degrees; absent ends are unbounded."""
    return interval(radians_or_none(lower), radians_or_none(upper))
