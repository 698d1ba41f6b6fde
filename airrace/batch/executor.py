"""The interface between supervision and those who fly the jobs: orders one way, events the other."""

from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

from airrace.batch.job import Job
from airrace.errors import Finding
from airrace.records import record


@record
class Attempt:
    """A job to be flown.

    Attributes:
        job: what is to be flown.
        attempt: 1 for the first; only one attempt of a job is ever under way.
        checkpoint: where its checkpoint belongs, on the machine of the supervision. If there is one already, it is the
            job's own, and finished stages in it that still stand are not flown again.
        timeout: longest wall time of this attempt, s; None for no limit.
    """

    job: Job
    attempt: int
    checkpoint: Path
    timeout: float | None


class FailureKind(Enum):
    """A reason for which a job ended without an answer of its own."""

    NONE = "none"
    CRASHED = "crashed"
    KILLED = "killed"
    LOST = "lost"
    TIMED_OUT = "timed out"
    STOPPED = "stopped"


@record
class AttemptResult:
    """The end of one attempt at a job.

    Attributes:
        code: the exit code that `airrace optimize` would have ended with.
        message: what went wrong, one sentence; empty if nothing did.
        findings: what is wrong with its input files.
        run: the object that `airrace optimize --json` prints, with the stages that are finished; None where the job
            ended without an answer.
        fault: why there is no answer; `FailureKind.NONE` where there is one.
        wall: the wall time of the attempt, s.
    """

    code: int
    message: str
    wall: float
    findings: tuple[Finding, ...] = ()
    run: Mapping[str, Any] | None = None  # Any: JSON
    fault: FailureKind = FailureKind.NONE


@record
class Started:
    """An event: an attempt is under way; `where` names the machine, empty for this one."""

    name: str
    where: str = ""


@record
class StageStarted:
    """An event: a stage of a job is under way."""

    name: str
    stage: str


@record
class StageFinished:
    """An event: a stage of a job is finished and in its checkpoint; `race_time` (s) is None if it found no flight."""

    name: str
    stage: str
    status: str
    race_time: float | None
    certified: bool


@record
class Ended:
    """An event: an attempt is over. It comes exactly once for every order, as the last event of it."""

    name: str
    ending: AttemptResult


Event = Started | StageStarted | StageFinished | Ended


class Executor(Protocol):
    """An object that flies jobs, here or elsewhere: a context manager that leaves nothing running behind.

    What it may rely on: all calls come from one thread; `submit` is called for at most `slots` jobs at a time, and
    never for a job that has not ended yet. What it owes:

    - Whatever becomes of a job (it crashes, hangs, its machine goes away), an `Ended` follows. Nothing of that raises.
    - Before it tells `StageFinished` or `Ended` of a job, the checkpoint with the stages finished by then lies at
      `order.checkpoint` as a whole file (`checkpoint.atomic.replace_file`), verified if it came from elsewhere. Stages
      may come back one by one or all at the end; the former costs less when a machine is lost.
    - An attempt that takes longer than `order.timeout` is stopped and ends with `FailureKind.TIMED_OUT` and code 6.
    - Every process it starts has one solver thread, and none outlives its job or this process.

    An executor that cannot work at all (an unreachable scheduler) raises an `AirraceError` when it is entered.
    """

    @property
    def slots(self) -> int:
        """The number of jobs that can be under way at a time; it may change from call to call, and be 0 for a while."""
        ...

    def submit(self, order: Attempt) -> None:
        """Begin with a job, and return at once."""
        ...

    def events(self, patience: float) -> Sequence[Event]:
        """Return what has happened since the last call, in order.

        It waits for the first event, `patience` seconds at most.
        """
        ...

    def stop(self) -> None:
        """Stop all jobs under way, within seconds; the next `events` tells how they ended (`STOPPED`, 130)."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
