"""Conversions from the units of the documents to SI."""

import math

from airrace.quantities import KNOT, Interval

__all__ = ["KNOT", "interval", "interval_deg", "radians_or_none"]


def radians_or_none(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def interval(lower: float | None, upper: float | None) -> Interval:
    """Return a range whose absent ends are unbounded."""
    return Interval(-math.inf if lower is None else lower, math.inf if upper is None else upper)


def interval_deg(lower: float | None, upper: float | None) -> Interval:
    """Return a range in radians from ends in degrees; absent ends are unbounded."""
    return interval(radians_or_none(lower), radians_or_none(upper))
