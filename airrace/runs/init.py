"""A course to begin with: a commented track file that flies as it stands."""

from importlib import resources
from pathlib import Path

from airrace.documents.shipped import SUFFIX, TRACKS
from airrace.errors import Finding, InputError
from airrace.runs.output import ensure_free, write_text

TEMPLATE = resources.files("airrace.documents") / "templates" / "course.yaml"


def init(name: str | Path, *, like: str | Path | None = None, force: bool = False) -> Path:
    """Write a track file to begin with.

    Args:
        name: the name of the new file; `.yaml` is added where it is missing.
        like: a course that comes along, or a file, to be copied; None for a short course with a comment on every part.
        force: whether an existing file is overwritten.

    Returns:
        The path of the file.

    Raises:
        UsageError: the file exists and `force` is not given.
        InputError: there is no such course to be copied.
        StorageError: the folder does not exist or takes no files.
    """
    path = Path(name)
    path = path if path.suffix == SUFFIX else path.with_name(path.name + SUFFIX)
    ensure_free(path, force=force)
    write_text(path, _copied(Path(like)) if like is not None else _begun(path))
    return path


def _begun(path: Path) -> str:
    title = path.stem.replace("_", " ").capitalize()
    text = TEMPLATE.read_text(encoding="utf-8")
    return text.replace("{file}", path.name).replace("{name}", _quoted(title))


def _quoted(title: str) -> str:
    """Return a title as YAML text, which might otherwise take it for a number or a truth value."""
    return "'" + title.replace("'", "''") + "'"


def _copied(like: Path) -> str:
    findings: list[Finding] = []
    document = TRACKS.read(like, findings)
    if document is None:
        raise InputError(findings)
    return document.text
