"""The ranking of the jobs of a batch: who is first, and by how much."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from airrace.batch.plan import Plan, Result, Step
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


@dataclass(frozen=True)
class Row:
    """A job, and how far it is behind.

    Attributes:
        behind: the time behind the fastest certified job of the batch, s; None without a race time.
        behind_course: the time behind the fastest certified job of its own course, s; None without a race time.
    """

    step: Step
    result: Result
    behind: float | None
    behind_course: float | None

    @property
    def state(self) -> str:
        """The state of the job at its end, in a word or two."""
        return STATES.get(self.result.code, f"exit code {self.result.code}")


def ranked(plan: Plan, results: Sequence[Result]) -> list[Row]:
    """Return all jobs: certified ones by race time, then other flights by race time, then the rest as planned."""
    pairs = list(zip(plan.steps, results, strict=True))
    best = _best(results)
    courses: dict[str, list[Result]] = {}
    for step, result in pairs:
        courses.setdefault(step.track, []).append(result)
    bests = {track: _best(of_course) for track, of_course in courses.items()}
    rows = [Row(step, result, _behind(result, best), _behind(result, bests[step.track])) for step, result in pairs]
    return sorted(rows, key=lambda row: _rank(row.result))


def has_siblings(rows: Sequence[Row]) -> bool:
    """Return whether the jobs are of several courses, one of them flown several times.

    Then two differences tell more than one: to the best of all jobs and to the best of the same course.
    """
    tracks = [row.step.track for row in rows]
    return 1 < len(set(tracks)) < len(tracks)


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Return how many jobs ended in which state, the most frequent first."""
    found: dict[str, int] = {}
    for row in rows:
        found[row.state] = found.get(row.state, 0) + 1
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def _best(results: Sequence[Result]) -> float | None:
    """Return the race time (s) of the fastest certified flight; where none is certified, of the fastest flight."""
    certified = [one.race_time for one in results if one.code == ExitCode.DONE and one.race_time is not None]
    flown = [one.race_time for one in results if one.race_time is not None]
    return min(certified or flown, default=None)


def _behind(result: Result, best: float | None) -> float | None:
    return None if result.race_time is None or best is None else result.race_time - best


def _rank(result: Result) -> tuple[int, float]:
    if result.race_time is None:
        return 2, 0.0
    return (0 if result.code == ExitCode.DONE else 1), result.race_time
