"""The files of a command: flights as they are asked for, `RUN.h5:STAGE`, and outputs, refused early or written whole.

An output is refused where it exists, where the command reads it, or where nothing can be written.
"""

import io
import os
import re
import tempfile
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from airrace.errors import StorageError, UsageError
from airrace.files.checkpoint.atomic import replace_file, replacing
from airrace.files.inputs import Document, Inputs
from airrace.files.inputs.document import AIRCRAFT, TRACKS
from airrace.flights.results.flight import NOBODY, Entrant
from airrace.runtime.extensions import extensions
from airrace.runtime.standard_streams import ONE_ON_STDOUT, STANDARD


@dataclass(frozen=True)
class FlightName:
    """A flight as it was asked for: a file, a stage or None for the last one, and who flies."""

    path: Path
    stage: str | None
    entrant: Entrant = NOBODY

    @classmethod
    def of(cls, text: str) -> "FlightName":
        """Split `RUN.h5:STAGE,name=...,nation=...`; a file whose name holds a colon or a comma comes first.

        Raises:
            UsageError: nothing stands behind the colon, or what stands behind a comma is no detail of an entrant.
        """
        if not Path(text).exists() and (details := _DETAILS.search(text)):
            name = cls.of(text[: details.start()])
            return cls(name.path, name.stage, _entrant_of(text[details.start() :], text))
        file, colon, stage = text.rpartition(":")
        names_stage = colon and not Path(text).exists() and "/" not in stage and "\\" not in stage
        if names_stage and not stage:
            raise UsageError(f"{text} names no stage behind the colon; leave the colon out for the last one")
        return cls(Path(file), stage) if names_stage else cls(Path(text), None)


_DETAILS = re.compile(r",\s*\w*\s*=")
"""The first detail of an entrant behind the name of a flight."""
_FORMS = {
    "name": (r".*[^\s\"].*", "a name"),
    "nation": (r"[A-Za-z]{2,3}", "a code of two or three letters, such as SUI"),
    "number": (r"\w{1,4}", "up to four letters or digits"),
    "colour": (r"#[0-9A-Fa-f]{6}", "a colour such as #ff8800"),
}
"""What each detail has to look like: an expression, and its words."""


def _entrant_of(text: str, flight: str) -> Entrant:
    """Return the entrant of `,name="A, B",nation=SUI,number=7,colour=#ff8800`; quotes hold commas, and may be left out.

    Raises:
        UsageError: a detail is not known, told twice or not valid.
    """
    details: dict[str, str] = {}
    for part in re.findall(r',((?:"[^"]*"|[^,"]|"(?!.*"))*)', text):
        key, sign, value = (piece.strip() for piece in part.partition("="))
        value = value.removeprefix('"').removesuffix('"').strip() if value.startswith('"') else value
        if not sign or key not in _FORMS:
            raise UsageError(f"{flight}: {part!r} tells nothing of an entrant; known are {', '.join(_FORMS)}")
        if key in details:
            raise UsageError(f"{flight}: the {key} is told twice")
        form, expected = _FORMS[key]
        if not re.fullmatch(form, value):
            raise UsageError(f"{flight}: {value!r} is no {key}: expected {expected}")
        details[key] = value
    details["nation"] = details.get("nation", "").upper()
    return Entrant(**details)


def entrant_of(text: str) -> Entrant:
    """Return who flies, of `name=...,nation=...`; nobody of an empty text.

    Raises:
        UsageError: a detail is not known, told twice or not valid.
    """
    return _entrant_of(f",{text}", text) if text else NOBODY


NO_PIPE = "a checkpoint is written again after every stage, so it needs a file: name one with --output"
"""The message that a run cannot be written to stdout."""


def ensure_run_file(path: str | Path) -> Path:
    """Return the path of a run that is solved.

    Raises:
        UsageError: it is stdout.
    """
    if Path(path) == STANDARD:
        raise UsageError(NO_PIPE)
    return Path(path)


def ensure_free(
    *paths: Path, force: bool, hint: str = "", sources: Iterable[object] = (), made: Path | None = None
) -> None:
    """Refuse outputs that exist or are read, and find out now whether their folders can be written to.

    Whatever path or link leads to a file, it is the same file. Stdout is always free, once.

    Args:
        paths: the files.
        force: whether they may exist.
        hint: stands before the advice to overwrite one with `--force`, and ends in a space.
        sources: what the command reads besides the extensions: files, names of shipped ones, flights as
            `RUN.h5:STAGE` and documents; anything else has no file.
        made: a folder that the command makes where it is missing.

    Raises:
        UsageError: a file exists and `force` is not given, it is a folder or one of the sources, or two are the same.
        StorageError: a folder does not exist or takes no files, or a path is a loop of links.
    """
    files = [path for path in paths if path != STANDARD]
    if len(paths) - len(files) > 1:
        raise UsageError(ONE_ON_STDOUT)
    read = {identity(file) for source in [*sources, *extensions()] for file in _files(source)}
    targets = set[Hashable]()
    folders = dict[Path, None]()
    for path in files:
        if Path(os.path.realpath(path)).is_symlink():
            raise StorageError(f"cannot write {path}: it is a link that leads in a circle")
        if path.is_dir():
            raise UsageError(f"{path} is a folder; name a file in it")
        file = identity(path)
        if file in read:
            raise UsageError(f"{path} is read by this command; write into another file")
        if file in targets:
            raise UsageError(f"{path} is another file that this command writes; name another one")
        if path.exists() and not force:
            raise UsageError(f"{path} exists; {hint}overwrite it with --force")
        targets.add(file)
        if made is None or made.exists() or identity(path.parent) != identity(made):
            folders[path.parent] = None
    for folder in folders:
        try:
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise StorageError(f"cannot write to the folder {folder}: {error.strerror}") from error


def identity(path: Path | int) -> Hashable:
    """Return what all paths to a file have in common, and its descriptor; where it would be if it does not exist."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):  # ValueError: a path with a null character
        return os.path.normcase(os.path.realpath(str(path)))
    return status.st_dev, status.st_ino


def documents_of(inputs: Inputs) -> list[Document | None]:
    """Return the documents of a run, the aircraft that its track names among them."""
    return [inputs.track, inputs.aircraft, inputs.settings_file]


def _files(source: object) -> set[Path | int]:
    """Return the files that may be meant by what a command reads; stdin, which may be a file, by its descriptor."""
    if not isinstance(source, str | Path | Document):
        return set()
    source_name = source.path if isinstance(source, Document) else str(source)
    path = Path(source_name)
    if FlightName.of(source_name).path == STANDARD:
        return {0}
    meant = {path, TRACKS.file(path), AIRCRAFT.file(path), FlightName.of(source_name).path}
    return {file for file in meant if file.exists()}


def output_path(output: str | Path | None, source: str | Path, suffix: str) -> Path:
    """Return where a command writes that makes a file of a file: where it is told to, else beside it, with its stem.

    What is made of stdin goes to stdout.

    Args:
        output: where it is told to; None for nowhere.
        source: a file, or a flight as `RUN.h5:STAGE`.
        suffix: of the new file, without the dot before it, e.g. `png` or `kneeboard.png`.

    Raises:
        UsageError: the source can be no file.
    """
    if output is not None:
        return Path(output)
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
