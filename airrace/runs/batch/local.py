"""Jobs on this computer: a process for each, a few at a time.

A job's process is `airrace.runs.batch.job_process`. The first line of its standard input is a JSON object (`job`,
`checkpoint`); it answers with lines of JSON on its standard output:

    {"stage_started": "point-mass"}
    {"stage_finished": "point-mass", "status": "solved", "race_time_s": 55.3, "certified": true}
    {"ended": {"code": 0, "run": {...}, "error": "", "findings": []}}

A terminal's Ctrl-C reaches only who is responsible for it, and when its standard input ends, it ends as well.
"""

import contextlib
import json
import math
import os
import queue
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import IO, Any, cast

from airrace.errors import Finding
from airrace.runs.batch.jobs import Job
from airrace.runs.batch.supervision import POLL, AttemptResult, JobPool
from airrace.runs.command_result import ExitCode
from airrace.runtime.process import ONE_THREAD, python_command, spawn_detached

GRACE = 5.0
"""The time that a process that has to stop may take, s."""
JOB_COMMAND = python_command("airrace.runs.batch.job_process")
"""The command that runs a job in a process of its own."""
STOP = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGTERM)
"""The signal that asks a process to end; Windows lets a program hear nothing else."""


class LocalPool(JobPool):
    """Jobs in processes of this computer.

    Args:
        command: what runs a job.
        slots: processes at a time.
    """

    def __init__(self, command: Sequence[str], slots: int) -> None:
        super().__init__()
        self._command = tuple(command)
        self._slots = slots

    @property
    def slots(self) -> int:
        return self._slots

    def run(self, job: Job, checkpoint: Path, timeout: float | None) -> AttemptResult:
        def report(line: Mapping[str, Any]) -> None:
            self.progress.put((job.name, line))

        report({"started": ""})
        return run_job(
            self._command,
            job,
            checkpoint,
            timeout,
            report=report,
            stop_asked=self.stop_asked.is_set,
            kill_asked=self.kill_asked.is_set,
        )


def run_job(
    command: Sequence[str],
    job: Job,
    checkpoint: Path,
    timeout: float | None,
    *,
    report: Callable[[Mapping[str, Any]], None],  # Any: JSON
    stop_asked: Callable[[], bool],
    kill_asked: Callable[[], bool],
) -> AttemptResult:
    """Run a job in a process of its own to its end; its process never outlives this call.

    Args:
        command: what runs a job.
        job, checkpoint, timeout: see `JobPool.run`.
        report: takes in what the process says of its stages.
        stop_asked: whether it is to end, within `GRACE`.
        kill_asked: whether it is to end at once.
    """
    request = json.dumps({"job": asdict(job), "checkpoint": str(checkpoint)}).encode() + b"\n"
    began = time.monotonic()
    with contextlib.ExitStack() as stack:
        try:
            errors = stack.enter_context(tempfile.TemporaryFile())
            process = spawn_detached(command, errors, {**os.environ, **ONE_THREAD})
        except OSError as error:  # no memory for a process, or no room for a file
            message = f"its process could not be started: {error.strerror or error}"
            return AttemptResult(ExitCode.SYSTEM, message, 0.0)
        stack.callback(_close_input, process)
        stack.callback(_kill_family, process)
        lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        threading.Thread(target=_converse, args=(process, request, lines), daemon=True).start()
        answer = stop_reason = None
        kill_after = math.inf
        while True:
            wall = time.monotonic() - began
            if stop_reason is None and (stop_reason := _reason_to_stop(wall, timeout, stop_asked)):
                kill_after = wall + GRACE
                with contextlib.suppress(OSError):
                    process.send_signal(STOP)
            if wall > kill_after or kill_asked():
                _kill_family(process)
                if process.poll() is not None:
                    break
            try:
                line = lines.get(timeout=POLL)
            except queue.Empty:
                continue
            if not line:
                break
            fields = _parse(line)
            if "ended" in fields:
                answer = _answer_of(fields["ended"])
            else:
                report(fields)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GRACE)  # it says no more, so it should end
        _kill_family(process)
        if stop_reason is not None and (answer is None or answer.code == ExitCode.INTERRUPTED):
            answer = replace(stop_reason, run=None if answer is None else answer.run)
        if answer is None:
            answer = AttemptResult(ExitCode.SYSTEM, _describe_crash(process.returncode, errors), 0.0)
        return replace(answer, wall=time.monotonic() - began)  # an answer counts even if it had to stop meanwhile


def _reason_to_stop(wall: float, timeout: float | None, stop_asked: Callable[[], bool]) -> AttemptResult | None:
    """Return how a job ends that has to stop now, after so many seconds; None if it may go on."""
    if stop_asked():
        return AttemptResult(ExitCode.INTERRUPTED, "interrupted", wall)
    if timeout is not None and wall > timeout:
        return AttemptResult(ExitCode.TIMEOUT, f"stopped after {timeout:g} s (--timeout)", wall)
    return None


def _converse(process: "subprocess.Popen[bytes]", request: bytes, lines: "queue.SimpleQueue[bytes]") -> None:
    """Hand the request over, and take in lines until there are no more; then an empty one."""
    assert process.stdin is not None  # `spawn_detached` was called with it
    assert process.stdout is not None
    with contextlib.suppress(OSError):  # it reads no more
        process.stdin.write(request)
        process.stdin.flush()
    with contextlib.suppress(OSError), process.stdout:
        for line in process.stdout:
            lines.put(line)
    lines.put(b"")


def _kill_family(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process that runs, and all that it has started, now."""
    if process.poll() is not None:
        return
    import psutil  # which is hardly ever needed

    family: list[psutil.Process] = []
    with contextlib.suppress(psutil.Error):
        family = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.wait()
    for child in family:
        with contextlib.suppress(psutil.Error):
            child.kill()


def _close_input(process: "subprocess.Popen[bytes]") -> None:
    assert process.stdin is not None
    with contextlib.suppress(OSError):
        process.stdin.close()


# Any: JSON, here and below.
def _parse(line: bytes) -> Mapping[str, Any]:
    """Return a line of JSON, or nothing: a process that goes astray must not take this one along."""
    try:
        plain = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return cast(Mapping[str, Any], plain) if isinstance(plain, dict) else {}


def _answer_of(plain: Any) -> AttemptResult | None:
    """Return the answer in a report, or None if it is malformed, which counts as no answer."""
    try:
        float(plain["run"]["race_time_s"] or 0.0)
        findings = tuple(Finding(**finding) for finding in plain["findings"])
        return AttemptResult(int(plain["code"]), str(plain["error"]), 0.0, findings, plain["run"])
    except (KeyError, TypeError, ValueError):
        return None


def _describe_crash(status: int, errors: IO[bytes]) -> str:
    """Return how a process without an answer has ended, with its last words where it left some."""
    how = signal.Signals(-status).name if status < 0 else f"exit code {status}"
    if how == "SIGKILL":
        return "its process was killed (out of memory?)"
    # In the last 2000 bytes of a crashed process's output stand its last words.
    errors.seek(max(0, errors.seek(0, os.SEEK_END) - 2000))
    words = [line.strip() for line in errors.read().decode(errors="replace").split("\n") if line.strip()]
    return f"its process crashed ({how})" + (f": {words[-1]}" if words else "")
