"""The tables of a batch."""

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from airrace.batch.ranking import Row, counts
from airrace.batch.wind import WindSummary, wind_words
from airrace.cli.tables import plain_table

MESSAGE_MAX = 90
"""Longer messages are cut in the table; all of them are in the other reports."""


def ranking_table(rows: Sequence[Row]) -> Table:
    """All jobs, course by course, the fastest of each first."""
    explored, laps = any(row.result.ways is not None for row in rows), any(row.result.laps for row in rows)
    told = ", ".join(f"{number} {state}" for state, number in counts(rows).items())
    numbers = ("race time\ns", "behind\ns", *(("best lap\ns",) if laps else ()))
    numbers = (*numbers, *(("ways\ntried", "next way\nbehind s") if explored else ()), "wall\ns")
    cells = [
        [
            *(row.step.name, row.state, row.result.stage or "-", *_times(row, laps=laps)),
            *(_ways(row) if explored else ()),
            *(_wall(row), _shortened(row.result.message)),
        ]
        for row in rows
    ]
    return _with_notes(f"{len(rows)} jobs: {told or 'none'}", numbers, cells)


def wind_tables(summaries: Sequence[WindSummary]) -> list[Table]:
    """For every course that was flown in several winds: best, worst, and what comes from where."""
    return [table for summary in summaries for table in _of_winds(summary)]


def _of_winds(summary: WindSummary) -> list[Table]:
    flights = [
        (words, row.step.name, wind_words(row), f"{row.result.race_time:.3f}")
        for words, row in (("best", summary.best), ("worst", summary.worst))
    ]
    slope = "" if summary.per_knot is None else f", {summary.per_knot:+.4f} s per knot"
    title = f"wind: {summary.title}: {summary.flights} certified flights{slope}"
    tables = [plain_table(title, ("", "job", "wind"), ("race time\ns",), flights)]
    if summary.bearings:
        rows = [
            (one.from_deg, f"{one.mean:.3f}", "-" if one.per_knot is None else f"{one.per_knot:+.4f}")
            for one in summary.bearings
        ]
        tables.append(plain_table("by direction of the wind", (), ("from\ndeg", "mean\ns", "s per\nkt"), rows))
    return tables


def _with_notes(title: str, numbers: Sequence[str], cells: Sequence[Sequence[str]]) -> Table:
    """Names, numbers, and what was said in the last column."""
    table = plain_table(title, ("job", "state", "stage"), numbers, ())
    table.add_column("message")
    for row in cells:
        table.add_row(*(Text(cell) for cell in row))
    return table


def _times(row: Row, *, laps: bool) -> list[str]:
    race_time, flown = row.result.race_time, row.result.laps
    best_lap = [f"{min(flown):.3f}" if flown else "-"] if laps else []
    return ["-" if race_time is None else f"{race_time:.3f}", row.behind_words, *best_lap]


def _ways(row: Row) -> tuple[str, str]:
    ways = row.result.ways
    if ways is None:
        return "-", "-"
    return str(ways.tried), "-" if ways.behind is None else f"{ways.behind:+.3f}"


def _wall(row: Row) -> str:
    return "kept" if row.step.action == "keep" else f"{row.result.wall:.1f}"


def _shortened(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= MESSAGE_MAX else f"{line[: MESSAGE_MAX - 3]}..."
