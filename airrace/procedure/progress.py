"""Who watches a run. The procedure reports to a `Progress`; the default one is silent."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from airrace.procedure.result import Stage, StageResult


@dataclass(frozen=True)
class Iteration:
    """One iteration of a solver: its number, the objective (s) and the largest scaled infeasibility."""

    number: int
    objective: float
    infeasibility: float


class Progress(ABC):
    """Callbacks of a run, called from the thread that runs the procedure.

    The procedure tells of all but the end of a stage: that is told by who keeps the result, once it is kept.
    """

    @abstractmethod
    def stage_started(self, stage: Stage) -> None: ...

    @abstractmethod
    def activity(self, text: str, done: int, total: int) -> None:
        """What is being done within the stage, e.g. `("phase 3 of 16: start -> g1", 2, 16)`; total 0 if unknown."""

    @abstractmethod
    def iteration(self, iteration: Iteration) -> None: ...

    @abstractmethod
    def stage_finished(self, result: StageResult) -> None: ...


class Silent(Progress):
    """Watches nothing."""

    def stage_started(self, stage: Stage) -> None: ...

    def activity(self, text: str, done: int, total: int) -> None: ...

    def iteration(self, iteration: Iteration) -> None: ...

    def stage_finished(self, result: StageResult) -> None: ...
