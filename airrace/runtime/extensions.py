"""Extensions: Python files of the user, and modules of installed packages, that add to what airrace knows.

The environment variable `AIRRACE_EXTENSIONS` names Python files, separated like the folders of `PATH`. An installed
package names its modules as entry points:

    [project.entry-points."airrace.limits"]
    energy_height = "my_limits"

Both are run once, when a list that they can add to is first read, so the command line, its child processes and a
notebook all know what they add. In Python a file that adds to a list can also just be imported.
"""

import functools
import hashlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from airrace.errors import AirraceError, UsageError, is_lack_of_memory
from airrace.runtime import interrupts

VARIABLE = "AIRRACE_EXTENSIONS"
GROUPS = ("airrace.gates", "airrace.fidelities", "airrace.exports", "airrace.limits")
"""The groups of entry points that name modules, each of which registers what it adds when it is imported."""
AIRCRAFT = "airrace.aircraft"
"""The group of entry points that are aircraft: `NAME = "package"` is the file `NAME.yaml` in a package's folder."""

_loaded: set[Path | EntryPoint] = set()


def extensions() -> list[Path]:
    """Return the paths of the files that the environment names, in its order."""
    return [Path(text).resolve() for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text]


@functools.cache
def installed_extensions() -> tuple[EntryPoint, ...]:
    """Return the entry points of installed packages that name modules, in the order of groups and names."""
    return tuple(point for group in GROUPS for point in sorted(entry_points(group=group), key=lambda point: point.name))


@functools.cache
def installed_aircraft() -> dict[str, Path]:
    """Return the files of the aircraft of installed packages by name.

    Raises:
        UsageError: a package that should have one has none, or two have one of the same name.
    """
    files: dict[str, Path] = {}
    for point in entry_points(group=AIRCRAFT):
        with named_errors(_origin(point), Path()):
            spec = importlib.util.find_spec(point.value)
        folders = [] if spec is None else spec.submodule_search_locations or [str(Path(spec.origin or "").parent)]
        found = [file for folder in folders if (file := Path(folder) / f"{point.name}.yaml").is_file()]
        if not found:
            raise UsageError(f"{_origin(point)}, in whose folder there is no file {point.name}.yaml")
        if point.name in files:
            raise UsageError(f"{_origin(point)}, and there is an aircraft of this name in {files[point.name].parent}")
        files[point.name] = found[0]
    return files


def extension_versions() -> dict[str, str]:
    """Return the first 12 hexadecimal digits of the sha256 of each extension's file, by its name.

    A result that was computed with another content of a file is another result. A module of an installed package has
    the name `package:module`, and the package's version before the digits.
    """
    versions = {path.name: _digits(path) for path in extensions() if path.is_file()}
    for point in installed_extensions():
        if (path := _module_file(point)).is_file() and point.dist is not None:
            versions[f"{point.dist.name}:{point.module}"] = f"{point.dist.version}, {_digits(path)}"
    return versions


def _module_file(point: EntryPoint) -> Path:
    """Return the file of a module; the current folder where there is none."""
    with named_errors(_origin(point), Path()):
        spec = importlib.util.find_spec(point.module)
    return Path() if spec is None or spec.origin is None else Path(spec.origin)


def _digits(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]


def load_extensions() -> None:
    """Run the files that the environment names and import the modules of installed packages, each once per process.

    Raises:
        UsageError: a file does not exist, is no Python file, or fails; or a module fails.
    """
    for path in extensions():
        _load_once(path, f"{VARIABLE} names {path}", path, functools.partial(_run, path))
    for point in installed_extensions():
        _load_once(point, _origin(point), _module_file(point), point.load)


def _load_once(key: Path | EntryPoint, origin: str, path: Path, load: Callable[[], object]) -> None:
    if key in _loaded:
        return
    _loaded.add(key)  # before it runs, for the list that it adds to loads extensions, too
    try:
        with named_errors(origin, path):
            load()
    except BaseException:
        _loaded.discard(key)
        raise


@contextmanager
def named_errors(origin: str, path: Path) -> Generator[None]:
    """Raise whatever an extension raises as an error of the user's that names it, and the line of its file."""
    try:
        yield
    except BaseException as error:
        if isinstance(error, AirraceError) or interrupts.caused(error) or is_lack_of_memory(error):
            raise
        ending = isinstance(error, SystemExit)
        cause = "it ends the program, which an extension must not do" if ending else f"{type(error).__name__}: {error}"
        raise UsageError(f"{origin}, which fails{_place(error, path)}: {cause}") from error


def _origin(point: EntryPoint) -> str:
    package = "an installed package" if point.dist is None else f"the package {point.dist.name}"
    return f"{package} has the entry point {point.group}: {point.name} = {point.value}"


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
