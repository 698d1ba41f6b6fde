"""Tasks: what is to be flown of a run, decided before anything is computed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from airrace.procedure import run as procedure
from airrace.procedure.restart import Another
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.settings import GuessKind
from airrace.runs.run import Run


@dataclass(frozen=True)
class Step:
    """A stage of a task; `reason` is a clause for the user that says why it runs, empty if it is kept."""

    stage: Stage
    reason: str

    def as_object(self) -> dict[str, object]:
        return {"stage": self.stage.value, "action": "run" if self.reason else "keep", "reason": self.reason}


@dataclass(frozen=True)
class Task:
    """A run and what is to be flown of it.

    Attributes:
        run: the run as it stands.
        until: the last stage.
        kept: results that need not be computed again.
        steps: every stage up to the last, with the reason why it runs; empty for a run of which nothing exists.
        start: another run to start from; None to start from the course alone.
    """

    run: Run
    until: Stage
    kept: tuple[StageResult, ...] = ()
    steps: tuple[Step, ...] = ()
    start: Another | None = None

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages of the run up to the last, those that are kept as well."""
        if self.steps:
            return tuple(step.stage for step in self.steps)
        stages = tuple(procedure.STAGES)
        without_homotopy = self.run.inputs.settings.guess is GuessKind.PLAN
        return stages[1 if without_homotopy else 0 : stages.index(self.until) + 1]


def described(steps: Sequence[Step]) -> Iterator[str]:
    """Yield one line per stage that says whether it is run or kept."""
    for step in steps:
        yield f"{step.stage.value}: run ({step.reason})" if step.reason else f"{step.stage.value}: keep"
