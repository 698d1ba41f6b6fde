"""The texts of flights: two on one clock, a flown log, and sensitivities."""

import csv
import io
import math
import textwrap
from collections.abc import Iterator, Sequence

from rich.table import Table
from rich.text import Text

from airrace.cli.run_tables import laps_line, leg_tables
from airrace.cli.tables import PAGE, number, plain_table, rendered
from airrace.logs.violations import Violation
from airrace.procedure.result import StageResult
from airrace.quantities import KNOT
from airrace.report.sections import penalty_text
from airrace.results import Flight
from airrace.results.comparison import TIE, Comparison, LegComparison, conditions
from airrace.runs.log_view import LogView
from airrace.sensitivity.sensitivity import Activity, Price

IN_MILLISECONDS = round(1000.0 * TIE)


def comparison_texts(comparison: Comparison, *, every: bool) -> Iterator[str]:
    """Yield the verdict and the conditions, then the legs with those first on which most is lost.

    Args:
        comparison: of a flight with the reference.
        every: whether legs that are ties are listed, too.
    """
    yield "\n".join([_verdict(comparison), *_conditions(comparison)])
    if len(comparison.laps) > 1:
        yield rendered(_laps_table(comparison), columns=PAGE)
    legs = [leg for leg in comparison.by_loss if every or not leg.tie]
    if legs:
        yield rendered(_legs_table(comparison, legs), columns=PAGE)
    ties = len(comparison.legs) - len(legs)
    if ties:
        legs_are = "1 leg is" if ties == 1 else f"{ties} legs are"
        yield f"{legs_are} a tie within {IN_MILLISECONDS} ms"


def _verdict(comparison: Comparison) -> str:
    reference, other = comparison.reference, comparison.other
    times = f"{other.race_time:.3f} s and {reference.race_time:.3f} s"
    if comparison.difference != comparison.difference:
        return f"{other.label} against {reference.label}: one of them does not finish"
    if comparison.tie:
        return f"{other.label} against {reference.label}: a tie within {IN_MILLISECONDS} ms ({times})"
    word = "slower" if comparison.difference > 0.0 else "faster"
    return f"{other.label} against {reference.label}: {abs(comparison.difference):.3f} s {word} ({times})"


def _conditions(comparison: Comparison) -> Iterator[str]:
    reference, other = comparison.reference, comparison.other
    for what, first, second in conditions(reference, other):
        yield f"  {what}: {second} against {first}"
    for flight in (other, reference):
        if flight.source.certified is False:
            yield f"  {flight.label} is {flight.source.verdict}"


def _laps_table(comparison: Comparison) -> Table:
    rows = [
        (str(mine.number), f"{mine.time:.3f}", f"{its.time:.3f}", f"{its.time - mine.time:+.3f}")
        for mine, its in comparison.laps
    ]
    return plain_table("laps", ("lap",), ("reference\ns", "flight\ns", "lost\ns"), rows)


def _legs_table(comparison: Comparison, legs: list[LegComparison]) -> Table:
    """Return a table with one row per leg: its time, what is lost on it, by way and by speed, and what differs."""
    table = plain_table("legs by time lost", ("leg to",), ("time\ns", "lost\ns", "by way\ns", "by speed\ns"), ())
    table.add_column("what differs", overflow="fold")
    for leg in legs:
        table.add_row(
            Text(leg.name),
            f"{leg.other.time:.3f}",
            f"{leg.difference:+.3f}",
            f"{leg.by_way:+.3f}",
            f"{leg.by_speed:+.3f}",
            Text("; ".join(one.text for one in leg.differences)),
        )
    return table


def log_texts(flown: LogView, *, legs: bool = False) -> Iterator[str]:
    """Yield race time and passings, violations and remarks; at most 80 columns wide.

    Args:
        flown: what is told.
        legs: whether every leg is told, too.
    """
    flight = flown.flight()
    yield rendered(_passings_table(flight), columns=PAGE)
    if flown.violations:
        yield rendered(_violations_table(flown.violations), columns=PAGE)
    yield f"penalties of what is certain: {penalty_text(flown.penalty)}"
    if line := laps_line(flight):
        yield line
    if legs:
        yield from (rendered(table, columns=PAGE) for table in leg_tables(flight))
    notes = (textwrap.fill(f"note: {one}", PAGE, subsequent_indent=6 * " ") for one in flown.remarks)
    yield "\n".join(notes)


def _passings_table(flight: Flight) -> Table:
    race_time = f"{flight.race_time:.3f} s" if math.isfinite(flight.race_time) else "not finished"
    numbers = ("time\ns", "leg\ns", "ground\nkt", "height\nm", "load\ng", "bank\ndeg", "climb\ndeg")
    rows: list[tuple[str, ...]] = []
    before = math.nan
    for one in flight.crossings:
        values = (one.value("V_K") / KNOT, one.value("height"))
        angles = [math.degrees(one.value(name)) for name in ("mu", "gamma")]
        rows.append(
            (
                one.name,
                number(one.time, 3),
                number(one.time - before, 3),
                *(number(value, 1) for value in values),
                number(one.value("n_z"), 1),
                *(number(angle, 0) for angle in angles),
            )
        )
        before = one.time
    return plain_table(f"{flight.label}: race time {race_time}, as flown", ("passing",), numbers, rows)


def _violations_table(violations: Sequence[Violation]) -> Table:
    """Return a table of the rules that would be broken; `+-` is the standard deviation of what was flown."""
    table = plain_table("rules that would be broken", ("at", "rule"), ("time\ns", "flown", "+-", "allowed"), ())
    for name in ("unit", "penalty", "certain"):
        table.add_column(name)
    for one in violations:
        table.add_row(
            Text(one.passing or "flight"),
            one.rule,
            number(one.time, 2),
            number(one.value, 1),
            number(one.deviation, 1),
            number(one.limit, 1),
            one.unit,
            penalty_text(one.penalty),
            "yes" if one.certain else "no",
        )
    return table


MILLI = 1000.0
BESIDE_KEYS = 50
"""The columns that the table takes beside its keys."""
LEAST_MS = 0.0005
"""The smallest cost that is shown as a number, ms; with three decimals a smaller one would show as zero."""


def sensitivities_csv(prices: Sequence[Price]) -> str:
    """Return the prices as CSV, one row per number, the largest first.

    An entry is empty where the inputs allow no value to that side.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    objects = {price.key: price.as_object() for price in prices}
    writer.writerow(["key", *_COLUMNS])
    for key, columns in objects.items():
        writer.writerow([key, *("" if columns[name] is None else columns[name] for name in _COLUMNS)])
    return text.getvalue()


KEY_MAX = 36
"""The longest key that stays on one line where lines are folded, characters."""


def sensitivities_text(result: StageResult, prices: Sequence[Price], columns: int | None = None) -> str:
    """Return a table of what costs something, why some prices are one-sided, and how many numbers are free.

    Args:
        result: the stage.
        prices: the largest first.
        columns: the width of the terminal, None without one; where it is narrow, long keys take two lines.
    """
    longest = max((len(price.key) for price in prices), default=0)
    folded = columns is not None and columns < longest + BESIDE_KEYS
    title = f"{result.stage.value}: race time {result.trajectory.race_time:.3f} s, what a usual step costs"
    dear = [price for price in prices if price.activity is not Activity.FREE]
    parts: list[str] = []
    if dear:
        rows = [_row(price, folded=folded) for price in dear]
        table = plain_table(title, ["key"], ["value", "s per unit", "step", "step up\nms"], rows)
        parts.append(rendered(table))
    sided = [_both_sides(price) for price in dear if price.activity is Activity.ONE_SIDED]
    if sided:
        parts.append("\n".join(["one-sided (*), a usual step up and down:", *sided]))
    free = len(prices) - len(dear)
    parts.append(f"free: {free} more number{'' if free == 1 else 's'} of {len(prices)} (--csv and --json list them)")
    return "\n\n".join(parts)


_COLUMNS = (
    "group",
    "unit",
    "value",
    "s_per_unit",
    "s_per_unit_up",
    "s_per_unit_down",
    "usual_step",
    "step_up_s",
    "step_down_s",
    "activity",
    "note",
)


def _row(price: Price, *, folded: bool) -> list[str]:
    unit = "" if price.unit == "1" else f" {price.unit}"
    mark = "*" if price.activity is Activity.ONE_SIDED else ""
    return [
        _folded(price.key + mark) if folded else price.key + mark,
        f"{price.value:.6g}{unit}",
        f"{price.price:+.4g}",
        f"{price.usual_step:.3g}{unit}",
        _cost(price.cost_up),
    ]


def _folded(key: str) -> str:
    """Return a long key on two lines, cut after a dot."""
    section, dot, name = key.rpartition(".")
    return f"{section}{dot}\n  {name}" if len(key) > KEY_MAX else key


def _both_sides(price: Price) -> str:
    return f"{price.key}: {_cost(price.cost_up)}, {_cost(price.cost_down)} ms ({price.note})"


def _cost(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "-"
    milliseconds = seconds * MILLI
    return "free" if abs(milliseconds) < LEAST_MS else f"{milliseconds:+.3f}"
