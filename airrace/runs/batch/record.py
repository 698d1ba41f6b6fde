"""Records of jobs: how a job ended, and on which inputs. Each is a small JSON file, replaced atomically.

A record is read instead of the checkpoint, so that thousands of jobs are looked through in seconds. It describes the
checkpoint well enough to notice one that is missing or was changed.
"""

import hashlib
import json
import os
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Self

from airrace.errors import AirraceError, Finding, StorageError, UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.runs.batch.jobs import Fingerprint, Job
from airrace.runs.command_result import ExitCode
from airrace.runs.execute import file_lock

SCHEMA = "airrace/job/1"
SIZE_MAX = 64 * 1024 * 1024
"""The size up to which a record is read, bytes."""


class RecordError(AirraceError):
    """An error of a job's record that cannot be used."""


@dataclass(frozen=True)
class FileMark:
    """A mark that tells whether a file has changed: its size (bytes), sha256 (hex) and time of change (ns)."""

    size: int
    sha256: str
    changed_ns: int

    @classmethod
    def of(cls, path: Path) -> Self | None:
        """Return the mark of a file as it is now, or None if it cannot be read."""
        try:
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256")
            status = path.stat()
        except OSError:
            return None
        return cls(status.st_size, digest.hexdigest(), status.st_mtime_ns)

    def difference(self, path: Path) -> str:
        """Return what is different about the file now, as a clause; empty if nothing is.

        Its content is read only if its time of change differs.
        """
        try:
            status = path.stat()
        except OSError:
            return "its checkpoint is missing"
        if status.st_size != self.size:
            return f"its checkpoint has changed (from {self.size} to {status.st_size} bytes)"
        if status.st_mtime_ns != self.changed_ns:
            now = FileMark.of(path)
            if now is None or now.sha256 != self.sha256:
                return "its checkpoint has changed (in its content)"
        return ""


@dataclass(frozen=True)
class JobRecord:
    """A job's record as it is stored on disk.

    Attributes:
        fingerprint: what it was solved with.
        ended: whether it has ended; otherwise it was under way when this was written.
        code, message, wall: the end of its last attempt, see `AttemptResult`.
        retries: why earlier attempts of the same call were not the last.
        run: the object of `airrace optimize --json`, None where there is none.
        findings: what was wrong with its inputs.
        checkpoint: as left behind; None if there was none.
    """

    fingerprint: Fingerprint
    ended: bool
    code: int = 0
    message: str = ""
    wall: float = 0.0
    retries: tuple[str, ...] = ()
    run: Mapping[str, Any] | None = None  # Any: JSON
    findings: tuple[Finding, ...] = ()
    checkpoint: FileMark | None = None


def checkpoint_path(folder: Path, name: str) -> Path:
    """Return the path of a job's checkpoint."""
    return folder / f"{name}.h5"


def record_path(folder: Path, name: str) -> Path:
    """Return the path of a job's record."""
    return folder / f"{name}.json"


def write_record(folder: Path, name: str, record: JobRecord) -> None:
    """Write the record of a job, in place of an earlier one.

    Raises:
        StorageError: the system refused.
    """
    text = json.dumps({"schema": SCHEMA, **asdict(record)}, allow_nan=False)
    replace_file(record_path(folder, name), text.encode())


def read_record(folder: Path, name: str) -> JobRecord | None:
    """Return the record of a job, or None if there is none.

    Raises:
        RecordError: there is one that cannot be used; the text says why, a clause.
    """
    try:
        with record_path(folder, name).open("rb") as file:
            plain = json.loads(file.read(SIZE_MAX))
        if plain["schema"] != SCHEMA:
            raise RecordError("its record is from another version of airrace")
        return _record_of(plain)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RecordError(f"its record cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise RecordError("its record is damaged") from error


# Any: JSON; what is not as it should be raises on the way.
def _record_of(plain: Mapping[str, Any]) -> JobRecord:
    run, mark = plain["run"], plain["checkpoint"]
    if run is not None:
        float(run["race_time_s"] or 0.0)
        run["stages"]
    return JobRecord(
        fingerprint=Fingerprint(**plain["fingerprint"]),
        ended=plain["ended"] is True,
        code=int(plain["code"]),
        message=str(plain["message"]),
        wall=float(plain["wall"]),
        retries=tuple(map(str, plain["retries"])),
        run=run,
        findings=tuple(Finding(**finding) for finding in plain["findings"]),
        checkpoint=None if mark is None else FileMark(int(mark["size"]), str(mark["sha256"]), int(mark["changed_ns"])),
    )


VERDICTS = (ExitCode.DONE, ExitCode.INFEASIBLE, ExitCode.NOT_CERTIFIED)
"""The exit codes to which the same inputs would lead again: these ends are answers, not accidents."""


class Repeat(Enum):
    """The finished jobs that are repeated."""

    NONE = "none"
    FAILED = "failed"
    ALL = "all"


def reason_to_fly(job: Job, folder: Path, repeat: Repeat) -> tuple[str, JobRecord | None]:
    """Return why a job has to run, as a clause, and its record.

    Returns:
        The reason, empty if the job is finished and nothing it depends on has changed; the record where there is one.
    """
    try:
        record = read_record(folder, job.name)
    except RecordError as error:
        return str(error), None
    checkpoint = checkpoint_path(folder, job.name)
    if repeat is Repeat.ALL:
        return "asked for", record
    if record is None:
        return ("its record is missing" if checkpoint.exists() else "new"), None
    reason = ""
    if changes := job.fingerprint.changes(record.fingerprint):
        reason = "; ".join(changes)
    elif not record.ended:
        reason = "it was not finished"
    elif record.code == ExitCode.INVALID_INPUT:
        reason = "its input was not valid"
    elif record.code == ExitCode.INTERRUPTED:
        reason = "it was interrupted"
    elif record.code not in VERDICTS:
        reason = f"it failed: {record.message}"
    elif record.code != ExitCode.DONE and repeat is Repeat.FAILED:
        reason = f"asked for, since it failed: {record.message}"
    elif record.checkpoint is None:
        reason = "it left no checkpoint"
    else:
        reason = record.checkpoint.difference(checkpoint)
    return reason, record


def ensure_folder(folder: Path) -> None:
    """Find out whether a folder for runs can be written to, or made where it is missing.

    Raises:
        UsageError: it is no folder.
        StorageError: it takes no files.
    """
    nearest = folder
    while not os.path.lexists(nearest) and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise UsageError(f"{folder} is not a folder; name one with --output")
    if not os.access(nearest, os.W_OK):
        raise StorageError(f"cannot write to the folder {folder}: permission denied")


def make_folder(folder: Path) -> None:
    """Create a folder for runs if it is missing, and find out now whether it can be written to.

    Raises:
        UsageError: it is no folder.
        StorageError: the system refused.
    """
    ensure_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"cannot write to the folder {folder}: {error.strerror}") from error


@contextmanager
def lock_folder(folder: Path) -> Generator[None, None, None]:
    """Create the folder if it is missing, and lock it. The system releases the lock when this process ends in any way.

    Raises:
        UsageError: another batch holds it, or it is no folder.
        StorageError: the system refused.
    """
    make_folder(folder)
    with file_lock(folder / ".batch.lock") as refused:
        if refused:
            raise UsageError(f"another batch is at work in {folder}; wait for it, or give --output")
        yield
