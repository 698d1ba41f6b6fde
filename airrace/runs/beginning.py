"""The beginning of a run: from a course, or from another run's optimum."""

from collections.abc import Sequence
from enum import Enum
from pathlib import Path

from airrace.inputs import Document, load_inputs
from airrace.runs.output import documents_of, ensure_unread
from airrace.runs.run import Run
from airrace.runs.stage_names import stage_named
from airrace.runs.starting import another, other_run
from airrace.runs.stored_inputs import new_run
from airrace.runs.task import Task


def new_task(
    track: str | Path | Document,
    *,
    aircraft: str | Path | Document | None = None,
    settings: str | Path | None = None,
    overrides: Sequence[str] = (),
    until: str | None = None,
    path: Path | None = None,
    start: Run | str | Path | None = None,
) -> Task:
    """Return the task to fly all stages of a course up to the last.

    Args:
        track, aircraft, settings, overrides: see `load_inputs`.
        until: the name of the last stage; None for the last one there is.
        path: the checkpoint to be written; None for a run that is kept in memory alone.
        start: another run, or its file, whose highest stage that holds is started from.

    Raises:
        InputError: with all findings.
        UsageError: no such stage; the other run has other passings or no optimum, or the file to be written is
            read.
        CheckpointError: the other run cannot be read.
    """
    last = stage_named(until)
    run = new_run(load_inputs(track, aircraft=aircraft, settings=settings, overrides=overrides), path)
    before = start.path if isinstance(start, Run) else start
    ensure_unread([] if path is None else [path], [*documents_of(run.inputs), before])
    if start is None:
        return Task(run, last)
    if not isinstance(start, Run):
        start = other_run(Path(start))
    return Task(run, last, start=another(start, run, last))


def settings_texts(**chosen: Enum | str | int | None) -> list[str]:
    """Return settings that have options of their own as `key=value` texts; None leaves a setting alone."""
    plain = {name: value.value if isinstance(value, Enum) else value for name, value in chosen.items()}
    return [f"settings.{name}={value}" for name, value in plain.items() if value is not None]
