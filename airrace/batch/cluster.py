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
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Self, cast

import dask.config
import distributed
from distributed import Client
from distributed.comm.core import connect  # pyright: ignore[reportUnknownVariableType]  (few annotations)
from distributed.security import Security

from airrace.batch.jobs import Job
from airrace.batch.local import GRACE, LocalExecutor
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
from airrace.checkpoint.atomic import replace_file
from airrace.errors import AirraceError, ClusterError, StorageError
from airrace.runs.command_result import ExitCode

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ClusterTimes:
    """The times of the conversation with a cluster, s.

    Attributes:
        connect: in which the scheduler must be reached.
        reply: in which a scheduler or a worker must answer.
        fetch: that may pass until a result is here.
        poll: between two looks of a worker whether its job is still wanted.
        look: between two looks at the workers.
        worker: for which a batch waits for a worker when there is none.
    """

    connect: float = 4.0
    reply: float = 5.0
    fetch: float = 60.0
    poll: float = 0.5
    look: float = 1.0
    worker: float = 600.0


TIMES = ClusterTimes()


class DamagedPayload(AirraceError):
    """An error of a file whose content is not what was sent."""


@dataclass(frozen=True)
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

    def unpack(self) -> bytes:
        """Return the bytes of the file, or raise `DamagedPayload` if they are not those that were sent."""
        arrived = hashlib.sha256(self.content).hexdigest()
        if arrived != self.sha256:
            raise DamagedPayload(f"damaged on its way (sha256 {arrived[:12]}... instead of {self.sha256[:12]}...)")
        return self.content


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class AttemptReply:
    """The result of an attempt with its checkpoint, as it travels back.

    `ending` is None if nothing was solved: the attempt had been begun before, on a worker that is gone.
    """

    ending: AttemptResult | None
    stages: tuple[StageFinished, ...] = ()
    checkpoint: Payload | None = None


# The process of a worker flies several jobs at once, in threads; `collect` and `stop` find them here.
_under_way: dict[str, Path] = {}
_stopped: set[str] = set()


def fly(payload: AttemptPayload) -> AttemptReply:
    """Fly a job, as a task of a worker: report its stages while it lasts, and end it when it is no longer wanted.

    dask repeats the tasks of a worker that is gone by itself, several times. Whether a job is repeated is not for it
    to say: attempts are counted, and their reasons stored.
    """
    worker: Any = distributed.get_worker()  # Any: here and below, `distributed` has few annotations
    client: Any = distributed.get_client()  # pyright: ignore[reportUnknownMemberType]
    begun = distributed.Event(payload.key, client=client)
    if begun.is_set():
        return AttemptReply(None)
    begun.set()

    def report(**said: object) -> None:
        worker.log_event(payload.batch, {"key": payload.key, **said})

    report(started=worker.address)
    stages: list[StageFinished] = []
    with (
        tempfile.TemporaryDirectory(prefix="airrace-", dir=worker.local_directory) as folder,
        LocalExecutor((sys.executable, *payload.command), 1) as local,
    ):
        path = Path(folder) / f"{payload.job.name}.h5"
        try:
            if payload.checkpoint is not None:
                path.write_bytes(payload.checkpoint.unpack())
        except DamagedPayload as error:
            return AttemptReply(_loss(f"its checkpoint was {error}"))
        _under_way[payload.key] = path
        try:
            local.submit(JobAttempt(payload.job, payload.attempt, path, payload.timeout))
            while True:
                for event in local.events(TIMES.poll):
                    match event:
                        case StageStarted(stage=stage):
                            report(stage_started=stage)
                        case StageFinished(stage=stage):
                            stages.append(event)
                            if stage != payload.job.until:  # after the last one the end follows, with everything
                                report(stage_finished=asdict(event), number=len(stages))
                        case Ended(ending=ending):
                            return AttemptReply(ending, tuple(stages), Payload.of(path))
                        case _:
                            pass
                # dask offers a task no function to ask whether it was cancelled, or its client is gone
                task = worker.state.tasks.get(payload.key)
                if task is None or task.state == "cancelled":
                    return AttemptReply(None)  # nobody waits for it; the process ends with the executor
                if payload.batch in _stopped:
                    local.stop()
        finally:
            del _under_way[payload.key]


def collect(key: str) -> Payload | None:
    """Return the checkpoint of a job under way on this worker, as it is now; None if the job is not under way."""
    path = _under_way.get(key)
    return None if path is None else Payload.of(path)


def stop(batch: str) -> None:
    """End all jobs of a batch on this worker soon, and let none begin."""
    _stopped.add(batch)


def _loss(message: str, wall: float = 0.0) -> AttemptResult:
    return AttemptResult(ExitCode.SYSTEM, message, wall, fault=FailureKind.LOST)


def words(error: BaseException) -> str:
    """Return an error of a library in one line of at most 300 characters."""
    return " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")[:300]


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
        self.client = _client_of(address)
        self._versions = versions
        self._fitting: dict[str, bool] = {}
        self._warned: set[str] = set()
        try:
            self._refuse_misfits()
        except BaseException:
            self.close()
            raise

    def threads(self) -> Mapping[str, int]:
        """Return the number of threads of each fitting worker, by its address."""
        known: Mapping[str, int] = self.client.nthreads(callback_timeout=TIMES.reply)
        self._fitting = {one: fits for one, fits in self._fitting.items() if one in known}
        for worker, misfit in self._misfits([one for one in known if one not in self._fitting]).items():
            self._fitting[worker] = not misfit
            if misfit and misfit not in self._warned:
                self._warned.add(misfit)
                _log.warning("worker %s gets no jobs: it has %s", worker, misfit)
        return {worker: number for worker, number in known.items() if self._fitting.get(worker, False)}

    def submit(self, function: Callable[..., Any], argument: Any, *, key: str, workers: Collection[str]) -> Any:
        """Submit a task that dask repeats only if its worker dies, and return its future."""
        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 GiB"}):  # a checkpoint is large
            return self.client.submit(
                function, argument, key=key, pure=False, retries=0, workers=list(workers), allow_other_workers=False
            )

    def call(self, function: Callable[..., Any], *arguments: Any, workers: Collection[str]) -> Mapping[str, Any]:
        """Call a function in the processes of workers, beside their tasks, and return its results by address."""
        return self.client.run(
            function, *arguments, workers=list(workers), on_error="ignore", callback_timeout=TIMES.reply
        )

    def forget(self, future: Any, key: str) -> None:
        """Release a task that is done, and the mark that it was begun."""
        future.release()
        distributed.Event(key, client=self.client).clear()

    def close(self) -> None:
        """Close the connection; the scheduler cancels tasks that are under way."""
        self.client.close(timeout=TIMES.reply)

    def _refuse_misfits(self) -> None:
        """Begin nothing with a cluster whose scheduler or workers have other versions."""
        here = self._versions["airrace"]
        try:
            try:
                there = self.client.run_on_scheduler(version, "airrace", callback_timeout=TIMES.reply)
            except PackageNotFoundError:
                raise ClusterError(f"the scheduler {self.address} has no airrace, which it needs as well") from None
            if there != here:
                raise ClusterError(f"the scheduler {self.address} has airrace {there}, here is {here}")
            for worker, misfit in self._misfits(list(self.client.nthreads(callback_timeout=TIMES.reply))).items():
                if misfit:
                    raise ClusterError(f"worker {worker} of {self.address} has {misfit}")
                self._fitting[worker] = True
        except ClusterError:
            raise
        except Exception as error:  # any error of the library
            raise ClusterError(f"the scheduler {self.address} does not answer as it should: {words(error)}") from error

    def _misfits(self, workers: Sequence[str]) -> Mapping[str, str]:
        """Return what is wrong with each of these workers that answer, empty if nothing is."""
        found = dict.fromkeys(workers, "")
        for name, here in self._versions.items() if workers else ():
            answers = self.client.run(version, name, workers=workers, on_error="return", callback_timeout=TIMES.reply)
            for worker in list(found):
                there = answers.get(worker)
                if isinstance(there, PackageNotFoundError):
                    found[worker] = found[worker] or f"no {name}"
                elif not isinstance(there, str):
                    del found[worker]
                elif there != here:
                    found[worker] = found[worker] or f"{name} {there}, here is {here}"
        return found


def _client_of(address: str) -> Any:
    """Return a client, which would wait for ever for a scheduler that listens and is silent: that is tried before."""
    for name in [one for one in logging.root.manager.loggerDict if one.partition(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported as the end of a job

    async def shake_hands() -> None:
        security: Any = Security()
        arguments = security.get_connection_args("client")
        comm = await cast(Any, connect)(address, timeout=TIMES.connect, **arguments)
        await comm.close()

    try:
        asyncio.run(asyncio.wait_for(shake_hands(), TIMES.connect))
        return Client(address, timeout=TIMES.connect, set_as_default=False, name="airrace")
    except TimeoutError as error:
        raise ClusterError(f"cannot reach the scheduler {address}: no answer within {TIMES.connect:g} s") from error
    except Exception as error:  # any error of the library: no such host, no answer, not an address
        raise ClusterError(f"cannot reach the scheduler {address}: {words(error)}") from error


@dataclass
class _RunningAttempt:
    """An attempt under way.

    Attributes:
        future: the future of its task.
        workers: the workers that may take it.
        since: the time when it was sent, later when it was begun, s.
        where: the worker that flies it; empty while it is queued.
        reported: the number of stages that were reported.
    """

    order: JobAttempt
    future: Any
    workers: frozenset[str]
    since: float
    where: str = ""
    reported: int = 0


class ClusterExecutor:
    """An executor that flies jobs on the workers of a scheduler.

    Args:
        address: the address of the scheduler.
        command: arguments with which a worker's Python runs a job, see `airrace.batch.local`.
        versions: the versions that workers must have, by name.
        slots: the largest number of jobs at a time; None for as many as workers have threads.
        wait: the time to wait for a worker when there is none, s; None for that of `TIMES`. After it jobs end
            without a flight, until there is one.
    """

    def __init__(
        self,
        address: str,
        command: Sequence[str],
        versions: Mapping[str, str],
        slots: int | None = None,
        wait: float | None = None,
    ) -> None:
        self._address = address
        self._command = tuple(command)
        self._versions = versions
        self._slots = slots
        self._wait = wait or TIMES.worker
        self._no_worker = f"no worker at {address} for {self._wait:g} s"
        self._batch = f"airrace-{secrets.token_hex(8)}"
        self._numbers = itertools.count(1)
        self._inbox: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()
        self._attempts: dict[str, _RunningAttempt] = {}
        self._pending: list[Event] = []
        self._threads: Mapping[str, int] = {}
        self._next_look = 0.0
        self._alone_since: float | None = None

    @property
    def slots(self) -> int:
        threads = sum(self._threads.values()) or (1 if self._gave_up else 0)
        return threads if self._slots is None else min(threads, self._slots)

    def submit(self, order: JobAttempt) -> None:
        name, key = order.job.name, f"{self._batch}-{next(self._numbers)}"
        if not self._threads:
            self._pending.append(Ended(name, _loss(self._no_worker)))
            return
        try:
            checkpoint = Payload.of(order.checkpoint)
            payload = AttemptPayload(
                key, self._batch, order.job, order.attempt, order.timeout, checkpoint, self._command
            )
            future = self._connection.submit(fly, payload, key=key, workers=self._threads)
        except Exception as error:  # the disk's, or any error of the library
            self._pending.append(Ended(name, _loss(f"it could not be sent to the cluster: {words(error)}")))
            return
        self._attempts[key] = _RunningAttempt(order, future, frozenset(self._threads), time.monotonic())

        def finish(_: object) -> None:
            self._inbox.put({"key": key, "done": True})

        future.add_done_callback(finish)

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
                self._hear(self._inbox.get(timeout=min(left, TIMES.look)))

    def stop(self) -> None:
        queued = [key for key, attempt in self._attempts.items() if not attempt.where]
        where = {attempt.where for attempt in self._attempts.values() if attempt.where}
        with contextlib.suppress(Exception):  # a worker does not answer; its jobs are cancelled below
            self._connection.call(stop, self._batch, workers=sorted(where & set(self._threads)))
        interrupted = AttemptResult(ExitCode.INTERRUPTED, "interrupted", 0.0, fault=FailureKind.STOPPED)
        self._end(queued, interrupted)
        deadline, ended = time.monotonic() + GRACE + 2.0, list[Event]()
        while self._attempts and time.monotonic() < deadline:
            ended += self.events(TIMES.look)
        self._end(list(self._attempts), interrupted)
        self._pending = [*ended, *self._pending]

    def __enter__(self) -> Self:

        def hear(event: tuple[float, Mapping[str, Any]]) -> None:
            self._inbox.put(event[1])

        self._connection = Connection(self._address, self._versions)
        self._connection.client.subscribe_topic(self._batch, hear)
        self._look()
        return self

    def __exit__(self, *raised: object) -> None:
        self._cancel(self._attempts.values())
        self._attempts = {}
        with contextlib.suppress(Exception):
            self._connection.close()

    @property
    def _gave_up(self) -> bool:
        return self._alone_since is not None and time.monotonic() - self._alone_since > self._wait

    def _look(self) -> None:
        """See which workers there are, now and then, and which attempts are lost."""
        now = time.monotonic()
        if now < self._next_look:
            return
        heard = True
        try:
            self._threads = self._connection.threads()
        except Exception:  # any error of the library, which ends attempts itself if the connection is lost
            self._threads, heard = dict[str, int](), False
        self._next_look = time.monotonic() + TIMES.look
        if self._threads:
            self._alone_since = None
        elif self._alone_since is None:
            self._alone_since = now
            _log.warning("no worker at %s: waiting for one, for %g s at most", self._address, self._wait)
        for key, one in list(self._attempts.items()):
            gone = one.where not in self._threads if one.where else one.workers.isdisjoint(self._threads)
            if heard and gone:
                self._end([key], _loss(_gone(one.where)))
            elif self._gave_up:
                self._end([key], _loss(self._no_worker))

    def _hear(self, said: Mapping[str, Any]) -> None:
        """Take in what a worker or a future reports; what concerns an attempt that has ended is ignored."""
        key = said["key"]
        attempt = self._attempts.get(key)
        if attempt is None:
            return
        name = attempt.order.job.name
        match said:
            case {"started": str(where)}:
                attempt.where, attempt.since = where, time.monotonic()
                self._pending.append(Started(name, where.rpartition("://")[2]))
            case {"stage_started": str(stage)}:
                self._pending.append(StageStarted(name, stage))
            case {"stage_finished": {**stage}, "number": int(number)} if number == attempt.reported + 1:
                # Its checkpoint is fetched, so that less is lost with the worker; else it comes with the end.
                with contextlib.suppress(Exception):  # any error of the library, a full disk, a damaged file
                    payload = self._connection.call(collect, key, workers=[attempt.where]).get(attempt.where)
                    if payload is not None:
                        replace_file(attempt.order.checkpoint, payload.unpack())
                        attempt.reported += 1
                        self._pending.append(StageFinished(**stage))
            case {"done": True}:
                self._receive(key, attempt)
            case _:
                pass

    def _receive(self, key: str, attempt: _RunningAttempt) -> None:
        """End an attempt as its task reports it."""
        try:
            reply = attempt.future.result(timeout=TIMES.fetch)
        except (Exception, asyncio.CancelledError) as error:  # of the task, of the library or of the connection
            self._end([key], _loss(f"its worker failed: {words(error)}"))
            return
        if reply.ending is None:
            self._end([key], _loss(_gone(attempt.where)))
            return
        del self._attempts[key]
        with contextlib.suppress(Exception):
            self._connection.forget(attempt.future, key)
        stages, ending = receive_checkpoint(attempt.order, reply)
        self._pending += [*stages[attempt.reported :], Ended(attempt.order.job.name, ending)]

    def _end(self, keys: Sequence[str], ending: AttemptResult) -> None:
        """Call attempts off, and report that they ended so, each after its own time."""
        attempts = [self._attempts.pop(key) for key in keys]
        self._cancel(attempts)
        for one in attempts:
            self._pending.append(Ended(one.order.job.name, replace(ending, wall=time.monotonic() - one.since)))

    def _cancel(self, attempts: Collection[_RunningAttempt]) -> None:
        with contextlib.suppress(Exception):  # any error of the library: the attempts count as ended already
            if attempts:
                self._connection.client.cancel([one.future for one in attempts])


def receive_checkpoint(order: JobAttempt, reply: AttemptReply) -> tuple[Sequence[StageFinished], AttemptResult]:
    """Put the checkpoint that came back where it belongs, if it is what was sent.

    Returns:
        The stages in it, and how the attempt ended: as the worker says, or with what went wrong here.
    """
    assert reply.ending is not None  # the caller has made sure of that
    wall = reply.ending.wall
    try:
        if reply.checkpoint is not None:
            replace_file(order.checkpoint, reply.checkpoint.unpack())
    except DamagedPayload as error:
        return (), _loss(f"its checkpoint came back {error}", wall)
    except StorageError as error:
        return (), AttemptResult(ExitCode.SYSTEM, str(error), wall)
    return reply.stages, reply.ending


def _gone(where: str) -> str:
    return f"its worker{where and ' '}{where.rpartition('://')[2]} is gone"
