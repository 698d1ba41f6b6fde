"""Runs that are started from another run: what is read of that one, and what is changed."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Self

from airrace.checkpoint import read_checkpoint
from airrace.errors import Finding, InputError, UsageError
from airrace.inputs import Document, inputs_from_documents
from airrace.inputs.document import read_document
from airrace.inputs.inputs import read_named
from airrace.inputs.shipped import AIRCRAFT, TRACKS
from airrace.procedure import run as procedure
from airrace.procedure.passings import ensure_same_passings, passings_of
from airrace.procedure.restart import SourceRun, startable
from airrace.procedure.result import Stage
from airrace.procedure.settings import MeshCheck
from airrace.records import record
from airrace.runs.run import Run
from airrace.runs.stored_inputs import document_of, library_versions, new_run, resolved_text, stored_run

logger = logging.getLogger(__name__)

MESH_CHECK = "settings.mesh_check="
"""The beginning of an override that says which stages are proved."""


@record
class Changes:
    """The differences of a run from the one it is started from; None and empty stand for what stays as it is."""

    track: str | Path | Document | None = None
    aircraft: str | Path | Document | None = None
    settings: str | Path | None = None
    overrides: Sequence[str] = ()

    def __bool__(self) -> bool:
        return any((self.track, self.aircraft, self.settings, self.overrides))

    def with_overrides(self, texts: Sequence[str]) -> Self:
        """Return these changes and further overrides, which are made last."""
        return replace(self, overrides=(*self.overrides, *texts))


def other_run(path: Path) -> Run:
    """Open the run to start from, with one warning if other versions have written it.

    Its flight is only a start, and what is found is certified anew, so other versions do no harm.

    Raises:
        CheckpointError: the file is damaged, or of another schema.
        InputError: this version of airrace does not accept its inputs.
    """
    checkpoint = read_checkpoint(path)
    others = [
        f"{name} {checkpoint.versions.get(name, 'unknown')}"
        for name, number in library_versions().items()
        if checkpoint.versions.get(name) != number
    ]
    if others:
        logger.warning(
            "%s was written with %s; its flight is only a start, and what is found is certified anew",
            path,
            ", ".join(others),
        )
    return stored_run(checkpoint, path)


def changed_run(before: Run, changes: Changes, out: Path | None) -> Run:
    """Return a new run: the inputs of a stored one with changes.

    The files that are named replace the stored texts; stored overrides are made before the new ones.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    findings: list[Finding] = []
    stored = before.checkpoint.inputs
    track, aircraft = document_of(stored.track), document_of(stored.aircraft)
    if changes.track is not None:
        track = read_named(TRACKS, changes.track, findings)
    if changes.aircraft is not None:
        aircraft = read_named(AIRCRAFT, changes.aircraft, findings)
    settings = None if stored.settings is None else document_of(stored.settings)
    if changes.settings is not None:
        settings = read_document(Path(changes.settings), findings)
    if findings or track is None or aircraft is None:
        raise InputError(findings)
    return new_run(inputs_from_documents(track, aircraft, settings, (*stored.overrides, *changes.overrides)), out)


def proved_otherwise(run: Run, mesh_check: MeshCheck | str) -> Run:
    """Return the same run, of which other stages are to be checked on a second mesh. Its stages stand as they did.

    Raises:
        InputError: `mesh_check` is not known.
    """
    stored = run.checkpoint.inputs
    asked = mesh_check.value if isinstance(mesh_check, MeshCheck) else mesh_check
    overrides = (*(text for text in stored.overrides if not text.startswith(MESH_CHECK)), f"{MESH_CHECK}{asked}")
    settings = None if stored.settings is None else document_of(stored.settings)
    inputs = inputs_from_documents(document_of(stored.track), document_of(stored.aircraft), settings, overrides)
    changed = replace(stored, overrides=overrides, resolved=resolved_text(inputs))
    return replace(run, inputs=inputs, checkpoint=replace(run.checkpoint, inputs=changed))


def another(before: Run, run: Run, until: Stage) -> SourceRun:
    """Return the run to start from, as the procedure takes it.

    Raises:
        UsageError: it has other passings, or no certified or solved stage up to `until`.
    """
    known = SourceRun(before.label, before.results)
    there, here = (passings_of(one.inputs.race.course) for one in (before, run))
    ensure_same_passings(here, there, known.name)
    stages = tuple(procedure.STAGES)
    startable(known, stages[: stages.index(until) + 1])
    return known


def last_stage(run: Run) -> Stage:
    """Return the last stage that a run holds.

    Raises:
        UsageError: it holds none.
    """
    if not run.results:
        raise UsageError(f"{run.label} has no finished stage to start from")
    return run.results[-1].stage
