"""Flights held against a reference, as an object for JSON."""

from airrace.results.comparison import SHARES, TIE, Comparison, LegComparison, conditions
from airrace.results.flight import Flight
from airrace.runs.run_object import finite


def compared_object(reference: Flight, comparisons: list[Comparison]) -> dict[str, object]:
    """Return what `airrace compare --json` prints: seconds, metres; legs in the order flown."""
    return {
        "tie_s": TIE,
        "reference": flight_object(reference),
        "flights": [_comparison_object(one) for one in comparisons],
    }


def flight_object(flight: Flight) -> dict[str, object]:
    """Return the object that says which flight it is."""
    return {
        "label": flight.label,
        "track": flight.course.name,
        "aircraft": flight.aircraft.name,
        "stage": flight.source.stage or None,
        "state": None if flight.source.state is None else flight.source.state.value,
        "certified": flight.source.certified,
        "race_time_s": finite(flight.race_time),
    }


def _comparison_object(comparison: Comparison) -> dict[str, object]:
    progress = comparison.progress
    return {
        **flight_object(comparison.other),
        "difference_s": finite(comparison.difference),
        "tie": comparison.tie,
        "conditions": [
            {"what": what, "reference": first, "flight": second}
            for what, first, second in conditions(comparison.reference, comparison.other)
        ],
        "laps": [
            {
                "lap": mine.number,
                "reference_s": finite(mine.time),
                "flight_s": finite(its.time),
                "difference_s": finite(its.time - mine.time),
            }
            for mine, its in comparison.laps
        ],
        "legs": [_leg_object(leg) for leg in comparison.legs],
        "progress": {
            "shares_of_a_leg": SHARES.tolist(),
            "distance_m": progress.distance.tolist(),
            "difference_s": [finite(one) for one in progress.difference.tolist()],
            "passings_m": progress.passings.tolist(),
        },
    }


def _leg_object(leg: LegComparison) -> dict[str, object]:
    return {
        "passing": leg.name,
        "lap": leg.reference.lap,
        "reference_s": finite(leg.reference.time),
        "flight_s": finite(leg.other.time),
        "difference_s": finite(leg.difference),
        "tie": leg.tie,
        "cumulative_s": finite(leg.cumulative),
        "by_longer_way_s": finite(leg.by_way),
        "by_lower_speed_s": finite(leg.by_speed),
        "differs": [
            {"what": one.name, "reference": one.reference, "flight": one.other, "unit": one.unit, "text": one.text}
            for one in leg.differences
        ],
    }
