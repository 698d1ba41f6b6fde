"""Reports of a batch as CSV, Markdown and JUnit XML.

A job is a test suite; what its stages certify are its test cases.

| in the batch | in the report |
|---|---|
| a stage | a test case named like it: a failure unless it ended `solved` |
| an item of its certificate | a test case `STAGE.ITEM` of the class `JOB.STAGE`: a failure unless it holds |
| the job as a whole | a test case `run`: a failure if it is not certified, an error if it has no answer or its inputs |
| | are not valid, skipped if it was never begun |
"""

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from airrace.batch.plan import JobResult
from airrace.batch.ranking import RankingRow, WindSummary, counts, wind_words
from airrace.batch.record import RecordError, checkpoint_path, read_record
from airrace.runs.command_result import ExitCode

COLUMNS = ("name", "course", "track", "aircraft")
MEASURED = ("state", "code", "stage", "race_time_s", "behind_s", "laps_s", "wall_s", "kept", "retries", "message")
ROUTES = ("route", "routes_evaluated", "next_route", "next_route_behind_s")


def csv_text(rows: Sequence[RankingRow], folder: Path) -> str:
    """Return the table as RFC 4180 has it, with a column for every swept key.

    Numbers have full precision; an entry is empty where there is none.
    """
    keys = list(dict.fromkeys(key for row in rows for key, _ in row.step.swept))
    written = io.StringIO()
    writer = csv.writer(written)
    writer.writerow([*COLUMNS, *keys, *MEASURED, *ROUTES, "checkpoint"])
    for row in rows:
        step, result, swept, routes = row.step, row.result, dict(row.step.swept), row.result.routes
        writer.writerow(
            [
                *(step.name, step.course, step.track, step.aircraft),
                *(swept.get(key) for key in keys),
                *(row.state, result.code, result.stage, result.race_time, row.behind),
                *(" ".join(str(lap) for lap in result.laps), result.wall),
                "yes" if step.action == "keep" else "no",
                len(result.retries),
                result.message,
                *(
                    (None,) * len(ROUTES)
                    if routes is None
                    else (routes.flown, routes.tried, routes.next, routes.behind)
                ),
                checkpoint_path(folder, step.name) if step.action != "refuse" else None,
            ]
        )
    return written.getvalue()


ROWS_MAX = 500
"""The largest number of jobs that are listed; GitHub takes 1 MiB."""


def markdown_text(rows: Sequence[RankingRow], summaries: Sequence[WindSummary]) -> str:
    """Return the report: a heading, the table, the routes, what is wrong, and the winds."""
    return "\n".join([*_ranking(rows), *_routes(rows), *_troubles(rows), *_winds(summaries)]) + "\n"


def _ranking(rows: Sequence[RankingRow]) -> Iterator[str]:
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


def _routes(rows: Sequence[RankingRow]) -> Iterator[str]:
    told = [(row, row.result.routes) for row in rows if row.result.routes is not None]
    if not told:
        return
    yield ""
    yield "| job | route | routes tried | next best route | behind s |"
    yield "|---|---|---:|---|---:|"
    for row, routes in told[:ROWS_MAX]:
        behind = "" if routes.behind is None else f"{routes.behind:+.3f}"
        yield f"| {_cell(row.step.name)} | {_cell(routes.flown)} | {routes.tried} | {_cell(routes.next)} | {behind} |"


def _troubles(rows: Sequence[RankingRow]) -> Iterator[str]:
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


# Characters that XML 1.0 cannot hold, not even escaped.
_UNFIT = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

Run = Mapping[str, Any]  # Any: the JSON of a run


def junit_text(rows: Sequence[RankingRow], folder: Path) -> str:
    """Return the report as XML; stages and certificates come from the records in the folder."""
    suites = Element("testsuites", name="airrace batch")
    for row in rows:
        suites.append(_suite(row, folder))
    for name in ("tests", "failures", "errors", "skipped"):
        suites.set(name, str(sum(int(suite.get(name, "0")) for suite in suites)))
    suites.set("time", _total_time(suites))
    ElementTree.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suites, encoding="unicode") + "\n"


def stages_of(row: RankingRow, folder: Path) -> Sequence[Run]:
    """Return the stages of a job as `airrace optimize --json` prints them, from its record."""
    if row.step.action == "refuse":
        return ()
    try:
        record = read_record(folder, row.step.name)
    except RecordError:
        return ()
    return () if record is None or record.run is None else record.run["stages"]


def _suite(row: RankingRow, folder: Path) -> Element:
    suite = Element("testsuite", name=fit(row.step.name))
    properties = SubElement(suite, "properties")
    for name, value in _properties(row):
        SubElement(properties, "property", name=fit(name), value=fit(value))
    stages = stages_of(row, folder)
    cases = [case for stage in stages for case in _stage_cases(row, stage)]
    spent = sum(float(case.get("time", "0")) for case in cases)
    suite.extend([*cases, _run_case(row, max(0.0, row.result.wall - spent))])
    for name, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(name, str(len(suite.findall(f"testcase/{tag}"))))
    suite.set("tests", str(len(suite.findall("testcase"))))
    suite.set("time", _total_time(suite))
    return suite


def _total_time(parent: Element) -> str:
    """Return the time (s) of all cases of a suite, or of all suites, as a text."""
    return str(round(sum(float(child.get("time", "0")) for child in parent), 3))


def _properties(row: RankingRow) -> Iterator[tuple[str, str]]:
    yield "course", row.step.course
    yield "track", row.step.track
    if row.step.aircraft is not None:
        yield "aircraft", row.step.aircraft
    yield from row.step.swept
    yield "state", row.state
    yield "exit_code", str(row.result.code)
    if row.result.race_time is not None:
        yield "race_time_s", repr(row.result.race_time)
    for reason in row.result.retries:
        yield "retried", reason


def _stage_cases(row: RankingRow, stage: Run) -> Iterator[Element]:
    name, kind = stage["stage"], f"{row.step.name}.{stage['stage']}"
    case = _case(kind, name, stage["wall_s"] or 0.0)
    if stage["status"] != "solved":
        _trouble(case, "failure", stage["status"], stage["message"] or stage["status"])
    yield case
    items: Sequence[Run] = stage["certificate"]["items"] if stage["certificate"] else ()
    for item in items:
        case = _case(kind, f"{name}.{item['name']}", 0.0)
        if not item["holds"]:
            _trouble(case, "failure", item["name"], _item_text(item))
        yield case


def _item_text(item: Run) -> str:
    value = "not measured" if item["value"] is None else f"{item['value']:.6g}"
    limit = "none" if item["limit"] is None else f"{item['limit']:.6g}"
    where = f" at {item['where']}" if item["where"] else ""
    return f"{item['name']} is {value}, its limit {limit} {item['unit']}{where}".rstrip()


def _run_case(row: RankingRow, seconds: float) -> Element:
    """Return the case of the job as a whole; its time is what its stages leave, so that the times of a suite add up."""
    result = row.result
    case = _case(row.step.name, "run", seconds)
    if result.code != ExitCode.DONE:
        text = "\n".join([result.message or row.state, *map(str, result.findings)])
        _trouble(case, _severity(result), row.state, text)
    return case


def _severity(result: JobResult) -> str:
    if result.code in (ExitCode.INFEASIBLE, ExitCode.NOT_CERTIFIED):
        return "failure"
    return "skipped" if result.code == ExitCode.INTERRUPTED and not result.wall else "error"


def _case(kind: str, name: str, seconds: float) -> Element:
    return Element("testcase", classname=fit(kind), name=fit(name), time=str(round(seconds, 3)))


def _trouble(case: Element, tag: str, kind: str, text: str) -> None:
    trouble = SubElement(case, tag, message=fit(text.partition("\n")[0]), type=fit(kind))
    trouble.text = fit(text)


def fit(text: str) -> str:
    """Return a text that XML can hold; a character that it cannot hold is written as `\\x00`."""
    return _UNFIT.sub(lambda found: f"\\x{ord(found[0]):02x}", text).replace("\r", "\\x0d")
