"""The tables of a flight log: passings, and the rules that would be broken."""

import math
from collections.abc import Sequence

from airrace.flights.logs.violations import Violation
from airrace.flights.results import Flight
from airrace.optimal_control.quantities import KNOT
from airrace.pages.views.tables import Cell, Column, Table, Value

_DEGREES = math.degrees(1.0)
_PASSINGS = (
    Column("passing", key="passing"),
    Column(key="lap"),
    Column("time", "s", "z.3f", "time_s"),
    Column("leg", "s", "z.3f", rank=3),
    Column("ground", "kt", "z.1f", "V_K", 1.0 / KNOT),
    Column(key="V_A"),
    Column(key="V_I"),
    Column("height", "m", "z.1f", "height"),
    Column("load", "g", "z.1f", "n_z", rank=4),
    Column("bank", "deg", "z.0f", "mu", _DEGREES, rank=2),
    Column("climb", "deg", "z.0f", "gamma", _DEGREES, rank=1),
)


def passings_table(flight: Flight, title: str = "") -> Table:
    """Return a table of the passings; `leg` is the time since the passing before."""
    rows: list[tuple[Value, ...]] = []
    before = math.nan
    for crossing in flight.crossings:
        values = [crossing.value(name) for name in ("V_K", "V_A", "V_I", "height", "n_z", "mu", "gamma")]
        rows.append((crossing.name, crossing.lap, crossing.time, crossing.time - before, *values))
        before = crossing.time
    return Table(title, _PASSINGS, rows)


_VIOLATIONS = (
    Column("at", key="passing"),
    Column("rule", key="rule"),
    Column("time", "s", "z.2f", "time_s", rank=2),
    Column("flown", form="z.1f", key="value"),
    Column("+-", form="z.1f", key="deviation", rank=1),  # the standard deviation of the measured value
    Column("allowed", form="z.1f", key="limit"),
    Column("unit", key="unit", wraps=True),
    Column("penalty", key="penalty_s", wraps=True, rank=3),
    Column(key="ends_race"),
    Column("certain", key="certain", wraps=True, rank=4),
)


def violations_table(violations: Sequence[Violation], title: str = "", notes: Sequence[str] = ()) -> Table:
    """Return a table of the rules that would be broken."""
    rows = [
        (
            Cell(violation.passing or None, text=violation.passing or "flight"),
            violation.rule,
            Cell(violation.time, time=violation.time if math.isfinite(violation.time) else None),
            violation.value,
            violation.deviation,
            violation.limit,
            violation.unit,
            Cell(violation.penalty, text=penalty_text(violation.penalty)),
            math.isinf(violation.penalty),
            Cell(violation.certain, text="yes" if violation.certain else "no", bad=violation.certain),
        )
        for violation in violations
    ]
    return Table(title, _VIOLATIONS, rows, notes)


def penalties_text(violations: Sequence[Violation]) -> str:
    """Return the sum of the penalties of what is certain, in words, with the rules whose penalties are not known."""
    certain = [violation for violation in violations if violation.certain]
    unknown = dict.fromkeys(violation.rule for violation in certain if math.isnan(violation.penalty))
    total = sum(violation.penalty for violation in certain if not math.isnan(violation.penalty))
    if math.isinf(total) or not unknown:
        return penalty_text(total)
    rest = f"not known for {', '.join(unknown)}"
    return f"{penalty_text(total)}, {rest}" if total > 0.0 else rest


def penalty_text(penalty: float) -> str:
    """Return a penalty in words."""
    if math.isnan(penalty):
        return "not known"
    return "ends the race" if math.isinf(penalty) else f"{penalty:g} s"
