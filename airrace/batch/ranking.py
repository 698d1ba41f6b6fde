"""The ranking of a batch's results, and what they say about the wind.

Per course, aircraft and values of all other sweeps; only certified flights count. The sensitivity is the slope of the
straight line that fits race time against wind speed best.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from airrace.batch.plan import BatchPlan, JobResult, PlannedJob
from airrace.quantities import KNOT
from airrace.records import record
from airrace.results.comparison import TIE
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


@record
class RankingRow:
    """A job, and how far it is behind.

    Attributes:
        behind: s behind the fastest certified job of its own course; None without a race time. Jobs of different
            courses are never compared.
        best: whether it is that fastest one.
    """

    step: PlannedJob
    result: JobResult
    behind: float | None
    best: bool

    @property
    def state(self) -> str:
        """The state of the job at its end, in a word or two."""
        return STATES.get(self.result.code, f"exit code {self.result.code}")

    @property
    def behind_words(self) -> str:
        """The time that the job is behind, s, as a text: a difference, `best`, `tie` where it is not more than `TIE`,
        or `-` without a race time."""
        if self.behind is None:
            return "-"
        if self.best:
            return "best"
        return "tie" if abs(self.behind) <= TIE else f"{self.behind:+.3f}"


def ranking_of(plan: BatchPlan, results: Sequence[JobResult]) -> list[RankingRow]:
    """Return all jobs, course by course as planned: certified ones by race time, then other flights by race time, then
    the rest as planned."""
    pairs = list(zip(plan.steps, results, strict=True))
    courses: dict[str, list[JobResult]] = {}
    for step, result in pairs:
        courses.setdefault(step.track, []).append(result)
    bests = {track: _best(of_course) for track, of_course in courses.items()}
    order = {track: number for number, track in enumerate(courses)}
    rows = [RankingRow(step, one, _behind(one, bests[step.track]), one is bests[step.track]) for step, one in pairs]
    return sorted(rows, key=lambda row: (order[row.step.track], *_rank(row.result)))


def counts(rows: Sequence[RankingRow]) -> dict[str, int]:
    """Return how many jobs ended in which state, the most frequent first."""
    found: dict[str, int] = {}
    for row in rows:
        found[row.state] = found.get(row.state, 0) + 1
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def _best(results: Sequence[JobResult]) -> JobResult | None:
    """Return the fastest certified flight; where none is certified the fastest there is."""
    flown = [one for one in results if one.race_time is not None]
    certified = [one for one in flown if one.code == ExitCode.DONE]
    return min(certified or flown, key=lambda one: one.race_time or 0.0, default=None)


def _behind(result: JobResult, best: JobResult | None) -> float | None:
    if result.race_time is None or best is None or best.race_time is None:
        return None
    return result.race_time - best.race_time


def _rank(result: JobResult) -> tuple[int, float]:
    if result.race_time is None:
        return 2, 0.0
    return (0 if result.code == ExitCode.DONE else 1), result.race_time


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
    best: RankingRow
    worst: RankingRow
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


def wind_summaries(rows: Sequence[RankingRow]) -> list[WindSummary]:
    """Return a summary of every course that was flown in several winds; none if the wind was not swept."""
    groups: dict[tuple[str, ...], list[RankingRow]] = {}
    for row in rows:
        if row.result.code == ExitCode.DONE and row.result.race_time is not None and _is_wind_swept(row):
            others = [f"{key}={value}" for key, value in row.step.swept if key != DIRECTION and key not in SPEEDS]
            key = (row.step.track, row.step.aircraft or "", row.step.course, *others)
            groups.setdefault(key, []).append(row)
    return [_summary(key, group) for key, group in groups.items() if len(group) > 1]


def wind_words(row: RankingRow) -> str:
    """Return the swept part of a job's wind in words, e.g. `10 kt from 45`."""
    swept = dict(row.step.swept)
    speeds = [f"{swept[key]} {'kt' if key.endswith('kt') else 'm/s'}" for key in SPEEDS if key in swept]
    return " ".join([*speeds, *([f"from {swept[DIRECTION]}"] if DIRECTION in swept else [])])


def _is_wind_swept(row: RankingRow) -> bool:
    return any(key == DIRECTION or key in SPEEDS for key, _ in row.step.swept)


def _summary(key: tuple[str, ...], group: Sequence[RankingRow]) -> WindSummary:
    _, aircraft, course, *others = key
    inorder = sorted(group, key=_time)
    directions = sorted({dict(row.step.swept).get(DIRECTION, "") for row in group} - {""}, key=_number)
    bearings = [
        _bearing(one, [row for row in group if dict(row.step.swept).get(DIRECTION) == one]) for one in directions
    ]
    title = ", ".join([course, *([Path(aircraft).stem] if aircraft else []), *others])
    return WindSummary(title, len(group), inorder[0], inorder[-1], _slope(group), tuple(bearings))


def _bearing(direction: str, rows: Sequence[RankingRow]) -> Bearing:
    return Bearing(direction, sum(map(_time, rows)) / len(rows), _slope(rows))


def _slope(rows: Sequence[RankingRow]) -> float | None:
    """Return the slope of race time over wind speed, s/kt, by least squares; None where the speed does not vary."""
    points = [(speed, _time(row)) for row in rows if (speed := _knots(row)) is not None]
    if len({speed for speed, _ in points}) < 2:
        return None
    middle = sum(speed for speed, _ in points) / len(points)
    spread = sum((speed - middle) ** 2 for speed, _ in points)
    return sum((speed - middle) * time for speed, time in points) / spread


def _knots(row: RankingRow) -> float | None:
    for key, value in row.step.swept:
        if key in SPEEDS and math.isfinite(number := _number(value)):
            return number * SPEEDS[key]
    return None


def _time(row: RankingRow) -> float:
    assert row.result.race_time is not None  # only flights are summarised
    return row.result.race_time


def _number(text: str) -> float:
    """Return the number that a text stands for; infinity if it is none, such as the `null` that takes a key out."""
    try:
        return float(text)
    except ValueError:
        return math.inf


def _flight(row: RankingRow) -> dict[str, object]:
    return {"name": row.step.name, "wind": wind_words(row), "race_time_s": row.result.race_time}
