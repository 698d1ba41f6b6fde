"""One job in a process of its own: started, listened to, and ended with everything it has started itself.

The process is `airrace.batch.job_process`. Its standard input is one JSON object (`job`, `checkpoint`, `parent`: a
process id); it answers with lines of JSON on a pipe, the number of whose file descriptor is its last argument:

    {"stage_started": "point-mass"}
    {"stage_finished": "point-mass", "status": "solved", "race_time_s": 55.3, "certified": true}
    {"ended": {"code": 0, "run": {...}, "error": "", "findings": []}}

It runs in a session of its own, so that a terminal's Ctrl-C reaches only who is responsible for it, and ends when the
thread that started it does.
"""

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from airrace.batch.executor import Ended, Ending, Event, Fault, Order, StageFinished, StageStarted
from airrace.errors import Finding
from airrace.process import ONE_THREAD, python_command
from airrace.records import record
from airrace.runs.exit_codes import ExitCode

GRACE = 5.0
"""The time that a process which is told to stop may take, s."""
SAID_MAX = 2000
"""The size of the end of a crashed process's output in which its last words are looked for, bytes."""
ANSWER_MAX = 64 * 1024 * 1024
"""The size up to which an answer is read, bytes; a larger one counts as none."""
JOB_COMMAND = python_command("airrace.batch.job_process")
"""The command that runs a job in a process of its own, without the number of the file descriptor."""


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
        command: what runs a job, the number of the file descriptor still to be appended.
    """

    def __init__(self, order: Order, command: Sequence[str]) -> None:
        self.order = order
        self._started = time.monotonic()
        self._received = b""
        self._answer: _Answer | None = None
        self._stopping: Fault = Fault.NONE
        self._killed_at: float | None = None
        self._closed = False
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the process)
        reading, writing = os.pipe()
        os.set_blocking(reading, False)
        self._replies = reading
        try:
            self._process = _spawned(order, command, writing, self._said)
        except BaseException:
            self._close()
            raise
        finally:
            os.close(writing)

    def fileno(self) -> int:
        """Return the descriptor that is readable when there is something to be read, so that many can be waited for."""
        return self._replies

    @property
    def silent(self) -> bool:
        """Whether the process has closed its end of the pipe: only its end is still waited for."""
        return self._closed

    def events(self) -> list[Event]:
        """Return what the process has reported since the last call, without waiting; the last event is its `Ended`.

        A process beyond its time limit is told to stop.
        """
        events = self._heard()
        elapsed = time.monotonic() - self._started
        if self.order.timeout is not None and elapsed > self.order.timeout:
            self.stop(Fault.TIMED_OUT)
        if self._killed_at is not None and time.monotonic() > self._killed_at:
            self.kill()
        if self._closed and self._process.poll() is not None:
            events.append(Ended(self.order.job.name, self._ending(elapsed)))
            self._close()
        return events

    def stop(self, why: Fault) -> None:
        """Ask the process to end; after `GRACE` seconds `events` kills it."""
        if self._stopping is Fault.NONE:
            self._stopping = why
            self._killed_at = time.monotonic() + GRACE
            with contextlib.suppress(OSError):
                self._process.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Kill the process and all that it has started, now."""
        family = _descendants(self._process.pid) if self._process.poll() is None else []
        self._process.kill()
        self._process.wait()
        for process in family:
            with contextlib.suppress(OSError):
                os.kill(process, signal.SIGKILL)

    def abandon(self) -> None:
        """Kill the process now and ignore what it has reported."""
        self.kill()
        self._close()

    def _close(self) -> None:
        self._closed = True
        if self._replies >= 0:
            os.close(self._replies)
            self._replies = -1
            self._said.close()

    def _heard(self) -> list[Event]:
        while not self._closed:
            try:
                piece = os.read(self._replies, 65536)
            except BlockingIOError:
                break
            self._received += piece
            if not piece or len(self._received) > ANSWER_MAX:
                self._closed = True
                self._killed_at = self._killed_at or time.monotonic() + GRACE
        *lines, self._received = self._received.split(b"\n")
        return [event for line in lines if (event := self._understood(line)) is not None]

    def _understood(self, line: bytes) -> Event | None:
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

    def _ending(self, wall: float) -> Ending:
        """Return how the attempt ended. An answer counts even if the process was told to stop meanwhile."""
        answer = self._answer
        if self._stopping is not Fault.NONE and (answer is None or answer.code == ExitCode.INTERRUPTED):
            run = None if answer is None else answer.run
            if self._stopping is Fault.TIMED_OUT:
                message = f"stopped after {self.order.timeout:g} s (--timeout)"
                return Ending(ExitCode.TIMEOUT, message, wall, run=run, fault=Fault.TIMED_OUT)
            return Ending(ExitCode.INTERRUPTED, "interrupted", wall, run=run, fault=Fault.STOPPED)
        if answer is None:
            return self._dead(self._process.returncode, wall)
        return Ending(answer.code, _with_suspicion(answer.error), wall, answer.findings, answer.run)

    def _dead(self, status: int, wall: float) -> Ending:
        if status == -signal.SIGKILL:
            return Ending(ExitCode.SYSTEM, "its process was killed (out of memory?)", wall, fault=Fault.KILLED)
        how = signal.Signals(-status).name if status < 0 else f"exit code {status}"
        said = self._last_words()
        return Ending(ExitCode.SYSTEM, f"its process crashed ({how}){said and ': ' + said}", wall, fault=Fault.CRASHED)

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


def _spawned(order: Order, command: Sequence[str], replies: int, said: IO[bytes]) -> "subprocess.Popen[bytes]":
    """Start the process; it reads its order from a file without a name, since a pipe would wait for it."""
    with tempfile.TemporaryFile() as request:
        plain = {"job": order.job.as_object(), "checkpoint": str(order.checkpoint), "parent": os.getpid()}
        request.write(json.dumps(plain).encode("utf-8"))
        request.seek(0)
        return subprocess.Popen(
            [*command, str(replies)],
            stdin=request,
            stdout=said,
            stderr=said,
            pass_fds=(replies,),
            start_new_session=True,
            env={**os.environ, **ONE_THREAD},
        )


def _descendants(process: int) -> list[int]:
    """Return the ids of the running processes that a process has started (Linux; elsewhere none are known)."""
    found: list[int] = []
    for children in Path("/proc").glob(f"{process}/task/*/children"):
        with contextlib.suppress(OSError):
            for child in map(int, children.read_text().split()):
                found += [child, *_descendants(child)]
    return found
