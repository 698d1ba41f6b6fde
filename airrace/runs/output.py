"""The files of a command: flights as they are asked for, `RUN.h5:STAGE`, and outputs, refused early or written whole.

An output is refused where it exists, where the command reads it, or where nothing can be written.
"""

import io
import os
import tempfile
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from airrace.checkpoint.atomic import replace_file, replacing
from airrace.errors import StorageError, UsageError
from airrace.extensions import extensions
from airrace.inputs import Document, Inputs
from airrace.inputs.document import AIRCRAFT, TRACKS
from airrace.standard_streams import STANDARD


@dataclass(frozen=True)
class FlightName:
    """A flight as it was asked for: a file, and a stage or None for the last one."""

    path: Path
    stage: str | None

    @classmethod
    def of(cls, text: str) -> "FlightName":
        """Split `RUN.h5:STAGE`; a file whose name holds a colon comes first.

        Raises:
            UsageError: nothing stands behind the colon.
        """
        file, colon, stage = text.rpartition(":")
        named = colon and not Path(text).exists() and "/" not in stage and "\\" not in stage
        if named and not stage:
            raise UsageError(f"{text} names no stage behind the colon; leave the colon out for the last one")
        return cls(Path(file), stage) if named else cls(Path(text), None)


Source = str | Path | Document | None
"""An input of a command: a file, the name of what comes along, a flight as `RUN.h5:STAGE`, a document, or None."""


NO_PIPE = "a checkpoint is written again after every stage, so it needs a file: name one with --output"
"""The message that a run cannot be written to stdout."""


def ensure_free(
    path: Path, *, force: bool, hint: str = "", sources: Iterable[Source] = (), made: Path | None = None
) -> None:
    """Refuse an output that exists, and find out now whether its folder can be written to; stdout is always free.

    Args:
        path: the file.
        force: whether it may exist.
        hint: stands before the advice to overwrite it with `--force`, and ends in a space.
        sources: see `ensure_unread`.
        made: a folder that the command makes where it is missing.

    Raises:
        UsageError: the file exists and `force` is not given, or it is a folder or one of the sources.
        StorageError: the folder does not exist or takes no files, or the path is a loop of links.
    """
    if path == STANDARD:
        return
    if Path(os.path.realpath(path)).is_symlink():
        raise StorageError(f"cannot write {path}: it is a link that leads in a circle")
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file in it")
    ensure_unread([path], sources)
    if path.exists() and not force:
        raise UsageError(f"{path} exists; {hint}overwrite it with --force")
    if made is not None and not made.exists() and identity(path.parent) == identity(made):
        return
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise StorageError(f"cannot write to the folder {path.parent}: {error.strerror}") from error


def ensure_unread(paths: Iterable[Path], sources: Iterable[Source]) -> None:
    """Refuse to write over a file that the command reads, whatever the path or link that leads to it.

    Args:
        paths: files to be written.
        sources: what the command reads besides the extensions.

    Raises:
        UsageError: one of the paths leads to one of the sources.
    """
    meant = {file for source in dict.fromkeys([*sources, *extensions()]) for file in _files(source)}
    read = {identity(file) for file in meant if not isinstance(file, Path) or file.exists()}
    for path in paths:
        if identity(path) in read:
            raise UsageError(f"{path} is read by this command; write into another file")


def identity(path: Path | int) -> Hashable:
    """Return what all paths to a file have in common, and its descriptor; where it would be if it does not exist."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):  # ValueError: a path with a null character
        return os.path.normcase(os.path.realpath(str(path)))
    return status.st_dev, status.st_ino


def documents_of(inputs: Inputs) -> list[Source]:
    """Return the documents of a run, the aircraft that its track names among them."""
    return [inputs.track, inputs.aircraft, inputs.settings_file]


def _files(source: Source) -> set[Path | int]:
    """Return the files that may be meant by what a command reads; stdin, which may be a file, by its descriptor."""
    if source is None:
        return set()
    named = source.path if isinstance(source, Document) else str(source)
    path = Path(named)
    if FlightName.of(named).path == STANDARD:
        return {0}
    return {path, TRACKS.file(path), AIRCRAFT.file(path), FlightName.of(named).path}


def default_output_path(source: str | Path, suffix: str) -> Path:
    """Return where a command writes that makes a file of a file and is given no other name: beside it, with its stem.

    What is made of stdin goes to stdout.

    Args:
        source: a file, or a flight as `RUN.h5:STAGE`.
        suffix: of the new file, without the dot before it, e.g. `png` or `kneeboard.png`.

    Raises:
        UsageError: the source can be no file.
    """
    path = FlightName.of(str(source)).path
    ensure_file_name(path)
    return path if path == STANDARD else path.with_name(f"{path.stem}.{suffix}")


def ensure_file_name(path: Path) -> None:
    """Refuse a path that can be no file, as `.` and `/`; an empty text is read as the former.

    Raises:
        UsageError: it names a folder.
    """
    if not path.name:
        raise UsageError(f"{path} is a folder; name a file")


def write_text(path: Path, text: str) -> None:
    """Write a file as a whole; what UTF-8 cannot hold, as of names of files that are none, is a question mark.

    Raises:
        StorageError: the system refused.
    """
    replace_file(path, text.encode("utf-8", "replace"))


def write_or_return(path: str | Path | None, write: Callable[[TextIO], None]) -> str:
    """Return a text, or write it into a file piece by piece, and return nothing of it.

    Raises:
        StorageError: the system refused.
    """
    if path is None:
        stream = io.StringIO(newline="")
        write(stream)
        return stream.getvalue()
    with replacing(Path(path)) as file:
        text = io.TextIOWrapper(file, encoding="utf-8", errors="replace", newline="")
        write(text)
        text.detach()
    return ""
