"""The execution of a plan: stage by stage, each stored as soon as it is finished, under the lock of the run's file."""

import contextlib
import os
import time
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from airrace import interrupts
from airrace.checkpoint import ReserveAttempt, write_checkpoint
from airrace.errors import OutOfTime, UsageError
from airrace.inputs.rules import ReserveEntry
from airrace.procedure import run as procedure
from airrace.procedure.fidelity_continuation import checks_mesh
from airrace.procedure.result import Progress, StageResult, Status
from airrace.procedure.stage import Stage
from airrace.runs.command_result import CommandResult, ExitCode
from airrace.runs.json_objects import comparison_object, reserve_object, run_object
from airrace.runs.output import ensure_free
from airrace.runs.plan import Changes, ExecutionPlan, plan_changed_run
from airrace.runs.reserve_attempts import ATTEMPTS_MAX
from airrace.runs.run import RunState, stages_object
from airrace.runs.verdict import is_certified, one_mesh_note, verdict

if TYPE_CHECKING:
    from airrace.runs.reserve import ReserveCase

PATIENCE = 0.1
"""The time for which a lock is tried, s: whoever holds it may just be removing it."""


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

    Where its folder takes no files, or knows no locks, nobody holds it.
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
    """Fly the stages that are not reused; yield the run after each, written to its file if it has one.

    The file is written before anything is computed, too: whatever ends the run, it can be resumed.

    Args:
        plan: what is to be computed.
        threads: threads that evaluate derivatives.
        timeout: the longest wall time of the stages, s; None for none.
        progress: who watches.
    """
    return (done.run for done in _execute(plan, threads=threads, timeout=timeout, progress=progress))


@dataclass(frozen=True)
class Executed:
    """A step of an execution: the run, the stage that was solved or checked last, and the reserve that it keeps.

    `reserve` is None unless this is the flight with margins that follows the optimum.
    """

    run: RunState
    result: StageResult
    reserve: "ReserveCase | None" = None


def _execute(
    plan: ExecutionPlan,
    *,
    threads: int,
    timeout: float | None = None,
    progress: Progress,
    attempted: Callable[[RunState], None] = lambda run: None,
) -> Iterator[Executed]:
    """Yield all steps, the last one that of a reserve where one is asked for.

    `attempted` receives the run with every attempt of that.
    """
    ensure_time(timeout)
    started = time.monotonic()
    with run_lock(plan.run.path):
        run = plan.run
        for done in _execute_locked(plan, threads=threads, timeout=timeout, progress=progress):
            run = done.run
            yield done
        if plan.reserve is not None and run.certified:
            left = None if timeout is None else max(timeout - (time.monotonic() - started), 1e-3)
            yield _keep_reserve(run, threads=threads, timeout=left, progress=progress, attempted=attempted)


def _keep_reserve(
    run: RunState,
    *,
    threads: int,
    timeout: float | None,
    progress: Progress,
    attempted: Callable[[RunState], None],
) -> Executed:
    """Fly a run again with the margins of its reserve, and store that in its file, and before it every attempt."""
    from airrace.runs.reserve import fly_reserve  # which takes what flies in closed loop

    until = None if timeout is None else time.monotonic() + timeout

    def fly_again(before: RunState, values: Sequence[str]) -> RunState:
        left = None if until is None else until - time.monotonic()
        if left is not None and left <= 0.0:
            raise OutOfTime("the time was over before the reserve was found")
        plan = plan_changed_run(before, Changes(overrides=values))
        *_, last = _execute_locked(plan, threads=threads, timeout=left, progress=progress)
        return last.run

    stored = run

    def keep(attempt: ReserveAttempt, flown: RunState | None) -> None:
        nonlocal stored
        stored = stored.with_attempt(attempt, flown)
        _store(stored, [one.stage for one in stored.results])
        attempted(stored)

    assert run.inputs.reserve is not None
    case = fly_reserve(run, run.inputs.reserve, fly_again, threads=threads, keep=keep, tell=progress.remark)
    renewed = replace(case.run, path=run.path, sign=run.sign)
    _store(renewed)
    return Executed(renewed, renewed.results[-1], replace(case, run=renewed))


def _execute_locked(
    plan: ExecutionPlan, *, threads: int, timeout: float | None = None, progress: Progress
) -> Iterator[Executed]:
    run, start = plan.run, plan.start
    reused = {result.stage for result in plan.reused}
    _store(run)
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
        run = run.with_mesh_check(result) if result.stage in reused else run.with_stage(result)
        _store(run, {one.stage for one in run.results} - {result.stage})
        progress.stage_finished(result)  # now, and not before it is stored: what is announced is never lost
        yield Executed(run, result)


def execute_for_command(
    answer: CommandResult, plan: ExecutionPlan, *, threads: int, timeout: float | None = None, progress: Progress
) -> tuple[RunState, Sequence[StageResult], "ReserveCase | None"]:
    """Fly the stages that are not reused, and fill in the answer's object, exit code and sentence.

    Args:
        answer: what the command has to say.
        plan: what is to be computed.
        threads: threads that evaluate derivatives.
        timeout: the longest wall time of the stages, s; None for none.
        progress: who watches.

    Raises:
        UsageError: `timeout` is not positive.

    Returns:
        The run by now, all its stages in order, and the reserve that it keeps.
    """
    started, run = time.perf_counter(), plan.run
    finished, reserve = {result.stage: result for result in plan.reused}, None

    def attempted(latest: RunState) -> None:
        nonlocal run
        run = latest

    try:
        for done in _execute(plan, threads=threads, timeout=timeout, progress=progress, attempted=attempted):
            finished[done.result.stage], run, reserve = done.result, done.run, done.reserve
        if reserve is not None:
            finished = {one.stage: one for one in run.results}
    except OutOfTime:
        left = _next_step(plan, run, tuple(finished.values()))
        answer.fail(ExitCode.TIMEOUT, f"stopped after {timeout:g} s (--timeout); {left}")
    except BaseException as error:
        if not interrupts.caused(error):
            raise
        interrupts.hear()
        answer.fail(ExitCode.INTERRUPTED, f"interrupted; {_next_step(plan, run, tuple(finished.values()))}")
    finally:
        results = tuple(finished.values())
        summarise(answer, plan.run.name, results, time.perf_counter() - started)
        answer.fields["stages"] = stages_object(run, results)
        for result in results:
            if result.status is Status.SOLVED and checks_mesh(plan.run.inputs.settings, result.stage, plan.until):
                answer.fail(ExitCode.NOT_CERTIFIED, f"{result.stage.value}: {one_mesh_note(result)}")
        if plan.start is not None:
            compared = replace(plan, run=run).compare(results)
            answer.fields["compared"] = None if compared is None else comparison_object(compared.reference, [compared])
    if reserve is not None:
        answer.fields["reserve"] = reserve.as_object()
    elif run.results and run.inputs.reserve is not None and run.inputs.reserve.found is None:
        answer.fields["reserve"] = reserve_object(run.stages[-1].stamp.reserve)
    message = unreached(run.inputs.reserve)
    if message:
        answer.fail(ExitCode.NOT_CERTIFIED, message if reserve is None else reserve.message)
    return run, results, reserve


def unreached(reserve: ReserveEntry | None) -> str:
    """Return a sentence where a flight keeps less of a reserve than was asked for; else an empty text."""
    if reserve is None or reserve.found is None or reserve.found.reached:
        return ""
    found = reserve.found
    most = f"the most is {found.measured:.3f} (from {found.lower:.3f})"
    return f"a reserve of {reserve.probability:g} was not reached: {most}"


def _store(run: RunState, unchanged: Collection[Stage] = ()) -> None:
    if run.path is not None:
        write_checkpoint(run.path, run.checkpoint, run.sign, unchanged)


def _next_step(plan: ExecutionPlan, run: RunState, results: Sequence[StageResult]) -> str:
    """Return how a run that was ended before its end is continued, and what of it is finished, as a clause."""
    if plan.start is not None and not results:  # resuming would begin from the course alone
        return f"no stage is finished; start from {plan.start.label} again with --force"
    finished = ", ".join(result.stage.value for result in results) or "none"
    if plan.reserve is not None:
        finished += f"; reserve: {len(run.attempts)} of {ATTEMPTS_MAX} attempts"
    return f"go on with `airrace resume {plan.run.path}` (finished: {finished})"


def summarise(answer: CommandResult, track: str, results: Sequence[StageResult], wall: float) -> None:
    """Fill in the object, and fail the answer unless the last stage is certified and all optima before it hold.

    Args:
        track: name of the course.
        results: the stages of the run so far, in order.
        wall: seconds the command took.
    """
    answer.fields.update(run_object(track, results, wall, certified=is_certified(results)))
    code, sentence = verdict(results)
    if code is not ExitCode.DONE:
        answer.fail(code, sentence)
