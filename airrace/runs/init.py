"""A course to begin with: a commented track file that flies as it stands."""

from importlib import resources
from pathlib import Path

from airrace.errors import Finding, InputError, UsageError
from airrace.inputs.course_import import sketched_course
from airrace.inputs.json_schema import schema_text
from airrace.inputs.placemarks import read_placemarks
from airrace.inputs.shipped import SUFFIX, TRACKS
from airrace.runs.output import ensure_free, write_text
from airrace.standard_streams import STANDARD, name_of

TEMPLATE = resources.files("airrace.inputs") / "templates" / "course.yaml"
SCHEMA_FILE = "track.schema.json"
"""The name of the file that holds the JSON Schema of tracks."""
EDITORS_LINE = "# yaml-language-server: $schema="
"""The line that names the schema of a file to editors, up to the path."""


def init(
    name: str | Path,
    *,
    like: str | Path | None = None,
    from_: str | Path | None = None,
    force: bool = False,
) -> Path:
    """Write a track file to begin with, and beside it the schema by which editors complete its keys.

    Args:
        name: the name of the new file; `.yaml` is added where it is missing.
        like: a course that comes along, or a file, to be copied; None for a short course with a comment on every part.
        from_: a file of placemarks (KML, GPX or GeoJSON) from which the course is sketched; None for none.
        force: whether existing files are overwritten. A schema that is already what it should be is none of them.

    Returns:
        The path of the file.

    Raises:
        UsageError: a file exists and `force` is not given, or is read; or a course is both to be copied and to be
            sketched.
        InputError: there is no such course to be copied, or the placemarks make none.
        StorageError: the folder does not exist or takes no files.
    """
    path = Path(name)
    path = path if path.suffix == SUFFIX or path == STANDARD else path.with_name(path.name + SUFFIX)
    if like is not None and from_ is not None:
        raise UsageError("a course is copied or sketched from placemarks; leave one of them out")
    ensure_free(path, force=force, sources=[like, from_])
    schema, schema_file = schema_text("track"), path.with_name(SCHEMA_FILE)
    written = path == STANDARD or _holds(schema_file, schema)
    if not written:
        ensure_free(schema_file, force=force, hint="it is not the schema of this version; ", sources=[like, from_])
    if from_ is not None:
        text = sketched_course(name_of(Path(from_)), _title(path), read_placemarks(Path(from_)))
    else:
        text = _copied(Path(like)) if like is not None else _begun(path)
    if EDITORS_LINE not in text and path != STANDARD:
        text = f"{EDITORS_LINE}{SCHEMA_FILE}\n{text}"
    if not written:
        write_text(schema_file, schema)
    write_text(path, text)
    return path


def _holds(path: Path, text: str) -> bool:
    """Return whether there is a file of exactly this text."""
    try:
        return path.read_bytes() == text.encode()
    except OSError:
        return False


def _title(path: Path) -> str:
    return ("course" if path == STANDARD else path.stem).replace("_", " ").capitalize()


def _begun(path: Path) -> str:
    title = _title(path)
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
