"""The tables of a run: stages, splits, certificates, routes, meshes, legs, near misses and the run it started from."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from airrace.cli.stored_stages import StoredStages
from airrace.cli.tables import (
    PAGE,
    add_numbers,
    empty_table,
    number,
    plain_table,
    rendered,
)
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import UNVERIFIABLE, Outcome, RefinementReason, SearchReport, StageResult, State
from airrace.procedure.split_comparison import compared, last_common
from airrace.quantities import KNOT
from airrace.results import Flight, laps_of
from airrace.results.clearances import NearMiss, near_misses
from airrace.results.leg_facts import LegFacts, Range, leg_facts
from airrace.runs.json_objects import REASONS
from airrace.trajectory import Array

if TYPE_CHECKING:
    from airrace.procedure.restart import SourceRun
    from airrace.runs.plan import ExecutionPlan

DOES_NOT_STAND = "NOT certified: its items may hold, but the stage does not stand"
ONE_MESH = "checked on one mesh; no second mesh has confirmed the race time"
_DEGREES = {"rad": "deg", "rad/s": "deg/s"}


def result_tables(result: StageResult, *, certificate: bool = True) -> list[Table]:
    """Return what a finished stage shows: its gate splits and its certificate; without a flight nothing.

    Args:
        result: the stage.
        certificate: whether the items of its certificate are listed.
    """
    tables = [splits_table(result)] if result.splits and result.is_flight else []
    tables += [routes_table(result.search)] if result.search.routes else []
    if certificate and result.certificate is not None:
        stands = result.outcome is Outcome.SOLVED or not result.certificate.holds
        tables.append(certificate_table(result.certificate, "" if stands else DOES_NOT_STAND))
    return tables


def splits_table(result: StageResult) -> Table:
    """Return a table of the passings; `leg` is the time since the passing before."""
    table = empty_table(f"{result.stage.value}: race time {result.trajectory.race_time:.3f} s", "gate")
    add_numbers(
        table, "time\ns", "leg\ns", "speed\nm/s", "speed\nkt", "height\nm", "load\ng", "bank\ndeg", "climb\ndeg"
    )
    before = result.splits[0].time if result.splits else 0.0
    for split in result.splits:
        table.add_row(
            Text(split.name),
            f"{split.time:.3f}",
            f"{split.time - before:.3f}",
            f"{split.V_K:.1f}",
            f"{split.V_K / KNOT:.1f}",
            f"{split.height:.1f}",
            f"{split.n_z:z.2f}",
            _degrees(split.bank),
            _degrees(split.climb),
        )
        before = split.time
    return table


def certificate_line(result: StageResult) -> str:
    """Return the verdict with the item that comes nearest to its limit, or with those that fail."""
    certificate = result.certificate
    if certificate is None:
        return ""
    items, failed = certificate.items, certificate.failed
    if certificate.holds and not result.holds:
        return f"certificate: {DOES_NOT_STAND}"
    if failed or not items:
        told = ", ".join(f"{item.name} {item.value:.3g} > {item.limit:.3g} {item.unit}".rstrip() for item in failed)
        return f"certificate: NOT certified ({certificate.solver_status}): {told or 'nothing was measured'}"
    limited = [item for item in items if item.limit > 0.0]
    nearest = max(limited, key=lambda item: item.value / item.limit, default=None)
    tightest = "" if nearest is None else f"; nearest to its limit: {nearest.name}, {nearest.value / nearest.limit:.0%}"
    verdict = "certified" if certificate.certified else ONE_MESH
    return f"certificate: {verdict} ({certificate.solver_status}), all {len(items)} items hold{tightest}"


def certificate_table(certificate: Certificate, verdict: str = "") -> Table:
    """Return a table of all items with their limits, and where the worst value lies if it is not zero.

    Args:
        certificate: with the items.
        verdict: what is said of it; empty for what the items say.
    """
    measured = "certified" if certificate.certified else ONE_MESH if certificate.holds else "NOT certified"
    verdict = verdict or measured
    table = empty_table(f"certificate: {verdict} ({certificate.solver_status})", "item")
    add_numbers(table, "value", "limit")
    for column in ("unit", "holds", "worst at"):
        table.add_column(column)
    for item in certificate.items:
        value, limit, unit = _for_people(item)
        holds = Text("yes") if item.holds else Text("NO", style="bold red")
        where = Text("" if value == 0.0 else item.where)
        table.add_row(Text(item.name), f"{value:.3g}", f"{limit:.3g}", unit, holds, where)
    return table


def stages_table(results: Sequence[StageResult]) -> Table:
    """Return a table of the finished stages.

    The column `cost` is what a fidelity adds to the time of the optimum before it that holds.
    """
    table = empty_table("stages", "stage")
    table.add_column("status")  # of two words, which a narrow terminal puts below each other
    add_numbers(table, "time\ns", "cost\ns", "regul.\ns", "track.\nm", "iter.", "wall\ns")
    before: float | None = None
    for result in results:
        race_time, provenance = result.trajectory.race_time, result.provenance
        optimum = result.is_flight and result.state is not State.GUESS
        table.add_row(
            result.stage.value,
            _status(result),
            f"{race_time:.3f}" if result.is_flight else "-",
            f"{race_time - before:+.3f}" if optimum and before is not None else "-",
            f"{provenance.regularisation:.3f}" if optimum else "-",
            f"{provenance.tracking_error:.2f}" if provenance.source else "-",
            str(result.iterations),
            f"{result.timings.wall:.1f}",
        )
        before = race_time if result.holds else before
    if any(result.state is State.SOLVED for result in results):
        table.caption = Text(f"solved: {ONE_MESH}")
        table.caption_justify = "left"
    return table


def _status(result: StageResult) -> Text:
    """Return how a stage ended, in the words that matter most."""
    if result.state is State.NOT_CERTIFIED:
        return Text("NOT certified", style="bold red")
    sound = result.state in (State.CERTIFIED, State.SOLVED, State.GUESS)
    return Text(result.state.value, style="" if sound else "bold red")


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):z.1f}"


def _for_people(item: Item) -> tuple[float, float, str]:
    """Return value, limit and unit of an item, angles in degrees."""
    if item.unit in _DEGREES:
        return math.degrees(item.value), math.degrees(item.limit), _DEGREES[item.unit]
    return item.value, item.limit, item.unit


SHOWN = 12
"""The largest number of routes in the table; all of them are in the checkpoint and in the object."""


def routes_table(explored: SearchReport) -> Table:
    """Return a table of the best route and those that came next, with what they cost."""
    solves = explored.converged_to_best + explored.converged_elsewhere + explored.failed
    starts = f"{explored.converged_to_best} of {solves} multistarts converged to the best"
    title = f"routes: {len(explored.routes)} tried in {explored.seconds:.1f} s, {starts}"
    table = Table(
        title=Text(title), title_justify="left", box=box.SIMPLE, pad_edge=False, collapse_padding=True, show_edge=False
    )
    table.add_column("route", overflow="fold")
    for name in ("rough time\ns", "behind\ns"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("evaluated\nby", no_wrap=True)
    for place, route in enumerate(explored.routes[:SHOWN]):
        behind = "best" if place == 0 else f"{route.difference:+.3f}"
        table.add_row(Text(route.text), f"{route.race_time:.3f}", behind, route.evaluated_by)
    if len(explored.routes) > SHOWN:
        table.add_row(Text(f"and {len(explored.routes) - SHOWN} more"), "", "", "")
    return table


def mesh_table(result: StageResult) -> Table:
    """Return a table of the legs: their intervals, the worst values measured, and the reasons for their lengths."""
    flown, record = result.trajectory, result.mesh
    steps = np.diff(flown.time)
    title = f"{result.stage.value}: {len(steps)} intervals, and what they were last cut or joined for"
    numbers = ("intervals", "shortest\nms", "longest\nms", "replay\ndefect", "Hamiltonian\nfrom -1")
    table = plain_table(title, ("leg to",), numbers, ())
    table.add_column("last cut or joined for")
    ends = [name.rpartition(" -> ")[2] for name in flown.phases]
    for name, first, last in zip(ends, flown.first_node, flown.first_node[1:], strict=False):
        leg = slice(first, last)
        measured = (_worst(record.defect, leg), _worst(record.drift, leg))
        cells = [name, str(last - first), *_lengths(steps[leg]), *measured, _reasons(record.why[leg])]
        table.add_row(*(Text(cell) for cell in cells))
    return table


def _reasons(why: np.ndarray) -> str:
    """Return how many intervals owe their length to which reason, the most frequent reason first."""
    counts = np.bincount(why, minlength=len(RefinementReason)).tolist()
    told = sorted(
        ((count, REASONS[reason]) for reason, count in zip(RefinementReason, counts, strict=True) if count),
        reverse=True,
    )
    return ", ".join(f"{reason} {count}" for count, reason in told)


def _lengths(steps: Array) -> tuple[str, str]:
    return f"{1e3 * steps.min():.0f}", f"{1e3 * steps.max():.0f}"


def _worst(values: Array, leg: slice) -> str:
    return f"{values[leg].max():.1e}"


def leg_tables(flight: Flight) -> Iterator[Table]:
    """Yield the tables, of at most 80 columns, of all that is told of every leg."""
    facts = leg_facts(flight)
    yield _loads_table(facts)
    yield _speeds_table(facts)


def laps_line(flight: Flight) -> str:
    """Return the lap times in a line; empty for a race of one lap."""
    laps = laps_of(flight)
    if len(laps) < 2:
        return ""
    return "laps: " + ", ".join(f"{lap.number}: {number(lap.time, 3)} s" for lap in laps)


def _loads_table(facts: Sequence[LegFacts]) -> Table:
    rows = [
        (
            one.leg.name,
            number(one.leg.time, 3),
            *_pair(one.n_z, 1.0, 2),
            *_pair(one.height, 1.0, 1),
            number(math.degrees(one.roll_rate), 0),
            number(one.energy_in, 0),
            number(one.energy_out, 0),
        )
        for one in facts
    ]
    numbers = ("time\ns", "load\nleast g", "load\nmost g", "height\nleast m", "height\nmost m", "roll\ndeg/s")
    return plain_table("legs", ("leg to",), (*numbers, "energy\nstart m", "energy\nend m"), rows)


def _speeds_table(facts: Sequence[LegFacts]) -> Table:
    """Least and greatest speeds in knots, and the clearance with the least margin."""
    numbers = ("ground\nkt", "true\nkt", "indicated\nkt", "nearest\nm", "required\nm")
    table = plain_table("legs: speeds and clearances", ("leg to",), numbers, ())
    table.add_column("to")
    for one in facts:
        speeds = [_span(values, KNOT) for values in (one.V_K, one.V_A, one.V_I)]
        nearest = one.clearances[0] if one.clearances else None
        where = "" if nearest is None else f"{nearest.text} at {nearest.time:.2f} s"
        distances = ("-", "-") if nearest is None else (f"{nearest.distance:.1f}", f"{nearest.required:.1f}")
        table.add_row(Text(one.leg.name), *speeds, *distances, Text(where))
    return table


def _pair(values: Range, unit: float, digits: int) -> tuple[str, str]:
    return number(values.least / unit, digits), number(values.greatest / unit, digits)


def _span(values: Range, unit: float) -> str:
    least, greatest = _pair(values, unit, 0)
    return f"{least} - {greatest}" if math.isfinite(values.least) else "-"


NEAR_MISSES = textwrap.fill(
    "warning: the rules measure the wing tips at the instant of a passing alone; right before or after it, or at other "
    "gates, the wing comes as close to pylons as told above.",
    PAGE,
)
"""The sentence that goes with the table of near misses."""


def near_misses_text(flight: Flight) -> str:
    """Return the table of the near misses of a flight, with a sentence; empty where there are none."""
    misses = near_misses(flight)
    return f"{rendered(near_miss_table(misses), columns=PAGE)}\n{NEAR_MISSES}" if misses else ""


def near_miss_table(misses: Sequence[NearMiss]) -> Table:
    """Return a table of near misses."""
    table = plain_table("near misses", ("pylon of",), ("distance\nm", "required\nm", "time\ns"), ())
    table.add_column("where")
    for one in misses:
        away = one.clearance
        numbers = (f"{away.distance:.2f}", f"{away.required:.2f}", f"{away.time:.2f}")
        table.add_row(Text(away.name), *numbers, Text(one.where))
    return table


def start_table(start: "SourceRun", results: Sequence[StageResult]) -> Table | None:
    """Return a table of the legs: time before and after, what was lost on the leg and so far.

    It is None where the two runs have no stage in common.
    """
    common = last_common(start.results, results)
    if common is None:
        return None
    comparison = compared(*common)
    rows = [
        (leg.name, f"{leg.before:.3f}", f"{leg.after:.3f}", f"{leg.difference:+.3f}", f"{leg.cumulative:+.3f}")
        for leg in comparison.legs
    ]
    rows.append(("race", f"{comparison.before:.3f}", f"{comparison.after:.3f}", f"{comparison.difference:+.3f}", ""))
    remark = "" if comparison.certified else " (not certified in both: a few ms may be the mesh)"
    title = f"{common[1].stage.value} against {start.name}: {comparison.difference:+.3f} s{remark}"
    return plain_table(title, ("leg to",), ("before\ns", "after\ns", "difference\ns", "so far\ns"), rows)


UNVERIFIED = "\n".join(
    textwrap.wrap(
        "unverified: all of this is read from the file, and nothing was measured again. `airrace verify` does that. "
        f"Nobody can verify {', '.join(UNVERIFIABLE[:-1])} and {UNVERIFIABLE[-1]}.",
        PAGE,
    )
)
"""The sentences that `airrace show` says of its numbers."""


def run_texts(shown: StoredStages, *, legs: bool, certificates: bool) -> Iterator[str]:
    """Yield the stages, what each of them says, then splits, ways, legs and certificates; at most 80 columns wide.

    Args:
        shown: what is told.
        legs: whether every leg of the chosen flight is told.
        certificates: whether the items of the certificates are listed instead of told in a line.
    """
    results = shown.results
    yield rendered(stages_table(results), columns=PAGE) if results else "no stage is finished yet"
    if results:
        yield UNVERIFIED
    yield from (f"{result.stage.value}: {result.remarks}" for result in results if result.remarks)
    yield from (f"a needless loop: {loop}" for result in results for loop in result.search.loops)
    for result in results:
        yield from _stage_texts(result, certificates=certificates)
        if result.stage.value == shown.stage:
            yield from _flight_texts(shown, legs=legs)


def _stage_texts(result: StageResult, *, certificates: bool) -> Iterator[str]:
    meshes = [mesh_table(result)] if len(result.mesh.why) else []
    for table in (*result_tables(result, certificate=certificates), *meshes):
        yield rendered(table, columns=PAGE)
    if result.certificate is not None and not certificates:
        yield certificate_line(result)


def _flight_texts(shown: StoredStages, *, legs: bool) -> Iterator[str]:
    assert shown.flight is not None  # its stage is known
    if line := laps_line(shown.flight):
        yield line
    if misses := near_misses_text(shown.flight):
        yield misses
    if legs:
        yield from (rendered(table, columns=PAGE) for table in leg_tables(shown.flight))


def flight_texts(task: "ExecutionPlan", results: Sequence[StageResult]) -> Iterator[str]:
    """Yield what `optimize` and `resume` show of the stages of a run: messages, tables, and what was changed by it."""
    from airrace.runs.stage_view import StageView

    yield from (f"{one.stage.value}: {one.remarks}" for one in results if one.holds and one.remarks)
    tables = [stages_table(results)] if any(result.holds for result in results) else []
    tables += [routes_table(one.search) for one in results[:-1] if one.search.routes]
    yield from (rendered(table, columns=PAGE) for table in (*tables, *result_tables(results[-1])))
    misses = near_misses_text(StageView(task.run.inputs, results[-1], {}).flight()) if results[-1].is_flight else ""
    if misses:
        yield misses
    difference = None if task.start is None else start_table(task.start, results)
    if difference is not None:
        yield rendered(difference, columns=PAGE)
