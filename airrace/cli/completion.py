"""Completion in the shell: what it offers when a name is begun and the tab key is pressed."""

import os
from pathlib import Path

from airrace.procedure.stage import STAGES
from airrace.resources import shipped_folder


def tracks(incomplete: str) -> list[str]:
    """Return the courses that come along, track files and folders whose names begin like this."""
    return _named("tracks", incomplete)


def aircraft(incomplete: str) -> list[str]:
    """Return the aircraft that come along, files and folders whose names begin like this."""
    return _named("configs", incomplete)


def stages(incomplete: str) -> list[str]:
    """Return the stages whose names begin like this, those of extensions among them."""
    return [stage.value for stage in STAGES if stage.value.startswith(incomplete)]


def _named(folder: str, incomplete: str) -> list[str]:
    names = sorted(file.stem for file in shipped_folder(folder).glob("*.yaml"))
    return [name for name in names if name.startswith(incomplete)] + _files(incomplete)


def _files(incomplete: str) -> list[str]:
    """Return the YAML files and folders whose paths begin like this."""
    folder, begin = os.path.split(incomplete)
    typed = incomplete.removesuffix(begin)
    try:
        entries = sorted(Path(folder or ".").iterdir())
    except OSError:
        return []
    wanted = [entry for entry in entries if entry.name.startswith(begin) and not entry.name.startswith(".")]
    return [
        f"{typed}{entry.name}{os.sep if entry.is_dir() else ''}"
        for entry in wanted
        if entry.is_dir() or entry.suffix == ".yaml"
    ]
