"""The answer of a batch: its object, its tables, its reports and its exit code."""

import sys
from collections.abc import Hashable, Iterator, Sequence
from pathlib import Path

from airrace.batch import reports as github
from airrace.batch.planning import BatchPlan, JobResult
from airrace.batch.reports import (
    BatchResult,
    WindSummary,
    counts,
    counts_words,
    csv_text,
    junit_text,
    markdown_text,
    ranking_of,
    wind_summaries,
)
from airrace.cli.batch_tables import plan_line, ranking_tables, wind_tables
from airrace.cli.tables import rendered, terminal_columns
from airrace.errors import Finding, UsageError
from airrace.records import record
from airrace.runs.command_result import CommandResult, ExitCode, worst
from airrace.runs.output import ensure_free, identity, write_text
from airrace.standard_streams import STANDARD

FINDINGS_MAX = 500
"""The largest number of findings that are printed for a batch."""


@record
class Reports:
    """The files that are written at the end, each None if it is not wanted. Every call replaces them."""

    csv: Path | None
    junit: Path | None
    markdown: Path | None

    def ensure_writable(self, plan: BatchPlan) -> None:
        """Make sure, before anything is flown, that the reports can be written and would spoil nothing.

        Raises:
            UsageError: one is a folder or read by the batch, or is another file that the batch writes.
            StorageError: a folder does not exist or takes no files.
        """
        paths = [path for path in (self.csv, self.junit, self.markdown) if path is not None]
        written = {identity(path) for path in plan.files()} if paths else set[Hashable]()
        for path in paths:
            ensure_free(path, force=True, sources=plan.read)
            if identity(path) in written:
                raise UsageError(f"{path} is another file that this batch writes; name another one for the report")
            written.add(identity(path))

    def write(self, rows: Sequence[BatchResult], summaries: Sequence[WindSummary]) -> None:
        """Write all reports that are wanted.

        Raises:
            StorageError: the system refused.
        """
        if self.csv is not None:
            write_text(self.csv, _writable(csv_text(rows)))
        if self.junit is not None:
            write_text(self.junit, junit_text(rows))
        if self.markdown is not None:
            write_text(self.markdown, _writable(markdown_text(rows, summaries)))


def _writable(text: str) -> str:
    """Return a text that UTF-8 can hold; names of files may hold bytes that it cannot."""
    return text.encode("utf-8", "backslashreplace").decode()


def describe_plan(answer: CommandResult, plan: BatchPlan, *, quiet: bool) -> None:
    """Fill in the answer of `--dry-run`."""
    actions = [step.action for step in plan.steps]
    totals = {action: actions.count(action) for action in ("fly", "keep", "refuse")}
    answer.fields = {"jobs": [step.as_object() for step in plan.steps], "counts": totals}
    if not quiet:
        lines = [
            f"{step.name}: {step.action}" + (f" ({told})" if (told := str(step.as_object()["reason"])) else "")
            for step in plan.steps
        ]
        answer.texts.append("\n".join([*lines, plan_line(plan)]))
    refused = [step.known for step in plan.steps if step.known is not None and step.action == "refuse"]
    _fail_for_inputs(answer, plan, refused)


def answer_with(
    answer: CommandResult, plan: BatchPlan, results: Sequence[JobResult], reports: Reports, *, wall: float, quiet: bool
) -> None:
    """Fill in the answer of a batch, and write its reports.

    Raises:
        StorageError: a report cannot be written; everything else is in the answer by then.
    """
    rows = ranking_of(plan, results)
    summaries = wind_summaries(rows)
    codes = [_code(result) for result in results]
    answer.fields = {
        "certified": bool(rows) and worst(codes) is ExitCode.DONE and not plan.findings,
        "wall_s": wall,
        "counts": counts(rows),
        "jobs": [row.as_object() for row in rows],
        "winds": [summary.as_object() for summary in summaries],
    }
    if not quiet and STANDARD not in (reports.csv, reports.junit, reports.markdown):
        columns = terminal_columns()
        tables = (*ranking_tables(rows, columns), *wind_tables(summaries, columns))
        answer.texts.extend(rendered(table) for table in tables)
    _fail_for_inputs(answer, plan, results)
    code = worst(codes)
    if code is not ExitCode.DONE:
        hint = "; the same command goes on" if code is ExitCode.INTERRUPTED else ""
        answer.fail(code, f"not all jobs are certified: {counts_words(rows)}{hint}", answer.findings)
    if github.runs_here():
        for line in github.annotations(rows, plan.findings):
            print(line, file=sys.stderr)
        github.append_summary(markdown_text(rows, summaries))
    reports.write(rows, summaries)


def _fail_for_inputs(answer: CommandResult, plan: BatchPlan, results: Sequence[JobResult]) -> None:
    """Report all findings, each once."""
    findings = list(dict.fromkeys(_findings(plan, results)))
    if findings:
        number = len(findings)
        more = [] if number <= FINDINGS_MAX else [Finding("", 0, 0, "", f"and {number - FINDINGS_MAX} more findings")]
        text = f"some input is not valid: {number} finding{'' if number == 1 else 's'}"
        answer.fail(ExitCode.INVALID_INPUT, text, [*findings[:FINDINGS_MAX], *more])


def _findings(plan: BatchPlan, results: Sequence[JobResult]) -> Iterator[Finding]:
    yield from plan.findings
    for result in results:
        yield from result.findings


def _code(result: JobResult) -> ExitCode:
    try:
        return ExitCode(result.code)
    except ValueError:
        return ExitCode.BUG
