"""The legs and laps of a flight as an object for JSON."""

from collections.abc import Sequence

from airrace.flights import Flight, laps_of
from airrace.flights.clearance import Clearance
from airrace.flights.leg_facts import LegFacts, Range, leg_facts
from airrace.runs.run_object import finite


def legs_object(flight: Flight) -> dict[str, object]:
    """Return `legs` and `laps` of a stage in `airrace show --json`: SI units, radians, g."""
    return {
        "legs": [_leg(facts) for facts in leg_facts(flight)],
        "laps": [{"lap": lap.number, "time_s": finite(lap.time)} for lap in laps_of(flight)],
    }


def _leg(facts: LegFacts) -> dict[str, object]:
    return {
        "passing": facts.leg.name,
        "lap": facts.leg.lap,
        "time_s": finite(facts.leg.time),
        "n_z_g": _range(facts.n_z),
        "height_m": _range(facts.height),
        "ground_speed_m_s": _range(facts.V_K),
        "true_airspeed_m_s": _range(facts.V_A),
        "indicated_airspeed_m_s": _range(facts.V_I),
        "roll_rate_rad_s": finite(facts.roll_rate),
        "energy_height_in_m": finite(facts.energy_in),
        "energy_height_out_m": finite(facts.energy_out),
        "clearances": _clearances(facts.clearances),
    }


def _range(one: Range) -> dict[str, float | None]:
    return {"least": finite(one.least), "greatest": finite(one.greatest)}


def _clearances(found: Sequence[Clearance]) -> list[dict[str, object]]:
    return [
        {
            "kind": one.kind,
            "name": one.name,
            "distance_m": finite(one.distance),
            "required_m": one.required,
            "time_s": one.time,
            "north_m": one.north,
            "east_m": one.east,
            "height_m": one.height,
        }
        for one in found
    ]
