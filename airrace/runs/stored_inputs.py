"""The inputs and the versions of a run as its file holds them."""

import json
import platform
from importlib.metadata import version

from airrace.files.checkpoint import StoredDocument, StoredInputs
from airrace.files.inputs import Document, Inputs
from airrace.runtime.extensions import extension_versions


def stored_inputs(inputs: Inputs) -> StoredInputs:
    """Return the inputs as runs and flight logs store them."""
    settings = inputs.settings_file
    return StoredInputs(
        track=StoredDocument(inputs.track.path, inputs.track.text),
        aircraft=StoredDocument(inputs.aircraft.path, inputs.aircraft.text),
        settings=None if settings is None else StoredDocument(settings.path, settings.text),
        overrides=tuple(inputs.overrides),
        resolved=resolved_text(inputs),
    )


def current_versions() -> dict[str, str]:
    """Return the versions that a run which is made now tells of."""
    return {**library_versions(), "python": platform.python_version()}


def library_versions() -> dict[str, str]:
    """Return the versions of airrace, of the libraries and of the extensions that its numbers depend on."""
    return {name: version(name) for name in ("airrace", "casadi", "numpy", "scipy")} | extension_versions()


def resolved_text(inputs: Inputs) -> str:
    """Return the resolved configuration as a text; equal configurations give equal texts."""
    return json.dumps(inputs.resolved, sort_keys=True, allow_nan=False)


def stored_documents(stored: StoredInputs) -> tuple[Document, Document, Document | None]:
    """Return the documents of track, aircraft and settings as they were read."""
    track, aircraft, settings = stored.track, stored.aircraft, stored.settings
    documents = Document(track.path, track.text), Document(aircraft.path, aircraft.text)
    return *documents, None if settings is None else Document(settings.path, settings.text)
