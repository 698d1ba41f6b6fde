"""The executor of a cluster: jobs as tasks of dask.distributed, which decides where each of them runs."""

import asyncio
import contextlib
import hashlib
import itertools
import logging
import queue
import secrets
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

import dask.config
import distributed
from distributed import Client
from distributed import Event as Flag
from distributed.comm.core import connect  # pyright: ignore[reportUnknownVariableType]  (few annotations)
from distributed.security import Security

from airrace.batch.jobs import Job
from airrace.batch.local import GRACE, LocalExecutor
from airrace.batch.supervision import (
    Attempt,
    AttemptResult,
    Ended,
    Event,
    FailureKind,
    StageFinished,
    StageStarted,
    Started,
)
from airrace.checkpoint.atomic import replace_file
from airrace.errors import AirraceError, ClusterError, StorageError
from airrace.records import record
from airrace.runs.command_result import ExitCode

POLL = 0.5
"""The time between two looks whether the job is still wanted, s."""


class DamagedPayload(AirraceError):
    """An error of a parcel whose content is not what was sent."""


@record
class Payload:
    """A file on its way: its bytes, and their sha256 (hex) where they were sent from."""

    content: bytes
    sha256: str

    @classmethod
    def of(cls, path: Path) -> Self | None:
        """Pack a file as it is now; return None if there is none."""
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        return cls(content, hashlib.sha256(content).hexdigest())

    def unpacked(self) -> bytes:
        """Return the bytes of the file, or raise `DamagedPayload` if they are not those that were sent."""
        arrived = hashlib.sha256(self.content).hexdigest()
        if arrived != self.sha256:
            raise DamagedPayload(f"damaged on its way (sha256 {arrived[:12]}... instead of {self.sha256[:12]}...)")
        return self.content


@record
class AttemptPayload:
    """An attempt at a job with the checkpoint of earlier ones, as it travels to a worker.

    `key` names this attempt and no other on the whole cluster, `batch` the batch: the topic of what workers report.
    `command` are the arguments with which the worker's Python runs a job, see `airrace.batch.local`.
    """

    key: str
    batch: str
    job: Job
    attempt: int
    timeout: float | None
    checkpoint: Payload | None
    command: tuple[str, ...]


@record
class AttemptReply:
    """The result of an attempt with its checkpoint, as it travels back.

    `ending` is None if nothing was flown: the attempt had been begun before, on a worker that is gone.
    """

    ending: AttemptResult | None
    stages: tuple[StageFinished, ...] = ()
    checkpoint: Payload | None = None


# The process of a worker flies several jobs at once, in threads; `collect` and `stop` find them here.
_under_way: dict[str, Path] = {}
_stopped: set[str] = set()


def fly(sending: AttemptPayload) -> AttemptReply:
    """Fly a job, as a task of a worker."""
    worker = distributed.get_worker()
    if not _is_first(sending.key):
        return AttemptReply(None)

    def tell(**said: object) -> None:
        worker.log_event(sending.batch, {"key": sending.key, **said})

    tell(started=worker.address)
    with tempfile.TemporaryDirectory(prefix="airrace-", dir=worker.local_directory) as folder:
        path = Path(folder) / f"{sending.job.name}.h5"
        try:
            if sending.checkpoint is not None:
                path.write_bytes(sending.checkpoint.unpacked())
        except DamagedPayload as error:
            return AttemptReply(
                AttemptResult(ExitCode.SYSTEM, f"its checkpoint was {error}", 0.0, fault=FailureKind.LOST)
            )
        _under_way[sending.key] = path
        try:
            return _watched(sending, path, worker, tell)
        finally:
            del _under_way[sending.key]


# Any: `distributed`'s Worker, and a function of keyword arguments; run by name on the worker.
def _watched(sending: AttemptPayload, path: Path, worker: Any, tell: Any) -> AttemptReply:
    """Fly a job, report its stages while it lasts, and end it when it is no longer wanted."""
    stages: list[StageFinished] = []
    with LocalExecutor((sys.executable, *sending.command), 1) as local:
        local.submit(Attempt(sending.job, sending.attempt, path, sending.timeout))
        while True:
            for event in local.events(POLL):
                match event:
                    case StageStarted(stage=stage):
                        tell(stage_started=stage)
                    case StageFinished(stage=stage):
                        stages.append(event)
                        if stage != sending.job.until:  # after the last stage the end follows at once, with everything
                            tell(stage_finished=asdict(event), number=len(stages))
                    case Ended(ending=ending):
                        return AttemptReply(ending, tuple(stages), Payload.of(path))
                    case _:
                        pass
            if _is_dropped(worker, sending.key):
                return AttemptReply(None)  # nobody waits for the answer; the process ends with the executor
            if sending.batch in _stopped:
                local.stop()


def collect(key: str) -> Payload | None:
    """Return the checkpoint of a job under way on this worker, as it is now; None if the job is not under way."""
    path = _under_way.get(key)
    return None if path is None else Payload.of(path)


def stop(batch: str) -> None:
    """End all jobs of a batch on this worker soon, and let none begin."""
    _stopped.add(batch)


def _is_first(key: str) -> bool:
    """Return whether this attempt is begun for the first time, on any worker.

    dask repeats the tasks of a worker that is gone by itself, several times. Whether a job is flown again is not for
    it to say: attempts are counted, and their reasons kept.
    """
    client: Any = distributed.get_client()  # pyright: ignore[reportUnknownMemberType]  (it has few annotations)
    begun = distributed.Event(key, client=client)
    if begun.is_set():
        return False
    begun.set()
    return True


def _is_dropped(worker: Any, key: str) -> bool:
    """Return whether nobody waits for this task any more: it was cancelled, or the client that asked for it is gone.

    dask offers a task no function to ask this, so the worker's own list of tasks is looked into.
    """
    task = worker.state.tasks.get(key)
    return task is None or task.state == "cancelled"


CONNECT = 4.0
"""The time in which the scheduler must be reached, s."""
REPLY = 5.0
"""The time in which a scheduler or a worker must answer, s."""

_log = logging.getLogger(__name__)


class Connection:
    """A connection to a scheduler whose workers all fitted when it was reached.

    Args:
        address: the address of the scheduler, e.g. `tcp://head:8786`.
        versions: the versions of airrace and of what its numbers depend on, by name. Workers with others get no jobs.

    Raises:
        ClusterError: the scheduler cannot be reached, or it or a worker lacks airrace or has other versions.
    """

    def __init__(self, address: str, versions: Mapping[str, str]) -> None:
        self.address = address
        self._versions = versions
        self._client = _client_of(address)
        self._fitting: dict[str, bool] = {}
        self._warned: set[str] = set()
        try:
            self._refuse_misfits()
        except BaseException:
            self.close()
            raise

    def threads(self) -> Mapping[str, int]:
        """Return the number of threads of each fitting worker, by its address."""
        known: Mapping[str, int] = self._client.nthreads(callback_timeout=REPLY)
        self._fitting = {one: fits for one, fits in self._fitting.items() if one in known}
        for worker, misfit in self._misfits([one for one in known if one not in self._fitting]).items():
            self._fitting[worker] = not misfit
            if misfit and misfit not in self._warned:
                self._warned.add(misfit)
                _log.warning("worker %s gets no jobs: it has %s", worker, misfit)
        return {worker: number for worker, number in known.items() if self._fitting.get(worker, False)}

    def submit(self, function: Callable[..., Any], argument: Any, *, key: str, workers: Sequence[str]) -> Any:
        """Submit a task that dask repeats only if its worker dies, and return its future."""
        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 GiB"}):  # a checkpoint is large
            return self._client.submit(
                function, argument, key=key, pure=False, retries=0, workers=list(workers), allow_other_workers=False
            )

    def call(self, function: Callable[..., Any], *arguments: Any, workers: Sequence[str]) -> Mapping[str, Any]:
        """Call a function in the processes of workers, beside their tasks, and return its results by address."""
        return self._client.run(function, *arguments, workers=list(workers), on_error="ignore", callback_timeout=REPLY)

    def forget(self, future: Any, key: str) -> None:
        """Release a task that is done, and the mark that it was begun."""
        future.release()
        Flag(key, client=self._client).clear()

    def cancel(self, futures: Sequence[Any]) -> None:
        """Cancel tasks, queued or running."""
        self._client.cancel(list(futures))

    def listen(self, topic: str, hear: Callable[[Any], None]) -> None:
        """Pass on everything that workers report under a topic; `hear` is called in another thread."""

        def heard(event: tuple[float, Any]) -> None:
            hear(event[1])

        self._client.subscribe_topic(topic, heard)

    def close(self) -> None:
        """Close the connection; the scheduler cancels tasks that are under way."""
        self._client.close(timeout=REPLY)

    def _refuse_misfits(self) -> None:
        """Begin nothing with a cluster whose scheduler or workers have other versions."""
        try:
            try:
                own = self._client.run_on_scheduler(version, "airrace", callback_timeout=REPLY)
            except PackageNotFoundError:
                raise ClusterError(f"the scheduler {self.address} has no airrace, which it needs as well") from None
            if own != self._versions["airrace"]:
                raise ClusterError(
                    f"the scheduler {self.address} has airrace {own}, here is {self._versions['airrace']}"
                )
            for worker, misfit in self._misfits(list(self._client.nthreads(callback_timeout=REPLY))).items():
                if misfit:
                    raise ClusterError(f"worker {worker} of {self.address} has {misfit}")
                self._fitting[worker] = True
        except ClusterError:
            raise
        except Exception as error:  # any error of the library
            raise ClusterError(f"the scheduler {self.address} does not answer as it should: {words(error)}") from error

    def _misfits(self, workers: Sequence[str]) -> Mapping[str, str]:
        """Return what is wrong with each of these workers, empty if nothing is.

        Workers that do not answer are left out.
        """
        if not workers:
            return {}
        found = dict.fromkeys(workers, "")
        for name, here in self._versions.items():
            answers = self._client.run(version, name, workers=list(workers), on_error="return", callback_timeout=REPLY)
            for worker in list(found):
                there = answers.get(worker)
                if isinstance(there, PackageNotFoundError):
                    found[worker] = found[worker] or f"no {name}"
                elif not isinstance(there, str):
                    del found[worker]
                elif there != here:
                    found[worker] = found[worker] or f"{name} {there}, here is {here}"
        return found


def words(error: BaseException) -> str:
    """Return an error of a library in one line of at most 300 characters."""
    return " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")[:300]


def _client_of(address: str) -> Any:
    for name in [one for one in logging.root.manager.loggerDict if one.partition(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported as the end of a job
    try:
        asyncio.run(asyncio.wait_for(_shake_hands(address), CONNECT))
        return Client(address, timeout=CONNECT, set_as_default=False, name="airrace")
    except TimeoutError as error:
        raise ClusterError(f"cannot reach the scheduler {address}: no answer within {CONNECT:g} s") from error
    except Exception as error:  # any error of the library: no such host, no answer, not an address
        raise ClusterError(f"cannot reach the scheduler {address}: {words(error)}") from error


async def _shake_hands(address: str) -> None:
    """Find out whether a scheduler is there at all.

    A client would wait for ever for one that listens and is silent.
    """
    security: Any = Security()
    comm = await cast(Any, connect)(address, timeout=CONNECT, **security.get_connection_args("client"))
    await comm.close()


WORKERS_WAIT = 600.0
"""The time for which a batch waits for a worker when there is none, s."""
LOOK = 1.0
"""The time between two looks at the workers, s."""
FETCH = 60.0
"""The time that may pass until a result is here, s."""


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
        command: arguments with which a worker's Python runs a job, see `airrace.batch.local`.
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
