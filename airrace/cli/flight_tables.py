"""The texts of a flight log, and those of sensitivities as a table and as CSV."""

import math
from collections.abc import Iterator, Sequence
from typing import cast

from airrace.cli.answer import PAGE, paragraph, render
from airrace.cli.run_tables import distance_tables, laps_text, leg_tables
from airrace.logs.violations import shown
from airrace.procedure.result import StageResult
from airrace.quantities import KNOT
from airrace.report.sections import penalty_text
from airrace.runs.log_view import LogView
from airrace.sensitivity import Activity, Sensitivity
from airrace.views.tables import Column, Table, Value


def log_texts(log: LogView, *, legs: bool = False) -> Iterator[str]:
    """Yield race time and passings of a flight log, violations and remarks; at most 80 columns wide.

    Args:
        log: the log, as it was understood.
        legs: whether every leg is shown, too.
    """
    flight = log.flight()
    race_time = f"{flight.race_time:.3f} s" if math.isfinite(flight.race_time) else "not finished"
    passings: list[tuple[str | float, ...]] = []
    before = math.nan
    for one in flight.crossings:
        speeds = (one.value("V_K") / KNOT, one.value("height"), one.value("n_z"))
        attitude = (math.degrees(one.value("mu")), math.degrees(one.value("gamma")))
        passings.append((one.name, one.time, one.time - before, *speeds, *attitude))
        before = one.time
    verified = f"; {flight.source.confirmation.remark}" if flight.source.confirmation else ""
    yield render(Table(f"{flight.label}: race time {race_time}, as flown{verified}", _PASSINGS, passings), columns=PAGE)
    if log.violations:
        rows: list[tuple[str | float | None, ...]] = []
        listed, others = shown(log.violations)
        for one in listed:
            measured = (one.time, one.value, one.deviation, one.limit, one.unit)
            certain = "yes" if one.certain else "no"
            rows.append((one.passing or "flight", one.rule, *measured, penalty_text(one.penalty), certain))
        yield render(Table("rules that would be broken", _VIOLATIONS, rows), columns=PAGE)
        if others:
            yield paragraph(others)
    yield f"penalties of what is certain: {penalty_text(log.penalty)}"
    if laps := laps_text(flight):
        yield paragraph(laps)
    yield from (render(one, columns=PAGE) for one in distance_tables(flight))
    if legs:
        yield from (render(table, columns=PAGE) for table in leg_tables(flight))
    yield "\n".join(paragraph(one, begin="note: ") for one in log.remarks)


_VIOLATIONS = (
    Column("at"),
    Column("rule"),
    Column("time", "s", "z.2f", rank=2),
    Column("flown", form="z.1f"),
    Column("+-", form="z.1f", rank=1),  # the standard deviation of the measured value
    Column("allowed", form="z.1f"),
    Column("unit", wraps=True),
    Column("penalty", wraps=True, rank=3),
    Column("certain", wraps=True, rank=4),
)
_PASSINGS = (
    Column("passing"),
    Column("time", "s", "z.3f"),
    Column("leg", "s", "z.3f", rank=3),
    Column("ground", "kt", "z.1f"),
    Column("height", "m", "z.1f"),
    Column("load", "g", "z.1f", rank=4),
    Column("bank", "deg", "z.0f", rank=2),
    Column("climb", "deg", "z.0f", rank=1),
)


_STORED = (
    *("key", "group", "unit", "value", "s_per_unit", "s_per_unit_up", "s_per_unit_down"),
    *("usual_step", "step_up_s", "step_down_s", "activity", "note"),
)
_SENSITIVITIES = (
    Column("key"),
    Column("value", form="g"),
    Column("s per unit", form="+.4g"),
    Column("step", form="g"),
    Column("step up", "ms", "+z.3f"),
)


def sensitivities_csv(sensitivities: Sequence[Sensitivity]) -> str:
    """Return sensitivities as CSV, one row per number, the largest first.

    An entry is empty where the inputs allow no value to that side.
    """
    rows = [cast(list[Value], [one.key, *one.as_object().values()]) for one in sensitivities]
    return Table("", [Column(key=key) for key in _STORED], rows).csv()


def sensitivities_text(result: StageResult, sensitivities: Sequence[Sensitivity], columns: int | None = None) -> str:
    """Return a table of what costs something, why some sensitivities are one-sided, and how many numbers are free.

    Args:
        result: the stage.
        sensitivities: the largest first.
        columns: the width of the terminal, None without one; where it is narrow, long keys take two lines.
    """
    longest = max((len(one.key) for one in sensitivities), default=0)
    folds = columns is not None and columns < longest + 50  # columns beside the keys
    active = [one for one in sensitivities if one.activity is not Activity.FREE]
    rows: list[tuple[str | float, ...]] = []
    sided: list[str] = []
    for one in active:
        unit, key = "" if one.unit == "1" else f" {one.unit}", one.key
        if one.activity is Activity.ONE_SIDED:
            key += "*"
            sided.append(f"{one.key}: {_cost(one.cost_up)}, {_cost(one.cost_down)} ms ({one.note})")
        if folds and len(key) > 36:  # on two lines, cut after a dot
            section, dot, name = key.rpartition(".")
            key = f"{section}{dot}\n  {name}"
        step = f"{one.usual_step:.3g}{unit}"
        rows.append((key, f"{one.value:.6g}{unit}", one.per_unit, step, _cost(one.cost_up)))
    parts: list[str] = []
    if rows:
        title = f"{result.stage.value}: race time {result.trajectory.race_time:.3f} s, what a usual step costs"
        parts.append(render(Table(title, _SENSITIVITIES, rows)))
    if sided:
        parts.append("\n".join(["one-sided (*), a usual step up and down:", *sided]))
    free = len(sensitivities) - len(active)
    more = f"{free} more number{'' if free == 1 else 's'}"
    return "\n\n".join([*parts, f"free: {more} of {len(sensitivities)} (--csv and --json list them)"])


def _cost(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "-"
    milliseconds = 1000.0 * seconds
    # A smaller cost would show as zero.
    return "free" if abs(milliseconds) < 0.0005 else f"{milliseconds:+.3f}"
