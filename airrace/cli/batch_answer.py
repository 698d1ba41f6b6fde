"""The answer of a batch: its object, its tables, its reports and its exit code."""

import os
import sys
from collections.abc import Hashable, Sequence
from pathlib import Path

from airrace.batch.planning import BatchPlan, JobResult
from airrace.batch.reports import (
    annotations,
    append_summary,
    batch_table,
    counts,
    counts_words,
    junit_report,
    markdown_report,
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
        taken = {identity(path) for path in plan.files()} if paths else set[Hashable]()
        for path in paths:
            ensure_free(path, force=True, sources=plan.read)
            if identity(path) in taken:
                raise UsageError(f"{path} is another file that this batch writes; name another one for the report")
            taken.add(identity(path))


def describe_plan(answer: CommandResult, plan: BatchPlan, *, quiet: bool) -> None:
    """Fill in the answer of `--dry-run`."""
    actions = [step.action for step in plan.steps]
    objects = [step.as_object() for step in plan.steps]
    answer.fields = {
        "jobs": objects,
        "counts": {action: actions.count(action) for action in ("fly", "keep", "refuse")},
    }
    if not quiet:
        lines = [
            f"{one['name']}: {one['action']}" + (f" ({one['reason']})" if one["reason"] else "") for one in objects
        ]
        answer.texts.append("\n".join([*lines, plan_line(plan)]))
    _fail_for_inputs(answer, plan, [step.known for step in plan.steps if step.known and step.action == "refuse"])


def answer_with(
    answer: CommandResult, plan: BatchPlan, results: Sequence[JobResult], reports: Reports, *, wall: float, quiet: bool
) -> None:
    """Fill in the answer of a batch, and write its reports.

    Raises:
        StorageError: a report cannot be written; everything else is in the answer by then.
    """
    rows = ranking_of(plan, results)
    summaries = wind_summaries(rows)
    code = worst(ExitCode(result.code) if result.code in list(ExitCode) else ExitCode.BUG for result in results)
    answer.fields = {
        "certified": bool(rows) and code is ExitCode.DONE and not plan.findings,
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
    if code is not ExitCode.DONE:
        hint = "; the same command goes on" if code is ExitCode.INTERRUPTED else ""
        answer.fail(code, f"not all jobs are certified: {counts_words(rows)}{hint}", answer.findings)
    if os.environ.get("GITHUB_ACTIONS") == "true":
        for line in annotations(rows, plan.findings):
            print(line, file=sys.stderr)
        append_summary(markdown_report(rows, summaries))
    for path, report in (
        (reports.csv, lambda: batch_table(rows).csv(end="\r\n")),  # as RFC 4180 has it
        (reports.junit, lambda: junit_report(rows)),
        (reports.markdown, lambda: markdown_report(rows, summaries)),
    ):
        if path is not None:  # names of files may hold bytes that UTF-8 cannot
            write_text(path, report().encode("utf-8", "backslashreplace").decode())


def _fail_for_inputs(answer: CommandResult, plan: BatchPlan, results: Sequence[JobResult]) -> None:
    """Report all findings, each once."""
    findings = list(dict.fromkeys([*plan.findings, *(finding for one in results for finding in one.findings)]))
    if findings:
        number = len(findings)
        more = [] if number <= FINDINGS_MAX else [Finding("", 0, 0, "", f"and {number - FINDINGS_MAX} more findings")]
        text = f"some input is not valid: {number} finding{'' if number == 1 else 's'}"
        answer.fail(ExitCode.INVALID_INPUT, text, [*findings[:FINDINGS_MAX], *more])
