"""What a shell offers while a command is typed: shipped names, files, stages."""

import os
from pathlib import Path

from airrace.procedure.stage import STAGES
from airrace.runtime.extensions import installed_aircraft
from airrace.runtime.resources import shipped_folder


def complete_track(incomplete: str) -> list[str]:
    """Return the shipped courses, track files and folders whose names begin like this."""
    return _complete("tracks", incomplete)


def complete_aircraft(incomplete: str) -> list[str]:
    """Return the shipped aircraft, files and folders whose names begin like this."""
    return _complete("configs", incomplete)


def complete_stage(incomplete: str) -> list[str]:
    """Return the stages whose names begin like this, those of extensions among them."""
    return [stage.value for stage in STAGES if stage.value.startswith(incomplete)]


COMPLETIONS = {"tracks": complete_track, "configs": complete_aircraft, "stages": complete_stage}
"""What completes an option, by its `completion`."""


def _complete(shipped: str, incomplete: str) -> list[str]:
    known = {file.stem for file in shipped_folder(shipped).glob("*.yaml")}
    known |= installed_aircraft().keys() if shipped == "configs" else set()
    names = [name for name in known if name.startswith(incomplete)]
    folder, begin = os.path.split(incomplete)
    typed = incomplete.removesuffix(begin)
    try:
        entries = sorted(Path(folder or ".").iterdir())
    except OSError:
        entries = []
    return sorted(names) + [
        f"{typed}{entry.name}{os.sep if entry.is_dir() else ''}"
        for entry in entries
        if entry.name.startswith(begin) and not entry.name.startswith(".")
        if entry.is_dir() or entry.suffix == ".yaml"
    ]
