"""Jobs on a cluster: tasks of dask.distributed, which decides where each runs and repeats those of lost workers."""

import asyncio
import logging
import secrets
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self, cast

import dask.config
import distributed
from distributed import Client
from distributed.comm.core import connect  # pyright: ignore[reportUnknownVariableType]  (few annotations)
from distributed.security import Security

from airrace.errors import ClusterError, StorageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.runs.batch.jobs import Job
from airrace.runs.batch.local import run_job
from airrace.runs.batch.supervision import POLL, AttemptResult, JobPool
from airrace.runs.command_result import ExitCode

CONNECT_TIME = 4.0
"""The time in which a scheduler must be reached, s."""
REPLY_TIME = 5.0
"""The time in which a scheduler or a worker must answer, s."""
LOOK_PERIOD = 1.0
"""The time between two looks at the workers, s."""
WORKER_TIME = 600.0
"""The time for which a batch waits for a worker when there is none, s."""

_log = logging.getLogger(__name__)


def run_on_worker(
    command: Sequence[str], job: Job, checkpoint: bytes | None, timeout: float | None, topic: str
) -> tuple[AttemptResult, bytes | None]:
    """Run a job, as a task of a worker, in a process that ends when the task is cancelled or its client is gone.

    Args:
        command: arguments with which the worker's Python runs a job.
        checkpoint: the checkpoint of earlier attempts.
        topic: of dask's log, under which stages are reported.

    Returns:
        The end of the job, and its checkpoint.
    """
    worker: Any = distributed.get_worker()  # Any: here and below, `distributed` has few annotations
    key = worker.get_current_task()

    def report(line: Mapping[str, Any]) -> None:
        worker.log_event(topic, {"name": job.name, "report": line})

    def cancelled() -> bool:  # dask offers no function for it
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    with tempfile.TemporaryDirectory(prefix="airrace-", dir=worker.local_directory) as folder:
        path = Path(folder) / f"{job.name}.h5"
        if checkpoint is not None:
            path.write_bytes(checkpoint)
        report({"started": worker.address.rpartition("://")[2]})
        result = run_job(
            (sys.executable, *command),
            job,
            path,
            timeout,
            report=report,
            stop_asked=lambda: False,
            kill_asked=cancelled,
        )
        return result, path.read_bytes() if path.exists() else None


class ClusterPool(JobPool):
    """Jobs on the workers of a scheduler.

    Args:
        address: the address of the scheduler, e.g. `tcp://head:8786`.
        command: arguments with which a worker's Python runs a job, see `airrace.runs.batch.local`.
        versions: the versions of airrace and of what its numbers depend on, by name. Workers with others get no jobs.
        slots: the largest number of jobs at a time; None for as many as workers have threads.
        wait: the time to wait for a worker when there is none, s; None for `WORKER_TIME`.
    """

    def __init__(
        self,
        address: str,
        command: Sequence[str],
        versions: Mapping[str, str],
        slots: int | None = None,
        wait: float | None = None,
    ) -> None:
        super().__init__()
        self._address = address
        self._command = tuple(command)
        self._versions = versions
        self._slots = slots
        self._wait = wait or WORKER_TIME
        self._topic = f"airrace-{secrets.token_hex(8)}"
        self._threads_of: dict[str, int] = {}  # of each worker that fits
        self._mismatches: dict[str, str] = {}  # by worker, empty where it fits
        self._next_look = 0.0
        self._alone_since: float | None = None

    def __enter__(self) -> Self:
        """Connect to the scheduler.

        Raises:
            ClusterError: it cannot be reached, or it or a worker lacks airrace or has other versions.
        """
        self._client: Any = _connect(self._address)
        try:
            self._refuse_other_versions()
            self._client.subscribe_topic(self._topic, self._take_report)
        except ClusterError:
            self.__exit__()
            raise
        except Exception as error:  # any error of the library
            self.__exit__()
            text = f"the scheduler {self._address} does not answer as it should: {_describe(error)}"
            raise ClusterError(text) from error
        return self

    def __exit__(self, *raised: object) -> None:
        super().__exit__(*raised)
        self._client.close(timeout=REPLY_TIME)

    @property
    def slots(self) -> int:
        if time.monotonic() >= self._next_look:
            self._look()
        threads = 0 if self._alone_since is not None else sum(self._threads_of.values())
        return threads if self._slots is None else min(threads, self._slots)

    def run(self, job: Job, checkpoint: Path, timeout: float | None) -> AttemptResult:
        began, workers = time.monotonic(), frozenset(self._threads_of)
        done = threading.Event()

        def finish(_: object) -> None:
            done.set()

        def failed(message: str, code: ExitCode = ExitCode.SYSTEM) -> AttemptResult:
            return AttemptResult(code, message, time.monotonic() - began)

        try:
            content = checkpoint.read_bytes() if checkpoint.exists() else None
            future = self._client.submit(
                run_on_worker,
                *(self._command, job, content, timeout, self._topic),
                pure=False,
                workers=list(workers),
            )
            future.add_done_callback(finish)
            while not done.wait(POLL):
                if self.stop_asked.is_set() or self.kill_asked.is_set():
                    future.cancel()
                    return failed("interrupted", ExitCode.INTERRUPTED)
                if workers.isdisjoint(self._threads_of):
                    future.cancel()
                    return failed("its worker is gone")
            result, content = future.result()
        except (Exception, asyncio.CancelledError) as error:  # any error of the library
            return failed(f"its worker failed: {_describe(error)}")
        try:
            if content is not None:
                replace_file(checkpoint, content)
        except StorageError as error:
            return failed(str(error))
        return result

    def _take_report(self, event: tuple[float, Mapping[str, Any]]) -> None:
        self.progress.put((event[1]["name"], event[1]["report"]))

    def _look(self) -> None:
        """See which workers there are.

        Raises:
            ClusterError: there has been none for too long.
        """
        try:
            threads = self._client.nthreads(callback_timeout=REPLY_TIME)
            if not threads.keys() <= self._mismatches.keys():
                for worker, answer in self._client.get_versions(packages=list(self._versions))["workers"].items():
                    mismatch = self._mismatch(answer["packages"])
                    if mismatch and mismatch not in self._mismatches.values():
                        _log.warning("worker %s gets no jobs: it has %s", worker, mismatch)
                    self._mismatches[worker] = mismatch
            self._threads_of = {name: number for name, number in threads.items() if self._mismatches.get(name) == ""}
            alone = not self._threads_of
        except Exception:  # any error of the library
            alone = True
        now = time.monotonic()
        self._next_look = now + LOOK_PERIOD
        if not alone:
            self._alone_since = None
        elif self._alone_since is None:
            self._alone_since = now
            _log.warning("no worker at %s: waiting for one, for %g s at most", self._address, self._wait)
        elif now - self._alone_since > self._wait:
            raise ClusterError(f"no worker at {self._address} for {self._wait:g} s")

    def _refuse_other_versions(self) -> None:
        """Begin nothing with a cluster whose scheduler or workers have other versions."""
        versions = self._client.get_versions(packages=list(self._versions))
        version, scheduler_version = self._versions["airrace"], versions["scheduler"]["packages"]["airrace"]
        if scheduler_version is None:
            raise ClusterError(f"the scheduler {self._address} has no airrace, which it needs as well")
        if scheduler_version != version:
            raise ClusterError(f"the scheduler {self._address} has airrace {scheduler_version}, here is {version}")
        for worker, answer in versions["workers"].items():
            if mismatch := self._mismatch(answer["packages"]):
                raise ClusterError(f"worker {worker} of {self._address} has {mismatch}")

    def _mismatch(self, packages: Mapping[str, str | None]) -> str:
        """Return the first version that is another one than here; empty where all are the same."""
        for name, version in self._versions.items():
            package_version = packages.get(name)
            if package_version is None:
                return f"no {name}"
            if package_version != version:
                return f"{name} {package_version}, here is {version}"
        return ""


def _connect(address: str) -> Any:
    for name in logging.root.manager.loggerDict:
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported as the end of a job
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 GiB"})  # a checkpoint is large

    async def shake_hands() -> None:  # a client would wait for ever for a scheduler that listens and is silent
        arguments = cast(Any, Security)().get_connection_args("client")
        comm = await cast(Any, connect)(address, timeout=CONNECT_TIME, **arguments)
        await comm.close()

    try:
        asyncio.run(asyncio.wait_for(shake_hands(), CONNECT_TIME))
        return Client(address, timeout=CONNECT_TIME, set_as_default=False, name="airrace")
    except TimeoutError as error:
        raise ClusterError(f"cannot reach the scheduler {address}: no answer within {CONNECT_TIME:g} s") from error
    except Exception as error:  # any error of the library: no such host, no answer, not an address
        raise ClusterError(f"cannot reach the scheduler {address}: {_describe(error)}") from error


def _describe(error: BaseException) -> str:
    """Return an error of a library in one line of at most 300 characters."""
    return " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")[:300]
