"""The ranking of a batch, and reports of it as CSV, Markdown and JUnit XML and to GitHub Actions."""

import math
import operator
import os
import re
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from airrace.errors import Finding, StorageError
from airrace.flights.results.comparison import TIE
from airrace.optimal_control.quantities import KNOT
from airrace.pages.views.plain_text import escape_markdown
from airrace.pages.views.tables import Column, Table
from airrace.procedure.result import Status
from airrace.runs.batch.planning import BatchPlan, JobResult, PlannedJob
from airrace.runs.batch.record import RecordError, checkpoint_path, read_record
from airrace.runs.command_result import ExitCode

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


@dataclass(frozen=True)
class BatchResult:
    """The result of a job, and how far it is behind.

    Attributes:
        step: the job, and why it ran or not.
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
    bests: dict[str, JobResult] = {}
    for step, result in zip(plan.steps, results, strict=True):
        bests[step.track] = min(bests.get(step.track, result), result, key=_rank)
    order = {track: number for number, track in enumerate(bests)}
    rows: list[BatchResult] = []
    for step, result in zip(plan.steps, results, strict=True):
        best = bests[step.track]
        behind = None if result.race_time is None or best.race_time is None else result.race_time - best.race_time
        rows.append(BatchResult(step, result, plan.folder, behind, best=behind is not None and result is best))
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


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class WindSummary:
    """The race times of one course in several winds.

    Attributes:
        title: of the batch, in words.
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
        flights = {
            word: {"name": row.name, "wind": wind_words(row), "race_time_s": row.race_time}
            for word, row in (("best", self.best), ("worst", self.worst))
        }
        directions = [
            {"from_deg": bearing.from_deg, "mean_s": bearing.mean, "s_per_kt": bearing.per_knot}
            for bearing in self.bearings
        ]
        return {
            "of": self.title,
            "flights": self.flights,
            **flights,
            "s_per_kt": self.per_knot,
            "directions": directions,
        }


def wind_words(row: BatchResult) -> str:
    """Return the swept part of a job's wind in words, e.g. `10 kt from 45`."""
    swept = row.swept
    speeds = [f"{swept[key]} {'kt' if key.endswith('kt') else 'm/s'}" for key in SPEEDS if key in swept]
    return " ".join([*speeds, *([f"from {swept[DIRECTION]}"] if DIRECTION in swept else [])])


def wind_summaries(rows: Sequence[BatchResult]) -> list[WindSummary]:
    """Return a summary of every course that was solved in several winds; none if the wind was not swept."""
    groups: dict[tuple[str, ...], list[tuple[float, BatchResult]]] = {}
    for row in rows:
        rest = [f"{key}={value}" for key, value in row.step.swept if key != DIRECTION and key not in SPEEDS]
        if row.certified and row.race_time is not None and len(rest) < len(row.step.swept):
            key = (row.step.track, row.step.aircraft or "", row.step.course, *rest)
            groups.setdefault(key, []).append((row.race_time, row))
    summaries: list[WindSummary] = []
    for (_, aircraft, course, *rest), group in groups.items():
        if len(group) > 1:
            flights = [row for _, row in sorted(group, key=operator.itemgetter(0))]
            title = ", ".join([course, *([Path(aircraft).stem] if aircraft else []), *rest])
            bearings = tuple(_bearings(group))
            summaries.append(WindSummary(title, len(group), flights[0], flights[-1], _slope(group), bearings))
    return summaries


def _bearings(flights: Sequence[tuple[float, BatchResult]]) -> Iterator[Bearing]:
    directions = {row.swept.get(DIRECTION, "") for _, row in flights} - {""}
    for direction in sorted(directions, key=_number):
        in_direction = [(time, row) for time, row in flights if row.swept.get(DIRECTION) == direction]
        mean = sum(time for time, _ in in_direction) / len(in_direction)
        yield Bearing(direction, mean, _slope(in_direction))


def _slope(flights: Sequence[tuple[float, BatchResult]]) -> float | None:
    """Return the slope of race time over wind speed, s/kt, by least squares; None where the speed does not vary."""
    speeds: list[float] = []
    times: list[float] = []
    for time, row in flights:
        for key, value in row.step.swept:
            if key in SPEEDS and math.isfinite(number := _number(value)):
                speeds.append(number * SPEEDS[key])
                times.append(time)
                break
    return statistics.linear_regression(speeds, times).slope if len(set(speeds)) > 1 else None


def _number(text: str) -> float:
    """Return the number that a text stands for; infinity if it is none, such as the `null` that takes a key out."""
    try:
        return float(text)
    except ValueError:
        return math.inf


ROWS_MAX = 500
"""The largest number of jobs that Markdown lists; GitHub takes 1 MiB."""
ANNOTATIONS_MAX = 50
"""The largest number of annotations; GitHub shows ten of a step."""
_ROUTES = (
    Column("job"),
    Column("route"),
    Column("routes tried", form="d"),
    Column("next best route"),
    Column("behind", "s", "+z.3f", missing=""),
)
_DIRECTIONS = (
    Column("from", "\N{DEGREE SIGN}", "s"),
    Column("mean", "s", ".3f"),
    Column("s per", "kt", "+z.4f", missing=""),
)


def batch_table(rows: Sequence[BatchResult]) -> Table:
    """Return the jobs: in CSV all that is known of each, with a column for every swept key; for people the ranking."""
    keys = list(dict.fromkeys(key for row in rows for key, _ in row.step.swept))
    columns = (
        Column("job", key="name"),
        *(Column(key=key) for key in ("course", "track", "aircraft", *keys)),
        Column("state", key="state"),
        Column(key="code"),
        Column("stage", key="stage"),
        Column("race time", "s", ".3f", "race_time_s", missing=""),
        Column("behind", "s", "+z.3f", missing=""),
        *(Column(key=key) for key in ("behind_s", "laps_s", "wall_s")),
        Column("wall", "s", ".1f"),
        *(Column(key=key) for key in ("kept", "retries", "message", "route", "routes_evaluated")),
        *(Column(key=key) for key in ("next_route", "next_route_behind_s", "least_distances_m", "checkpoint")),
    )
    cells: list[tuple[str | float | None, ...]] = []
    for row in rows:
        step, result, swept, routes = row.step, row.result, row.swept, row.result.routes
        reused = step.action == "keep"
        cells.append(
            (
                *(step.name, step.course, step.track, step.aircraft),
                *(swept.get(key) for key in keys),
                *(row.state, result.code, result.stage, result.race_time),
                *(None if row.behind is None else row.behind_words, row.behind),
                *(" ".join(map(str, result.laps)), result.wall, "kept" if reused else result.wall),
                *("yes" if reused else "no", len(result.retries), result.message),
                *((routes.route, routes.tried, routes.next, routes.behind) if routes else [None] * 4),
                ", ".join(f"{name} {away:.2f}" for name, away in result.least_distances),
                None if row.checkpoint is None else str(row.checkpoint),
            )
        )
    return Table("", columns, cells)


def markdown_report(rows: Sequence[BatchResult], summaries: Sequence[WindSummary]) -> str:
    """Return the report: a heading, the table, the routes, what is wrong, and the winds."""
    parts = [f"### airrace: {len(rows)} job{'' if len(rows) == 1 else 's'}: {counts_words(rows)}"]
    parts.append(batch_table(rows[:ROWS_MAX]).markdown())
    if len(rows) > ROWS_MAX:
        parts.append(f"and {len(rows) - ROWS_MAX} more")
    routes: list[tuple[str | float | None, ...]] = []
    for row in rows:
        if summary := row.result.routes:
            routes.append((row.name, summary.route, summary.tried, summary.next, summary.behind))
    if routes:
        parts.append(Table("", _ROUTES, routes[:ROWS_MAX]).markdown())
    messages = [
        f"- {escape_markdown(row.name)}: {escape_markdown(line)}"
        for row in rows
        if row.message
        for line in map(str, row.result.findings or [row.message])
    ]
    if len(messages) > ROWS_MAX:
        messages[ROWS_MAX:] = [f"- and {len(messages) - ROWS_MAX} more"]
    if messages:
        parts.append("\n".join(messages))
    for summary in summaries:
        parts.append(f"#### Wind: {escape_markdown(summary.title)}")
        lines = [
            f"- {word}: {row.race_time:.3f} s ({wind_words(row)})"
            for word, row in (("best", summary.best), ("worst", summary.worst))
        ]
        lines += [] if summary.per_knot is None else [f"- {summary.per_knot:+.4f} s per knot"]
        parts.append("\n".join(lines))
        if summary.bearings:
            bearings = [(bearing.from_deg, bearing.mean, bearing.per_knot) for bearing in summary.bearings]
            parts.append(Table("", _DIRECTIONS, bearings).markdown())
    return "\n\n".join(parts) + "\n"


# Characters that XML 1.0 cannot hold, not even escaped.
_UNFIT = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_report(rows: Sequence[BatchResult]) -> str:
    """Return the report as XML; stages and certificates come from the jobs' records."""
    suites = Element("testsuites", name="airrace batch")
    suites.extend(_suite(row) for row in rows)
    _set_totals(suites)
    ElementTree.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suites, encoding="unicode") + "\n"


def _set_totals(suite: Element) -> None:
    """Write the numbers of its cases, and their time (s), on a suite or on all of them."""
    for name, tag in (("tests", "testcase"), ("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(name, str(len(suite.findall(f".//{tag}"))))
    suite.set("time", str(round(sum(float(case.get("time", "0")) for case in suite.iter("testcase")), 3)))


def _suite(row: BatchResult) -> Element:
    """Return the suite of a job: a case for each stage and each item of its certificate, and one for the whole job.

    The time of the last one is what the stages leave, so that the times of a suite add up.
    """
    step, result = row.step, row.result
    suite = Element("testsuite", name=fit(row.name))
    properties = SubElement(suite, "properties")
    for name, value in (
        *(("course", step.course), ("track", step.track)),
        *([] if step.aircraft is None else [("aircraft", step.aircraft)]),
        *step.swept,
        *(("state", row.state), ("exit_code", str(result.code))),
        *([] if result.race_time is None else [("race_time_s", repr(result.race_time))]),
        *(("retried", reason) for reason in result.retries),
    ):
        SubElement(properties, "property", name=fit(name), value=fit(value))
    spent = 0.0
    for stage in row.stages():
        name, kind = stage["stage"], f"{row.name}.{stage['stage']}"
        case = _add_case(suite, kind, name, stage["wall_s"] or 0.0)
        spent += float(case.get("time", "0"))
        if stage["status"] not in (Status.CERTIFIED.value, Status.SOLVED.value, Status.GUESS.value):
            _add_trouble(case, "failure", stage["status"], stage["message"] or stage["status"])
        items: Sequence[Mapping[str, Any]] = stage["certificate"]["items"] if stage["certificate"] else ()  # Any: JSON
        for item in items:
            case = _add_case(suite, kind, f"{name}.{item['name']}", 0.0)
            if not item["holds"]:
                value = "not measured" if item["value"] is None else f"{item['value']:.6g}"
                limit = "none" if item["limit"] is None else f"{item['limit']:.6g}"
                where = f" at {item['where']}" if item["where"] else ""
                text = f"{item['name']} is {value}, its limit {limit} {item['unit']}{where}".rstrip()
                _add_trouble(case, "failure", item["name"], text)
    case = _add_case(suite, row.name, "run", max(0.0, result.wall - spent))
    if not row.certified:
        tag = "failure" if result.code in (ExitCode.INFEASIBLE, ExitCode.NOT_CERTIFIED) else "error"
        if result.code == ExitCode.INTERRUPTED and not result.wall:
            tag = "skipped"
        _add_trouble(case, tag, row.state, "\n".join([result.message or row.state, *map(str, result.findings)]))
    _set_totals(suite)
    return suite


def _add_case(suite: Element, kind: str, name: str, seconds: float) -> Element:
    return SubElement(suite, "testcase", classname=fit(kind), name=fit(name), time=str(round(seconds, 3)))


def _add_trouble(case: Element, tag: str, kind: str, text: str) -> None:
    SubElement(case, tag, message=fit(text.partition("\n")[0]), type=fit(kind)).text = fit(text)


def fit(text: str) -> str:
    """Return a text that XML can hold; a character that it cannot hold is written as `\\x00`."""
    return _UNFIT.sub(lambda match: f"\\x{ord(match[0]):02x}", text).replace("\r", "\\x0d")


def annotations(rows: Sequence[BatchResult], findings: Sequence[Finding]) -> Iterator[str]:
    """Yield commands of a workflow, one per line: an error for every finding and every job that is not certified."""
    errors = dict.fromkeys(findings)
    for row in rows:
        if row.result.findings:
            errors.update(dict.fromkeys(row.result.findings))
        elif not row.certified:
            errors[Finding(row.step.track, 0, 0, f"{row.name}: {row.state}", row.message)] = None
    for error in islice(errors, ANNOTATIONS_MAX):
        file = "" if error.file.startswith("--") else error.file
        places = {"file": file, "line": error.line, "col": error.column, "title": error.key or "airrace"}
        properties = ",".join(f"{name}={_escape(str(value), ':,')}" for name, value in places.items() if value)
        yield f"::error {properties}::{_escape(error.message)}"
    if len(errors) > ANNOTATIONS_MAX:
        yield f"::warning title=airrace::and {len(errors) - ANNOTATIONS_MAX} more errors"


def _escape(text: str, also: str = "") -> str:
    for character in "%\r\n" + also:
        text = text.replace(character, f"%{ord(character):02X}")
    return text


def append_summary(text: str) -> None:
    """Append Markdown to the summary of the step of GitHub Actions, if there is one.

    Raises:
        StorageError: the system refused.
    """
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    if not path:
        return
    try:
        with Path(path).open("a", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
    except OSError as error:
        raise StorageError(f"cannot write to the step summary {path}: {error.strerror}") from error
