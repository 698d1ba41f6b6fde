"""The executor of this machine: a process for each job, a few at a time."""

import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from airrace.batch.executor import Attempt, AttemptResult, Ended, Event, FailureKind, Started
from airrace.batch.process import JobProcess
from airrace.runs.command_result import ExitCode

POLL = 0.2
"""The time between two looks at time limits, s."""


class LocalExecutor:
    """An executor that flies jobs in processes of this machine.

    Args:
        command: what runs a job, see `process.py`.
        slots: processes at a time.
    """

    def __init__(self, command: Sequence[str], slots: int) -> None:
        self._command = tuple(command)
        self._slots = slots
        self._heard = threading.Event()
        self._running: list[JobProcess] = []
        self._pending: list[Event] = []

    @property
    def slots(self) -> int:
        return self._slots

    def submit(self, order: Attempt) -> None:
        try:
            self._running.append(JobProcess(order, self._command, self._heard))
        except OSError as error:  # no memory for a process, or no room for a file
            message = f"its process could not be started: {error.strerror or error}"
            self._pending.append(
                Ended(order.job.name, AttemptResult(ExitCode.SYSTEM, message, 0.0, fault=FailureKind.CRASHED))
            )
        else:
            self._pending.append(Started(order.job.name))

    def events(self, patience: float) -> Sequence[Event]:
        deadline = time.monotonic() + patience
        while True:
            events, self._pending = self._pending, []
            for process in self._running:
                events += process.events()
            ended = {event.name for event in events if isinstance(event, Ended)}
            self._running = [process for process in self._running if process.order.job.name not in ended]
            left = deadline - time.monotonic()
            if events or left <= 0.0:
                return events
            if self._heard.wait(min(left, POLL)):
                self._heard.clear()

    def stop(self) -> None:
        for process in self._running:
            process.stop(FailureKind.STOPPED)
        ended: list[Event] = []
        while self._running:
            ended += self.events(POLL)
        self._pending = ended

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in self._running:
            process.abandon()
        self._running = []
