"""Flying the stages of a run and keeping each as soon as it is finished."""

import os
import platform
import time
from collections.abc import Sequence

from airrace.checkpoint import write_checkpoint
from airrace.procedure import run as procedure
from airrace.procedure.progress import Progress
from airrace.procedure.restart import Another
from airrace.procedure.result import Stage, StageResult
from airrace.runs.answer import Answer
from airrace.runs.comparison import comparison_object
from airrace.runs.exit_codes import ExitCode
from airrace.runs.run import Run
from airrace.runs.run_object import summarise


def fly_stages(
    answer: Answer,
    run: Run,
    *,
    finished: Sequence[StageResult],
    until: Stage,
    threads: int,
    progress: Progress,
    start: Another | None = None,
) -> Sequence[StageResult]:
    """Run the stages that are not finished, write the checkpoint after each, and fill in the answer's object.

    Args:
        answer: what the command has to say.
        run: as it stands.
        finished: the stages that are kept.
        until: the last stage.
        threads: threads that evaluate derivatives.
        progress: who watches.
        start: another run to start from; None to start from the course alone.

    Returns:
        All stages of the run by now, in order.
    """
    started = time.perf_counter()
    results = list(finished)
    checkpoint = run.checkpoint
    try:
        # Written before anything is computed: whatever ends the run, `resume` can take it up.
        write_checkpoint(run.path, checkpoint)
        for result in procedure.optimise(
            run.inputs.race,
            run.inputs.settings,
            until=until,
            threads=threads,
            finished=tuple(finished),
            start=() if start is None else start.results,
            start_name="" if start is None else start.name,
            progress=progress,
        ):
            checkpoint = checkpoint.with_stage(result)
            write_checkpoint(run.path, checkpoint)
            results.append(result)
    except KeyboardInterrupt:
        kept = ", ".join(result.stage.value for result in results) or "none"
        remedy = f"go on with `airrace resume {run.path}` (finished: {kept})"
        if start is not None and not results:  # going on would climb from the course alone
            remedy = f"no stage is finished; start from {start.name} again with --force"
        answer.fail(ExitCode.INTERRUPTED, f"interrupted; {remedy}")
    finally:
        summarise(answer, run.name, results, time.perf_counter() - started)
        if start is not None:
            answer.fields["compared"] = comparison_object(start, results)
    return results


def available_cores() -> int:
    """Cores this process may use, which can be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if os.name == "posix" and platform.system() == "Linux" else os.cpu_count() or 1
