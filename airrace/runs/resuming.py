"""A run that is resumed: continued where it ended, or flown again with something changed."""

from pathlib import Path

from airrace.procedure.settings import MeshCheck
from airrace.runs.continuation import continuation, starting_steps
from airrace.runs.output import documents_of, ensure_unread
from airrace.runs.run import Run
from airrace.runs.stage_names import stage_named
from airrace.runs.starting import Changes, another, changed_run, last_stage, proved_otherwise
from airrace.runs.task import Task


def continued_task(
    run: Run, *, until: str | None = None, from_stage: str | None = None, mesh_check: MeshCheck | str | None = None
) -> Task:
    """Return what is left of a run: the stages after the last one that still stands, and proofs to be completed.

    Args:
        run: the stored run.
        until: the name of the last stage; None for the last one there is.
        from_stage: the name of a stage that is computed again although it may still stand; None for none.
        mesh_check: which stages are proved from now on; None for what the run's settings say.

    Raises:
        InputError: `mesh_check` is not known.
        UsageError: no such stage, or `from_stage` comes after `until`.
    """
    again = None if from_stage is None else stage_named(from_stage)
    run = run if mesh_check is None else proved_otherwise(run, mesh_check)
    return continuation(run, until=stage_named(until), from_stage=again)


def changed_task(before: Run, changes: Changes, *, until: str | None = None, out: Path | None = None) -> Task:
    """Return a new run with other inputs, started from the highest stage that holds of one that exists.

    Args:
        before: the run that exists.
        changes: what is otherwise.
        until: the name of the last stage; None for the last one that the other run holds.
        out: the checkpoint to be written; None for a run that is kept in memory alone.

    Raises:
        InputError: the changed inputs are not valid; it carries all findings.
        UsageError: there is nothing to start from, or the file to be written is one that is read.
    """
    last = last_stage(before) if until is None else stage_named(until)
    run = changed_run(before, changes, out)
    ensure_unread([] if out is None else [out], [*documents_of(run.inputs), before.path])
    start = another(before, run, last)
    return Task(run, last, steps=starting_steps(start, last), start=start)
