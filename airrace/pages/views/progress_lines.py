"""The progress of a run as plain lines."""

import time
from collections.abc import Callable, Sequence
from typing import TextIO

from airrace.procedure.result import Iteration, Progress, StageResult, Status
from airrace.procedure.stage import Stage

LINE_INTERVAL = 2.0
"""The time between two plain lines about iterations, s: often enough to show progress, rare enough for a log."""

_VERDICTS = {
    Status.CERTIFIED: "certified",
    Status.SOLVED: "on one mesh",
    Status.GUESS: "a guess",
}


def outcome_line(result: StageResult) -> str:
    """Return a finished stage in one line."""
    seconds = f"{result.timings.wall:.1f} s"
    certified = _VERDICTS.get(result.status, "NOT certified")
    verdict = certified if result.outcome is Status.NOT_CERTIFIED else f"{result.outcome.value}, {certified}"
    race_time = f"race time {result.trajectory.race_time:.3f} s, " if result.has_race_time else ""
    goes_on = "; the search goes on by prices" if result.search.goes_on else ""
    return f"{result.stage.value}: {verdict}, {race_time}{result.iterations} iterations, {seconds}{goes_on}"


class PlainLines(Progress):
    """An observer that prints one line per event, without control codes; iterations are thinned out."""

    def __init__(
        self, stream: TextIO, stages: Sequence[Stage] = (), clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stream = stream
        self._stages = stages
        self._clock = clock
        self._started = clock()
        self._last_line = -LINE_INTERVAL

    def stage_started(self, stage: Stage) -> None:
        number = stage_number(stage, self._stages)
        self._line(f"{stage.value}: started{number and f' ({number})'}")

    def activity(self, text: str, done: int, total: int) -> None:
        self._line(f"  {text}")

    def iteration(self, iteration: Iteration) -> None:
        if self._clock() - self._last_line >= LINE_INTERVAL:
            self._line(
                f"  iteration {iteration.number}: objective {iteration.objective:.3f} s, "
                f"infeasibility {iteration.infeasibility:.1e}"
            )

    def stage_finished(self, result: StageResult) -> None:
        self._line(outcome_line(result))

    def remark(self, text: str) -> None:
        self._line(text)

    def _line(self, text: str) -> None:
        self._last_line = self._clock()
        print(f"[{self._last_line - self._started:7.1f} s] {text}", file=self._stream, flush=True)


def stage_number(stage: Stage, stages: Sequence[Stage]) -> str:
    """Return the number of a stage in a run as `stage 3 of 6`; empty if that is not known."""
    return f"stage {stages.index(stage) + 1} of {len(stages)}" if stage in stages else ""
