"""The executor of this computer: a process for each job, a few at a time.

A job's process is `airrace.batch.job_process`. The first line of its standard input is a JSON object (`job`,
`checkpoint`); it answers with lines of JSON on its standard output:

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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import IO, Any, Self

from airrace.batch.supervision import (
    AttemptResult,
    Ended,
    Event,
    FailureKind,
    JobAttempt,
    StageFinished,
    StageStarted,
    Started,
)
from airrace.errors import Finding
from airrace.process import ONE_THREAD, python_command, spawn_detached
from airrace.runs.command_result import ExitCode

GRACE = 5.0
"""The time that a process that has to stop may take, s."""
JOB_COMMAND = python_command("airrace.batch.job_process")
"""The command that runs a job in a process of its own."""
STOP = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGTERM)
"""The signal that asks a process to end; Windows lets a program hear nothing else."""


class LocalExecutor:
    """An executor that flies jobs in processes of this computer.

    Args:
        command: what runs a job.
        slots: processes at a time.
    """

    def __init__(self, command: Sequence[str], slots: int) -> None:
        self._command = tuple(command)
        self.slots = slots
        self._running: dict[str, _JobProcess] = {}
        self._inbox: queue.SimpleQueue[Event] = queue.SimpleQueue()

    def submit(self, order: JobAttempt) -> None:
        name = order.job.name
        try:
            self._running[name] = _JobProcess(order, self._command, self._inbox.put)
        except OSError as error:  # no memory for a process, or no room for a file
            message = f"its process could not be started: {error.strerror or error}"
            self._inbox.put(Ended(name, AttemptResult(ExitCode.SYSTEM, message, 0.0, fault=FailureKind.CRASHED)))

    def events(self, patience: float) -> Sequence[Event]:
        events: list[Event] = []
        with contextlib.suppress(queue.Empty):
            events.append(self._inbox.get(patience > 0.0, patience or None))
            while True:
                events.append(self._inbox.get_nowait())
        for event in events:
            if isinstance(event, Ended):
                self._running.pop(event.name, None)
        return events

    def stop(self) -> None:
        for process in self._running.values():
            process.stop(FailureKind.STOPPED)
        events: list[Event] = []
        while self._running:
            events += self.events(GRACE)
        for event in events:
            self._inbox.put(event)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        for process in self._running.values():
            process.kill()
        self._running = {}


class _JobProcess:
    """A running attempt: it reports events, the last of them its `Ended`.

    Args:
        order: the job; its checkpoint is read and written in place.
        command: what runs a job.
        report: is called from another thread.
    """

    def __init__(self, order: JobAttempt, command: Sequence[str], report: Callable[[Event], None]) -> None:
        self._order = order
        self._report = report
        self._started = time.monotonic()
        self._answer: AttemptResult | None = None
        self._stopping: FailureKind = FailureKind.NONE
        self._timers: list[threading.Timer] = []
        self._output: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the process)
        try:
            self._process = spawn_detached(command, self._output, {**os.environ, **ONE_THREAD})
        except BaseException:
            self._output.close()
            raise
        report(Started(order.job.name))
        if order.timeout is not None:
            self._after(order.timeout, lambda: self.stop(FailureKind.TIMED_OUT))
        threading.Thread(target=self._converse, daemon=True).start()

    def stop(self, why: FailureKind) -> None:
        """Ask the process to end; it is killed if it takes longer than `GRACE`."""
        if self._stopping is FailureKind.NONE:
            self._stopping = why
            self._after(GRACE, self.kill)
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

    def _after(self, seconds: float, act: Callable[[], None]) -> None:
        timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), act)
        timer.daemon = True
        self._timers.append(timer)
        timer.start()

    def _converse(self) -> None:
        """Hand the order over, take in lines until there are no more, and report the end."""
        name = self._order.job.name
        order = {"job": asdict(self._order.job), "checkpoint": str(self._order.checkpoint)}
        asked, answers = self._process.stdin, self._process.stdout
        assert asked is not None  # `spawn_detached` was called with it
        assert answers is not None
        with contextlib.suppress(OSError):  # it reads no more
            asked.write(json.dumps(order).encode("utf-8") + b"\n")
            asked.flush()
        with contextlib.suppress(OSError):
            while line := answers.readline(64 * 2**20):  # a larger line, bytes, is no answer
                match _json_of(line):
                    case {"stage_started": str(stage)}:
                        self._report(StageStarted(name, stage))
                    case {
                        "stage_finished": str(stage),
                        "status": str(status),
                        "race_time_s": race_time,
                        "certified": bool(certified),
                    }:
                        self._report(StageFinished(name, stage, status, race_time, certified))
                    case {"ended": {**answer}}:
                        self._answer = _answer_of(answer)
                    case _:
                        pass
        self._after(GRACE, self.kill)  # it says no more, so it should end
        self._process.wait()
        for timer in self._timers:
            timer.cancel()
        for stream in (asked, answers):  # not before: when its standard input ends, the process does
            with contextlib.suppress(OSError):
                stream.close()
        ending = self._ending(time.monotonic() - self._started)
        self._output.close()
        self._report(Ended(name, ending))

    def _ending(self, wall: float) -> AttemptResult:
        """Return how the attempt ended. An answer counts even if the process had to stop meanwhile."""
        answer = self._answer
        if self._stopping is not FailureKind.NONE and (answer is None or answer.code == ExitCode.INTERRUPTED):
            code, message = ExitCode.INTERRUPTED, "interrupted"
            if self._stopping is FailureKind.TIMED_OUT:
                code, message = ExitCode.TIMEOUT, f"stopped after {self._order.timeout:g} s (--timeout)"
            return AttemptResult(code, message, wall, run=answer and answer.run, fault=self._stopping)
        if answer is not None:
            return replace(answer, wall=wall)
        status = self._process.returncode
        how = signal.Signals(-status).name if status < 0 else f"exit code {status}"
        fault, message = FailureKind.KILLED, "its process was killed (out of memory?)"
        if how != "SIGKILL":
            said = self._last_words()
            fault, message = FailureKind.CRASHED, f"its process crashed ({how}){said and ': ' + said}"
        return AttemptResult(ExitCode.SYSTEM, message, wall, fault=fault)

    def _last_words(self) -> str:
        # In the last 2000 bytes of a crashed process's output stand its last words.
        self._output.seek(max(0, self._output.seek(0, os.SEEK_END) - 2000))
        lines = self._output.read().decode(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")


# Any: JSON, here and below.
def _json_of(line: bytes) -> Any:
    """Return a line of JSON as plain values, or None: a process that went astray must not take this one along."""
    try:
        return json.loads(line, parse_constant=_refuse_constant)
    except (ValueError, RecursionError):
        return None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def _answer_of(plain: Mapping[str, Any]) -> AttemptResult | None:
    """Return the answer in a report, or None if it is malformed, which counts as no answer."""
    try:
        run, findings = plain["run"], tuple(Finding(**finding) for finding in plain["findings"])
        float(run["race_time_s"] or 0.0)
        run = {**run, "stages": list(run["stages"])}
        return AttemptResult(int(plain["code"]), str(plain["error"]), 0.0, findings, run)
    except (KeyError, TypeError, ValueError):
        return None
