"""Files that commands write: where they go; refused before anything is computed, and replaced as a whole."""

import io
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TextIO

from airrace.checkpoint.atomic import replace_file, replacing
from airrace.errors import StorageError, UsageError
from airrace.runs.named import Named


def ensure_free(path: Path, *, force: bool, remedy: str = "", sources: Sequence[str | Path] = ()) -> None:
    """Refuse an output that exists, and find out now whether its folder can be written to.

    Args:
        remedy: what to do besides `--force`, a clause.
        sources: files that the command reads, or flights as `RUN.h5:STAGE`; not even `--force` overwrites one of them.

    Raises:
        UsageError: the file exists and `force` is not given, or it is a folder or one of the sources.
        StorageError: the folder does not exist or takes no files, or the path is a loop of links.
    """
    if Path(os.path.realpath(path)).is_symlink():
        raise StorageError(f"cannot write {path}: it is a link that leads in a circle")
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file in it")
    files = (Named.of(str(source)).path for source in sources)
    if path.exists() and any(file.exists() and file.samefile(path) for file in files):
        raise UsageError(f"{path} is read by this command; write into another file")
    if path.exists() and not force:
        raise UsageError(f"{path} exists; {remedy}overwrite it with --force")
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise StorageError(f"cannot write to the folder {path.parent}: {error.strerror}") from error


def beside(source: str | Path, suffix: str) -> Path:
    """Return where a command writes that makes a file of a file and is told no other name: beside it, with its stem.

    Args:
        source: a file, or a flight as `RUN.h5:STAGE`.
        suffix: of the new file, without the dot before it, e.g. `png` or `kneeboard.png`.
    """
    path = Named.of(str(source)).path
    return path.with_name(f"{path.stem}.{suffix}")


def write_text(path: Path, text: str) -> None:
    """Write a file as a whole; what UTF-8 cannot hold, as of names of files that are none, is a question mark.

    Raises:
        StorageError: the system refused.
    """
    replace_file(path, text.encode("utf-8", "replace"))


def written_or_returned(path: str | Path | None, write: Callable[[TextIO], None]) -> str:
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
