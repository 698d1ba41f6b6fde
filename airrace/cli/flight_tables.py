"""The texts of a flight log, and those of sensitivities."""

import math
from collections.abc import Iterator, Sequence

from airrace.cli.printed_result import PAGE, paragraph, render
from airrace.cli.run_tables import cost_to_go_texts, distance_tables, laps_text, leg_tables
from airrace.flights.logs.violations import CERTAIN_DEVIATIONS, select_violations
from airrace.flights.sensitivity import Activity, Sensitivity
from airrace.pages.report.sensitivity_tables import cost_text, sensitivities_table
from airrace.pages.views.log_tables import passings_table, penalties_text, violations_table
from airrace.procedure.result import StageResult
from airrace.runs.log_view import LogView

BESIDE_KEYS = 50
"""The columns that a table of sensitivities needs beside its keys."""


def log_texts(log: LogView, *, legs: bool = False) -> Iterator[str]:
    """Yield race time and passings of a flight log, violations and remarks; at most 80 columns wide.

    Args:
        log: the log, as it was understood.
        legs: whether every leg is shown, too.
    """
    flight = log.flight()
    race_time = "not finished"
    if math.isfinite(flight.race_time):
        race_time = f"{flight.race_time:.3f} +- {log.race_time_deviation:.2g} s"
    verified = f"; {flight.source.verification.remark}" if flight.source.verification else ""
    title = f"{flight.label}: race time {race_time}, as flown{verified}"
    yield render(passings_table(flight, title), columns=PAGE)
    if log.violations:
        listed, rest = select_violations(log.violations)
        yield render(violations_table(listed, "rules that would be broken"), columns=PAGE)
        if rest:
            yield paragraph(rest)
    yield paragraph(
        f"penalties of what is certain: {penalties_text(log.violations)}; certain are {CERTAIN_DEVIATIONS:g} standard "
        f"deviations, by {log.assumption}"
    )
    if laps := laps_text(flight):
        yield paragraph(laps)
    tables = [*distance_tables(flight), *(leg_tables(flight) if legs else ())]
    yield from (render(table, columns=PAGE) for table in tables)
    if log.cost_to_go is not None:
        yield from cost_to_go_texts(log.cost_to_go)
    yield "\n".join(paragraph(remark, begin="note: ") for remark in log.remarks)


def sensitivities_text(result: StageResult, sensitivities: Sequence[Sensitivity], columns: int | None = None) -> str:
    """Return a table of what costs something, why some sensitivities are one-sided, and how many numbers are free.

    Args:
        result: the stage.
        sensitivities: the largest first.
        columns: the width of the terminal, None without one; where it is narrow, long keys take two lines.
    """
    longest = max((len(sensitivity.key) for sensitivity in sensitivities), default=0)
    title = f"{result.stage.value}: race time {result.trajectory.race_time:.3f} s, what a usual step costs"
    table = sensitivities_table(sensitivities, title, folds=columns is not None and columns < longest + BESIDE_KEYS)
    parts = [render(table)] if table.rows else []
    lines: list[str] = []
    for sensitivity in sensitivities:
        if sensitivity.activity is Activity.ONE_SIDED:
            costs = f"{cost_text(sensitivity.cost_up)}, {cost_text(sensitivity.cost_down)} ms"
            lines.append(f"{sensitivity.key}: {costs} ({sensitivity.note})")
    if lines:
        parts.append("\n".join(["one-sided (*), a usual step up and down:", *lines]))
    free = len(sensitivities) - len(table.rows)
    numbers = f"{free} more number{'' if free == 1 else 's'}"
    return "\n\n".join([*parts, f"free: {numbers} of {len(sensitivities)} (--csv and --json list them)"])
