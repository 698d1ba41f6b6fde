"""The flying of a run: stage by stage, each kept as soon as it is finished."""

import time
from collections.abc import Collection, Iterator, Sequence

from airrace import interrupts
from airrace.checkpoint import write_checkpoint
from airrace.errors import OutOfTime, UsageError
from airrace.procedure import run as procedure
from airrace.procedure.fidelity_continuation import proves
from airrace.procedure.progress import Progress
from airrace.procedure.result import Stage, StageResult, State
from airrace.runs.answer import Answer
from airrace.runs.exit_codes import ExitCode
from airrace.runs.leg_object import stages_object
from airrace.runs.run import Run
from airrace.runs.run_lock import flown_alone
from airrace.runs.run_object import summarise, unproved
from airrace.runs.split_comparison import comparison_object
from airrace.runs.task import Task


def flown(task: Task, *, threads: int, timeout: float | None = None, progress: Progress) -> Iterator[Run]:
    """Fly the stages that are not kept; yield the run after each, written to its file if it has one.

    The file is written before anything is computed, too: whatever ends the run, it can be resumed.

    Args:
        task: what is to be flown.
        threads: threads that evaluate derivatives.
        timeout: the longest wall time of what is flown, s; None for none.
        progress: who watches.
    """
    return (run for run, _ in _flown(task, threads=threads, timeout=timeout, progress=progress))


def _flown(
    task: Task, *, threads: int, timeout: float | None = None, progress: Progress
) -> Iterator[tuple[Run, StageResult]]:
    """Return the run after each stage that was flown, or proved, and that stage."""
    if timeout is not None and not timeout > 0.0:
        raise UsageError(f"a run needs some time: --timeout {timeout:g} leaves none")
    with flown_alone(task.run.path):
        yield from _flown_alone(task, threads=threads, timeout=timeout, progress=progress)


def _flown_alone(
    task: Task, *, threads: int, timeout: float | None = None, progress: Progress
) -> Iterator[tuple[Run, StageResult]]:
    run, start = task.run, task.start
    kept = {result.stage for result in task.kept}
    _keep(run)
    for result in procedure.optimize(
        run.inputs.race,
        run.inputs.settings,
        until=task.until,
        threads=threads,
        finished=task.kept,
        start=() if start is None else start.results,
        start_name="" if start is None else start.name,
        timeout=timeout,
        progress=progress,
    ):
        run = run.with_proof(result) if result.stage in kept else run.with_stage(result)
        _keep(run, {one.stage for one in run.results} - {result.stage})
        progress.stage_finished(result)  # now, and not before it is kept: what is announced is never lost
        yield run, result


def fly_stages(
    answer: Answer, task: Task, *, threads: int, timeout: float | None = None, progress: Progress
) -> Sequence[StageResult]:
    """Fly the stages that are not kept, and fill in the answer's object, exit code and sentence.

    Args:
        answer: what the command has to say.
        task: what is to be flown.
        threads: threads that evaluate derivatives.
        timeout: the longest wall time of what is flown, s; None for none.
        progress: who watches.

    Raises:
        UsageError: `timeout` is not positive.

    Returns:
        All stages of the run by now, in order.
    """
    started = time.perf_counter()
    finished = {result.stage: result for result in task.kept}
    try:
        for _, result in _flown(task, threads=threads, timeout=timeout, progress=progress):
            finished[result.stage] = result
    except OutOfTime:
        answer.fail(
            ExitCode.TIMEOUT, f"stopped after {timeout:g} s (--timeout); {_next_step(task, tuple(finished.values()))}"
        )
    except BaseException as error:
        if not interrupts.caused(error):
            raise
        interrupts.hear()
        answer.fail(ExitCode.INTERRUPTED, f"interrupted; {_next_step(task, tuple(finished.values()))}")
    finally:
        results = tuple(finished.values())
        summarise(answer, task.run.name, results, time.perf_counter() - started)
        answer.fields["stages"] = stages_object(task.run.inputs, results)
        for result in results:
            if result.state is State.SOLVED and proves(task.run.inputs.settings, result.stage, task.until):
                answer.fail(ExitCode.NOT_CERTIFIED, f"{result.stage.value}: {unproved(result)}")
        if task.start is not None:
            answer.fields["compared"] = comparison_object(task.start, results)
    return results


def _keep(run: Run, unchanged: Collection[Stage] = ()) -> None:
    if run.path is not None:
        write_checkpoint(run.path, run.checkpoint, run.sign, unchanged)


def _next_step(task: Task, results: Sequence[StageResult]) -> str:
    """Return how a run that was ended before its end is continued, as a clause."""
    if task.start is not None and not results:  # resuming would begin from the course alone
        return f"no stage is finished; start from {task.start.name} again with --force"
    finished = ", ".join(result.stage.value for result in results) or "none"
    return f"go on with `airrace resume {task.run.path}` (finished: {finished})"
