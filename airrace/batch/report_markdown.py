"""The ranking as Markdown: for the summary of a CI run, or a comment on a pull request."""

from collections.abc import Iterator, Sequence

from airrace.batch.ranking import Row, counts
from airrace.batch.wind import WindSummary, wind_words

ROWS_MAX = 500
"""The largest number of jobs that are listed; GitHub takes 1 MiB."""


def markdown_text(rows: Sequence[Row], summaries: Sequence[WindSummary]) -> str:
    """Return the report: a heading, the table, the ways round, what is wrong, and the winds."""
    return "\n".join([*_ranking(rows), *_ways(rows), *_troubles(rows), *_winds(summaries)]) + "\n"


def _ranking(rows: Sequence[Row]) -> Iterator[str]:
    told = ", ".join(f"{number} {state}" for state, number in counts(rows).items())
    yield f"### airrace: {len(rows)} job{'' if len(rows) == 1 else 's'}: {told}"
    yield ""
    yield "| job | state | stage | race time s | behind s | wall s |"
    yield "|---|---|---|---:|---:|---:|"
    for row in rows[:ROWS_MAX]:
        result = row.result
        race_time = "" if result.race_time is None else f"{result.race_time:.3f}"
        behind = "" if row.behind is None else row.behind_words
        wall = "kept" if row.step.action == "keep" else f"{result.wall:.1f}"
        yield f"| {_cell(row.step.name)} | {row.state} | {result.stage} | {race_time} | {behind} | {wall} |"
    if len(rows) > ROWS_MAX:
        yield ""
        yield f"and {len(rows) - ROWS_MAX} more"


def _ways(rows: Sequence[Row]) -> Iterator[str]:
    told = [(row, row.result.ways) for row in rows if row.result.ways is not None]
    if not told:
        return
    yield ""
    yield "| job | route | routes tried | next best route | behind s |"
    yield "|---|---|---:|---|---:|"
    for row, ways in told[:ROWS_MAX]:
        behind = "" if ways.behind is None else f"{ways.behind:+.3f}"
        yield f"| {_cell(row.step.name)} | {_cell(ways.flown)} | {ways.tried} | {_cell(ways.next)} | {behind} |"


def _troubles(rows: Sequence[Row]) -> Iterator[str]:
    lines = [
        f"- `{row.step.name}`: {_plain(line)}"
        for row in rows
        if row.result.message
        for line in ([str(finding) for finding in row.result.findings] or [row.result.message])
    ]
    if lines:
        yield ""
        yield from lines[:ROWS_MAX]
    if len(lines) > ROWS_MAX:
        yield f"- and {len(lines) - ROWS_MAX} more"


def _winds(summaries: Sequence[WindSummary]) -> Iterator[str]:
    for summary in summaries:
        best, worst = summary.best.result.race_time, summary.worst.result.race_time
        yield ""
        yield f"#### Wind: {_plain(summary.title)}"
        yield ""
        yield f"- best: {best:.3f} s ({wind_words(summary.best)})"
        yield f"- worst: {worst:.3f} s ({wind_words(summary.worst)})"
        if summary.per_knot is not None:
            yield f"- {summary.per_knot:+.4f} s per knot"
        if summary.bearings:
            yield ""
            yield "| from ° | mean s | s per kt |"
            yield "|---:|---:|---:|"
        for one in summary.bearings:
            slope = "" if one.per_knot is None else f"{one.per_knot:+.4f}"
            yield f"| {one.from_deg} | {one.mean:.3f} | {slope} |"


def _cell(text: str) -> str:
    return _plain(text).replace("|", "\\|")


def _plain(text: str) -> str:
    return " ".join(text.split()).replace("<", "&lt;")
