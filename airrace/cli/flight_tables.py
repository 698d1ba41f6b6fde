"""The texts of flights: two on one clock, a flown log, and sensitivities."""

import csv
import io
import math
import textwrap
from collections.abc import Iterator, Sequence

from airrace.cli.run_tables import laps_lines, leg_tables
from airrace.cli.tables import PAGE, rendered
from airrace.procedure.result import StageResult
from airrace.quantities import KNOT
from airrace.report.sections import penalty_text
from airrace.results import Flight
from airrace.results.comparison import TIE, Comparison, conditions
from airrace.runs.log_view import LogView
from airrace.sensitivity.sensitivity import Activity, Sensitivity
from airrace.views.tables import Column, Table

TIE_MS = round(1000.0 * TIE)
_LAPS = (
    Column("lap", form="d"),
    Column("reference", "s", ".3f"),
    Column("flight", "s", ".3f"),
    Column("lost", "s", "+.3f"),
)
_LEGS = (
    Column("leg to"),
    Column("time", "s", ".3f"),
    Column("lost", "s", "+.3f"),
    Column("by way", "s", "+.3f"),
    Column("by speed", "s", "+.3f"),
    Column("what differs", wraps=True),
)


def comparison_texts(comparison: Comparison, *, every: bool) -> Iterator[str]:
    """Yield the verdict and the conditions, then the legs with those first on which most is lost.

    Args:
        comparison: of a flight with the reference.
        every: whether legs that are ties are listed, too.
    """
    yield "\n".join([_verdict(comparison), *_conditions(comparison)])
    if len(comparison.laps) > 1:
        laps = [(mine.number, mine.time, its.time, its.time - mine.time) for mine, its in comparison.laps]
        yield rendered(Table("laps", _LAPS, laps), columns=PAGE)
    legs = [leg for leg in comparison.by_loss if every or not leg.tie]
    if legs:
        rows = [
            (
                leg.name,
                leg.other.time,
                leg.difference,
                leg.by_way,
                leg.by_speed,
                "; ".join(one.text for one in leg.differences),
            )
            for leg in legs
        ]
        yield rendered(Table("legs by time lost", _LEGS, rows), columns=PAGE)
    ties = len(comparison.legs) - len(legs)
    if ties:
        legs_are = "1 leg is" if ties == 1 else f"{ties} legs are"
        yield f"{legs_are} a tie within {TIE_MS} ms"


def _verdict(comparison: Comparison) -> str:
    reference, other = comparison.reference, comparison.other
    times = f"{other.race_time:.3f} s and {reference.race_time:.3f} s"
    if comparison.difference != comparison.difference:
        return f"{other.label} against {reference.label}: one of them does not finish"
    if comparison.tie:
        return f"{other.label} against {reference.label}: a tie within {TIE_MS} ms ({times})"
    word = "slower" if comparison.difference > 0.0 else "faster"
    return f"{other.label} against {reference.label}: {abs(comparison.difference):.3f} s {word} ({times})"


def _conditions(comparison: Comparison) -> Iterator[str]:
    reference, other = comparison.reference, comparison.other
    for what, first, second in conditions(reference, other):
        yield f"  {what}: {second} against {first}"
    for flight in (other, reference):
        if flight.source.certified is False:
            yield f"  {flight.label} is {flight.source.verdict}"


def log_texts(log: LogView, *, legs: bool = False) -> Iterator[str]:
    """Yield race time and passings of a flown log, violations and remarks; at most 80 columns wide.

    Args:
        log: the log, as it was understood.
        legs: whether every leg is shown, too.
    """
    flight = log.flight()
    yield rendered(_passings_table(flight), columns=PAGE)
    if log.violations:
        rows = [
            (
                one.passing or "flight",
                one.rule,
                one.time,
                one.value,
                one.deviation,
                one.limit,
                one.unit,
                penalty_text(one.penalty),
                "yes" if one.certain else "no",
            )
            for one in log.violations
        ]
        yield rendered(Table("rules that would be broken", _VIOLATIONS, rows), columns=PAGE)
    yield f"penalties of what is certain: {penalty_text(log.penalty)}"
    yield from laps_lines(flight)
    if legs:
        yield from (rendered(table, columns=PAGE) for table in leg_tables(flight))
    yield "\n".join(textwrap.fill(f"note: {one}", PAGE, subsequent_indent=6 * " ") for one in log.remarks)


_VIOLATIONS = (
    Column("at"),
    Column("rule"),
    Column("time", "s", "z.2f"),
    Column("flown", form="z.1f"),
    Column("+-", form="z.1f"),  # the standard deviation of what was flown
    Column("allowed", form="z.1f"),
    Column("unit", wraps=True),
    Column("penalty", wraps=True),
    Column("certain", wraps=True),
)
_PASSINGS = (
    Column("passing"),
    Column("time", "s", "z.3f"),
    Column("leg", "s", "z.3f"),
    Column("ground", "kt", "z.1f"),
    Column("height", "m", "z.1f"),
    Column("load", "g", "z.1f"),
    Column("bank", "deg", "z.0f"),
    Column("climb", "deg", "z.0f"),
)


def _passings_table(flight: Flight) -> Table:
    race_time = f"{flight.race_time:.3f} s" if math.isfinite(flight.race_time) else "not finished"
    befores = (math.nan, *(one.time for one in flight.crossings))
    rows = [
        (
            one.name,
            one.time,
            one.time - before,
            one.value("V_K") / KNOT,
            one.value("height"),
            one.value("n_z"),
            math.degrees(one.value("mu")),
            math.degrees(one.value("gamma")),
        )
        for one, before in zip(flight.crossings, befores, strict=False)
    ]
    return Table(f"{flight.label}: race time {race_time}, as flown", _PASSINGS, rows)


BESIDE_KEYS = 50
"""The columns that the table of sensitivities takes beside its keys."""
KEY_MAX = 36
"""The longest key that stays on one line where lines are folded, characters."""
LEAST_MS = 0.0005
"""The smallest cost that is shown as a number, ms; with three decimals a smaller one would show as zero."""


def sensitivities_csv(sensitivities: Sequence[Sensitivity]) -> str:
    """Return sensitivities as CSV, one row per number, the largest first.

    An entry is empty where the inputs allow no value to that side.
    """
    rows = [{"key": one.key, **one.as_object()} for one in sensitivities]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, ("key", *_COLUMNS), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


_COLUMNS = (
    *("group", "unit", "value", "s_per_unit", "s_per_unit_up", "s_per_unit_down"),
    *("usual_step", "step_up_s", "step_down_s", "activity", "note"),
)
_SENSITIVITIES = (
    Column("key"),
    Column("value", form="g"),
    Column("s per unit", form="+.4g"),
    Column("step", form="g"),
    Column("step up", "ms", "+.3f"),
)


def sensitivities_text(result: StageResult, sensitivities: Sequence[Sensitivity], columns: int | None = None) -> str:
    """Return a table of what costs something, why some sensitivities are one-sided, and how many numbers are free.

    Args:
        result: the stage.
        sensitivities: the largest first.
        columns: the width of the terminal, None without one; where it is narrow, long keys take two lines.
    """
    longest = max((len(one.key) for one in sensitivities), default=0)
    folded = columns is not None and columns < longest + BESIDE_KEYS
    active = [one for one in sensitivities if one.activity is not Activity.FREE]
    parts: list[str] = []
    if active:
        title = f"{result.stage.value}: race time {result.trajectory.race_time:.3f} s, what a usual step costs"
        parts.append(rendered(Table(title, _SENSITIVITIES, [_row(one, folded=folded) for one in active])))
    sided = [
        f"{one.key}: {_cost(one.cost_up)}, {_cost(one.cost_down)} ms ({one.note})"
        for one in active
        if one.activity is Activity.ONE_SIDED
    ]
    if sided:
        parts.append("\n".join(["one-sided (*), a usual step up and down:", *sided]))
    free = len(sensitivities) - len(active)
    parts.append(
        f"free: {free} more number{'' if free == 1 else 's'} of {len(sensitivities)} (--csv and --json list them)"
    )
    return "\n\n".join(parts)


def _row(one: Sensitivity, *, folded: bool) -> tuple[str | float, ...]:
    unit = "" if one.unit == "1" else f" {one.unit}"
    key = f"{one.key}*" if one.activity is Activity.ONE_SIDED else one.key
    if folded and len(key) > KEY_MAX:  # on two lines, cut after a dot
        section, dot, name = key.rpartition(".")
        key = f"{section}{dot}\n  {name}"
    return (key, f"{one.value:.6g}{unit}", one.per_unit, f"{one.usual_step:.3g}{unit}", _cost(one.cost_up))


def _cost(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "-"
    milliseconds = 1000.0 * seconds
    return "free" if abs(milliseconds) < LEAST_MS else f"{milliseconds:+.3f}"
