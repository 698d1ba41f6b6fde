"""One job in a process of its own: started, listened to, and ended with everything it has started itself.

The process is `airrace.batch.job_process`. The first line of its standard input is a JSON object (`job`, `checkpoint`);
it answers with lines of JSON on its standard output:

    {"stage_started": "point-mass"}
    {"stage_finished": "point-mass", "status": "solved", "race_time_s": 55.3, "certified": true}
    {"ended": {"code": 0, "run": {...}, "error": "", "findings": []}}

A terminal's Ctrl-C reaches only who is responsible for it, and when its standard input ends, it ends as well.
"""

import contextlib
import json
import os
import queue
import signal
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from typing import IO, Any

from airrace.batch.executor import Attempt, AttemptResult, Ended, Event, FailureKind, StageFinished, StageStarted
from airrace.errors import Finding
from airrace.process import ONE_THREAD, python_command, started_apart
from airrace.records import record
from airrace.runs.command_result import ExitCode

GRACE = 5.0
"""The time that a process which is told to stop may take, s."""
SAID_MAX = 2000
"""The size of the end of a crashed process's output in which its last words are looked for, bytes."""
ANSWER_MAX = 64 * 1024 * 1024
"""The size up to which a line is read, bytes; a larger one is no answer."""
JOB_COMMAND = python_command("airrace.batch.job_process")
"""The command that runs a job in a process of its own."""
STOP = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGTERM)
"""The signal that asks a process to end; Windows lets a program hear nothing else."""


@record
class _Answer:
    """The last report of a process on the job it has run."""

    code: int
    error: str
    findings: tuple[Finding, ...]
    run: Mapping[str, Any]  # Any: JSON


class JobProcess:
    """A running attempt. `events` reads what it reports; `stop` ends it early.

    Args:
        order: the job; its checkpoint is read and written in place.
        command: what runs a job.
        heard: is set when there is something for `events`.
    """

    def __init__(self, order: Attempt, command: Sequence[str], heard: threading.Event) -> None:
        self.order = order
        self._started = time.monotonic()
        self._heard = heard
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._answer: _Answer | None = None
        self._stopping: FailureKind = FailureKind.NONE
        self._killed_at: float | None = None
        self._closed = False
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the process)
        try:
            self._process = started_apart(command, self._said, {**os.environ, **ONE_THREAD})
        except BaseException:
            self._said.close()
            raise
        threading.Thread(target=self._converse, daemon=True).start()

    def events(self) -> list[Event]:
        """Return what the process has reported since the last call, without waiting; the last event is its `Ended`.

        A process beyond its time limit is told to stop.
        """
        events = self._understood()
        elapsed = time.monotonic() - self._started
        if self.order.timeout is not None and elapsed > self.order.timeout:
            self.stop(FailureKind.TIMED_OUT)
        if self._killed_at is not None and time.monotonic() > self._killed_at:
            self.kill()
        if self._closed and self._process.poll() is not None:
            events.append(Ended(self.order.job.name, self._ending(elapsed)))
            self._said.close()
        return events

    def stop(self, why: FailureKind) -> None:
        """Ask the process to end; after `GRACE` seconds `events` kills it."""
        if self._stopping is FailureKind.NONE:
            self._stopping = why
            self._killed_at = time.monotonic() + GRACE
            with contextlib.suppress(OSError):
                self._process.send_signal(STOP)

    def kill(self) -> None:
        """Kill the process and all that it has started, now."""
        import psutil  # which is hardly ever needed

        family: list[psutil.Process] = []
        if self._process.poll() is None:
            with contextlib.suppress(psutil.Error):
                family = psutil.Process(self._process.pid).children(recursive=True)
        self._process.kill()
        self._process.wait()
        for process in family:
            with contextlib.suppress(psutil.Error):
                process.kill()

    def abandon(self) -> None:
        """Kill the process now and ignore what it has reported."""
        self.kill()
        self._said.close()

    def _converse(self) -> None:
        """Hand the order over and take in lines, in a thread of its own, for a pipe waits for the other side."""
        asked, answers = self._process.stdin, self._process.stdout
        assert asked is not None  # `started_apart` was told so
        assert answers is not None
        order = {"job": self.order.job.as_object(), "checkpoint": str(self.order.checkpoint)}
        with contextlib.suppress(OSError), asked, answers:  # an OSError: it reads no more
            with contextlib.suppress(OSError):
                asked.write(json.dumps(order).encode("utf-8") + b"\n")
                asked.flush()
            while line := answers.readline(ANSWER_MAX):
                self._lines.put(line)
                self._heard.set()
            self._lines.put(b"")
            self._heard.set()
            self._process.wait()
            self._heard.set()

    def _understood(self) -> list[Event]:
        """Return what the lines that have arrived tell."""
        events: list[Event | None] = []
        with contextlib.suppress(queue.Empty):
            while line := self._lines.get_nowait():
                events.append(self._event(line))
            self._closed = True
            self._killed_at = self._killed_at or time.monotonic() + GRACE
        return [event for event in events if event is not None]

    def _event(self, line: bytes) -> Event | None:
        name = self.order.job.name
        match _plain(line):
            case {"stage_started": str(stage)}:
                return StageStarted(name, stage)
            case {
                "stage_finished": str(stage),
                "status": str(status),
                "race_time_s": race_time,
                "certified": bool(certified),
            }:
                return StageFinished(name, stage, status, race_time, certified)
            case {"ended": {**answer}}:
                self._answer = _answered(answer)
            case _:
                pass
        return None

    def _ending(self, wall: float) -> AttemptResult:
        """Return how the attempt ended. An answer counts even if the process was told to stop meanwhile."""
        answer = self._answer
        if self._stopping is not FailureKind.NONE and (answer is None or answer.code == ExitCode.INTERRUPTED):
            run = None if answer is None else answer.run
            if self._stopping is FailureKind.TIMED_OUT:
                message = f"stopped after {self.order.timeout:g} s (--timeout)"
                return AttemptResult(ExitCode.TIMEOUT, message, wall, run=run, fault=FailureKind.TIMED_OUT)
            return AttemptResult(ExitCode.INTERRUPTED, "interrupted", wall, run=run, fault=FailureKind.STOPPED)
        if answer is None:
            return self._dead(self._process.returncode, wall)
        return AttemptResult(answer.code, _with_suspicion(answer.error), wall, answer.findings, answer.run)

    def _dead(self, status: int, wall: float) -> AttemptResult:
        how = signal.Signals(-status).name if status < 0 else f"exit code {status}"
        if how == "SIGKILL":
            return AttemptResult(
                ExitCode.SYSTEM, "its process was killed (out of memory?)", wall, fault=FailureKind.KILLED
            )
        said = self._last_words()
        return AttemptResult(
            ExitCode.SYSTEM, f"its process crashed ({how}){said and ': ' + said}", wall, fault=FailureKind.CRASHED
        )

    def _last_words(self) -> str:
        self._said.seek(max(0, self._said.seek(0, os.SEEK_END) - SAID_MAX))
        lines = self._said.read().decode(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")


# Any: JSON, here and below.
def _plain(line: bytes) -> Any:
    """Return a line of JSON as plain values, or None if it is not JSON.

    A process that went astray must not take this one along.
    """
    try:
        return json.loads(line, parse_constant=_refused)
    except (ValueError, RecursionError):
        return None


def _refused(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def _answered(plain: Mapping[str, Any]) -> _Answer | None:
    """Return the answer in a report, or None if it is malformed, which counts as no answer."""
    try:
        run, findings = plain["run"], tuple(Finding(**finding) for finding in plain["findings"])
        float(run["race_time_s"] or 0.0)
        return _Answer(int(plain["code"]), str(plain["error"]), findings, {**run, "stages": list(run["stages"])})
    except (KeyError, TypeError, ValueError):
        return None


def _with_suspicion(error: str) -> str:
    """Return the error, with the suspicion that memory ran out if the solver's process was killed.

    The solver has a process of its own, and most of the memory: it is the one that the system picks.
    """
    return f"{error} (out of memory?)" if "status -9" in error else error
