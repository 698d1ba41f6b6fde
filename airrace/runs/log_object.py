"""A flown log as an object for JSON, as `airrace import` and `airrace show` print it."""

import math

from airrace.logs.violations import Violation
from airrace.results import Flight
from airrace.runs.leg_object import legs_object
from airrace.runs.log_view import LogView
from airrace.runs.run_object import finite


def flown_object(flown: LogView) -> dict[str, object]:
    """Return race time, passings, breaches, legs and remarks; SI units and radians, breaches in their own units."""
    flight, log = flown.flight(), flown.recorded.log
    return {
        "flown": True,
        "track": flight.course.name,
        "aircraft": flight.aircraft.name,
        "log": log.path,
        "format": log.format,
        "begins": log.begins or None,
        "start_in_log_s": log.offset,
        "race_time_s": finite(flight.race_time),
        "penalty_s": finite(flown.penalty),
        "race_over": math.isinf(flown.penalty),
        "passings": _passings(flight),
        "breaches": [_breach(one) for one in flown.breaches],
        **legs_object(flight),
        "histories": {name: one.basis.value for name, one in flight.histories.items()},
        "remarks": list(flown.remarks),
    }


def _passings(flight: Flight) -> list[dict[str, object]]:
    told = ("height", "V_K", "V_A", "V_I", "n_z", "mu", "gamma")
    return [
        {
            "passing": one.name,
            "lap": one.lap,
            "time_s": finite(one.time),
            **{name: finite(one.value(name)) for name in told},
        }
        for one in flight.crossings
    ]


def _breach(one: Violation) -> dict[str, object]:
    return {
        "passing": one.passing or None,
        "rule": one.rule,
        "time_s": finite(one.time),
        "value": finite(one.value),
        "limit": finite(one.limit),
        "unit": one.unit,
        "deviation": finite(one.deviation),
        "certain": one.certain,
        "penalty_s": finite(one.penalty),
        "ends_race": math.isinf(one.penalty),
    }
