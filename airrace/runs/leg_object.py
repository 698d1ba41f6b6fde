"""The legs, laps and near misses of a flight as an object for JSON."""

from collections.abc import Sequence

from airrace.inputs import Inputs
from airrace.procedure.result import StageResult
from airrace.results import Flight, laps_of
from airrace.results.clearances import Clearance, NearMiss, near_misses
from airrace.results.leg_facts import LegFacts, Range, leg_facts
from airrace.results.legs import passings_around
from airrace.runs.run_object import finite, stage_object
from airrace.runs.stage_view import StageView


def legs_object(flight: Flight) -> dict[str, object]:
    """Return `legs`, `laps` and `near_misses` of a stage in `airrace show --json`: SI units, radians, g."""
    return {
        "legs": [_leg(facts) for facts in leg_facts(flight)],
        "laps": [{"lap": lap.number, "time_s": finite(lap.time)} for lap in laps_of(flight)],
        "near_misses": near_misses_object(flight),
    }


def near_misses_object(flight: Flight) -> list[dict[str, object]]:
    """Return `near_misses` of a stage: SI units."""
    return [_near_miss(one) for one in near_misses(flight)]


def stages_object(inputs: Inputs, results: Sequence[StageResult]) -> list[dict[str, object]]:
    """Return `stages` of a run: the last one that found a flight has `near_misses`.

    Args:
        inputs: of the run.
        results: its stages as they may be told, in order.
    """
    stages = [stage_object(result) for result in results]
    for result, stage in zip(reversed(results), reversed(stages), strict=True):
        if result.is_flight:
            stage["near_misses"] = near_misses_object(StageView(inputs, result, {}).flight())
            break
    return stages


def planned_object(planned: Flight, clearances: Sequence[Clearance]) -> dict[str, object]:
    """Return `planned` of `airrace check --json`: what the planned line comes near to, and between which passings."""
    return {
        "optimised": False,
        "least_distances": [
            {**_clearance(one), "leg": [end.name for end in passings_around(planned, one.time)]} for one in clearances
        ],
    }


def _near_miss(one: NearMiss) -> dict[str, object]:
    return {
        **_clearance(one.clearance),
        "leg": [one.before.name, one.after.name],
        "beside": None if one.passing is None else one.passing.name,
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
        "clearances": [_clearance(one) for one in facts.clearances],
    }


def _range(one: Range) -> dict[str, float | None]:
    return {"least": finite(one.least), "greatest": finite(one.greatest)}


def _clearance(one: Clearance) -> dict[str, object]:
    return {
        "kind": one.kind,
        "name": one.name,
        "distance_m": finite(one.distance),
        "required_m": one.required,
        "time_s": one.time,
        "north_m": one.north,
        "east_m": one.east,
        "height_m": finite(one.height),
    }
