"""A job on a worker of a cluster: what travels there, the run itself, and what comes back.

Nothing is shared with the machine that planned the job: texts and the bytes of a checkpoint travel, each file with its
sha256. On the worker the job is flown in a temporary folder by the executor of a single machine, `local.py`: in a
process of its own, with its time limit.
"""

import hashlib
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import distributed

from airrace.batch.executor import Attempt, AttemptResult, Ended, FailureKind, StageFinished, StageStarted
from airrace.batch.job import Job
from airrace.batch.local import LocalExecutor
from airrace.errors import AirraceError
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
        """Pack a file as it is now; return None if there is none.

        Raises:
            OSError: the file cannot be read.
        """
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        return cls(content, hashlib.sha256(content).hexdigest())

    def unpacked(self) -> bytes:
        """Return the bytes of the file.

        Raises:
            DamagedParcel: they are not those that were sent.
        """
        arrived = hashlib.sha256(self.content).hexdigest()
        if arrived != self.sha256:
            raise DamagedPayload(f"damaged on its way (sha256 {arrived[:12]}... instead of {self.sha256[:12]}...)")
        return self.content


@record
class AttemptPayload:
    """An attempt at a job, as it travels to a worker.

    Attributes:
        key: names this attempt and no other, on the whole cluster.
        batch: names the batch likewise; what workers tell while they fly comes under this name.
        job, attempt, timeout: see `executor.Attempt`.
        checkpoint: the checkpoint of earlier attempts, if there is one.
        command: arguments with which the worker's Python runs a job, see `process.py`.
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
    """The result of an attempt, as it travels back.

    Attributes:
        ending: None if nothing was flown: the attempt had been begun before, on a worker that is gone.
        stages: the stages that it finished.
        checkpoint: the checkpoint that was left behind, if any.
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
