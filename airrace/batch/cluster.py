"""The executor of a cluster: jobs as tasks of dask.distributed, which decides where each of them runs.

    submit -> scheduler -> a worker: cluster_job.fly -> local.py -> process.py
    events <- started, stages (with the checkpoint so far) <-+
           <- the end, with the checkpoint <-----------------+

An attempt is one task under a key of its own. It ends when its result is here, or when its worker is gone, whichever is
seen first; afterwards nobody knows the key any more, so no attempt ends twice, and nothing is written for it twice.
"""

import asyncio
import contextlib
import itertools
import logging
import queue
import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from airrace.batch.cluster_connection import Connection, words
from airrace.batch.cluster_job import AttemptPayload, AttemptReply, DamagedPayload, Payload, collect, fly, stop
from airrace.batch.executor import (
    Attempt,
    AttemptResult,
    Ended,
    Event,
    FailureKind,
    StageFinished,
    StageStarted,
    Started,
)
from airrace.batch.process import GRACE
from airrace.checkpoint.atomic import replace_file
from airrace.errors import StorageError
from airrace.runs.command_result import ExitCode

WORKERS_WAIT = 600.0
"""The time for which a batch waits for a worker when there is none, s."""
LOOK = 1.0
"""The time between two looks at the workers, s."""
FETCH = 60.0
"""The time that may pass until a result is here, s."""

_log = logging.getLogger(__name__)


@dataclass
class _RunningAttempt:
    """An attempt under way.

    Attributes:
        future: the future of its task (Any: `distributed` has few annotations).
        workers: the workers that may take it.
        since: the time when it was sent, later when it was begun, s.
        where: the worker that flies it; empty while it is queued.
        told: the number of stages that were reported.
    """

    order: Attempt
    future: Any
    workers: frozenset[str]
    since: float
    where: str = ""
    told: int = 0

    @property
    def wall(self) -> float:
        return time.monotonic() - self.since


class ClusterExecutor:
    """An executor that flies jobs on the workers of a scheduler.

    Args:
        address: the address of the scheduler.
        command: arguments with which a worker's Python runs a job, see `process.py`.
        versions: the versions that workers must have, by name.
        slots: the largest number of jobs at a time; None for as many as workers have threads.
        wait: the time to wait for a worker when there is none, s. After it jobs end unflown, until there is one.
    """

    def __init__(
        self,
        address: str,
        command: Sequence[str],
        versions: Mapping[str, str],
        slots: int | None = None,
        wait: float = WORKERS_WAIT,
    ) -> None:
        self._address = address
        self._command = tuple(command)
        self._versions = versions
        self._slots = slots
        self._wait = wait
        self._batch = f"airrace-{secrets.token_hex(8)}"
        self._numbers = itertools.count(1)
        self._inbox: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()
        self._flights: dict[str, _RunningAttempt] = {}
        self._pending: list[Event] = []
        self._threads: Mapping[str, int] = {}
        self._next_look = 0.0
        self._alone_since: float | None = None

    @property
    def slots(self) -> int:
        threads = sum(self._threads.values()) or (1 if self._gave_up else 0)
        return threads if self._slots is None else min(threads, self._slots)

    def submit(self, order: Attempt) -> None:
        name, key = order.job.name, f"{self._batch}-{next(self._numbers)}"
        if not self._threads:
            self._pending.append(
                Ended(name, AttemptResult(ExitCode.SYSTEM, self._no_worker, 0.0, fault=FailureKind.LOST))
            )
            return
        try:
            parcel = Payload.of(order.checkpoint)
            sending = AttemptPayload(key, self._batch, order.job, order.attempt, order.timeout, parcel, self._command)
            future = self._connection.submit(fly, sending, key=key, workers=list(self._threads))
        except Exception as error:  # the disk's, or any error of the library
            message = f"it could not be sent to the cluster: {words(error)}"
            self._pending.append(Ended(name, AttemptResult(ExitCode.SYSTEM, message, 0.0, fault=FailureKind.LOST)))
            return
        self._flights[key] = _RunningAttempt(order, future, frozenset(self._threads), time.monotonic())

        def done(_: object) -> None:
            self._inbox.put({"key": key, "done": True})

        future.add_done_callback(done)

    def events(self, patience: float) -> Sequence[Event]:
        deadline = time.monotonic() + patience
        while True:
            self._look()
            while not self._inbox.empty():
                self._hear(self._inbox.get())
            events, self._pending = self._pending, []
            left = deadline - time.monotonic()
            if events or left <= 0.0:
                return events
            with contextlib.suppress(queue.Empty):
                self._hear(self._inbox.get(timeout=min(left, LOOK)))

    def stop(self) -> None:
        queued = [key for key, flight in self._flights.items() if not flight.where]
        where = {flight.where for flight in self._flights.values() if flight.where}
        with contextlib.suppress(Exception):  # a worker does not answer; its jobs are cancelled below
            self._connection.call(stop, self._batch, workers=sorted(where & set(self._threads)))
        self._stopped(queued)
        deadline, ended = time.monotonic() + GRACE + 2.0, list[Event]()
        while self._flights and time.monotonic() < deadline:
            ended += self.events(LOOK)
        self._stopped(list(self._flights))
        self._pending = [*ended, *self._pending]

    def __enter__(self) -> Self:
        self._connection = Connection(self._address, self._versions)
        self._connection.listen(self._batch, self._inbox.put)
        self._look()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        futures = [flight.future for flight in self._flights.values()]
        self._flights = {}
        with contextlib.suppress(Exception):  # a scheduler that is gone has nothing to cancel
            if futures:
                self._connection.cancel(futures)
        with contextlib.suppress(Exception):
            self._connection.close()

    @property
    def _no_worker(self) -> str:
        return f"no worker at {self._address} for {self._wait:g} s"

    @property
    def _gave_up(self) -> bool:
        return self._alone_since is not None and time.monotonic() - self._alone_since > self._wait

    def _look(self) -> None:
        """See which workers there are, now and then, and which flights are lost."""
        now = time.monotonic()
        if now < self._next_look:
            return
        heard = True
        try:
            self._threads = self._connection.threads()
        except Exception:  # any error of the library, which ends flights itself if the connection is lost
            self._threads, heard = dict[str, int](), False
        self._next_look = time.monotonic() + LOOK
        if self._threads:
            self._alone_since = None
        elif self._alone_since is None:
            self._alone_since = now
            _log.warning("no worker at %s: waiting for one, for %g s at most", self._address, self._wait)
        for key, flight in list(self._flights.items()):
            gone = flight.where not in self._threads if flight.where else flight.workers.isdisjoint(self._threads)
            if heard and gone:
                self._lose(key, _gone(flight.where))
            elif self._gave_up:
                self._lose(key, self._no_worker)

    def _hear(self, said: Mapping[str, Any]) -> None:
        """Take in what a worker or a future tells; what concerns a flight that has ended is ignored."""
        flight = self._flights.get(said["key"])
        if flight is None:
            return
        name = flight.order.job.name
        match said:
            case {"started": str(where)}:
                flight.where, flight.since = where, time.monotonic()
                self._pending.append(Started(name, _place(where)))
            case {"stage_started": str(stage)}:
                self._pending.append(StageStarted(name, stage))
            case {"stage_finished": {**stage}, "number": int(number)} if number == flight.told + 1:
                self._keep_stage(said["key"], flight, StageFinished(**stage))
            case {"done": True}:
                self._land(said["key"], flight)
            case _:
                pass

    def _keep_stage(self, key: str, flight: _RunningAttempt, stage: StageFinished) -> None:
        """Fetch the checkpoint of a job under way, so that less is lost with its worker.

        Where that fails, the stage is reported at the end of the attempt.
        """
        with contextlib.suppress(Exception):  # any error of the library, a full disk, a damaged parcel
            parcel = self._connection.call(collect, key, workers=[flight.where]).get(flight.where)
            if parcel is not None:
                replace_file(flight.order.checkpoint, parcel.unpacked())
                flight.told += 1
                self._pending.append(stage)

    def _land(self, key: str, flight: _RunningAttempt) -> None:
        """End an attempt as its task reports it."""
        try:
            flown = flight.future.result(timeout=FETCH)
        except (
            Exception,
            asyncio.CancelledError,
        ) as error:  # an error of the task, of the library or of the connection
            self._lose(key, f"its worker failed: {words(error)}")
            return
        if flown.ending is None:
            self._lose(key, _gone(flight.where))
            return
        del self._flights[key]
        with contextlib.suppress(Exception):
            self._connection.forget(flight.future, key)
        stages, ending = landed(flight.order, flown)
        self._pending += [*stages[flight.told :], Ended(flight.order.job.name, ending)]

    def _lose(self, key: str, message: str) -> None:
        flight = self._flights.pop(key)
        self._call_off([flight])
        ending = AttemptResult(ExitCode.SYSTEM, message, flight.wall, fault=FailureKind.LOST)
        self._pending.append(Ended(flight.order.job.name, ending))

    def _stopped(self, keys: Sequence[str]) -> None:
        flights = [self._flights.pop(key) for key in keys]
        self._call_off(flights)
        for flight in flights:
            ending = AttemptResult(ExitCode.INTERRUPTED, "interrupted", flight.wall, fault=FailureKind.STOPPED)
            self._pending.append(Ended(flight.order.job.name, ending))

    def _call_off(self, flights: Sequence[_RunningAttempt]) -> None:
        with contextlib.suppress(Exception):  # any error of the library: the flights count as ended already
            if flights:
                self._connection.cancel([flight.future for flight in flights])


def landed(order: Attempt, flown: AttemptReply) -> tuple[Sequence[StageFinished], AttemptResult]:
    """Put the checkpoint that came back where it belongs, if it is what was sent.

    Returns:
        The stages in it, and how the attempt ended: as the worker says, or with what went wrong here.
    """
    assert flown.ending is not None  # `_land` has made sure of that
    try:
        if flown.checkpoint is not None:
            replace_file(order.checkpoint, flown.checkpoint.unpacked())
    except DamagedPayload as error:
        return (), AttemptResult(
            ExitCode.SYSTEM, f"its checkpoint came back {error}", flown.ending.wall, fault=FailureKind.LOST
        )
    except StorageError as error:
        return (), AttemptResult(ExitCode.SYSTEM, str(error), flown.ending.wall)
    return flown.stages, flown.ending


def _gone(where: str) -> str:
    return f"its worker{where and ' '}{_place(where)} is gone"


def _place(address: str) -> str:
    return address.rpartition("://")[2]
