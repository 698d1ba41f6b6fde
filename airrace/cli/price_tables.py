"""Prices as CSV and as a table for people."""

import csv
import io
import math
from collections.abc import Sequence

from airrace.cli.tables import plain_table, rendered
from airrace.procedure.result import StageResult
from airrace.sensitivity.sensitivity import Activity, Price

MILLI = 1000.0
BESIDE_KEYS = 50
"""The columns that the table takes beside its keys."""
LEAST_MS = 0.0005
"""The smallest cost that is shown as a number, ms; with three decimals a smaller one would show as zero."""


def prices_csv(prices: Sequence[Price]) -> str:
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


def prices_text(result: StageResult, prices: Sequence[Price], columns: int | None = None) -> str:
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
