"""The process of one job of a batch: it reads the job from standard input, flies it, and reports on standard output.

`airrace/runs/batch/local.py` starts it, and describes what is read and reported. The process takes up its checkpoint
where it stands, as `airrace resume` does, and ends with the code and the object of `airrace optimize`.
"""

import io
import json
import os
import signal
import sys
import threading
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import IO, TYPE_CHECKING

from airrace.errors import SolverCrash
from airrace.optimal_control.solvers import start_early
from airrace.procedure.result import Iteration, Progress, StageResult
from airrace.procedure.stage import Stage
from airrace.runs.command_result import CommandResult, ExitCode, empty_result, record_failure
from airrace.runtime import interrupts, process

if TYPE_CHECKING:
    from airrace.runs.batch.jobs import Job


class JsonProgress(Progress):
    """An observer that reports stages as lines of JSON."""

    def __init__(self, replies: IO[str]) -> None:
        self._replies = replies

    def stage_started(self, stage: Stage) -> None:
        self.write({"stage_started": stage.value})

    def activity(self, text: str, done: int, total: int) -> None: ...

    def iteration(self, iteration: Iteration) -> None: ...

    def stage_finished(self, result: StageResult) -> None:
        self.write(
            {
                "stage_finished": result.stage.value,
                "status": result.status.value,
                "race_time_s": float(result.trajectory.race_time) if result.is_flight else None,
                "certified": result.certified,
            }
        )

    def write(self, line: Mapping[str, object]) -> None:
        self._replies.write(json.dumps(line, allow_nan=False) + "\n")
        self._replies.flush()


def main() -> None:
    """Run the job; whatever happens in it becomes its result."""
    interrupts.listen()
    process.omit_memory_tracebacks()
    process.set_parent_death_signal()
    requests, answers = process.claim_stdio()
    request = json.loads(requests.readline())
    threading.Thread(target=_end_after, args=(requests,), daemon=True).start()
    start_early()
    from airrace.runs.batch.jobs import Job  # a slow import, during which the solver process loads as well

    job = Job.from_object(request["job"])
    with io.TextIOWrapper(answers, encoding="utf-8") as replies:
        progress = JsonProgress(replies)
        command_result = CommandResult(empty_result(job.course))
        try:
            _fly(command_result, job, Path(request["checkpoint"]), progress)
        except (Exception, KeyboardInterrupt) as error:  # the edge of the program: every error ends here
            record_failure(command_result, error)
            if isinstance(error, SolverCrash) and error.status == -getattr(signal, "SIGKILL", 9):
                command_result.error += " (out of memory?)"  # the solver has most of it, and the system picks it
        findings = [asdict(finding) for finding in command_result.findings]
        end_fields = {
            "code": int(command_result.code),
            "run": command_result.fields,
            "error": command_result.error,
            "findings": findings,
        }
        progress.write({"ended": end_fields})
    sys.exit(int(command_result.code))


def _fly(command_result: CommandResult, job: "Job", path: Path, progress: Progress) -> None:
    """Fly all stages up to the job's last one, except those in the checkpoint that still stand."""
    from airrace.files.inputs import inputs_from_documents
    from airrace.runs.execute import execute_for_command
    from airrace.runs.execution_plan import plan_resumed_run
    from airrace.runs.run_state import adopt_checkpoint, new_run

    inputs = inputs_from_documents(job.track, job.aircraft, job.settings, job.overrides)
    run = adopt_checkpoint(new_run(inputs, path))
    execute_for_command(command_result, plan_resumed_run(run, until=job.until), threads=1, progress=progress)


def _end_after(requests: IO[bytes]) -> None:
    """End this process, whatever it is at, when the one that started it has ended."""
    requests.read()
    os._exit(int(ExitCode.INTERRUPTED))


if __name__ == "__main__":
    main()
