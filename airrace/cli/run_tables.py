"""The tables of a run: stages, certificates, meshes, legs, near misses, and comparisons."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from airrace.cli.printed_result import PAGE, number, paragraph, render
from airrace.flights.results import Flight, laps_of
from airrace.flights.results.clearances import NearMiss
from airrace.flights.results.comparison import TIE, Comparison, compare_flights, conditions
from airrace.flights.results.cost_to_go import CostToGoLoss
from airrace.flights.results.flight_facts import Range, leg_facts
from airrace.flights.results.time_loss import time_loss
from airrace.optimal_control.certificate import RefinementReason
from airrace.optimal_control.quantities import KNOT
from airrace.pages.views.comparison_tables import (
    cost_table,
    laps_table,
    loss_text,
    lost_table,
    recorded_sectors,
    sectors_notes,
    sectors_table,
)
from airrace.pages.views.stage_tables import ONE_MESH, ROUGH, certificate_table, distance_table
from airrace.pages.views.tables import Column, Table
from airrace.procedure.result import StageResult
from airrace.runs.json_objects import REASONS

if TYPE_CHECKING:
    from airrace.optimal_control.certificate import Certificate


ROUTES_MAX = 12
"""The largest number of rows of routes; all of them are in the checkpoint and in the object."""
TIE_MS = round(1000.0 * TIE)
"""The difference within which legs are a tie, ms."""


def items_table(certificate: "Certificate", verdict: str = "", begin: str = "") -> Table:
    """Return a table of the items of a certificate.

    Args:
        certificate: of a stage.
        verdict: in its title; by default what the items say.
        begin: the begin of its title.
    """
    one_mesh = f"solved {ROUGH if certificate.is_rough else ONE_MESH}"
    if certificate.certified:
        outcome = "certified"
    else:
        outcome = one_mesh if certificate.holds else "NOT certified"
    title = f"{begin}certificate: {verdict or outcome}{_open_clause(certificate)} ({certificate.solver_status})"
    return certificate_table(certificate, title)


def _open_clause(certificate: "Certificate") -> str:
    """Return a clause for what is only measured and is not as it should be; empty where there is nothing."""
    clauses = (
        f"; but {item.name} missed by {item.value:.2f} {item.unit} ({item.where})" for item in certificate.undecided
    )
    return "".join(clauses)


_MESH = (
    Column("leg to"),
    Column("intervals", form="d"),
    Column("shortest", "ms", ".0f", rank=3),
    Column("longest", "ms", ".0f", rank=4),
    Column("replay", "defect", ".1e", rank=2),
    Column("Hamiltonian", "from -1", ".1e", rank=1),
    Column("last cut or joined for", wraps=True),
)


def mesh_table(result: StageResult) -> Table:
    """Return a table of the legs: their intervals, the worst values measured, and the reasons for their lengths."""
    trajectory, mesh = result.trajectory, result.mesh
    steps = 1e3 * np.diff(trajectory.time)
    rows: list[tuple[str | float, ...]] = []
    for phase, first, last in zip(trajectory.phases, trajectory.first_node, trajectory.first_node[1:], strict=False):
        leg = slice(first, last)
        counts = np.bincount(mesh.why[leg], minlength=len(RefinementReason)).tolist()
        reasons = [(count, REASONS[reason]) for reason, count in zip(RefinementReason, counts, strict=True) if count]
        rows.append(
            (
                phase.rpartition(" -> ")[2],
                int(last - first),
                float(steps[leg].min()),
                float(steps[leg].max()),
                float(mesh.defect[leg].max()),
                float(mesh.drift[leg].max()),
                ", ".join(f"{reason} {count}" for count, reason in sorted(reasons, reverse=True)),
            )
        )
    title = f"{result.stage.value}: {len(steps)} intervals, and what they were last cut or joined for"
    return Table(title, _MESH, rows)


def laps_text(flight: Flight) -> str:
    """Return the lap times in a line; empty for a race of one lap."""
    laps = [f"{lap.number}: {number(lap.time, 3)} s" for lap in laps_of(flight)]
    return f"laps: {', '.join(laps)}" if len(laps) > 1 else ""


def leg_tables(flight: Flight) -> tuple[Table, Table]:
    """Return two tables, of at most 80 columns, of every leg: loads and energy; speeds (kt) and the clearance with the
    least margin."""
    loads: list[tuple[str | float | None, ...]] = []
    speeds: list[tuple[str | float | None, ...]] = []
    for facts in leg_facts(flight):
        name, nearest = facts.leg.name, facts.clearances[0] if facts.clearances else None
        ranges = (facts.n_z.least, facts.n_z.greatest, facts.height.least, facts.height.greatest)
        loads.append((name, facts.leg.time, *ranges, math.degrees(facts.roll_rate), facts.energy_in, facts.energy_out))
        clearance = (nearest.distance, nearest.required) if nearest else (None, None)
        where = f"{nearest.text} at {nearest.time:.2f} s" if nearest else ""
        speeds.append((name, _knots(facts.V_K), _knots(facts.V_A), _knots(facts.V_I), *clearance, where))
    return Table("legs", _LOADS, loads), Table("legs: speeds and clearances", _SPEEDS, speeds)


def distance_tables(flight: Flight) -> list[Table]:
    """Return a table of the least distance from every thing on the course; none where nothing is known."""
    table = distance_table(flight, "least distances")
    return [table] if table.rows else []


_LOADS = (
    Column("leg to"),
    Column("time", "s", "z.3f"),
    Column("load", "least g", "z.2f", rank=3),
    Column("load", "most g", "z.2f"),
    Column("height", "least m", "z.1f"),
    Column("height", "most m", "z.1f", rank=4),
    Column("roll", "deg/s", "z.0f", rank=5),
    Column("energy", "start m", "z.0f", rank=1),
    Column("energy", "end m", "z.0f", rank=2),
)
_SPEEDS = (
    Column("leg to"),
    Column("ground", "kt", ".0f", rank=2),
    Column("true", "kt", ".0f", rank=1),
    Column("indicated", "kt", ".0f", rank=4),
    Column("nearest", "m", ".1f"),
    Column("required", "m", ".1f", rank=3),
    Column("to", wraps=True),
)


def _knots(speeds: Range) -> str:
    least, greatest = speeds.least / KNOT, speeds.greatest / KNOT
    return f"{number(least, 0)} - {number(greatest, 0)}" if math.isfinite(least) else "-"


_NEAR_MISSES = (
    Column("pylon of"),
    Column("distance", "m", ".2f"),
    Column("required", "m", ".2f", rank=2),
    Column("time", "s", ".2f", rank=1),
    Column("where", wraps=True),
)


def near_miss_table(misses: Sequence[NearMiss]) -> Table:
    """Return a table of near misses."""
    rows: list[tuple[str | float, ...]] = []
    for miss in misses:
        clearance = miss.clearance
        rows.append((clearance.name, clearance.distance, clearance.required, clearance.time, miss.where))
    return Table("near misses", _NEAR_MISSES, rows)


def comparison_texts(comparisons: Sequence[Comparison], *, every: bool) -> Iterator[str]:
    """Yield verdicts, conditions and what cost most, then tables: of two flights beside each other, and of all legs.

    Args:
        comparisons: of flights with one reference.
        every: whether legs that are ties are listed, too.
    """
    for comparison in comparisons:
        yield "\n".join(_verdict_lines(comparison))
        yield from _loss_texts(comparison)
        if comparison.cost_to_go is not None:
            yield from cost_to_go_texts(comparison.cost_to_go)
    flights = [comparisons[0].reference, *(comparison.flight for comparison in comparisons)]
    displaced = dict.fromkeys(sentence for flight in flights for sentence in flight.source.displaced)
    if displaced:
        yield "\n".join(paragraph(sentence, begin="note: ") for sentence in displaced)
    if len(comparisons) == 2:
        yield from _pair_texts(*comparisons)
    sectors = recorded_sectors(flights)
    if sectors is not None:
        yield render(sectors_table(sectors, f"{len(sectors.flights)} recorded flights, sector by sector"), columns=PAGE)
        yield "\n".join(map(paragraph, sectors_notes(sectors)))
    for comparison in comparisons:
        yield from _legs_texts(comparison, f"{comparison.flight.label}: " if len(comparisons) > 1 else "", every=every)


def _verdict_lines(comparison: Comparison) -> list[str]:
    reference, other = comparison.reference, comparison.flight
    times = f"{other.race_time:.3f} s and {reference.race_time:.3f} s"
    verdict = f"{abs(comparison.difference):.3f} s {'slower' if comparison.difference > 0.0 else 'faster'} ({times})"
    if math.isnan(comparison.difference):
        verdict = "one of them does not finish"
    elif comparison.tie:
        verdict = f"a tie within {TIE_MS} ms ({times})"
    details = [f"{what}: {second} against {first}" for what, first, second in conditions(reference, other)]
    flights = (other, reference)
    details += [f"{flight.label} is {flight.source.verdict}" for flight in flights if flight.source.certified is False]
    for flight in flights:
        if flight.source.verification is not None:
            details.append(f"{flight.label}: {flight.source.verification.remark}")
        if flight.source.penalties:
            details.append(f"{flight.label}: penalties of what is certain: {flight.source.penalties}")
    first = paragraph(f"{other.label} against {reference.label}: {verdict}")
    return [first, *(paragraph(detail, begin="  ") for detail in details)]


def _loss_texts(comparison: Comparison) -> Iterator[str]:
    """Yield in words what costs the slower flight most, if anything does."""
    loss = time_loss(comparison)
    if loss.costliest:
        lines = (
            paragraph(loss_text(item), begin=f"  {number}. ") for number, item in enumerate(loss.costliest, start=1)
        )
        yield "\n".join([paragraph(f"{loss.title}:"), *lines])


def cost_to_go_texts(loss: CostToGoLoss) -> Iterator[str]:
    """Yield what a flight lost by the cost to go: in all, the costliest legs in words, and a table of all legs."""
    lines = [paragraph(leg.words, begin=f"  {number}. ") for number, leg in enumerate(loss.costliest, start=1)]
    yield "\n".join([paragraph(f"{loss.title}{':' if lines else ''}"), *lines])
    yield render(cost_table(loss), columns=PAGE)


def _pair_texts(first: Comparison, second: Comparison) -> Iterator[str]:
    """Yield two flights against each other and both against the reference: in words, and in one table of all legs."""
    between = compare_flights(first.flight, second.flight)
    yield from _loss_texts(between)
    labels = [f"{comparison.flight.label} lost" for comparison in (first, second)]
    labels.append(f"{second.flight.label} lost against {first.flight.label}")
    columns = [Column("leg to"), Column(first.reference.label, "s", ".3f")]
    columns += [Column(label, "s", "+z.3f", wraps=True) for label in labels]
    legs = zip(first.legs, second.legs, between.legs, strict=True)
    rows = [(a.name, a.reference.time, a.difference, b.difference, c.difference) for a, b, c in legs]
    rows.append(("race", first.reference.race_time, first.difference, second.difference, between.difference))
    yield render(Table(f"both against {first.reference.label}, and against each other", columns, rows), columns=PAGE)


def _legs_texts(comparison: Comparison, label: str, *, every: bool) -> Iterator[str]:
    if len(comparison.laps) > 1:
        yield render(laps_table(comparison, f"{label}laps"), columns=PAGE)
    legs = [leg for leg in comparison.by_loss if every or not leg.tie]
    if legs:
        yield render(lost_table(legs, f"{label}legs by time lost"), columns=PAGE)
    ties = len(comparison.legs) - len(legs)
    if ties:
        yield paragraph(f"{label}{'1 leg is' if ties == 1 else f'{ties} legs are'} a tie within {TIE_MS} ms")
