"""Measures as flight manuals give them, a number with its unit: `57kt`, `315 hp`, `3200 ft/min`."""

import re
from collections.abc import Mapping

from airrace.errors import UsageError
from airrace.quantities import DEGREE, FOOT, KNOT, Interval
from airrace.records import record

POUND, MILE = 0.45359237, 1609.344
"""The pound avoirdupois, kg, and the statute mile, m."""
HORSEPOWER, METRIC_HORSEPOWER = 745.69987, 735.49875
"""550 foot-pounds and 75 metre-kilograms per second, W."""
_MEASURE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*([^\d\s.,+-].*)?")


@record
class Measure:
    """A kind of measure.

    Attributes:
        units: their SI values; the unit of a kind with only one may be left out.
        allowed: what an aircraft can have, in the first unit.
    """

    units: Mapping[str, float]
    allowed: Interval


SPEED = Measure({"kt": KNOT, "km/h": 1.0 / 3.6, "mph": MILE / 3600.0, "m/s": 1.0}, Interval(10.0, 550.0))
MASS = Measure({"kg": 1.0, "lb": POUND}, Interval(50.0, 50_000.0))
LENGTH = Measure({"m": 1.0, "ft": FOOT}, Interval(2.0, 60.0))
AREA = Measure({"m2": 1.0, "ft2": FOOT * FOOT}, Interval(1.0, 500.0))
POWER = Measure({"kW": 1000.0, "hp": HORSEPOWER, "PS": METRIC_HORSEPOWER}, Interval(5.0, 5000.0))
CLIMB = Measure({"m/s": 1.0, "ft/min": FOOT / 60.0, "m/min": 1.0 / 60.0}, Interval(0.1, 60.0))
ROLL_RATE = Measure({"deg/s": DEGREE}, Interval(5.0, 1000.0))
LOAD_FACTOR = Measure({"g": 1.0}, Interval(1.1, 25.0))
NEGATIVE_LOAD_FACTOR = Measure({"g": 1.0}, Interval(-25.0, 0.9))


def parse(text: str, measure: Measure, option: str) -> float:
    """Return the measure, in SI units, of a number with its unit; messages call it by its option, e.g. `--stall`.

    Raises:
        UsageError: it is no number, its unit is missing or unknown, or no aircraft has it.
    """
    found, known, first = _MEASURE.fullmatch(text), ", ".join(measure.units), next(iter(measure.units))
    if found is None:
        raise UsageError(f"{option}: {text!r} is no number with a unit ({known})")
    unit = (found[2] or "").strip().lower().replace("\N{SUPERSCRIPT TWO}", "2")
    if not unit and len(measure.units) > 1:
        raise UsageError(f"{option}: {text!r} has no unit; give one of {known}, e.g. {found[1]}{first}")
    factors = {name.lower(): factor for name, factor in measure.units.items()}
    factor = factors.get(unit or first.lower())
    if factor is None:
        raise UsageError(f"{option}: {found[2]!r} is no unit of it; known are {known}")
    value, allowed = float(found[1]) * factor, measure.allowed
    if not allowed.lower <= value / measure.units[first] <= allowed.upper:
        raise UsageError(f"{option}: {text} is beyond {allowed.lower:g} to {allowed.upper:g} {first}")
    return value
