"""The decision which jobs of a batch are done already, and why another one is flown again."""

from collections.abc import Mapping
from enum import Enum
from pathlib import Path

from airrace.batch.job import Job
from airrace.batch.record import Record, RecordError, checkpoint_path, read_record
from airrace.runs.exit_codes import ExitCode

VERDICTS = (ExitCode.DONE, ExitCode.INFEASIBLE, ExitCode.NOT_CERTIFIED)
"""The exit codes to which the same inputs would lead again: these ends are answers, not accidents."""

REASONS: Mapping[int, str] = {
    ExitCode.INVALID_INPUT: "its input was not valid",
    ExitCode.INTERRUPTED: "it was interrupted",
}
"""The reason for which a job is flown again, by the exit code that it ended with."""


class Choice(Enum):
    """A choice of the finished jobs that are flown again."""

    NONE = "none"
    FAILED = "failed"
    ALL = "all"


def reason_to_fly(job: Job, folder: Path, choice: Choice) -> tuple[str, Record | None]:
    """Return why a job has to be flown, as a clause, and its record.

    Returns:
        The reason, empty if the job is finished and nothing it depends on has changed; the record where there is one.
    """
    try:
        record = read_record(folder, job.name)
    except RecordError as error:
        return str(error), None
    if choice is Choice.ALL:
        return "asked for", record
    if record is None:
        known = checkpoint_path(folder, job.name).exists()
        return ("its record is missing" if known else "new"), None
    return _reason(job, record, folder, choice), record


def _reason(job: Job, record: Record, folder: Path, choice: Choice) -> str:
    changes = job.fingerprint.changes(record.fingerprint)
    if changes:
        return "; ".join(changes)
    if not record.ended:
        return "it was not finished"
    if record.code not in VERDICTS:
        return REASONS.get(record.code, f"it failed: {record.message}")
    if record.code != ExitCode.DONE and choice is Choice.FAILED:
        return f"asked for, since it failed: {record.message}"
    if record.checkpoint is None:
        return "it left no checkpoint"
    return record.checkpoint.difference(checkpoint_path(folder, job.name))
