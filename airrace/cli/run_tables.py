"""The tables of a run: stages, splits, certificates, routes, meshes, legs, near misses, its start, and comparisons."""

import logging
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from airrace.checkpoint import Checkpoint, inputs_hash, stale_stages
from airrace.cli.answer import PAGE, number, render
from airrace.errors import InputError, UsageError
from airrace.procedure.result import UNVERIFIABLE, RefinementReason, StageResult, Status
from airrace.procedure.stage import Stage
from airrace.quantities import KNOT
from airrace.records import record
from airrace.results import Confirmation, Flight, laps_of
from airrace.results.clearances import NearMiss, near_misses
from airrace.results.comparison import TIE, Comparison, compare_flights, conditions
from airrace.results.flight_facts import Range, leg_facts, sustained_loads
from airrace.results.time_loss import time_loss
from airrace.runs.json_objects import REASONS, confirmation_object, legs_object, run_object, stage_object
from airrace.runs.run import ensure_readable, run_of_checkpoint
from airrace.runs.stage_view import downgrade_stale, is_certified
from airrace.track.course import ClearanceRule
from airrace.views.plain_text import one_line
from airrace.views.stage_tables import certificate_table, claim, distance_table, search_table, splits_table
from airrace.views.tables import Cell, Column, Table

if TYPE_CHECKING:
    from airrace.optimal_control.certificate import Certificate
    from airrace.runs.plan import ExecutionPlan

logger = logging.getLogger(__name__)

DOES_NOT_STAND = "NOT certified: its items may hold, but the stage does not stand"
ONE_MESH = "checked on one mesh; no second mesh has confirmed the race time"


@record
class TableSettings:
    """What the tables of a run leave out.

    Attributes:
        routes_max: the largest number of routes in the table; all of them are in the checkpoint and in the object.
        tie_ms: the difference within which legs are a tie, ms.
    """

    routes_max: int = 12
    tie_ms: float = round(1000.0 * TIE)


TABLE = TableSettings()
NEAR_MISSES = textwrap.fill(
    "warning: the rules measure the wing tips at the instant of a passing alone; right before or after it, or at other "
    "gates, the wing comes as close to pylons as stated above. With `--set rules.clearance=flight` it keeps clear of "
    "them all along.",
    PAGE,
)
REFUSED = "this version of airrace refuses the inputs"
NOBODY_CAN = f"Nobody can verify {', '.join(UNVERIFIABLE[:-1])} and {UNVERIFIABLE[-1]}."


def flight_texts(plan: "ExecutionPlan", results: Sequence[StageResult]) -> Iterator[str]:
    """Yield what `optimize` and `resume` show of the stages of a run: messages, tables, and what was changed by it."""
    from airrace.runs.stage_view import StageView

    yield from _headline(results)
    yield from (f"{one.stage.value}: {one.remarks}" for one in results if one.holds and one.remarks)
    tables = [stages_table(results)] if any(result.holds for result in results) else []
    tables += [search_table(one.search, most=TABLE.routes_max) for one in results[:-1] if one.search.routes]
    yield from (render(table, columns=PAGE) for table in (*tables, *result_tables(results[-1])))
    if results[-1].is_flight:
        yield from _warnings(StageView(plan.run.inputs, results[-1], {}).flight())
    compared = plan.compare(results)
    if compared is not None:
        yield from comparison_texts([compared], every=False)


@record
class StoredStages:
    """The content of a checkpoint as `airrace show` shows it: its stages, and legs and laps of one of them.

    Attributes:
        checkpoint: that holds them.
        every: all stages of the run; those that no longer stand are not certified.
        results: the stages that are shown, in their order.
        confirmations: the outcome of measuring each of them again.
        flight: that of the stage that was asked for, by default of the last one that found a flight; None where there
            is none, or where this version of airrace does not accept the stored inputs.
        stage: the name of the stage that the flight belongs to; empty without one.
    """

    checkpoint: Checkpoint
    every: tuple[StageResult, ...]
    results: tuple[StageResult, ...]
    confirmations: Mapping[Stage, Confirmation]
    flight: Flight | None = None
    stage: str = ""

    @property
    def verified(self) -> bool | None:
        """Whether all stages that are shown are verified; None where some are not, and none is refuted."""
        verified = [one.verified for one in self.confirmations.values()]
        return False if False in verified else True if verified and all(verified) else None

    def as_object(self) -> dict[str, object]:
        """Return the object of the run, with `legs` and `laps` in the stage whose flight is shown.

        `verified` is null where not all of it was measured again.
        """
        wall = sum(result.timings.wall for result in self.every)
        track = one_line(Path(self.checkpoint.inputs.track.path).stem)
        legs = {} if self.flight is None else {self.stage: legs_object(self.flight)}
        stages = [
            stage_object(result)
            | legs.get(result.stage.value, {})
            | confirmation_object(self.confirmations[result.stage])
            for result in self.results
        ]
        run = run_object(track, self.results, wall, certified=is_certified(self.every))
        return run | {"stages": stages, "verified": self.verified}


def stored_stages(checkpoint: Checkpoint, path: Path, stage: str | None, *, verify: bool) -> StoredStages:
    """Choose what is shown.

    Args:
        checkpoint: read from a file.
        path: of that file.
        stage: the name of the only stage that is shown; None for all.
        verify: whether these are measured again.

    Raises:
        UsageError: the run has no such stage.
    """
    run, refusal = None, ""
    shown = [one.result.stage for one in checkpoint.stages if stage in (None, one.result.stage.value)]
    try:
        run = ensure_readable(run_of_checkpoint(checkpoint, path)).confirmed(shown, verify=verify)
        every = run.valid_results
    except InputError as error:  # the stages may stand on these inputs as they are stored
        refusal = str(error.findings[0])
        stale = dict(stale_stages(checkpoint, inputs_hash(checkpoint.inputs.resolved)))
        stored = (one.result for one in checkpoint.stages)
        every = tuple(downgrade_stale(result, stale.get(result.stage, "")) for result in stored)
    results = tuple(result for result in every if stage in (None, result.stage.value))
    if stage is not None and not results:
        names = ", ".join(result.stage.value for result in every) or "none"
        raise UsageError(f"this run has no stage {stage!r}; it has: {names}")
    name = next((result.stage.value for result in reversed(results) if result.is_flight), None)
    confirmations = run.confirmations if run is not None else {one: Confirmation(None, REFUSED) for one in shown}
    if name is not None and run is not None:
        return StoredStages(checkpoint, every, results, confirmations, run.flight(name), name)
    if name is not None:
        logger.warning("legs and laps are left out: %s: %s", REFUSED, refusal)
    return StoredStages(checkpoint, every, results, confirmations)


def _headline(results: Sequence[StageResult], confirmation: Confirmation | None = None) -> Iterator[str]:
    """Yield race time and claim of the last stage, and the outcome of measuring it again.

    Where the stage does not hold there is nothing, unless that is the outcome.
    """
    claimed, confirmed = claim(results), "" if confirmation is None else confirmation.outcome
    if confirmation is not None and confirmation.refutation:
        claimed = results[-1].status.value
    if claimed:
        words = "; ".join(text for text in (claimed, confirmed) if text)
        yield textwrap.fill(f"{results[-1].trajectory.race_time:.3f} s, {words}", PAGE)


def _confirmation_texts(confirmations: Mapping[Stage, Confirmation]) -> Iterator[str]:
    """Yield the outcomes of measuring stages again, equal words once, and what nobody can verify.

    What was refuted the remark on its stage tells.
    """
    alike: dict[str, list[str]] = {}
    for stage, one in confirmations.items():
        alike.setdefault(one.remark, []).append(stage.value)
    yield "\n".join(
        textwrap.fill(f"{'all stages' if len(alike) == 1 < len(confirmations) else ', '.join(stages)}: {words}", PAGE)
        for words, stages in alike.items()
    )
    yield textwrap.fill(NOBODY_CAN, PAGE)


def run_texts(shown: StoredStages, *, legs: bool, certificates: bool) -> Iterator[str]:
    """Yield the stages, what each of them says, then splits, routes, legs and certificates; at most 80 columns wide.

    Args:
        shown: what `show` shows.
        legs: whether every leg of the chosen flight is shown.
        certificates: whether the items of the certificates are listed instead of summed up in a line.
    """
    results = shown.results
    yield from _headline(results, shown.confirmations[results[-1].stage] if results else None)
    yield render(stages_table(results), columns=PAGE) if results else "no stage is finished yet"
    if results:
        yield from _confirmation_texts(shown.confirmations)
    yield from (f"{result.stage.value}: {result.remarks}" for result in results if result.remarks)
    yield from (f"a needless loop: {loop}" for result in results for loop in result.search.loops)
    for result in results:
        meshes = [mesh_table(result)] if len(result.mesh.why) else []
        tables = [*result_tables(result, certificate=certificates), *meshes]
        yield from (render(table, columns=PAGE) for table in tables)
        if result.certificate is not None and not certificates:
            yield _certificate_line(result, result.certificate)
        if shown.flight is not None and result.stage.value == shown.stage:
            yield from laps_lines(shown.flight)
            yield from (render(one, columns=PAGE) for one in distance_tables(shown.flight))
            yield from _warnings(shown.flight)
            if legs:
                yield from (render(table, columns=PAGE) for table in leg_tables(shown.flight))


def result_tables(result: StageResult, *, certificate: bool = True) -> list[Table]:
    """Return what a finished stage shows: gate splits, routes and, if asked for, the items of its certificate."""
    tables: list[Table] = []
    if result.splits and result.is_flight:
        title = f"{result.stage.value}: race time {result.trajectory.race_time:.3f} s"
        tables.append(splits_table(result.splits, title))
    if result.search.routes:
        tables.append(search_table(result.search, most=TABLE.routes_max))
    if certificate and result.certificate is not None:
        stands = result.outcome is Status.SOLVED or not result.certificate.holds
        tables.append(items_table(result.certificate, "" if stands else DOES_NOT_STAND))
    return tables


def items_table(certificate: "Certificate", verdict: str = "") -> Table:
    """Return a table of the items of a certificate; its title is the verdict, by default what the items say."""
    measured = "certified" if certificate.certified else ONE_MESH if certificate.holds else "NOT certified"
    title = f"certificate: {verdict or measured}{_open_clause(certificate)} ({certificate.solver_status})"
    return certificate_table(certificate, title)


def _open_clause(certificate: "Certificate") -> str:
    """Return a clause for what is only measured and is not as it should be; empty where there is nothing."""
    clauses = (f"; but {one.name} missed by {one.value:.2f} {one.unit} ({one.where})" for one in certificate.undecided)
    return "".join(clauses)


def _certificate_line(result: StageResult, certificate: "Certificate") -> str:
    """Return the verdict with the item that comes nearest to its limit, or with those that fail."""
    items, failed = certificate.items, certificate.failed
    if certificate.holds and not result.holds:
        return f"certificate: {DOES_NOT_STAND}"
    if failed or not items:
        listed = ", ".join(f"{item.name} {item.value:.3g} > {item.limit:.3g} {item.unit}".rstrip() for item in failed)
        return f"certificate: NOT certified ({certificate.solver_status}): {listed or 'nothing was measured'}"
    limited = [item for item in items if item.limit > 0.0]
    nearest = max(limited, key=lambda item: item.value / item.limit, default=None)
    tightest = "" if nearest is None else f"; nearest to its limit: {nearest.name}, {nearest.value / nearest.limit:.0%}"
    verdict = ("certified" if certificate.certified else ONE_MESH) + _open_clause(certificate)
    return f"certificate: {verdict} ({certificate.solver_status}), all {len(items)} items hold{tightest}"


_STAGES = (
    Column("stage"),
    Column("status", wraps=True),  # of two words, which a narrow terminal puts below each other
    Column("time", "s", ".3f"),
    Column("cost", "s", "+z.3f"),
    Column("regul.", "s", ".3f"),
    Column("track.", "m", ".2f"),
    Column("iter.", form="d"),
    Column("wall", "s", ".1f"),
)


def stages_table(results: Sequence[StageResult]) -> Table:
    """Return a table of the finished stages; `cost` is what a fidelity adds to the optimum before it that holds."""
    rows: list[tuple[Cell | str | float | None, ...]] = []
    before: float | None = None
    for result in results:
        race_time, provenance = result.trajectory.race_time, result.provenance
        optimum = result.is_flight and result.status is not Status.GUESS
        sound = result.status in (Status.CERTIFIED, Status.SOLVED, Status.GUESS)
        status = "NOT certified" if result.status is Status.NOT_CERTIFIED else result.status.value
        rows.append(
            (
                result.stage.value,
                Cell(status, bad=not sound),
                race_time if result.is_flight else None,
                race_time - before if optimum and before is not None else None,
                provenance.regularisation if optimum else None,
                provenance.tracking_error if provenance.source else None,
                result.iterations,
                result.timings.wall,
            )
        )
        before = race_time if result.holds else before
    solved = any(result.status is Status.SOLVED for result in results)
    return Table("stages", _STAGES, rows, [f"solved: {ONE_MESH}"] if solved else [])


_MESH = (
    Column("leg to"),
    Column("intervals", form="d"),
    Column("shortest", "ms", ".0f"),
    Column("longest", "ms", ".0f"),
    Column("replay", "defect", ".1e"),
    Column("Hamiltonian", "from -1", ".1e"),
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


def laps_lines(flight: Flight) -> list[str]:
    """Return the lap times in a line; none for a race of one lap."""
    laps = [f"{lap.number}: {number(lap.time, 3)} s" for lap in laps_of(flight)]
    return [f"laps: {', '.join(laps)}"] if len(laps) > 1 else []


def leg_tables(flight: Flight) -> tuple[Table, Table]:
    """Return two tables, of at most 80 columns, of every leg: loads and energy; speeds (kt) and the clearance with the
    least margin."""
    loads: list[tuple[str | float | None, ...]] = []
    speeds: list[tuple[str | float | None, ...]] = []
    for one in leg_facts(flight):
        name, nearest = one.leg.name, one.clearances[0] if one.clearances else None
        ranges = (one.n_z.least, one.n_z.greatest, one.height.least, one.height.greatest)
        loads.append((name, one.leg.time, *ranges, math.degrees(one.roll_rate), one.energy_in, one.energy_out))
        clearance = (nearest.distance, nearest.required) if nearest else (None, None)
        where = f"{nearest.text} at {nearest.time:.2f} s" if nearest else ""
        speeds.append((name, _knots(one.V_K), _knots(one.V_A), _knots(one.V_I), *clearance, where))
    return Table("legs", _LOADS, loads), Table("legs: speeds and clearances", _SPEEDS, speeds)


def distance_tables(flight: Flight) -> list[Table]:
    """Return a table of the least distance from every thing on the course; none where nothing is known."""
    table = distance_table(flight, "least distances")
    return [table] if table.rows else []


_LOADS = (
    Column("leg to"),
    Column("time", "s", "z.3f"),
    Column("load", "least g", "z.2f"),
    Column("load", "most g", "z.2f"),
    Column("height", "least m", "z.1f"),
    Column("height", "most m", "z.1f"),
    Column("roll", "deg/s", "z.0f"),
    Column("energy", "start m", "z.0f"),
    Column("energy", "end m", "z.0f"),
)
_SPEEDS = (
    Column("leg to"),
    Column("ground", "kt", ".0f"),
    Column("true", "kt", ".0f"),
    Column("indicated", "kt", ".0f"),
    Column("nearest", "m", ".1f"),
    Column("required", "m", ".1f"),
    Column("to", wraps=True),
)


def _knots(speeds: Range) -> str:
    least, greatest = speeds.least / KNOT, speeds.greatest / KNOT
    return f"{number(least, 0)} - {number(greatest, 0)}" if math.isfinite(least) else "-"


def _warnings(flight: Flight) -> Iterator[str]:
    """Yield what is measured of a flight and no limit of it: near misses of pylons, loads sustained for too long."""
    if misses := near_misses(flight):
        table = render(near_miss_table(misses), columns=PAGE)
        yield table if flight.course.rules.clearance is ClearanceRule.FLIGHT else f"{table}\n{NEAR_MISSES}"
    for one in sustained_loads(flight):
        yield textwrap.fill(f"warning: {one.text}", PAGE)


_NEAR_MISSES = (
    Column("pylon of"),
    Column("distance", "m", ".2f"),
    Column("required", "m", ".2f"),
    Column("time", "s", ".2f"),
    Column("where", wraps=True),
)


def near_miss_table(misses: Sequence[NearMiss]) -> Table:
    """Return a table of near misses."""
    rows = [
        (away.name, away.distance, away.required, away.time, one.where) for one in misses if (away := one.clearance)
    ]
    return Table("near misses", _NEAR_MISSES, rows)


_LAPS = (
    Column("lap", form="d"),
    Column("reference", "s", ".3f"),
    Column("flight", "s", ".3f"),
    Column("lost", "s", "+z.3f"),
)
_LEGS = (
    Column("leg to"),
    Column("time", "s", ".3f"),
    Column("lost", "s", "+z.3f"),
    Column("by way", "s", "+z.3f"),
    Column("by speed", "s", "+z.3f"),
    Column("what differs", wraps=True),
)


def comparison_texts(comparisons: Sequence[Comparison], *, every: bool) -> Iterator[str]:
    """Yield verdicts, conditions and what cost most, then tables: of two flights beside each other, and of all legs.

    Args:
        comparisons: of flights with one reference.
        every: whether legs that are ties are listed, too.
    """
    for one in comparisons:
        yield "\n".join(_verdict_lines(one))
        yield from _loss_texts(one)
    if len(comparisons) == 2:
        yield from _pair_texts(*comparisons)
    for one in comparisons:
        yield from _legs_texts(one, f"{one.other.label}: " if len(comparisons) > 1 else "", every=every)


def _verdict_lines(comparison: Comparison) -> list[str]:
    reference, other = comparison.reference, comparison.other
    times = f"{other.race_time:.3f} s and {reference.race_time:.3f} s"
    verdict = f"{abs(comparison.difference):.3f} s {'slower' if comparison.difference > 0.0 else 'faster'} ({times})"
    if math.isnan(comparison.difference):
        verdict = "one of them does not finish"
    elif comparison.tie:
        verdict = f"a tie within {TABLE.tie_ms} ms ({times})"
    lines = [f"{other.label} against {reference.label}: {verdict}"]
    lines += [f"  {what}: {second} against {first}" for what, first, second in conditions(reference, other)]
    lines += [
        f"  {flight.label} is {flight.source.verdict}"
        for flight in (other, reference)
        if flight.source.certified is False
    ]
    return lines + [
        f"  {one.label}: {found.remark}" for one in (other, reference) if (found := one.source.confirmation)
    ]


def _loss_texts(comparison: Comparison) -> Iterator[str]:
    """Yield in words what costs the slower flight most, if anything does."""
    lost = time_loss(comparison)
    if lost.costliest:
        lines = (f"  {number}. {one.text}" for number, one in enumerate(lost.costliest, start=1))
        wrapped = (textwrap.fill(one, PAGE, subsequent_indent=5 * " ", break_on_hyphens=False) for one in lines)
        yield "\n".join([f"{lost.title}:", *wrapped])


def _pair_texts(first: Comparison, second: Comparison) -> Iterator[str]:
    """Yield two flights against each other and both against the reference: in words, and in one table of all legs."""
    between = compare_flights(first.other, second.other)
    yield from _loss_texts(between)
    labels = [f"{one.other.label} lost" for one in (first, second)]
    labels.append(f"{second.other.label} lost against {first.other.label}")
    columns = [Column("leg to"), Column(first.reference.label, "s", ".3f")]
    columns += [Column(one, "s", "+z.3f", wraps=True) for one in labels]
    legs = zip(first.legs, second.legs, between.legs, strict=True)
    rows = [(a.name, a.reference.time, a.difference, b.difference, c.difference) for a, b, c in legs]
    rows.append(("race", first.reference.race_time, first.difference, second.difference, between.difference))
    yield render(Table(f"both against {first.reference.label}, and against each other", columns, rows), columns=PAGE)


def _legs_texts(comparison: Comparison, label: str, *, every: bool) -> Iterator[str]:
    if len(comparison.laps) > 1:
        laps = [(mine.number, mine.time, its.time, its.time - mine.time) for mine, its in comparison.laps]
        yield render(Table(f"{label}laps", _LAPS, laps), columns=PAGE)
    legs = [leg for leg in comparison.by_loss if every or not leg.tie]
    if legs:
        rows: list[tuple[str | float, ...]] = []
        for leg in legs:
            what = "; ".join(one.text for one in leg.differences)
            rows.append((leg.name, leg.other.time, leg.difference, leg.by_way, leg.by_speed, what))
        yield render(Table(f"{label}legs by time lost", _LEGS, rows), columns=PAGE)
    ties = len(comparison.legs) - len(legs)
    if ties:
        yield f"{label}{'1 leg is' if ties == 1 else f'{ties} legs are'} a tie within {TABLE.tie_ms} ms"
