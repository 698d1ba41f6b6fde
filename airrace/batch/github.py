"""The messages to GitHub Actions: annotations of the files that are wrong, and a summary of the run."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from airrace.batch.ranking import RankingRow
from airrace.errors import Finding, StorageError
from airrace.runs.command_result import ExitCode

ANNOTATIONS_MAX = 50
"""The largest number of annotations; GitHub shows ten of a step."""


def runs_here(environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether this process is a step of GitHub Actions."""
    return environment.get("GITHUB_ACTIONS") == "true"


def annotations(rows: Sequence[RankingRow], findings: Sequence[Finding]) -> Iterator[str]:
    """Yield commands of a workflow, one per line: an error for every finding and every job that is not certified."""
    lines = dict.fromkeys([*(_of_finding(one) for one in findings), *(line for row in rows for line in _of_row(row))])
    told = list(lines)
    yield from told[:ANNOTATIONS_MAX]
    if len(told) > ANNOTATIONS_MAX:
        yield f"::warning title=airrace::and {len(told) - ANNOTATIONS_MAX} more errors"


def append_summary(text: str, environment: Mapping[str, str] = os.environ) -> None:
    """Append Markdown to the summary of the step, if there is one.

    Raises:
        StorageError: the system refused.
    """
    path = environment.get("GITHUB_STEP_SUMMARY")
    if not path:
        return
    try:
        with Path(path).open("a", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
    except OSError as error:
        raise StorageError(f"cannot write to the step summary {path}: {error.strerror}") from error


def _of_row(row: RankingRow) -> Iterator[str]:
    if row.result.findings:
        yield from map(_of_finding, row.result.findings)
    elif row.result.code != ExitCode.DONE:
        yield _error(f"{row.step.name}: {row.state}", row.result.message, row.step.track, 0, 0)


def _of_finding(finding: Finding) -> str:
    return _error(finding.key or "airrace", finding.message, finding.file, finding.line, finding.column)


def _error(title: str, message: str, file: str, line: int, column: int) -> str:
    places = {
        "file": "" if file.startswith("--") else file,
        "line": line,
        "col": column,
        "title": title,
    }
    properties = ",".join(f"{name}={_escaped(str(value), ':,')}" for name, value in places.items() if value)
    return f"::error {properties}::{_escaped(message, '')}"


def _escaped(text: str, also: str) -> str:
    for character in "%\r\n" + also:
        text = text.replace(character, f"%{ord(character):02X}")
    return text
