"""Runs that are begun and runs that are read: the conversions between documents, checkpoints and `Run`."""

import json
import platform
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from airrace.checkpoint import (
    Checkpoint,
    StoredDocument,
    StoredInputs,
    inputs_hash,
    read_checkpoint,
    stale_stages,
)
from airrace.errors import CheckpointError
from airrace.extensions import extension_versions
from airrace.inputs import Document, Inputs, inputs_from_documents
from airrace.procedure import results_api
from airrace.runs.run import Run


def new_run(inputs: Inputs, path: Path | None = None) -> Run:
    """Return a run of which nothing is finished yet."""
    return Run(inputs, Checkpoint(stored_inputs(inputs), made_with()), path)


def stored_inputs(inputs: Inputs) -> StoredInputs:
    """Return the inputs as runs and flown logs store them."""
    return StoredInputs(
        track=_stored(inputs.track),
        aircraft=_stored(inputs.aircraft),
        settings=None if inputs.settings_file is None else _stored(inputs.settings_file),
        overrides=tuple(inputs.overrides),
        resolved=resolved_text(inputs),
    )


def made_with() -> dict[str, str]:
    """Return the versions that a run which is made now tells of."""
    return {**library_versions(), "python": platform.python_version()}


def library_versions() -> dict[str, str]:
    """Return the versions of airrace, of the libraries and of the extensions that its numbers depend on."""
    return {name: version(name) for name in ("airrace", "casadi", "numpy", "scipy")} | extension_versions()


def resolved_text(inputs: Inputs) -> str:
    """Return the resolved configuration as a text; equal configurations give equal texts."""
    return json.dumps(inputs.resolved, sort_keys=True, allow_nan=False)


def opened_run(path: Path) -> Run:
    """Return the run in a file.

    Raises:
        CheckpointError: there is no such file, it is not a whole, undamaged checkpoint, or its flights are not those
            of its stages' models.
        InputError: this version of airrace no longer accepts its inputs.
    """
    return readable(stored_run(read_checkpoint(path), path))


def readable(run: Run) -> Run:
    """Return a run whose flights can be read by the models of their stages.

    Raises:
        CheckpointError: a stage has other histories, or another number of legs.
    """
    for result in run.results:
        results_api.ensure_matches_model(run.race, result)
    return run


def stored_run(checkpoint: Checkpoint, path: Path | None) -> Run:
    """Return a run read from its checkpoint; its inputs are understood anew from their stored texts.

    Raises:
        InputError: this version of airrace no longer accepts them.
    """
    stored = checkpoint.inputs
    inputs = inputs_from_documents(
        document_of(stored.track),
        document_of(stored.aircraft),
        None if stored.settings is None else document_of(stored.settings),
        stored.overrides,
    )
    # Stages link to the configuration they were computed from; new ones to the one understood now.
    current = replace(checkpoint, inputs=replace(stored, resolved=resolved_text(inputs)))
    return Run(inputs, current, path)


def taken_up(run: Run) -> Run:
    """Return a new run together with the stages that still stand of the checkpoint at its path.

    What is damaged, of other inputs or from other versions, is left aside.
    """
    if run.path is None:
        return run
    try:
        earlier = read_checkpoint(run.path)
    except CheckpointError:
        return run
    if any(earlier.versions.get(name) != number for name, number in library_versions().items()):
        return run
    stale = {stage for stage, _ in stale_stages(earlier, inputs_hash(run.checkpoint.inputs.resolved))}
    standing = tuple(one for one in earlier.stages if one.result.stage not in stale)
    return replace(run, checkpoint=replace(run.checkpoint, stages=standing))


def document_of(stored: StoredDocument) -> Document:
    """Return a stored document as it was read."""
    return Document(stored.path, stored.text)


def _stored(document: Document) -> StoredDocument:
    return StoredDocument(document.path, document.text)
