"""The ranking of the jobs of a batch: who is first, and by how much."""

from collections.abc import Mapping, Sequence

from airrace.batch.plan import Plan, Result, Step
from airrace.records import record
from airrace.results.comparison import TIE
from airrace.runs.exit_codes import ExitCode

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
class Row:
    """A job, and how far it is behind.

    Attributes:
        behind: s behind the fastest certified job of its own course; None without a race time. Jobs of different
            courses are never compared.
        best: whether it is that fastest one.
    """

    step: Step
    result: Result
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


def ranked(plan: Plan, results: Sequence[Result]) -> list[Row]:
    """Return all jobs, course by course as planned: certified ones by race time, then other flights by race time, then
    the rest as planned."""
    pairs = list(zip(plan.steps, results, strict=True))
    courses: dict[str, list[Result]] = {}
    for step, result in pairs:
        courses.setdefault(step.track, []).append(result)
    bests = {track: _best(of_course) for track, of_course in courses.items()}
    order = {track: number for number, track in enumerate(courses)}
    rows = [Row(step, one, _behind(one, bests[step.track]), one is bests[step.track]) for step, one in pairs]
    return sorted(rows, key=lambda row: (order[row.step.track], *_rank(row.result)))


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Return how many jobs ended in which state, the most frequent first."""
    found: dict[str, int] = {}
    for row in rows:
        found[row.state] = found.get(row.state, 0) + 1
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def _best(results: Sequence[Result]) -> Result | None:
    """Return the fastest certified flight; where none is certified the fastest there is."""
    flown = [one for one in results if one.race_time is not None]
    certified = [one for one in flown if one.code == ExitCode.DONE]
    return min(certified or flown, key=lambda one: one.race_time or 0.0, default=None)


def _behind(result: Result, best: Result | None) -> float | None:
    if result.race_time is None or best is None or best.race_time is None:
        return None
    return result.race_time - best.race_time


def _rank(result: Result) -> tuple[int, float]:
    if result.race_time is None:
        return 2, 0.0
    return (0 if result.code == ExitCode.DONE else 1), result.race_time
