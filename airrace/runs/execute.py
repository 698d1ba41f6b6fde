"""The execution of a plan: stage by stage, each stored as soon as it is finished, under the lock of the run's file."""

import contextlib
import logging
import os
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from airrace.errors import OutOfTime, UsageError
from airrace.files.checkpoint import ReserveAttempt, write_checkpoint
from airrace.files.inputs.rules import ReserveEntry
from airrace.flights.results.comparison import Comparison
from airrace.procedure import procedure
from airrace.procedure.result import Progress, StageResult, Status
from airrace.procedure.schedule import checks_mesh
from airrace.runs.command_result import CommandResult, ExitCode
from airrace.runs.execution_plan import Changes, ExecutionPlan, plan_changed_run
from airrace.runs.json_objects import comparison_object, reserve_object, run_object
from airrace.runs.output import ensure_free
from airrace.runs.reserve_attempts import ATTEMPTS_MAX
from airrace.runs.run_state import RunState, stages_object
from airrace.runs.verdict import is_certified, one_mesh_note, verdict
from airrace.runtime import interrupts

if TYPE_CHECKING:
    from airrace.runs.reserve_search import ReserveCase

logger = logging.getLogger(__name__)

PATIENCE = 0.1
"""The time for which a lock is tried, s: its holder may just be removing it."""


@contextmanager
def run_lock(path: Path | None) -> Generator[None, None, None]:
    """Hold the lock of a run's file while it is solved.

    It lies beside the file, for that is replaced after every stage. The system releases it when this process ends in
    any way; where the folder takes no files, or knows no locks, there is nothing to hold.

    Args:
        path: the checkpoint; None for a run that is held in memory alone.

    Raises:
        UsageError: another process holds it.
    """
    target = None if path is None else Path(os.path.realpath(path))
    if target is None or not target.parent.is_dir():
        yield
        return
    with file_lock(target.with_name(f".{target.name[:200]}.lock")) as refused:
        if refused:
            raise UsageError(f"{path} is being written by another process; wait for it, or name another file")
        yield


@contextmanager
def file_lock(lock: Path) -> Generator[bool, None, None]:
    """Hold a lock that is a file of its own, and tell whether it is refused since another process holds it.

    Where its folder takes no files, or has no locks, it counts as free.
    """
    from filelock import FileLock, Timeout  # which not every command loads

    own = FileLock(lock)
    refused = False
    try:
        own.acquire(timeout=PATIENCE, poll_interval=PATIENCE / 4)
    except Timeout:
        refused = True
    except (OSError, NotImplementedError):
        pass
    try:
        yield refused
    finally:
        if own.is_locked:
            with contextlib.suppress(OSError):  # Windows removes it when it is released
                lock.unlink()
            own.release()


def ensure_time(timeout: float | None) -> None:
    """Refuse a wall time (s; None for no limit) that leaves nothing.

    Raises:
        UsageError: it is not positive, or no number.
    """
    if timeout is not None and not timeout > 0.0:
        raise UsageError(f"a run needs some time: --timeout {timeout:g} leaves none")


def ensure_executable(plan: ExecutionPlan, *, timeout: float | None = None) -> None:
    """Refuse what `execute` would refuse before anything is computed.

    Raises:
        UsageError: `timeout` is not positive, or another process solves the run.
        StorageError: its file cannot be written.
    """
    ensure_time(timeout)
    with run_lock(plan.run.path):
        if plan.run.path is not None:
            ensure_free(plan.run.path, force=True)


def execute(
    plan: ExecutionPlan, *, threads: int, timeout: float | None = None, progress: Progress
) -> Iterator[RunState]:
    """Fly the stages that are not reused; yield the run after each, see `Execution.steps`."""
    return Execution(plan).steps(threads=threads, timeout=timeout, progress=progress)


class Execution:
    """A plan, and how far it is carried out, also where an error ends it.

    Attributes:
        plan: what is to be computed.
        run: the run by now.
        reserve: the flight with the margins that it was asked to keep; None before that, or without.
    """

    def __init__(self, plan: ExecutionPlan) -> None:
        self.plan = plan
        self.run = plan.run
        self.reserve: ReserveCase | None = None
        self._finished = {result.stage: result for result in plan.reused}
        self._started = time.perf_counter()

    @property
    def results(self) -> tuple[StageResult, ...]:
        """The finished stages, those that are reused among them, in the order in which they were finished."""
        return tuple(self._finished.values())

    @property
    def wall(self) -> float:
        """The time since this was begun, s."""
        return time.perf_counter() - self._started

    @property
    def comparison(self) -> Comparison | None:
        """The flight beside that of the run that it was started from; None where there is none, or none in common."""
        return replace(self.plan, run=self.run).compare(self.results)

    def steps(self, *, threads: int, timeout: float | None = None, progress: Progress) -> Iterator[RunState]:
        """Fly the stages that are not reused; yield the run after each, written to its file if it has one.

        The file is written before anything is computed, too: whatever ends the run, it can be resumed. The last step is
        the flight with the margins of a reserve, where one is asked for.

        Args:
            threads: threads that evaluate derivatives.
            timeout: the longest wall time, s; None for none.
            progress: who watches.

        Raises:
            OutOfTime: `timeout` is over.
            UsageError: it is not positive, or another process solves the run.
        """
        ensure_time(timeout)
        start_time = time.monotonic()
        with run_lock(self.plan.run.path):
            for run, result in _execute_locked(self.plan, threads=threads, timeout=timeout, progress=progress):
                self.run, self._finished[result.stage] = run, result
                yield run
            if self.plan.reserve is not None and self.run.certified:
                left = None if timeout is None else max(timeout - (time.monotonic() - start_time), 1e-3)
                self._keep_reserve(threads=threads, timeout=left, progress=progress)
                self._finished = {result.stage: result for result in self.run.results}
                yield self.run

    def _keep_reserve(self, *, threads: int, timeout: float | None, progress: Progress) -> None:
        """Fly the run again with the margins of its reserve; store that in its file, and before it every attempt."""
        from airrace.runs.reserve_search import fly_reserve  # which takes what flies in closed loop

        until = None if timeout is None else time.monotonic() + timeout

        def fly_again(before: RunState, values: Sequence[str]) -> RunState:
            left = None if until is None else until - time.monotonic()
            if left is not None and left <= 0.0:
                raise OutOfTime("the time was over before the reserve was found")
            plan = plan_changed_run(before, Changes(overrides=values))
            *_, (last, _) = _execute_locked(plan, threads=threads, timeout=left, progress=progress)
            return last

        def keep(attempt: ReserveAttempt, flight: RunState | None) -> None:
            self.run = self.run.with_attempt(attempt, flight)
            _store(self.run)

        def show(text: str, done: int, total: int) -> None:
            if until is not None and time.monotonic() > until:
                raise OutOfTime("the time was over before the reserve was found")
            progress.activity(text, done, total)

        run, tell = self.run, progress.remark
        assert run.inputs.reserve is not None
        case = fly_reserve(run, run.inputs.reserve, fly_again, threads=threads, keep=keep, tell=tell, show=show)
        self.run = replace(case.run, path=run.path)
        _store(self.run)
        self.reserve = replace(case, run=self.run)


def _execute_locked(
    plan: ExecutionPlan, *, threads: int, timeout: float | None = None, progress: Progress
) -> Iterator[tuple[RunState, StageResult]]:
    """Yield the run after each stage, with that stage's result."""
    run, start = plan.run, plan.start
    reused_stages = {result.stage for result in plan.reused}
    _store(run)
    before = run
    for result in procedure.optimize(
        run.inputs.race,
        run.inputs.settings,
        until=plan.until,
        threads=threads,
        finished=plan.reused,
        start=() if start is None else start.results,
        start_name="" if start is None else start.label,
        timeout=timeout,
        progress=progress,
    ):
        run = run.with_mesh_check(result) if result.stage in reused_stages else run.with_stage(result)
        _store(run, before)
        before = run
        progress.stage_finished(result)  # now, and not before it is stored: what is announced is never lost
        yield run, result


def execute_for_command(
    command_result: CommandResult, plan: ExecutionPlan, *, threads: int, progress: Progress
) -> Execution:
    """Fly the stages that are not reused, and fill in the result's object, exit code and sentence; return what is done.

    Args:
        command_result: what the command has to say.
        plan: what is to be computed.
        threads: threads that evaluate derivatives.
        progress: who watches.
    """
    execution = Execution(plan)
    try:
        for _ in execution.steps(threads=threads, progress=progress):
            pass
    except BaseException as error:
        record_end(command_result, execution, error)
    else:
        summarise(command_result, execution)
    return execution


def record_end(
    command_result: CommandResult, execution: Execution, error: BaseException, timeout: float | None = None
) -> None:
    """Fill in the result with what is finished when an error ends an execution.

    The end of the time (`timeout`, s) and an interrupt are results, with a sentence on how to go on; any other error is
    raised again. That what is finished cannot be told hides no error.

    Raises:
        BaseException: the error.
    """
    stopped = isinstance(error, OutOfTime) or interrupts.caused(error)
    if isinstance(error, OutOfTime):
        command_result.fail(ExitCode.TIMEOUT, f"stopped after {timeout:g} s (--timeout); {_next_step(execution)}")
    elif stopped:
        interrupts.acknowledge()
        command_result.fail(ExitCode.INTERRUPTED, f"interrupted; {_next_step(execution)}")
    try:
        summarise(command_result, execution, stopped=stopped)
    except Exception:
        if stopped:
            raise
        logger.debug("what is finished cannot be told", exc_info=True)
    if not stopped:
        raise error


def summarise(command_result: CommandResult, execution: Execution, *, stopped: bool = False) -> None:
    """Fill in the object, and fail the result unless the last stage is certified and all optima before it hold.

    Of a run that was stopped the last stage need not be certified.
    """
    plan, run, results, reserve = execution.plan, execution.run, execution.results, execution.reserve
    command_result.fields.update(run_object(plan.run.name, results, execution.wall, certified=is_certified(results)))
    code, sentence = verdict(results, stopped=stopped)
    if code is not ExitCode.DONE:
        command_result.fail(code, sentence)
    command_result.fields["stages"] = stages_object(run, results)
    for result in results:
        if result.status is Status.SOLVED and checks_mesh(plan.run.inputs.settings, result.stage, plan.until):
            command_result.fail(ExitCode.NOT_CERTIFIED, f"{result.stage.value}: {one_mesh_note(result)}")
    if plan.start is not None:
        comparison = execution.comparison
        command_result.fields["compared"] = (
            None if comparison is None else comparison_object(comparison.reference, [comparison])
        )
    if reserve is not None:
        command_result.fields["reserve"] = reserve.as_object()
    elif run.results and run.inputs.reserve is not None and run.inputs.reserve.found is None:
        command_result.fields["reserve"] = reserve_object(run.stages[-1].stamp.reserve)
    message = unreached(run.inputs.reserve)
    if message:
        command_result.fail(ExitCode.NOT_CERTIFIED, message if reserve is None else reserve.message)


def unreached(reserve: ReserveEntry | None) -> str:
    """Return a sentence where a flight keeps less of a reserve than was asked for; else an empty text."""
    if reserve is None or reserve.found is None or reserve.found.reached:
        return ""
    outcome = reserve.found
    most = f"the most is {outcome.measured:.3f} (from {outcome.lower:.3f})"
    return f"a reserve of {reserve.probability:g} was not reached: {most}"


def _store(run: RunState, before: RunState | None = None) -> None:
    """Write a run to its file, if it has one, which holds the run `before`."""
    if run.path is not None:
        write_checkpoint(run.path, run.checkpoint, None if before is None else before.checkpoint)


def _next_step(execution: Execution) -> str:
    """Return how a run that was ended before its end is continued, and what of it is finished, as a clause."""
    plan, results = execution.plan, execution.results
    if plan.start is not None and not results:  # resuming would begin from the course alone
        return f"no stage is finished; start from {plan.start.label} again with --force"
    finished_text = ", ".join(result.stage.value for result in results) or "none"
    if plan.reserve is not None:
        finished_text += f"; reserve: {len(execution.run.attempts)} of {ATTEMPTS_MAX} attempts"
    return f"go on with `airrace resume {plan.run.path}` (finished: {finished_text})"
