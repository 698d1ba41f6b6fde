"""Supervision of a batch: it hands out jobs, hears how they end, tries again and keeps records.

It never raises for what happens to a job, and keeps only a few numbers of a finished one: the rest is on the disk.
"""

import contextlib
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from airrace.batch.executor import (
    Attempt,
    AttemptResult,
    Ended,
    Executor,
    FailureKind,
    StageFinished,
    StageStarted,
    Started,
)
from airrace.batch.job import Job
from airrace.batch.plan import BatchPlan, JobResult, PlannedJob, result_of
from airrace.batch.record import Choice, FileMark, JobRecord, checkpoint_path, record_path, write_record
from airrace.errors import StorageError
from airrace.records import record
from airrace.runs.command_result import ExitCode

PATIENCE = 0.25
"""The time between two looks whether to stop, s."""
ACCIDENTS = (FailureKind.CRASHED, FailureKind.KILLED, FailureKind.LOST)
"""The faults that may well not occur the next time."""


@record
class Policy:
    """The patience of supervision: its time limit, its retries, and what it flies again.

    Attributes:
        timeout: longest wall time of an attempt, s; None for no limit.
        retries: how often a job is tried again after an accident.
        choice: which finished jobs are flown again; with `Choice.ALL` from their beginning.
    """

    timeout: float | None = None
    retries: int = 1
    choice: Choice = Choice.NONE


class Watcher(Protocol):
    """An observer of a batch; all calls come from the thread that supervises."""

    def begun(self, plan: BatchPlan) -> None: ...

    def started(self, step: PlannedJob, attempt: int, where: str) -> None: ...

    def stage_started(self, step: PlannedJob, stage: str) -> None: ...

    def stage_finished(self, step: PlannedJob, event: StageFinished) -> None: ...

    def retried(self, step: PlannedJob, reason: str) -> None: ...

    def ended(self, step: PlannedJob, result: JobResult) -> None: ...

    def idle(self) -> None:
        """Note that nothing happened for a moment."""
        ...


@dataclass
class _Attempts:
    """The attempts at a job so far in this call."""

    step: PlannedJob
    job: Job
    number: int = 0
    reasons: tuple[str, ...] = ()


def supervise(
    plan: BatchPlan, executor: Executor, policy: Policy, watcher: Watcher, *, stop_asked: Callable[[], bool]
) -> Sequence[JobResult]:
    """Fly all jobs of a plan that are to be flown.

    Args:
        stop_asked: whether to stop; asked a few times a second. Jobs under way are stopped and count as interrupted,
            those not begun as well.

    Returns:
        The result of every step, in the order of the plan.
    """
    return _Supervision(plan, executor, policy, watcher).run(stop_asked)


class _Supervision:
    def __init__(self, plan: BatchPlan, executor: Executor, policy: Policy, watcher: Watcher) -> None:
        self._plan = plan
        self._executor = executor
        self._policy = policy
        self._watcher = watcher
        self._results = {step.name: step.known for step in plan.steps if step.known is not None}
        self._waiting = deque(_Attempts(step, step.job) for step in plan.steps if step.known is None and step.job)
        self._running: dict[str, _Attempts] = {}

    def run(self, stop_asked: Callable[[], bool]) -> Sequence[JobResult]:
        self._watcher.begun(self._plan)
        while (self._waiting or self._running) and not stop_asked():
            while self._waiting and len(self._running) < self._executor.slots:
                self._begin(self._waiting.popleft())
            self._hear(PATIENCE)
        if self._running:
            self._executor.stop()
            self._hear(0.0, trying_again=False)
        never = JobResult(ExitCode.INTERRUPTED, "interrupted before it was begun")
        return [self._results.get(step.name, never) for step in self._plan.steps]

    def _begin(self, attempts: _Attempts) -> None:
        job, path = attempts.job, checkpoint_path(self._plan.folder, attempts.job.name)
        try:
            if attempts.number == 0 and self._policy.choice is Choice.ALL:
                path.unlink(missing_ok=True)
            write_record(self._plan.folder, job.name, JobRecord(job.fingerprint, ended=False))
        except (OSError, StorageError) as error:
            self._end(attempts, AttemptResult(ExitCode.SYSTEM, str(error), 0.0))
            return
        attempts.number += 1
        self._running[job.name] = attempts
        self._executor.submit(Attempt(job, attempts.number, path, self._policy.timeout))

    def _hear(self, patience: float, *, trying_again: bool = True) -> None:
        events = self._executor.events(patience)
        if not events:
            self._watcher.idle()
        for event in events:
            attempts = self._running.get(event.name)
            if attempts is None:  # no such job is under way
                continue
            match event:
                case Started(where=where):
                    self._watcher.started(attempts.step, attempts.number, where)
                case StageStarted(stage=stage):
                    self._watcher.stage_started(attempts.step, stage)
                case StageFinished():
                    self._watcher.stage_finished(attempts.step, event)
                case Ended(ending=ending):
                    del self._running[event.name]
                    if trying_again and self._is_accident(ending) and attempts.number <= self._policy.retries:
                        attempts.reasons = (*attempts.reasons, ending.message)
                        self._watcher.retried(attempts.step, ending.message)
                        self._waiting.appendleft(attempts)
                    else:
                        self._end(attempts, ending)

    def _is_accident(self, ending: AttemptResult) -> bool:
        return ending.fault in ACCIDENTS or (ending.fault is FailureKind.NONE and ending.code == ExitCode.SYSTEM)

    def _end(self, attempts: _Attempts, ending: AttemptResult) -> None:
        job, folder = attempts.job, self._plan.folder
        code, message = ending.code, ending.message
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
        result = replace(result_of(record), code=code, message=message)
        self._results[job.name] = result
        self._watcher.ended(attempts.step, result)
