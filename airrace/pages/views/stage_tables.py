"""The tables of a flight and its stage: gate splits, certificate, routes, and least distances."""

import math
from collections.abc import Sequence
from dataclasses import replace

from airrace.flights.results import Flight
from airrace.flights.results.active_limits import ActiveLimit, active_limits
from airrace.flights.results.clearances import NEAR_MISS, least_distances
from airrace.optimal_control.certificate import Certificate, Curvature
from airrace.optimal_control.quantities import KNOT, plain_number
from airrace.pages.views.tables import RACE, Cell, Column, Table, Units, Value
from airrace.procedure.result import (
    CLEARANCE,
    HARDLY_SLOWER,
    GateSplit,
    LowerBound,
    NoteKind,
    SearchReport,
    StageResult,
    Status,
)

_SPLITS = (
    Column("gate", key="passage"),
    Column("time", "s", ".3f", "time_s"),
    Column("leg", "s", ".3f", "leg_s", rank=4),
    Column("speed", "kt", ".1f", "V_K_kt"),
    Column("speed", "m/s", ".1f", "V_K_m_s", rank=1),
    Column("height", "m", ".1f", "height_m"),
    Column("load", "g", "z.2f", "n_z", rank=5),
    Column("bank", "deg", "z.1f", "bank_deg", rank=3),
    Column("climb", "deg", "z.1f", "climb_deg", rank=2),
    Column(key="heading_deg"),
)


def splits_table(splits: Sequence[GateSplit], title: str = "gate splits") -> Table:
    """Return a table of the passings; `leg` is the time since the passing before, of the first one since the start."""
    befores = (0.0, *(split.time for split in splits))
    rows = [
        (
            split.name,
            split.time,
            split.time - before,
            split.V_K / KNOT,
            split.V_K,
            split.height,
            split.n_z,
            math.degrees(split.bank),
            math.degrees(split.climb),
            round(math.degrees(split.heading), 7) % 360.0,
        )
        for split, before in zip(splits, befores, strict=False)
    ]
    return Table(title, _SPLITS, rows)


_VALUE = Column("value", form=".3g", key="value")
_CERTIFICATE = (
    Column("item", key="name"),
    _VALUE,
    Column("limit", form=".3g", key="limit", rank=3),
    Column("unit", key="unit", rank=2),
    Column("holds", key="holds"),
    Column("worst at", key="where", wraps=True, rank=1),
)


def certificate_table(certificate: Certificate, title: str, notes: Sequence[str] = ()) -> Table:
    """Return a table of all items with their limits, angles in degrees, and where a value that is not zero is worst."""
    rows: list[tuple[Cell | Value, ...]] = []
    for item in certificate.items:
        value, limit, unit = Cell(item.value), Cell(item.limit), Cell(item.unit)
        if item.unit in ("rad", "rad/s"):
            value = Cell(item.value, text=_VALUE.text(math.degrees(item.value)))
            limit = Cell(item.limit, text=_VALUE.text(math.degrees(item.limit)))
            unit = Cell(item.unit, text=item.unit.replace("rad", "deg"))
        holds = Cell(bool(item.holds), text="yes" if item.holds else "NO", bad=not item.holds)
        rows.append((item.name, value, limit, unit, holds, Cell(item.where, text=item.where if item.value else "")))
    curvature = [] if certificate.second_order is None else [f"Curvature: {certificate.second_order}."]
    return Table(title, _CERTIFICATE, rows, [*notes, *curvature])


ONE_MESH = "on one mesh; no second mesh has confirmed the race time"
ROUGH = "as closely as the next stage needs; a race time may be a few hundredths of a second too long"


_STAGES = (
    Column("stage"),
    Column("status", wraps=True),  # of two words, which a narrow terminal puts below each other
    Column("time", "s", ".3f"),
    Column("cost", "s", "+z.3f", rank=4),
    Column("regul.", "s", ".3f", rank=2),
    Column("track.", "m", ".2f", rank=1),
    Column("iter.", form="d", rank=3),
    Column("wall", "s", ".1f", rank=3),
)


def stages_table(results: Sequence[StageResult]) -> Table:
    """Return a table of the finished stages; `cost` is what a fidelity adds to the optimum before it that holds."""
    rows: list[tuple[Cell | str | float | None, ...]] = []
    before: float | None = None
    for result in results:
        race_time, provenance = result.trajectory.race_time, result.provenance
        optimum = result.has_race_time
        sound = result.status in (Status.CERTIFIED, Status.SOLVED, Status.GUESS)
        status = "NOT certified" if result.status is Status.NOT_CERTIFIED else result.status.value
        rows.append(
            (
                result.stage.value,
                Cell(status, bad=not sound),
                race_time if optimum else None,
                race_time - before if optimum and before is not None else None,
                provenance.regularisation if optimum else None,
                provenance.tracking_error if provenance.source else None,
                result.iterations,
                result.timings.wall,
            )
        )
        before = race_time if result.holds else before
    solved_results = [result for result in results if result.status is Status.SOLVED]
    rough = ", ".join(result.stage.value for result in solved_results if result.is_rough)
    notes = [f"solved: {ONE_MESH}"] if solved_results else []
    notes += [f"{rough}: {ROUGH}"] if rough else []
    return Table("stages", _STAGES, rows, notes)


_ROUTE, _BEHIND, _EVALUATED = (
    Column("route", wraps=True),
    Column("behind", "s", "+z.3f"),
    Column("evaluated by", rank=1),
)
SLACK_TOLD = 0.01
"""The time by which a window holds a lower bound open that is told, s."""
NEAR_ROLLS = 0.015
"""The time behind the best within which routes that only roll otherwise share a line, s."""


LIMITS_OF_CLAIM = (
    "It is a local optimum: small changes gain nothing, as far as first and second derivatives tell; "
    "another route may be faster.",
    "The routes are those that the search evaluated on a coarse mesh; it says nothing of those that it did not try.",
    "The limits are those of course, rules and aircraft, in the air of the inputs.",
    "The aircraft is the model of this stage, as true as its numbers.",
    "Limits are reached, so the flight has no reserve for gusts, for delay or for errors of the pilot.",
)
"""What the claim of a stage does not say, a sentence each."""


def verdict_words(result: StageResult) -> str:
    """Return the verdict on a stage in about four words, e.g. `certified: local optimum`, or the items that fail."""
    match result.status:
        case Status.CERTIFIED:
            return "certified: local optimum"
        case Status.SOLVED:
            return (
                "solved on one mesh, as closely as the next stage needs"
                if result.is_rough
                else "solved on one mesh: local optimum"
            )
        case Status.GUESS:
            return "a guess, no optimum"
        case Status.NOT_CERTIFIED:
            failed = [] if result.certificate is None else [item.name for item in result.certificate.failed]
            more = f" and {len(failed) - 2} more" if len(failed) > 2 else ""
            return f"NOT certified{': ' if failed else ''}{', '.join(failed[:2])}{more}"
        case _:
            return f"no flight: {result.status.value}"


def claim(results: Sequence[StageResult]) -> str:
    """Return what is claimed of the last of some stages; empty where it does not hold.

    It says e.g. `certified: a local minimum, all limits measured, the best of 23 routes`, or `the simplest within 10 ms
    of the best of 23 routes` where a faster flight was left for it.

    Args:
        results: the stage and those before it, of which the last one that searched tells how many routes there were.
    """
    if not results or not results[-1].holds:
        return ""
    if results[-1].is_rough:
        return (
            "solved: on one mesh, as closely as the next stage needs; curvature and limits between nodes not measured"
        )
    certified = results[-1].status is Status.CERTIFIED
    verdict, meshes = ("certified", "") if certified else ("solved", " on one mesh")
    count = next((len(result.search.routes) for result in reversed(results) if result.search.routes), 1)
    routes = f"the best of {count} routes" if count > 1 else "no other route was evaluated"
    if _left_faster(results):
        fastest = routes if count > 1 else "the fastest flight"
        routes = f"the simplest within {1e3 * HARDLY_SLOWER:.0f} ms of {fastest}"
    optimum, touched = _optimum(results[-1].certificate), _touches(results[-1].certificate)
    return f"{verdict}: {optimum}, all limits measured{meshes}, {routes}{touched}"


def _left_faster(results: Sequence[StageResult]) -> bool:
    """Tell whether a faster flight was left for that of the last stage, in it or where its route was chosen last."""
    for number in range(len(results) - 1, -1, -1):
        if any(note.kind is NoteKind.SIMPLER_ROUTE for note in results[number].notes):
            return True
        if number and results[number - 1].alternatives:
            return False  # which were flown in this stage, too, so it has chosen anew
    return False


def _optimum(certificate: Certificate | None) -> str:
    """Return what an optimum that holds is, as far as its curvature tells."""
    second_order = None if certificate is None else certificate.second_order
    if second_order is None:
        return "a local optimum"
    if second_order.hangs_on_weak_limits:
        return "a local optimum, a minimum as far as limits that are weakly active hold"
    if second_order.curvature is Curvature.POSITIVE:
        return "a local minimum"
    direction = f"the {second_order.quantity} on {second_order.phase}"
    return f"a local minimum but for changes that cost next to nothing, as of {direction}"


def _touches(certificate: Certificate | None) -> str:
    """Return the sentence on a clearance from pylons that is missed and does not decide; empty where there is none."""
    items = () if certificate is None else certificate.items
    clearance_violation = next((item.value for item in items if item.name == CLEARANCE and math.isinf(item.limit)), 0.0)
    text = f"; beside its crossings the wing misses its clearance from a pylon by {clearance_violation:.2f} m"
    return text if clearance_violation >= NEAR_MISS else ""


def search_table(search: SearchReport, title: str = "", most: int | None = None, notes: Sequence[str] = ()) -> Table:
    """Return a table of the route of the flight and those that came next, on a coarse mesh or refined.

    It is called the best where none is ahead of it there.

    Args:
        search: of a stage that tried routes.
        title: empty for one that tells how many routes were tried.
        most: the largest number of rows of routes; None for any. Routes that only roll otherwise share one.
        notes: sentences that belong to it.
    """
    best, starts = search.converged_to_best, search.converged_to_best + search.converged_elsewhere + search.failed
    first, *further_routes = search.routes
    place = "chosen" if any(route.difference < 0.0 for route in further_routes) else "best"
    rolls = [route for route in further_routes if route.rolls and abs(route.difference) <= NEAR_ROLLS]
    rolls = rolls if len(rolls) > 1 else []
    rows: list[tuple[str | float, ...]] = [(first.text, first.race_time, place, first.evaluated_by)]
    if rolls:
        behind = 1e3 * max(route.difference for route in rolls)
        last = f"{abs(behind):.0f} ms {'ahead' if behind < 0.0 else 'behind'}"
        words = f"{len(rolls)} routes that roll otherwise on a leg, the last of them {last}"
        rows.append((words, rolls[0].race_time, rolls[0].difference, ""))
    distinct_routes = [route for route in further_routes if route not in rolls]
    visible_routes = distinct_routes if most is None else distinct_routes[: max(most - len(rows), 0)]
    rows += [(route.text, route.race_time, route.difference, route.evaluated_by) for route in visible_routes]
    if len(visible_routes) < len(distinct_routes):
        rows.append((f"and {len(distinct_routes) - len(visible_routes)} more", "", "", ""))
    heading, time = f"routes: {len(search.routes)} optimised", "race time"
    if not search.refined:
        heading, time = f"routes: {len(search.routes)} tried in {search.seconds:.1f} s", "rough time"
        heading += f", {best} of {starts} multistarts converged to the {place} one"
    columns = (_ROUTE, Column(time, "s", ".3f", rank=2), _BEHIND, _EVALUATED)
    return Table(title or heading, columns, rows, notes)


def bound_text(bound: LowerBound) -> str:
    """Return the sentence on how much faster a flight could be, and which windows hold it open."""
    if not bound.windows:
        return "the search by prices was stopped before it had a bound: how much faster a flight could be is not known"
    faster = bound.race_time * bound.gap
    text = (
        f"no flight is more than {100.0 * bound.gap:.2f} % ({faster:.2f} s) faster, as far as windows of up to "
        f"{bound.legs_max} legs were solved globally by at least {bound.starts} starts each"
    )
    widest = max(bound.windows, key=lambda window: window.slack)
    if widest.slack >= SLACK_TOLD:
        text += f"; {widest.slack:.2f} s of it on {widest.text}"
    if unsolved := [window.text for window in bound.windows if not window.solved]:
        text += f"; no start led to a flight at the final prices on {', '.join(unsolved)}"
    if bound.stopped:
        text += "; the search by prices was stopped before its end"
    return text


_DISTANCES = (
    Column("from", wraps=True),
    Column("least", "m", "z.2f"),
    Column("required", "m", "z.1f", rank=2),
    Column("left", "m", "z.2f"),
    Column("at", "s", "z.2f"),
    Column("height", "m", "z.0f", rank=1),
)


def distance_table(
    flight: Flight, title: str, *, begin: float = 0.0, notes: Sequence[str] = (), units: Units = RACE
) -> Table:
    """Return a row for every thing; none where nothing is known.

    Args:
        flight: of which it is.
        title: stands above it.
        begin: the time that times count from, s.
        notes: sentences that belong to it.
        units: of lengths.
    """
    columns: list[Column] = []
    for column in _DISTANCES:
        is_length = column.unit == "m"
        columns.append(replace(column, unit=units.length, factor=units.per_m) if is_length else column)
    rows: list[tuple[str | float, ...]] = []
    for clearance in least_distances(flight):
        distances = (clearance.distance, clearance.required, clearance.margin)
        if clearance.kind == "floor":  # people know it as a height
            distances = (clearance.height, clearance.height - clearance.distance, clearance.margin)
        rows.append((clearance.text, *distances, clearance.time - begin, clearance.height))
    return Table(title, columns, rows, notes)


_LIMITS = (
    Column("what limits", wraps=True),
    Column("at"),
    Column("for s", form=".2f"),
    Column("of the race", form=".0%", rank=1),
    Column("most on the leg to", rank=2),
)


def limits_table(flight: Flight, most: int | None = None) -> Table:
    """Return a table of the limits that a flight reaches, those it keeps to for longest first.

    Args:
        flight: an optimum.
        most: the largest number of rows; None for all.
    """
    limits = active_limits(flight)
    rows = [
        (limit.text, _value_text(limit), limit.duration, limit.duration / flight.race_time, limit.leg)
        for limit in limits[:most]
    ]
    return Table("", _LIMITS, rows)


def _value_text(limit: ActiveLimit) -> str:
    """Return the value of a limit with its unit, angles in degrees."""
    if "rad" in limit.unit:
        return f"{plain_number(math.degrees(limit.value), 4)} {limit.unit.replace('rad', 'deg')}"
    return f"{plain_number(limit.value, 4)} {'' if limit.unit == '1' else limit.unit}".rstrip()
