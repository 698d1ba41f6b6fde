"""The ranking of a batch, and reports of it as CSV, Markdown and JUnit XML and to GitHub Actions."""

import csv
import io
import math
import os
import re
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from airrace.batch.planning import BatchPlan, JobResult, PlannedJob
from airrace.batch.record import RecordError, checkpoint_path, read_record
from airrace.errors import Finding, StorageError
from airrace.procedure.result import Status
from airrace.quantities import KNOT
from airrace.records import record
from airrace.results.comparison import TIE
from airrace.runs.command_result import ExitCode
from airrace.views.tables import Column, Table

STATES: Mapping[int, str] = {
    ExitCode.DONE: "certified",
    ExitCode.BUG: "bug",
    ExitCode.INVALID_INPUT: "invalid input",
    ExitCode.INFEASIBLE: "infeasible",
    ExitCode.NOT_CERTIFIED: "not certified",
    ExitCode.TIMEOUT: "timeout",
    ExitCode.BAD_CHECKPOINT: "bad checkpoint",
    ExitCode.SYSTEM: "failed",
    ExitCode.INTERRUPTED: "interrupted",
}
"""The words for how a job ended, by its exit code."""


@record
class BatchResult:
    """The result of a job, and how far it is behind.

    Attributes:
        step: the job, and why it was flown or not.
        result: how it ended.
        folder: where its checkpoint and its record lie.
        behind: s behind the fastest certified job of its own course; None without a race time. Jobs of different
            courses are never compared.
        best: whether it is that fastest one.
    """

    step: PlannedJob
    result: JobResult
    folder: Path
    behind: float | None
    best: bool

    @property
    def name(self) -> str:
        """The name of the job, of which its files are called."""
        return self.step.name

    @property
    def swept(self) -> dict[str, str]:
        """The values of the swept keys."""
        return dict(self.step.swept)

    @property
    def race_time(self) -> float | None:
        """The race time of the last stage, s; None without a flight."""
        return self.result.race_time

    @property
    def certified(self) -> bool:
        """Whether the job ended with a certified flight."""
        return self.result.code == ExitCode.DONE

    @property
    def message(self) -> str:
        """What went wrong; empty if nothing did."""
        return self.result.message

    @property
    def state(self) -> str:
        """The state of the job at its end, in a word or two."""
        return STATES.get(self.result.code, f"exit code {self.result.code}")

    @property
    def checkpoint(self) -> Path | None:
        """The checkpoint, as far as the job came; None where its inputs are not valid."""
        return None if self.step.action == "refuse" else checkpoint_path(self.folder, self.name)

    @property
    def behind_words(self) -> str:
        """The time behind, s, as a text: a difference, `best`, `tie` within `TIE`, or `-` without a race time."""
        if self.behind is None:
            return "-"
        return "best" if self.best else "tie" if abs(self.behind) <= TIE else f"{self.behind:+.3f}"

    def stages(self) -> Sequence[Mapping[str, Any]]:
        """Return the stages as `airrace optimize --json` prints them, from the job's record."""
        if self.step.action == "refuse":
            return ()
        try:
            record = read_record(self.folder, self.name)
        except RecordError:
            return ()
        return () if record is None or record.run is None else record.run["stages"]

    def as_object(self) -> dict[str, object]:
        """Return the result as plain values, as `airrace batch --json` prints it."""
        step, result = self.step, self.result
        return {
            "name": step.name,
            "course": step.course,
            "track": step.track,
            "aircraft": step.aircraft,
            "swept": self.swept,
            "state": self.state,
            "code": result.code,
            "certified": self.certified,
            "race_time_s": result.race_time,
            "behind_s": self.behind,
            "stage": result.stage or None,
            "lap_times_s": list(result.laps),
            "wall_s": result.wall if math.isfinite(result.wall) else None,
            "kept": step.action == "keep",
            "reason": step.reason,
            "retries": list(result.retries),
            "message": result.message,
            "findings": [asdict(finding) for finding in result.findings],
            "checkpoint": None if self.checkpoint is None else str(self.checkpoint),
            "stages": list(self.stages()),
        }

    def __repr__(self) -> str:
        race_time = "" if self.race_time is None else f", {self.race_time:.3f} s"
        return f"<BatchResult {self.name}: {self.state}{race_time}>"


def ranking_of(plan: BatchPlan, results: Sequence[JobResult]) -> list[BatchResult]:
    """Return all jobs, course by course as planned: certified ones by race time, then other flights by race time, then
    the rest as planned."""
    pairs = list(zip(plan.steps, results, strict=True))
    courses: dict[str, list[JobResult]] = {}
    for step, result in pairs:
        courses.setdefault(step.track, []).append(result)
    bests = {track: min(of_course, key=_rank) for track, of_course in courses.items()}
    order = {track: number for number, track in enumerate(courses)}

    def result_of(step: PlannedJob, result: JobResult) -> BatchResult:
        best = bests[step.track]
        if result.race_time is None or best.race_time is None:
            return BatchResult(step, result, plan.folder, None, best=False)
        return BatchResult(step, result, plan.folder, result.race_time - best.race_time, best=result is best)

    rows = [result_of(*pair) for pair in pairs]
    return sorted(rows, key=lambda row: (order[row.step.track], *_rank(row.result)))


def _rank(result: JobResult) -> tuple[int, float]:
    if result.race_time is None:
        return 2, 0.0
    return (0 if result.code == ExitCode.DONE else 1), result.race_time


def counts(rows: Sequence[BatchResult]) -> dict[str, int]:
    """Return how many jobs ended in which state, the most frequent first."""
    return dict(Counter(row.state for row in rows).most_common())


def counts_words(rows: Sequence[BatchResult]) -> str:
    """Return how many jobs ended in which state, in words, e.g. `3 certified, 1 failed`."""
    return ", ".join(f"{number} {state}" for state, number in counts(rows).items())


DIRECTION = "environment.wind.from_deg"
SPEEDS: Mapping[str, float] = {"environment.wind.speed_kt": 1.0, "environment.wind.speed_m_s": 1.0 / KNOT}
"""The keys of the wind's speed, and the knots in one of their units."""


@record
class Bearing:
    """The race times in one direction of the wind.

    Attributes:
        from_deg: where it blows from, as swept.
        mean: the mean of the race times, s.
        per_knot: race time for a knot of wind, s/kt; None with one speed only.
    """

    from_deg: str
    mean: float
    per_knot: float | None


@record
class WindSummary:
    """The race times of one course in several winds.

    Attributes:
        title: what was flown, in words.
        flights: the number of certified flights.
        best, worst: the fastest and the slowest of them.
        per_knot: race time for a knot of wind over all directions, s/kt; None with one speed only.
        bearings: the results by direction, in the order of the sweep; empty if the direction was not swept.
    """

    title: str
    flights: int
    best: BatchResult
    worst: BatchResult
    per_knot: float | None
    bearings: tuple[Bearing, ...]

    def as_object(self) -> dict[str, object]:
        """Return the summary as plain values, for JSON."""
        return {
            "of": self.title,
            "flights": self.flights,
            "best": _flight(self.best),
            "worst": _flight(self.worst),
            "s_per_kt": self.per_knot,
            "directions": [
                {"from_deg": one.from_deg, "mean_s": one.mean, "s_per_kt": one.per_knot} for one in self.bearings
            ],
        }


def wind_summaries(rows: Sequence[BatchResult]) -> list[WindSummary]:
    """Return a summary of every course that was flown in several winds; none if the wind was not swept."""
    groups: dict[tuple[str, ...], list[BatchResult]] = {}
    for row in rows:
        if row.result.code == ExitCode.DONE and row.result.race_time is not None and _is_wind_swept(row):
            others = [f"{key}={value}" for key, value in row.step.swept if key != DIRECTION and key not in SPEEDS]
            key = (row.step.track, row.step.aircraft or "", row.step.course, *others)
            groups.setdefault(key, []).append(row)
    return [_summary(key, group) for key, group in groups.items() if len(group) > 1]


def wind_words(row: BatchResult) -> str:
    """Return the swept part of a job's wind in words, e.g. `10 kt from 45`."""
    swept = dict(row.step.swept)
    speeds = [f"{swept[key]} {'kt' if key.endswith('kt') else 'm/s'}" for key in SPEEDS if key in swept]
    return " ".join([*speeds, *([f"from {swept[DIRECTION]}"] if DIRECTION in swept else [])])


def _is_wind_swept(row: BatchResult) -> bool:
    return any(key == DIRECTION or key in SPEEDS for key, _ in row.step.swept)


def _summary(key: tuple[str, ...], group: Sequence[BatchResult]) -> WindSummary:
    _, aircraft, course, *others = key
    inorder = sorted(group, key=_time)
    directions = sorted({dict(row.step.swept).get(DIRECTION, "") for row in group} - {""}, key=_number)
    bearings = [
        _bearing(one, [row for row in group if dict(row.step.swept).get(DIRECTION) == one]) for one in directions
    ]
    title = ", ".join([course, *([Path(aircraft).stem] if aircraft else []), *others])
    return WindSummary(title, len(group), inorder[0], inorder[-1], _slope(group), tuple(bearings))


def _bearing(direction: str, rows: Sequence[BatchResult]) -> Bearing:
    return Bearing(direction, sum(map(_time, rows)) / len(rows), _slope(rows))


def _slope(rows: Sequence[BatchResult]) -> float | None:
    """Return the slope of race time over wind speed, s/kt, by least squares; None where the speed does not vary."""
    points = [(speed, _time(row)) for row in rows if (speed := _knots(row)) is not None]
    if len({speed for speed, _ in points}) < 2:
        return None
    return statistics.linear_regression(*zip(*points, strict=True)).slope


def _knots(row: BatchResult) -> float | None:
    for key, value in row.step.swept:
        if key in SPEEDS and math.isfinite(number := _number(value)):
            return number * SPEEDS[key]
    return None


def _time(row: BatchResult) -> float:
    assert row.result.race_time is not None  # only flights are summarised
    return row.result.race_time


def _number(text: str) -> float:
    """Return the number that a text stands for; infinity if it is none, such as the `null` that takes a key out."""
    try:
        return float(text)
    except ValueError:
        return math.inf


def _flight(row: BatchResult) -> dict[str, object]:
    return {"name": row.step.name, "wind": wind_words(row), "race_time_s": row.result.race_time}


COLUMNS = ("name", "course", "track", "aircraft")
MEASURED = ("state", "code", "stage", "race_time_s", "behind_s", "laps_s", "wall_s", "kept", "retries", "message")
ROUTES = ("route", "routes_evaluated", "next_route", "next_route_behind_s")


def csv_text(rows: Sequence[BatchResult]) -> str:
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
                row.checkpoint,
            ]
        )
    return written.getvalue()


ROWS_MAX = 500
"""The largest number of jobs that are listed; GitHub takes 1 MiB."""


_RANKING = (
    Column("job"),
    Column("state"),
    Column("stage"),
    Column("race time", "s", ".3f", missing=""),
    Column("behind", "s", "+.3f", missing=""),
    Column("wall", "s", ".1f"),
)
_ROUTES = (
    Column("job"),
    Column("route"),
    Column("routes tried", form="d"),
    Column("next best route"),
    Column("behind", "s", "+.3f", missing=""),
)
_DIRECTIONS = (
    Column("from", "\N{DEGREE SIGN}", "s"),
    Column("mean", "s", ".3f"),
    Column("s per", "kt", "+.4f", missing=""),
)


def markdown_text(rows: Sequence[BatchResult], summaries: Sequence[WindSummary]) -> str:
    """Return the report: a heading, the table, the routes, what is wrong, and the winds."""
    parts = [f"### airrace: {len(rows)} job{'' if len(rows) == 1 else 's'}: {counts_words(rows)}"]
    ranking = [
        (
            row.name,
            row.state,
            row.result.stage,
            row.race_time,
            None if row.behind is None else row.behind_words,
            "kept" if row.step.action == "keep" else row.result.wall,
        )
        for row in rows[:ROWS_MAX]
    ]
    parts.append(Table("", _RANKING, ranking).markdown())
    if len(rows) > ROWS_MAX:
        parts.append(f"and {len(rows) - ROWS_MAX} more")
    routes = [
        (row.name, one.flown, one.tried, one.next, one.behind) for row in rows if (one := row.result.routes) is not None
    ]
    if routes:
        parts.append(Table("", _ROUTES, routes[:ROWS_MAX]).markdown())
    troubles = list(_troubles(rows))
    if troubles:
        parts.append("\n".join(troubles))
    return "\n\n".join([*parts, *(part for summary in summaries for part in _winds(summary))]) + "\n"


def _troubles(rows: Sequence[BatchResult]) -> Iterator[str]:
    lines = [
        f"- `{row.name}`: {_plain(line)}"
        for row in rows
        if row.message
        for line in ([str(finding) for finding in row.result.findings] or [row.message])
    ]
    yield from lines[:ROWS_MAX]
    if len(lines) > ROWS_MAX:
        yield f"- and {len(lines) - ROWS_MAX} more"


def _winds(summary: WindSummary) -> Iterator[str]:
    yield f"#### Wind: {_plain(summary.title)}"
    lines = [
        f"- {word}: {row.race_time:.3f} s ({wind_words(row)})"
        for word, row in (("best", summary.best), ("worst", summary.worst))
    ]
    yield "\n".join([*lines, *([] if summary.per_knot is None else [f"- {summary.per_knot:+.4f} s per knot"])])
    if summary.bearings:
        rows = [(one.from_deg, one.mean, one.per_knot) for one in summary.bearings]
        yield Table("", _DIRECTIONS, rows).markdown()


def _plain(text: str) -> str:
    return " ".join(text.split()).replace("<", "&lt;")


# Characters that XML 1.0 cannot hold, not even escaped.
_UNFIT = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

Run = Mapping[str, Any]  # Any: the JSON of a run


def junit_text(rows: Sequence[BatchResult]) -> str:
    """Return the report as XML; stages and certificates come from the jobs' records."""
    suites = Element("testsuites", name="airrace batch")
    for row in rows:
        suites.append(_suite(row))
    for name in ("tests", "failures", "errors", "skipped"):
        suites.set(name, str(sum(int(suite.get(name, "0")) for suite in suites)))
    suites.set("time", _total_time(suites))
    ElementTree.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suites, encoding="unicode") + "\n"


def _suite(row: BatchResult) -> Element:
    suite = Element("testsuite", name=fit(row.step.name))
    properties = SubElement(suite, "properties")
    for name, value in _properties(row):
        SubElement(properties, "property", name=fit(name), value=fit(value))
    cases = [case for stage in row.stages() for case in _stage_cases(row, stage)]
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


def _properties(row: BatchResult) -> Iterator[tuple[str, str]]:
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


SOUND = {one.value for one in (Status.CERTIFIED, Status.SOLVED, Status.GUESS)}
"""The statuses of stages that are no failure."""


def _stage_cases(row: BatchResult, stage: Run) -> Iterator[Element]:
    name, kind = stage["stage"], f"{row.step.name}.{stage['stage']}"
    case = _case(kind, name, stage["wall_s"] or 0.0)
    if stage["status"] not in SOUND:
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


def _run_case(row: BatchResult, seconds: float) -> Element:
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


ANNOTATIONS_MAX = 50
"""The largest number of annotations; GitHub shows ten of a step."""


def runs_here(environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether this process is a step of GitHub Actions."""
    return environment.get("GITHUB_ACTIONS") == "true"


def annotations(rows: Sequence[BatchResult], findings: Sequence[Finding]) -> Iterator[str]:
    """Yield commands of a workflow, one per line: an error for every finding and every job that is not certified."""
    lines = dict.fromkeys([*(_of_finding(one) for one in findings), *(line for row in rows for line in _of_row(row))])
    told = list(lines)
    yield from told[:ANNOTATIONS_MAX]
    if len(told) > ANNOTATIONS_MAX:
        yield f"::warning title=airrace::and {len(told) - ANNOTATIONS_MAX} more errors"


def append_summary(text: str, environment: Mapping[str, str] = os.environ) -> None:
    """Append Markdown to the summary of the step, if there is one.

    Raises:
        StorageError: the system refused.
    """
    path = environment.get("GITHUB_STEP_SUMMARY")
    if not path:
        return
    try:
        with Path(path).open("a", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
    except OSError as error:
        raise StorageError(f"cannot write to the step summary {path}: {error.strerror}") from error


def _of_row(row: BatchResult) -> Iterator[str]:
    if row.result.findings:
        yield from map(_of_finding, row.result.findings)
    elif row.result.code != ExitCode.DONE:
        yield _error(f"{row.step.name}: {row.state}", row.result.message, row.step.track, 0, 0)


def _of_finding(finding: Finding) -> str:
    return _error(finding.key or "airrace", finding.message, finding.file, finding.line, finding.column)


def _error(title: str, message: str, file: str, line: int, column: int) -> str:
    places = {
        "file": "" if file.startswith("--") else file,
        "line": line,
        "col": column,
        "title": title,
    }
    properties = ",".join(f"{name}={_escaped(str(value), ':,')}" for name, value in places.items() if value)
    return f"::error {properties}::{_escaped(message, '')}"


def _escaped(text: str, also: str) -> str:
    for character in "%\r\n" + also:
        text = text.replace(character, f"%{ord(character):02X}")
    return text
