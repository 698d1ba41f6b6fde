"""Supervision of a batch: it hands out jobs, hears how they end, tries again and keeps records."""

import contextlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self

from airrace.batch.jobs import Job
from airrace.batch.planning import BatchPlan, JobResult, PlannedJob, result_of
from airrace.batch.record import FileMark, JobRecord, checkpoint_path, record_path, write_record
from airrace.errors import Finding, StorageError
from airrace.runs.command_result import ExitCode

if TYPE_CHECKING:
    from airrace.batch import BatchOptions


@dataclass(frozen=True)
class JobAttempt:
    """A job to run.

    Attributes:
        job: its inputs.
        attempt: 1 for the first; only one attempt of a job is ever under way.
        checkpoint: where its checkpoint belongs, on the computer of the supervision. If there is one already, it is the
            job's own, and finished stages in it that still stand are not repeated.
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


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Started:
    """An event: an attempt is under way; `where` names the host, empty for this one."""

    name: str
    where: str = ""


@dataclass(frozen=True)
class StageStarted:
    """An event: a stage of a job is under way."""

    name: str
    stage: str


@dataclass(frozen=True)
class StageFinished:
    """An event: a stage of a job is finished and in its checkpoint; `race_time` (s) is None if it found no flight."""

    name: str
    stage: str
    status: str
    race_time: float | None
    certified: bool


@dataclass(frozen=True)
class Ended:
    """An event: an attempt is over. It comes exactly once for every order, as the last event of it."""

    name: str
    ending: AttemptResult


Event = Started | StageStarted | StageFinished | Ended


class Executor(Protocol):
    """An object that flies jobs, here or elsewhere: a context manager that leaves nothing running behind.

    What it may rely on: all calls come from one thread; `submit` is called for at most `slots` jobs at a time, and
    never for a job that has not ended yet. What it owes:

    - Whatever becomes of a job (it crashes, hangs, its host goes away), an `Ended` follows. Nothing of that raises.
    - Before it tells `StageFinished` or `Ended` of a job, the checkpoint with the stages finished by then lies at
      `order.checkpoint` as a whole file (`checkpoint.atomic.replace_file`), verified if it came from elsewhere. Stages
      may come back one by one or all at the end; the former costs less when a host is lost.
    - An attempt that takes longer than `order.timeout` is stopped and ends with `FailureKind.TIMED_OUT` and code 6.
    - Every process it starts has one solver thread, and none outlives its job or this process.

    An executor that cannot work at all (an unreachable scheduler) raises an `AirraceError` when it is entered.
    """

    @property
    def slots(self) -> int:
        """The number of jobs that can be under way at a time; it may change from call to call, and be 0 for a while."""
        ...

    def submit(self, order: JobAttempt) -> None:
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

    def __exit__(self, *raised: object) -> None: ...


PATIENCE = 0.25
"""The time between two looks whether to stop, s."""
ACCIDENTS = (FailureKind.CRASHED, FailureKind.KILLED, FailureKind.LOST)
"""The faults that may well not occur the next time."""


class Watcher:
    """An observer of a batch, which sees nothing; all calls come from the thread that supervises."""

    def on_begin(self, plan: BatchPlan) -> None: ...

    def on_start(self, step: PlannedJob, attempt: int, where: str) -> None: ...

    def on_stage_start(self, step: PlannedJob, stage: str) -> None: ...

    def on_stage_end(self, step: PlannedJob, event: StageFinished) -> None: ...

    def on_retry(self, step: PlannedJob, reason: str) -> None: ...

    def on_end(self, step: PlannedJob, result: JobResult) -> None: ...


@dataclass
class _Attempts:
    """The attempts at a job so far in this call."""

    step: PlannedJob
    job: Job
    number: int = 0
    reasons: tuple[str, ...] = ()


def supervise(
    plan: BatchPlan,
    executor: Executor,
    options: "BatchOptions",
    watcher: Watcher,
    *,
    stop_asked: Callable[[], bool],
) -> Sequence[JobResult]:
    """Run all jobs of a plan that are due.

    Args:
        options: whose `timeout`, `retries` and `force` are followed.
        stop_asked: whether to stop; asked a few times a second. Jobs under way are stopped and count as interrupted,
            those not begun as well.

    Returns:
        The result of every step, in the order of the plan.
    """
    waiting = deque(_Attempts(step, step.job) for step in plan.steps if step.known is None and step.job)
    running: dict[str, _Attempts] = {}
    results = {step.name: step.known for step in plan.steps if step.known is not None}

    def end(attempts: _Attempts, ending: AttemptResult) -> None:
        results[attempts.job.name] = _store(plan.folder, attempts, ending)
        watcher.on_end(attempts.step, results[attempts.job.name])

    def begin(attempts: _Attempts) -> None:
        job, path = attempts.job, checkpoint_path(plan.folder, attempts.job.name)
        try:
            if attempts.number == 0 and options.force:
                path.unlink(missing_ok=True)
            write_record(plan.folder, job.name, JobRecord(job.fingerprint, ended=False))
        except (OSError, StorageError) as error:
            end(attempts, AttemptResult(ExitCode.SYSTEM, str(error), 0.0))
            return
        attempts.number += 1
        running[job.name] = attempts
        executor.submit(JobAttempt(job, attempts.number, path, options.timeout))

    def hear(patience: float, *, retries: int) -> None:
        for event in executor.events(patience):
            attempts = running.get(event.name)
            if attempts is None:  # no such job is under way
                continue
            match event:
                case Started(where=where):
                    watcher.on_start(attempts.step, attempts.number, where)
                case StageStarted(stage=stage):
                    watcher.on_stage_start(attempts.step, stage)
                case StageFinished():
                    watcher.on_stage_end(attempts.step, event)
                case Ended(ending=ending):
                    del running[event.name]
                    failed = ending.fault is FailureKind.NONE and ending.code == ExitCode.SYSTEM
                    if (failed or ending.fault in ACCIDENTS) and attempts.number <= retries:
                        attempts.reasons = (*attempts.reasons, ending.message)
                        watcher.on_retry(attempts.step, ending.message)
                        waiting.appendleft(attempts)
                    else:
                        end(attempts, ending)

    watcher.on_begin(plan)
    while (waiting or running) and not stop_asked():
        while waiting and len(running) < executor.slots:
            begin(waiting.popleft())
        hear(PATIENCE, retries=options.retries)
    if running:
        executor.stop()
        hear(0.0, retries=0)
    never = JobResult(ExitCode.INTERRUPTED, "interrupted before it was begun")
    return [results.get(step.name, never) for step in plan.steps]


def _store(folder: Path, attempts: _Attempts, ending: AttemptResult) -> JobResult:
    """Write the record of a job that has ended, and return what it says."""
    job, code, message = attempts.job, ending.code, ending.message
    mark = FileMark.of(checkpoint_path(folder, job.name))
    if code == ExitCode.DONE and mark is None:
        code, message = ExitCode.SYSTEM, "its checkpoint is missing"
    record = JobRecord(
        job.fingerprint, True, code, message, ending.wall, attempts.reasons, ending.run, ending.findings, mark
    )
    try:
        write_record(folder, job.name, record)
    except StorageError as error:
        # A record that says less than the truth makes the job run again; one that says more must not stay.
        with contextlib.suppress(OSError):
            record_path(folder, job.name).unlink(missing_ok=True)
        if code == ExitCode.DONE:
            code, message = ExitCode.SYSTEM, str(error)
    return replace(result_of(record), code=code, message=message)
