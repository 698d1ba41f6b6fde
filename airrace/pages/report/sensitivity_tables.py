"""The tables of sensitivities, for people and as CSV."""

import math
from collections.abc import Sequence
from typing import cast

from airrace.flights.sensitivity import Activity, Sensitivity
from airrace.pages.views.tables import Cell, Column, Table, Value

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
LINE_MAX = 36
"""The longest key that stays on one line where keys are folded, characters."""


def sensitivities_csv(sensitivities: Sequence[Sensitivity]) -> str:
    """Return sensitivities as CSV, one row per number, the largest first.

    An entry is empty where the inputs allow no value to that side.
    """
    rows = [cast(list[Value], [sensitivity.key, *sensitivity.as_object().values()]) for sensitivity in sensitivities]
    return Table("", [Column(key=key) for key in _STORED], rows).csv()


def sensitivities_table(
    sensitivities: Sequence[Sensitivity], title: str, most: int | None = None, *, folds: bool = False
) -> Table:
    """Return a table of the numbers that cost something; a key with a star has another cost up than down.

    Args:
        sensitivities: the largest first.
        title: stands above it.
        most: the largest number of rows; of more, the last one says how many there are. None for all.
        folds: whether long keys take two lines, cut after a dot.
    """
    active = [sensitivity for sensitivity in sensitivities if sensitivity.activity is not Activity.FREE]
    rows: list[tuple[Cell | Value, ...]] = []
    for sensitivity in active[:most]:
        unit = "" if sensitivity.unit == "1" else f" {sensitivity.unit}"
        key = f"{sensitivity.key}{'*' if sensitivity.activity is Activity.ONE_SIDED else ''}"
        if folds and len(key) > LINE_MAX:
            section, dot, name = key.rpartition(".")
            key = f"{section}{dot}\n  {name}"
        value, step = f"{sensitivity.value:.6g}{unit}", f"{sensitivity.usual_step:.3g}{unit}"
        rows.append((key, value, sensitivity.per_unit, step, cost_text(sensitivity.cost_up)))
    if most is not None and len(rows) < len(sensitivities):
        rows.append((f"and {len(sensitivities) - len(rows)} more", "", "", "", ""))
    return Table(title, _SENSITIVITIES, rows)


def cost_text(seconds: float) -> str:
    """Return a cost in milliseconds, without the unit."""
    if not math.isfinite(seconds):
        return "-"
    milliseconds = 1000.0 * seconds
    # A smaller cost would show as zero.
    return "free" if abs(milliseconds) < 0.0005 else f"{milliseconds:+.3f}"
