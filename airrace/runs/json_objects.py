"""Runs, stages, legs, flight logs and comparisons as objects for JSON: SI units and radians, null if not finite."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from airrace.flights.results import Flight, ReserveState, Stamp, Verification, laps_of
from airrace.flights.results.clearances import Clearance, NearMiss, least_distances, near_misses
from airrace.flights.results.comparison import (
    SHARES,
    TIE,
    Comparison,
    Difference,
    LegComparison,
    compare_flights,
    conditions,
)
from airrace.flights.results.cost_to_go import CostToGoLoss
from airrace.flights.results.flight import passings_around
from airrace.flights.results.flight_facts import LegFacts, Range, leg_facts, sustained_loads
from airrace.flights.results.sectors import JOINT, SectorTimes
from airrace.flights.results.time_loss import Loss, TimeLoss, loss_parts, time_loss
from airrace.optimal_control.certificate import Certificate, RefinementReason, SecondOrder
from airrace.pages.views.comparison_tables import (
    difference_text,
    laps_table,
    loss_text,
    lost_table,
    recorded_sectors,
    sectors_table,
)
from airrace.pages.views.stage_tables import bound_text, certificate_table
from airrace.procedure.result import GateSplit, LowerBound, SearchReport, StageResult, SuggestedChange

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
        "bound": None if explored.bound is None else bound_object(explored.bound),
    }


def bound_object(bound: LowerBound) -> dict[str, object]:
    """Return how much faster a flight could be, with the windows whose least priced times say so."""
    return {
        "on_mesh_s": finite(bound.seconds),
        "race_time_on_mesh_s": finite(bound.race_time),
        "gap": finite(bound.gap),
        "legs_max": bound.legs_max,
        "starts": bound.starts,
        "solves": bound.solves,
        "unsolved": bound.unsolved,
        "stopped": bound.stopped,
        "windows": [
            {"text": window.text, "legs": window.legs, "slack_s": finite(window.slack), "solved": window.solved}
            for window in bound.windows
        ],
        "text": bound_text(bound),
    }


def certificate_object(certificate: Certificate) -> dict[str, object]:
    """Return the object of a certificate with all its numbers; what could not be measured is null and does not hold."""
    return {
        "solver_status": certificate.solver_status,
        "items": certificate_table(certificate, "").objects(),
        "second_order": None if certificate.second_order is None else second_order_object(certificate.second_order),
    }


def second_order_object(second_order: SecondOrder) -> dict[str, object]:
    """Return the object of what the curvature tells; phase and quantity are null where there is no such direction."""
    return {
        "curvature": second_order.curvature.value,
        "threshold_s": finite(second_order.threshold),
        "least_s": finite(second_order.least),
        "phase": second_order.phase or None,
        "quantity": second_order.quantity or None,
        "active_limits": second_order.active,
        "weakly_active_limits": second_order.weakly_active,
    }


def conflict_objects(suggested_changes: Sequence[SuggestedChange]) -> list[dict[str, object]]:
    """Return the conflicts of limits for which no flight was found, each with what would resolve it."""
    groups = [list(group) for _, group in itertools.groupby(suggested_changes, key=lambda change: change.conflict)]
    return [
        {
            "where": group[0].where,
            "suggested_changes": [_change_object(change) for change in group if change.text],
        }
        for group in groups
    ]


def _change_object(change: SuggestedChange) -> dict[str, object]:
    return {
        "key": change.key or None,
        "text": change.text,
        "unit": change.unit or None,
        "given": finite(change.given),
        "needed": finite(change.needed),
        "certified": change.certified,
        "failed": finite(change.failed),
        "failed_flies": change.failed_flies,
        "race_time_s": finite(change.race_time),
    }


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
        "least_distances": [_clearance(clearance) for clearance in least_distances(flight)],
        "near_misses": [_near_miss(near_miss) for near_miss in near_misses(flight)],
        "sustained_loads": [
            {
                "n_z_g": load.n_z,
                "begin_s": load.begin,
                "duration_s": load.duration,
                "tolerated_s": load.tolerated,
                "text": load.text,
            }
            for load in sustained_loads(flight)
        ],
    }


def planned_object(flight: Flight, clearances: Sequence[Clearance]) -> dict[str, object]:
    """Return `planned` of `airrace check --json`: what the planned line comes near to, and between which passings."""
    distances: list[dict[str, object]] = []
    for clearance in clearances:
        before, after = passings_around(flight, clearance.time)
        distances.append({**_clearance(clearance), "leg": [before.name, after.name]})
    return {"optimised": False, "least_distances": distances}


def _near_miss(near_miss: NearMiss) -> dict[str, object]:
    return {
        **_clearance(near_miss.clearance),
        "leg": [near_miss.before.name, near_miss.after.name],
        "beside": None if near_miss.passing is None else near_miss.passing.name,
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
        "clearances": [_clearance(clearance) for clearance in facts.clearances],
    }


def _range(value_range: Range) -> dict[str, float | None]:
    return {"least": finite(value_range.least), "greatest": finite(value_range.greatest)}


def _clearance(clearance: Clearance) -> dict[str, object]:
    return {
        "kind": clearance.kind,
        "name": clearance.name,
        "distance_m": finite(clearance.distance),
        "required_m": clearance.required,
        "time_s": clearance.time,
        "north_m": clearance.north,
        "east_m": clearance.east,
        "height_m": finite(clearance.height),
    }


def comparison_object(reference: Flight, comparisons: list[Comparison]) -> dict[str, object]:
    """Return what `airrace compare --json` prints: seconds, metres; legs in race order."""
    fields: dict[str, object] = {
        "tie_s": TIE,
        "reference": flight_object(reference),
        "flights": [_comparison_object(comparison) for comparison in comparisons],
    }
    sectors = recorded_sectors([reference, *(comparison.flight for comparison in comparisons)])
    fields["sectors"] = None if sectors is None else _sectors_object(sectors)
    if len(comparisons) == 2:
        first, second = comparisons
        fields["rivals"] = _comparison_object(compare_flights(first.flight, second.flight))
    return fields


def _sectors_object(sectors: SectorTimes) -> dict[str, object]:
    return {
        "flights": [flight.label for flight in sectors.flights],
        "fastest": sectors.fastest.label,
        "sum_of_best_s": finite(sectors.sum_of_best),
        "best_race_s": finite(sectors.best_race),
        "joint": {
            "speed_m_s": JOINT.speed,
            "height_m": JOINT.height,
            "aside_m": JOINT.aside,
            "heading_rad": JOINT.heading,
            "climb_rad": JOINT.climb,
            "energy_m": JOINT.energy,
        },
        "legs": [
            {**row, "times_s": [finite(time) for time in sector.times]}
            for row, sector in zip(sectors_table(sectors).objects(), sectors.sectors, strict=True)
        ],
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
        **({} if (verification := flight.source.verification) is None else verification_object(verification)),
        "race_time_s": finite(flight.race_time),
        **({"penalties": flight.source.penalties} if flight.source.penalties else {}),
        **({"displaced": list(flight.source.displaced)} if flight.source.displaced else {}),
        "stamp": stamp_object(flight.stamp),
    }


def verification_object(verification: Verification) -> dict[str, object]:
    """Return the outcome of measuring a stage again: `verified` is null where nothing was measured."""
    return {"verified": verification.verified, "verification": verification.words}


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
        **flight_object(comparison.flight),
        "difference_s": finite(comparison.difference),
        "tie": comparison.tie,
        "conditions": [
            {"what": what, "reference": first, "flight": second}
            for what, first, second in conditions(comparison.reference, comparison.flight)
        ],
        "laps": laps_table(comparison).objects(),
        "costs": _loss_object(time_loss(comparison)),
        "cost_to_go": None if comparison.cost_to_go is None else cost_to_go_object(comparison.cost_to_go),
        "legs": [
            {**row, "differs": _difference_objects(leg)}
            for row, leg in zip(lost_table(comparison.legs).objects(), comparison.legs, strict=True)
        ],
        "progress": {
            "shares_of_a_leg": SHARES.tolist(),
            "distance_m": progress.distance.tolist(),
            "difference_s": [finite(difference) for difference in progress.difference.tolist()],
            "passings_m": progress.passings.tolist(),
        },
    }


def _loss_object(time_loss: TimeLoss) -> dict[str, object]:
    legs = {leg.name: loss_parts(time_loss.comparison, leg) for loss in time_loss.losses for leg in loss.legs}
    return {
        "flight": time_loss.comparison.flight.label,
        "against": time_loss.comparison.reference.label,
        "costliest": [_item_object(loss) for loss in time_loss.costliest],
        "items": [_item_object(loss) for loss in time_loss.losses],
        "legs": [
            {
                "from": leg.reference.before.name,
                "passing": leg.name,
                "lost_s": leg.difference,
                **{f"by_{cause.value}_s": part for cause, part in legs[leg.name].items()},
            }
            for loss in time_loss.losses
            for leg in loss.legs
        ],
    }


def _item_object(loss: Loss) -> dict[str, object]:
    return {
        "from": loss.begin,
        "passing": loss.end,
        "legs": [leg.name for leg in loss.legs],
        "lost_s": loss.amount,
        "parts": [
            {
                "cause": "all else" if part.cause is None else part.cause.value,
                "by": "rest" if part.cause is None else part.cause.by,
                "lost_s": part.amount,
                "shown_s": part.hundredths / 100.0,
                "facts": [_difference_object(fact) for fact in part.facts],
            }
            for part in loss.parts
        ],
        "text": loss_text(loss),
    }


def cost_to_go_object(loss: CostToGoLoss) -> dict[str, object]:
    """Return what a flight lost by the cost to go: seconds, on the clock of the flight."""
    return {
        "flight": loss.flight.label,
        "against": loss.against,
        "race_time_s": loss.race_time,
        "total_s": loss.total,
        "start_s": loss.start,
        "costliest": [{"passing": leg.leg.name, "lost_s": leg.amount, "text": leg.words} for leg in loss.costliest],
        "legs": [
            {
                "from": leg.leg.before.name,
                "passing": leg.leg.name,
                "lost_s": leg.amount,
                "deviation_s": leg.deviation,
                **{f"by_{name}_s": part for name, part in leg.parts.items()},
                "cues": [{"cue": cue.name, "time_s": cue.time, "lost_s": cue.amount} for cue in leg.cues],
            }
            for leg in loss.legs
        ],
        "moments": [
            {
                "time_s": sample.moment.time,
                "cost_to_go_s": sample.cost,
                "deviation_s": sample.deviation,
                "gave_way": sample.text or None,
            }
            for sample in loss.samples
        ],
    }


def _difference_objects(leg: LegComparison) -> list[dict[str, object]]:
    return [_difference_object(difference) for difference in leg.differences]


def _difference_object(difference: Difference) -> dict[str, object]:
    return {
        "what": difference.name,
        "reference": difference.reference,
        "flight": difference.value,
        "unit": difference.unit,
        "text": difference_text(difference),
    }
