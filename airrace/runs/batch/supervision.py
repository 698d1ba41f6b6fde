"""Supervision of a batch: it hands out jobs, takes in how they end, tries again and keeps records."""

import contextlib
import queue
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from airrace.errors import ClusterError, Finding, StorageError
from airrace.runs.batch.jobs import Job
from airrace.runs.batch.planning import BatchPlan, JobResult, PlannedJob, result_of
from airrace.runs.batch.record import FileMark, JobRecord, checkpoint_path, record_path, write_record
from airrace.runs.command_result import ExitCode

if TYPE_CHECKING:
    from airrace.runs.batch import BatchOptions

POLL = 0.1
"""The time between two looks whether a job has ended or has to, s."""
THREADS_MAX = 10_000
"""The largest number of jobs at a time, each of which a thread waits for."""


@dataclass(frozen=True)
class AttemptResult:
    """The end of one attempt at a job.

    Attributes:
        code: the exit code that `airrace optimize` would have ended with.
        message: what went wrong, one sentence; empty if nothing did.
        wall: the wall time of the attempt, s.
        findings: what is wrong with its input files.
        run: the object that `airrace optimize --json` prints, with the stages that are finished; None where the job
            ended without an answer.
    """

    code: int
    message: str
    wall: float
    findings: tuple[Finding, ...] = ()
    run: Mapping[str, Any] | None = None  # Any: JSON


class JobPool(ABC):
    """Jobs under way, here or elsewhere, a thread for each. A context manager that leaves nothing running behind.

    Attributes:
        progress: the name of a job and what it reports, see `airrace.runs.batch.local`; besides `{"started": HOST}`.
        stop_asked: set when all jobs are to end soon.
        kill_asked: set when all jobs are to end at once.
    """

    def __init__(self) -> None:
        self.progress: queue.SimpleQueue[tuple[str, Mapping[str, Any]]] = queue.SimpleQueue()  # Any: JSON
        self.stop_asked = threading.Event()
        self.kill_asked = threading.Event()
        self._threads = ThreadPoolExecutor(THREADS_MAX, thread_name_prefix="job")

    @property
    @abstractmethod
    def slots(self) -> int:
        """The number of jobs that can be under way at a time; it may change, and be 0 for a while.

        Raises:
            ClusterError: no job can run any more.
        """

    @abstractmethod
    def run(self, job: Job, checkpoint: Path, timeout: float | None) -> AttemptResult:
        """Run a job to its end, whatever becomes of it.

        Finished stages in its checkpoint, which lies at the path here, are not repeated. By its end the checkpoint with
        all finished stages is there as a whole file.

        Args:
            job: its inputs.
            checkpoint: where its checkpoint belongs, on this computer.
            timeout: longest wall time, s; None for no limit. A job that takes longer ends with code 6.
        """

    def submit(self, job: Job, checkpoint: Path, timeout: float | None) -> "Future[AttemptResult]":
        """Begin with a job, and return at once."""
        return self._threads.submit(self.run, job, checkpoint, timeout)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.stop_asked.set()
        self.kill_asked.set()
        self._threads.shutdown()


@dataclass(frozen=True)
class StageFinished:
    """The end of a stage of a job; `race_time` (s) is None if it found no flight."""

    name: str
    stage: str
    status: str
    race_time: float | None
    certified: bool


class Watcher:
    """An observer of a batch, which sees nothing; all calls come from the thread that supervises."""

    def on_begin(self, plan: BatchPlan) -> None: ...

    def on_start(self, step: PlannedJob, attempt: int, where: str) -> None: ...

    def on_stage_start(self, step: PlannedJob, stage: str) -> None: ...

    def on_stage_end(self, step: PlannedJob, event: StageFinished) -> None: ...

    def on_retry(self, step: PlannedJob, reason: str) -> None: ...

    def on_end(self, step: PlannedJob, result: JobResult) -> None: ...


def supervise(
    plan: BatchPlan,
    pool: JobPool,
    options: "BatchOptions",
    watcher: Watcher,
    *,
    stop_asked: Callable[[], bool] = lambda: False,
) -> Sequence[JobResult]:
    """Run all jobs of a plan that are due.

    Args:
        options: whose `timeout`, `retries` and `force` are followed.
        stop_asked: whether to stop; asked a few times a second. Jobs under way are stopped and count as interrupted,
            those not begun as well.

    Returns:
        The result of every step, in the order of the plan.
    """
    batch = _Supervision(plan, pool, options, watcher)
    watcher.on_begin(plan)
    try:
        while (batch.waiting or batch.running) and not stop_asked():
            slots = pool.slots  # asked every time: a cluster notices by it what it has lost
            while batch.waiting and len(batch.running) < slots:
                batch.begin(batch.waiting.popleft())
            batch.collect()
        pool.stop_asked.set()
        while batch.running:
            batch.collect()
    except ClusterError as error:
        for pending in (*batch.running.values(), *batch.waiting):
            batch.end(pending, AttemptResult(ExitCode.SYSTEM, str(error), 0.0))
    never = JobResult(ExitCode.INTERRUPTED, "interrupted before it was begun")
    return [batch.results.get(step.name, never) for step in plan.steps]


@dataclass
class _PendingJob:
    """A job that has not ended, and why its attempts so far were not the last."""

    step: PlannedJob
    job: Job
    reasons: list[str] = field(default_factory=list[str])


class _Supervision:
    """The jobs of a batch: those that wait, those under way, and the results so far."""

    def __init__(self, plan: BatchPlan, pool: JobPool, options: "BatchOptions", watcher: Watcher) -> None:
        self._folder, self._pool, self._options, self._watcher = plan.folder, pool, options, watcher
        self.waiting = deque(_PendingJob(step, step.job) for step in plan.steps if step.result is None and step.job)
        self.running: dict[Future[AttemptResult], _PendingJob] = {}
        self.results = {step.name: step.result for step in plan.steps if step.result is not None}

    def begin(self, pending: _PendingJob) -> None:
        job, path = pending.job, checkpoint_path(self._folder, pending.job.name)
        try:
            if self._options.force and not pending.reasons:
                path.unlink(missing_ok=True)
            write_record(self._folder, job.name, JobRecord(job.fingerprint, ended=False))
        except (OSError, StorageError) as error:
            self.end(pending, AttemptResult(ExitCode.SYSTEM, str(error), 0.0))
            return
        self.running[self._pool.submit(job, path, self._options.timeout)] = pending

    def collect(self) -> None:
        """Wait a moment for jobs to end, and take in what those under way report."""
        if not self.running:
            time.sleep(POLL)
        done, _ = wait(self.running, timeout=POLL, return_when=FIRST_COMPLETED)
        self._report_progress()
        for future in done:
            pending, result = self.running.pop(future), future.result()
            # Who stops a batch may signal its jobs as well: they have not failed.
            if result.code == ExitCode.SYSTEM and self._pool.stop_asked.is_set():
                result = replace(result, code=ExitCode.INTERRUPTED, message="interrupted")
            # A crash, a lost worker or a lack of memory may well not occur the next time.
            if result.code == ExitCode.SYSTEM and len(pending.reasons) < self._options.retries:
                pending.reasons.append(result.message)
                self._watcher.on_retry(pending.step, result.message)
                self.waiting.appendleft(pending)
            else:
                self.end(pending, result)

    def _report_progress(self) -> None:
        running = {pending.job.name: pending for pending in self.running.values()}
        while not self._pool.progress.empty():
            name, report = self._pool.progress.get()
            pending = running.get(name)
            if pending is None:  # it ended before its last report came
                continue
            match report:
                case {"started": str(where)}:
                    self._watcher.on_start(pending.step, len(pending.reasons) + 1, where)
                case {"stage_started": str(stage)}:
                    self._watcher.on_stage_start(pending.step, stage)
                case {
                    "stage_finished": str(stage),
                    "status": str(status),
                    "race_time_s": race_time,
                    "certified": bool(certified),
                }:
                    event = StageFinished(name, stage, status, race_time, certified)
                    self._watcher.on_stage_end(pending.step, event)
                case _:
                    pass

    def end(self, pending: _PendingJob, result: AttemptResult) -> None:
        """Write the record of a job that has ended, and keep what it says."""
        job, code, message = pending.job, result.code, result.message
        mark = FileMark.of(checkpoint_path(self._folder, job.name))
        if code == ExitCode.DONE and mark is None:
            code, message = ExitCode.SYSTEM, "its checkpoint is missing"
        retries = tuple(pending.reasons)
        record = JobRecord(
            job.fingerprint, True, code, message, result.wall, retries, result.run, result.findings, mark
        )
        try:
            write_record(self._folder, job.name, record)
        except StorageError as error:
            # A record that says less than the truth makes the job run again; one that says more must not stay.
            with contextlib.suppress(OSError):
                record_path(self._folder, job.name).unlink(missing_ok=True)
            if code == ExitCode.DONE:
                code, message = ExitCode.SYSTEM, str(error)
        self.results[job.name] = replace(result_of(record), code=code, message=message)
        self._watcher.on_end(pending.step, self.results[job.name])
