"""The tables of a batch."""

import re
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from airrace.batch.ranking import RankingRow, WindSummary, counts, wind_words
from airrace.cli.tables import full_columns, plain_table

MESSAGE_MAX = 90
"""The longest message in the table, in characters; the other reports hold longer ones in full."""
MESSAGE_LEAST = 30
"""The columns without which a message is not put beside numbers: narrower ones would break most of its lines."""
NAME_MAX = 20
"""The longest line of a job's name on a narrow terminal, in characters: so much is left of 80 columns beside its state,
the stage with the longest name, its race time and how far it is behind."""


def ranking_tables(rows: Sequence[RankingRow], columns: int | None = None) -> list[Table]:
    """Return all jobs, course by course, the fastest of each first.

    They are one table, or where the terminal is too narrow for it three: the ranking, how the jobs were flown, and the
    messages.

    Args:
        rows: the jobs in their order.
        columns: the width of the terminal, None without one.
    """
    flown, flights = _flown(rows)
    rankings = [_ranking(row) for row in rows]
    messages = [_shortened(row.result.message) for row in rows]
    told = ", ".join(f"{number} {state}" for state, number in counts(rows).items())
    title, names = f"{len(rows)} jobs: {told or 'none'}", ("job", "state", "stage")
    times = ("race time\ns", "behind\ns")
    whole = [(row.step.name, *ranking, *flight) for row, ranking, flight in zip(rows, rankings, flights, strict=True)]
    table, noted = plain_table(title, names, (*times, *flown), whole), columns is None or any(messages)
    if columns is None or full_columns(table) + MESSAGE_LEAST * noted <= columns:
        cells = [(*cells, message) for cells, message in zip(whole, messages, strict=True)]
        return [_with_messages(title, names, (*times, *flown), cells) if noted else table]
    jobs = [folded(row.step.name) for row in rows]
    ranked = [(job, *ranking) for job, ranking in zip(jobs, rankings, strict=True)]
    how = [(job, *flight) for job, flight in zip(jobs, flights, strict=True)]
    said = [(job, message) for job, message in zip(jobs, messages, strict=True) if message]
    return [
        plain_table(title, names, times, ranked),
        plain_table("how they were flown", ("job",), flown, how),
        *([_with_messages("what was said of them", ("job",), (), said)] if said else []),
    ]


def folded(name: str) -> str:
    """Return a job's name on as many lines as it needs on a narrow terminal, cut after commas."""
    lines = [""]
    for part in re.split(r"(?<=,)", name):
        if lines[-1] and len(lines[-1] + part) > NAME_MAX:
            lines.append("  ")
        lines[-1] += part
    return "\n".join(lines)


def wind_tables(summaries: Sequence[WindSummary], columns: int | None = None) -> list[Table]:
    """Return tables for every course that was flown in several winds: best and worst, and the mean by direction.

    Args:
        summaries: what the courses have shown.
        columns: the width of the terminal, None without one; names of jobs are folded where it is too narrow.
    """
    return [table for summary in summaries for table in _of_winds(summary, columns)]


def _of_winds(summary: WindSummary, columns: int | None) -> list[Table]:
    flights = [
        (words, row.step.name, wind_words(row), f"{row.result.race_time:.3f}")
        for words, row in (("best", summary.best), ("worst", summary.worst))
    ]
    slope = "" if summary.per_knot is None else f", {summary.per_knot:+.4f} s per knot"
    title = f"wind: {summary.title}: {summary.flights} certified flights{slope}"
    names, times = ("", "job", "wind"), ("race time\ns",)
    extremes = plain_table(title, names, times, flights)
    if columns is not None and full_columns(extremes) > columns:
        extremes = plain_table(title, names, times, [(words, folded(job), *more) for words, job, *more in flights])
    tables = [extremes]
    if summary.bearings:
        rows = [
            (one.from_deg, f"{one.mean:.3f}", "-" if one.per_knot is None else f"{one.per_knot:+.4f}")
            for one in summary.bearings
        ]
        tables.append(plain_table("by direction of the wind", (), ("from\ndeg", "mean\ns", "s per\nkt"), rows))
    return tables


def _ranking(row: RankingRow) -> tuple[str, ...]:
    """Return the cells that rank a job: state, stage, race time and how far it is behind."""
    race_time = row.result.race_time
    told = "-" if race_time is None else f"{race_time:.3f}"
    return row.state, row.result.stage or "-", told, row.behind_words


def _flown(rows: Sequence[RankingRow]) -> tuple[list[str], list[list[str]]]:
    """Return the heads and the cells of how the jobs were flown, of what any of them has to tell."""
    explored, laps = any(row.result.ways is not None for row in rows), any(row.result.laps for row in rows)
    heads = [
        *(["best lap\ns"] if laps else []),
        *(["ways\ntried", "next way\nbehind s"] if explored else []),
        "wall\ns",
    ]
    cells = [[*([_best_lap(row)] if laps else []), *(_ways(row) if explored else ()), _wall(row)] for row in rows]
    return heads, cells


def _with_messages(title: str, names: Sequence[str], numbers: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of names, of numbers, and of a message in the last column, which is wrapped between words."""
    table = plain_table(title, names, numbers, ())
    table.add_column("message")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table


def _best_lap(row: RankingRow) -> str:
    return f"{min(row.result.laps):.3f}" if row.result.laps else "-"


def _ways(row: RankingRow) -> tuple[str, str]:
    ways = row.result.ways
    if ways is None:
        return "-", "-"
    return str(ways.tried), "-" if ways.behind is None else f"{ways.behind:+.3f}"


def _wall(row: RankingRow) -> str:
    return "kept" if row.step.action == "keep" else f"{row.result.wall:.1f}"


def _shortened(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= MESSAGE_MAX else f"{line[: MESSAGE_MAX - 3]}..."
