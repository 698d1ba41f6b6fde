"""Tasks: what is to be flown of a run, decided before anything is computed."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Self

from airrace.checkpoint import Sign
from airrace.procedure import run as procedure
from airrace.procedure.restart import SourceRun
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.settings import GuessKind
from airrace.records import record
from airrace.runs.run import Run


@record
class Step:
    """A stage of a task.

    Attributes:
        stage: which one.
        reason: why it runs, a clause for the user; empty where it is kept.
        unproved: why it is kept but checked on a second mesh first, a clause; empty where it is not.
    """

    stage: Stage
    reason: str
    unproved: str = ""

    @property
    def action(self) -> str:
        """The word for what is done with the stage: `run`, `prove` or `keep`."""
        return "run" if self.reason else "prove" if self.unproved else "keep"

    def as_object(self) -> dict[str, object]:
        return {"stage": self.stage.value, "action": self.action, "reason": self.reason or self.unproved}


@record
class Task:
    """A run and what is to be flown of it.

    Attributes:
        run: the run as it stands.
        until: the last stage.
        kept: results that need not be computed again, though some may still have to be proved.
        steps: every stage up to the last, with the reason why it runs; empty for a run of which nothing exists.
        start: another run to start from; None to start from the course alone.
    """

    run: Run
    until: Stage
    kept: tuple[StageResult, ...] = ()
    steps: tuple[Step, ...] = ()
    start: SourceRun | None = None

    def signed(self, sign: Sign | None) -> Self:
        """Return this task with a way to sign the file of its run."""
        return replace(self, run=self.run.signing(sign))

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
        reason = step.reason or step.unproved
        yield f"{step.stage.value}: {step.action}{reason and f' ({reason})'}"
