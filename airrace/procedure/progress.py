"""The progress of a run, which the procedure reports to a `Progress`; the default one is silent."""

from abc import ABC, abstractmethod

from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.records import record


@record
class Iteration:
    """A solver's iteration: its number, the objective (s) and the largest scaled infeasibility."""

    number: int
    objective: float
    infeasibility: float


class Progress(ABC):
    """The callbacks of a run, called one at a time, though not always from the same thread.

    The procedure tells of all but the end of a stage: whoever stores the result reports it, once it is stored.
    """

    @abstractmethod
    def stage_started(self, stage: Stage) -> None: ...

    @abstractmethod
    def activity(self, text: str, done: int, total: int) -> None:
        """Receive what is being done within the stage.

        An example is `("phase 3 of 16: start -> g1", 2, 16)`; `total` is 0 if it is unknown.
        """

    @abstractmethod
    def iteration(self, iteration: Iteration) -> None: ...

    @abstractmethod
    def stage_finished(self, result: StageResult) -> None: ...


class Silent(Progress):
    """A progress that shows nothing."""

    def stage_started(self, stage: Stage) -> None: ...

    def activity(self, text: str, done: int, total: int) -> None: ...

    def iteration(self, iteration: Iteration) -> None: ...

    def stage_finished(self, result: StageResult) -> None: ...
