"""Extensions: Python files of the user that add a fidelity or a kind of gate to airrace.

The environment variable `AIRRACE_EXTENSIONS` names Python files, separated like the folders of `PATH`. They are run
once, when a list that they can add to is first read, so the command line, its child processes and a notebook all know
what they add. In Python a file that adds to a list can also just be imported.
"""

import hashlib
import importlib.util
import os
import sys
import traceback
from pathlib import Path

from airrace.errors import AirraceError, UsageError, is_lack_of_memory
from airrace.runtime import interrupts

VARIABLE = "AIRRACE_EXTENSIONS"

_loaded: set[Path] = set()


def extensions() -> list[Path]:
    """Return the paths of the files that the environment names, in its order."""
    return [Path(text).resolve() for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text]


def extension_versions() -> dict[str, str]:
    """Return the first 12 hexadecimal digits of each file's sha256, by the file's name.

    A result that was computed with another content of a file is another result.
    """
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest()[:12] for path in extensions() if path.is_file()}


def load_extensions() -> None:
    """Run the files that the environment names, each of them once per process.

    Raises:
        UsageError: a file does not exist, is no Python file, or fails.
    """
    for path in extensions():
        if path in _loaded:
            continue
        _loaded.add(path)  # before it runs, for the list that it adds to loads extensions, too
        try:
            _run(path)
        except BaseException as error:
            _loaded.discard(path)
            if isinstance(error, AirraceError) or interrupts.caused(error) or is_lack_of_memory(error):
                raise
            ending = isinstance(error, SystemExit)
            cause = (
                "it ends the program, which an extension must not do" if ending else f"{type(error).__name__}: {error}"
            )
            raise UsageError(f"{VARIABLE} names {path}, which fails{_place(error, path)}: {cause}") from error


def _place(error: BaseException, path: Path) -> str:
    """Return the line of the file in which it failed, as ` in line 7`; empty where it is not known."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    if isinstance(error, SyntaxError):
        lines = [error.lineno] if error.lineno and error.filename == str(path) else []
    return f" in line {lines[-1]}" if lines else ""


def _run(path: Path) -> None:
    name = f"airrace_extension_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise UsageError(f"{VARIABLE} names {path}, which is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # so that its classes can be pickled
    spec.loader.exec_module(module)
