"""Runs, stages, legs, flight logs and comparisons as objects for JSON: SI units and radians, null if not finite."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from airrace.flights.results import Confirmation, Flight, ReserveState, Stamp, laps_of
from airrace.flights.results.clearances import Clearance, NearMiss, least_distances, near_misses
from airrace.flights.results.comparison import SHARES, TIE, Comparison, LegComparison, compare_flights, conditions
from airrace.flights.results.flight import passings_around
from airrace.flights.results.flight_facts import LegFacts, Range, leg_facts, sustained_loads
from airrace.flights.results.time_loss import TimeLoss, time_loss
from airrace.optimal_control.certificate import Certificate, SecondOrder
from airrace.pages.views.comparison_tables import laps_table, lost_table
from airrace.pages.views.stage_tables import certificate_table
from airrace.procedure.result import GateSplit, RefinementReason, SearchReport, StageResult, SuggestedChange

REASONS: Mapping[RefinementReason, str] = {
    RefinementReason.FIRST: "first mesh",
    RefinementReason.CALM: "calm",
    RefinementReason.INTEGRATION: "replay",
    RefinementReason.LIMITS: "limits",
    RefinementReason.HAMILTONIAN: "hamiltonian",
    RefinementReason.RACE_TIME: "race time",
}
"""The words for the reasons for which intervals of a mesh were last cut or joined."""


def run_object(track: str | None, results: Iterable[StageResult], wall: float, *, certified: bool) -> dict[str, object]:
    """Return the object of a run; `race_time_s` is that of its last stage, null if that found no flight."""
    stages = [stage_object(result) for result in results]
    return {
        "track": track,
        "certified": certified,
        "race_time_s": stages[-1]["race_time_s"] if stages else None,
        "wall_s": finite(wall),
        "stages": stages,
    }


def stage_object(result: StageResult) -> dict[str, object]:
    """Return one stage of the object."""
    return {
        "stage": result.stage.value,
        "status": result.status.value,
        "message": result.remarks,
        "race_time_s": finite(result.trajectory.race_time) if result.is_flight else None,
        "lap_times_s": lap_times(result.splits) if result.is_flight else [],
        "regularisation_s": finite(result.provenance.regularisation),
        "started_from": result.provenance.source or None,
        "tracking_error_m": finite(result.provenance.tracking_error) if result.provenance.source else None,
        "iterations": result.iterations,
        "solve_s": finite(result.timings.solve),
        "derivatives_s": finite(result.timings.derivatives),
        "wall_s": finite(result.timings.wall),
        "certified": result.certified,
        "alternatives": [
            {
                "race_time_s": finite(alternative.trajectory.race_time),
                "status": alternative.status.value,
                "certified": alternative.certified,
            }
            for alternative in result.alternatives
        ],
        "mesh": mesh_object(result),
        "routes": [  # race times and differences are those of a rough mesh, of optima refined ones
            {
                "route": route.text,
                "race_time_s": finite(route.race_time),
                "difference_s": finite(route.difference),
                "evaluated_by": route.evaluated_by,
                "rolls": route.rolls,
            }
            for route in result.search.routes
        ],
        "search": search_object(result.search) if result.search.routes else None,
        "conflicts": conflict_objects(result.suggested_changes),
        "certificate": None if result.certificate is None else certificate_object(result.certificate),
    }


def lap_times(splits: Sequence[GateSplit]) -> list[float]:
    """Return the time of every lap, s, by the numbers that the passings' names begin with; empty for one lap."""
    ends = {split.name.partition(":")[0]: split.time for split in splits}  # the last passing of a lap ends it
    times = list(ends.values())
    return [after - before for before, after in itertools.pairwise(times)] if len(times) > 2 else []


def mesh_object(result: StageResult) -> dict[str, object] | None:
    """Return how the nodes of a mesh are distributed, and why; None if nothing was measured."""
    steps, record = np.diff(result.trajectory.time), result.mesh
    if not len(record.why):
        return None
    counts = np.bincount(record.why, minlength=len(RefinementReason)).tolist()
    return {
        "intervals": len(steps),
        "intervals_of_coarser_mesh": int(record.coarser.sum()) - 1,
        "shortest_s": float(steps.min()),
        "longest_s": float(steps.max()),
        "why": {REASONS[why]: counts[why] for why in RefinementReason},
    }


def search_object(explored: SearchReport) -> dict[str, object]:
    """Return how exploring went: of the flights optimised as a whole, how many led to the best, elsewhere, nowhere."""
    return {
        "seconds": finite(explored.seconds),
        "converged_to_best": explored.converged_to_best,
        "converged_elsewhere": explored.converged_elsewhere,
        "failed": explored.failed,
        "loops": list(explored.loops),
    }


def certificate_object(certificate: Certificate) -> dict[str, object]:
    """Return the object of a certificate with all its numbers; what could not be measured is null and does not hold."""
    return {
        "solver_status": certificate.solver_status,
        "items": certificate_table(certificate, "").objects(),
        "second_order": None if certificate.second_order is None else second_order_object(certificate.second_order),
    }


def second_order_object(judged: SecondOrder) -> dict[str, object]:
    """Return the object of what the curvature tells; phase and quantity are null where there is no such direction."""
    return {
        "curvature": judged.curvature.value,
        "threshold_s": finite(judged.threshold),
        "least_s": finite(judged.least),
        "phase": judged.phase or None,
        "quantity": judged.quantity or None,
        "active_limits": judged.active,
        "weakly_active_limits": judged.weakly_active,
    }


def conflict_objects(suggested_changes: Sequence[SuggestedChange]) -> list[dict[str, object]]:
    """Return the conflicts of limits for which no flight was found, each with what would resolve it."""
    groups = [list(group) for _, group in itertools.groupby(suggested_changes, key=lambda one: one.conflict)]
    return [
        {
            "where": group[0].where,
            "suggested_changes": [
                {
                    "key": one.key or None,
                    "text": one.text,
                    "unit": one.unit or None,
                    "given": finite(one.given),
                    "needed": finite(one.needed),
                    "certified": one.certified,
                    "failed": finite(one.failed),
                    "failed_flies": one.failed_flies,
                    "race_time_s": finite(one.race_time),
                }
                for one in group
                if one.text
            ],
        }
        for group in groups
    ]


def finite(value: float) -> float | None:
    """Return a number as JSON can hold it: None for NaN and infinity, which JSON does not know."""
    return float(value) if math.isfinite(value) else None


def legs_object(flight: Flight) -> dict[str, object]:
    """Return `legs`, `laps` and the warnings of a stage in `airrace show --json`: SI units, radians, g."""
    return {
        "legs": [_leg(facts) for facts in leg_facts(flight)],
        "laps": [{"lap": lap.number, "time_s": finite(lap.time)} for lap in laps_of(flight)],
        **warnings_object(flight),
    }


def warnings_object(flight: Flight) -> dict[str, object]:
    """Return `least_distances`, `near_misses` and `sustained_loads` of a stage: SI units, g."""
    return {
        "least_distances": [_clearance(one) for one in least_distances(flight)],
        "near_misses": [_near_miss(one) for one in near_misses(flight)],
        "sustained_loads": [
            {
                "n_z_g": one.n_z,
                "begin_s": one.begin,
                "duration_s": one.duration,
                "tolerated_s": one.tolerated,
                "text": one.text,
            }
            for one in sustained_loads(flight)
        ],
    }


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


def comparison_object(reference: Flight, comparisons: list[Comparison]) -> dict[str, object]:
    """Return what `airrace compare --json` prints: seconds, metres; legs in race order."""
    pair = len(comparisons) == 2
    return {
        "tie_s": TIE,
        "reference": flight_object(reference),
        "flights": [_comparison_object(one) for one in comparisons],
        **({"rivals": _comparison_object(compare_flights(*(one.other for one in comparisons)))} if pair else {}),
    }


def flight_object(flight: Flight) -> dict[str, object]:
    """Return the object that says which flight it is."""
    return {
        "label": flight.label,
        "track": flight.course.name,
        "aircraft": flight.aircraft.name,
        "stage": flight.source.stage or None,
        "status": None if flight.source.status is None else flight.source.status.value,
        "certified": flight.source.certified,
        **({} if (found := flight.source.confirmation) is None else confirmation_object(found)),
        "race_time_s": finite(flight.race_time),
        "stamp": stamp_object(flight.stamp),
    }


def confirmation_object(confirmation: Confirmation) -> dict[str, object]:
    """Return the outcome of measuring a stage again: `verified` is null where nothing was measured."""
    return {"verified": confirmation.verified, "verification": confirmation.words}


def stamp_object(stamp: Stamp) -> dict[str, object]:
    """Return the object that says what a flight is; what is no question of it is null."""
    return {
        "text": stamp.text,
        "stage": stamp.stage or None,
        "certified": stamp.certified,
        "failed": list(stamp.failed),
        "aircraft": stamp.aircraft,
        "air": stamp.air,
        "pilot": stamp.pilot or None,
        "reserve": reserve_object(stamp.reserve),
        "margins_by_hand": None if stamp.status is None else stamp.by_hand,
    }


def reserve_object(state: ReserveState | None) -> dict[str, object] | None:
    """Return the object of what was asked of a flight in disturbances, and what was found; None for nothing."""
    if state is None:
        return None
    return {
        "text": state.text,
        "probability": state.asked,
        "measured": state.measured,
        "flights": state.flights,
        "reached": state.reached,
        "measured_along": state.source or None,
        "attempts": state.attempts,
        "attempts_max": state.attempts_max,
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
        "laps": laps_table(comparison).objects(),
        "costs": _loss_object(time_loss(comparison)),
        "legs": [
            {**row, "differs": _difference_objects(leg)}
            for row, leg in zip(lost_table(comparison.legs).objects(), comparison.legs, strict=True)
        ],
        "progress": {
            "shares_of_a_leg": SHARES.tolist(),
            "distance_m": progress.distance.tolist(),
            "difference_s": [finite(one) for one in progress.difference.tolist()],
            "passings_m": progress.passings.tolist(),
        },
    }


def _loss_object(lost: TimeLoss) -> dict[str, object]:
    return {
        "flight": lost.comparison.other.label,
        "against": lost.comparison.reference.label,
        "costliest": [{"passing": one.leg.name, "lost_s": one.amount, "text": one.text} for one in lost.costliest],
        "legs": [
            {
                "from": one.leg.reference.before.name,
                "passing": one.leg.name,
                "lost_s": one.amount,
                **{f"by_{cause.value}_s": part for cause, part in one.parts.items()},
            }
            for one in lost.losses
        ],
    }


def _difference_objects(leg: LegComparison) -> list[dict[str, object]]:
    return [
        {
            "what": difference.name,
            "reference": difference.reference,
            "flight": difference.other,
            "unit": difference.unit,
            "text": difference.text,
        }
        for difference in leg.differences
    ]
