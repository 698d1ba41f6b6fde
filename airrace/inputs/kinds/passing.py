"""Passings by the rules, of gates and pylons alike: their tolerances where a file says nothing, and their checks."""

import math

from airrace.inputs.kinds.defaults import GateDefaultsEntry, GatePassingEntry, PassingEntry
from airrace.inputs.kinds.entry import chosen
from airrace.inputs.nodes import Reporter
from airrace.inputs.units import interval_deg
from airrace.quantities import Interval
from airrace.track.gates import Gate, Passing, Pylon, Tolerances

# The values where neither a gate nor `gate_defaults` gives one. By the race rules of 2014 to 2019 pylons are 25 m high,
# gates 10 to 14 m wide, the legal height is about 15 to 25 m, wings are level within 10 degrees; the rest are choices.
HEIGHT_M = 20.0
HEIGHT_BAND_M = 5.0
WIDTH_M = 13.0
GATE_CLEARANCE_M = 0.5
PYLON_CLEARANCE_M = 3.5
BANK_TOLERANCE_DEG = 10.0
CLIMB_MAX_DEG = 45.0
CROSSING_MAX_DEG = 60.0
REACH_M = 100.0

DIGITS = 9
"""The decimal places to which angles are rounded when they come back from radians, degrees."""


def passing_of(entry: PassingEntry, defaults: GateDefaultsEntry) -> Passing:
    """Return how strictly an element is passed."""
    return Passing(chosen(entry.passing, defaults.passing, "window"))


def tolerances_of(entry: PassingEntry, defaults: GateDefaultsEntry, *, clearance: float) -> Tolerances:
    """Return what the passing of an element allows; `clearance` in m."""
    height = chosen(entry.height_m, defaults.height_m, HEIGHT_M)
    climb = Interval(
        chosen(entry.climb_min_deg, defaults.climb_min_deg, -CLIMB_MAX_DEG),
        chosen(entry.climb_max_deg, defaults.climb_max_deg, CLIMB_MAX_DEG),
    )
    return Tolerances(
        clearance=clearance,
        height=Interval(
            chosen(entry.height_min_m, defaults.height_min_m, max(0.0, height - HEIGHT_BAND_M)),
            chosen(entry.height_max_m, defaults.height_max_m, height + HEIGHT_BAND_M),
        ),
        bank=_bank_tolerance(entry, defaults),
        climb=interval_deg(climb.lower, climb.upper),
        crossing=math.radians(chosen(entry.crossing_max_deg, defaults.crossing_max_deg, CROSSING_MAX_DEG)),
    )


def _bank_tolerance(entry: PassingEntry, defaults: GateDefaultsEntry) -> float:
    if not isinstance(entry, GatePassingEntry):
        return math.pi  # the bank at a single pylon is free
    return math.radians(chosen(entry.bank_tolerance_deg, defaults.bank_tolerance_deg, BANK_TOLERANCE_DEG))


def check_passing(element: Gate | Pylon, reporter: Reporter) -> None:
    """Report heights and climb angles that leave nothing."""
    _check_height(element, reporter)
    _check_climb(element, reporter)


def _check_height(element: Gate | Pylon, reporter: Reporter) -> None:
    band = element.tolerances.height
    if element.passing is Passing.POINT:
        return
    if band.empty:
        reporter.value(
            ("gates", element.name, "height_min_m"),
            f"the height band is empty: from {band.lower:g} m up to {band.upper:g} m",
        )
    elif not band.lower <= element.height <= band.upper:
        reporter.value(
            ("gates", element.name, "height_m"),
            f"must lie within the window's heights, {band.lower:g} to {band.upper:g} m, not {element.height:g}",
        )


def _check_climb(element: Gate | Pylon, reporter: Reporter) -> None:
    climb = element.tolerances.climb
    if climb.empty:
        reporter.value(
            ("gates", element.name, "climb_min_deg"),
            f"must not exceed the largest climb angle: {math.degrees(climb.lower):g} to {math.degrees(climb.upper):g}",
        )


def silent_passing(element: Gate | Pylon) -> dict[str, float | None]:
    """Return the numbers of a passing by their keys."""
    allowed = element.tolerances
    return {
        "height_m": element.height,
        "clearance_m": allowed.clearance,
        "height_min_m": allowed.height.lower,
        "height_max_m": allowed.height.upper,
        "climb_min_deg": rounded(allowed.climb.lower),
        "climb_max_deg": rounded(allowed.climb.upper),
        "crossing_max_deg": rounded(allowed.crossing),
    }


def rounded(angle: float) -> float:
    """Return an angle in degrees without the conversion's last bits."""
    return round(math.degrees(angle), DIGITS)
