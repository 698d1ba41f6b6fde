"""Documents: the text of an input file with the path under which messages name it, and those that come along."""

import difflib
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from airrace.errors import Finding
from airrace.inputs.nodes import LIMITS
from airrace.resources import shipped_folder
from airrace.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

SUFFIX = ".yaml"


@dataclass(frozen=True)
class Document:
    """The text of an input file. `path` is what the user gave, not made absolute."""

    path: str
    text: str


def read_document(path: Path, findings: list[Finding], names: Sequence[str] = ()) -> Document | None:
    """Read a file as UTF-8 text; what is wrong with it becomes one finding, and the result None.

    Args:
        path: the path of the file; `-` for stdin.
        findings: receives what is wrong.
        names: names that could have been meant by a path that leads nowhere.
    """
    content = read_content(path, findings, names)
    try:
        return None if content is None else Document(name_of(path), content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        message = f"is not UTF-8 text (byte {error.start}); save it as UTF-8"
        findings.append(Finding(name_of(path), 0, 0, "", message))


def read_content(path: Path, findings: list[Finding], names: Sequence[str] = ()) -> bytes | None:
    """Read a file as it is; see `read_document`."""
    problem = ""
    try:
        if path == STANDARD or path.is_file():
            content = read_bytes(path, LIMITS.size + 1)
            logger.info("%s is read", name_of(path))
            if len(content) <= LIMITS.size:
                return content
            problem = f"is too large: at most {LIMITS.size} bytes are read"
        else:
            problem = "is not a file" if path.exists() else missing_file(path, names)
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = error.strerror if isinstance(error, OSError) else str(error)
        problem = f"cannot be read: {reason}"
    findings.append(Finding(name_of(path), 0, 0, "", problem))
    return None


def missing_file(path: Path, names: Sequence[str] = ()) -> str:
    """Return the message that a file does not exist, with the most similar name beside it or among `names`."""
    try:
        neighbours = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return f"no such file: {path} (its folder does not exist either)"
    if similar := difflib.get_close_matches(path.name, neighbours, n=1):
        return f"no such file: {path}; did you mean `{similar[0]}`?"
    if similar := difflib.get_close_matches(path.name, names, n=1):
        return f"no such file: {path}; did you mean `{similar[0]}`, which comes with airrace?"
    return f"no such file: {path}"


@dataclass(frozen=True)
class Collection:
    """A collection of documents of one kind that come along, each under the name of its file without the suffix.

    Attributes:
        folder: the name of their folder.
    """

    folder: str

    @property
    def path(self) -> Path:
        """The folder in which the documents lie."""
        return shipped_folder(self.folder)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all documents, in alphabetical order."""
        return _names(self.path)

    def file(self, named: Path, beside: Path = Path()) -> Path:
        """Return the file that a path or a name stands for.

        A file of that path comes first, then the same path with `.yaml`, then what comes along under that name. Where
        there is none of them, the path itself is returned, so that whoever reads it says that it is missing.

        Args:
            named: a path, or the bare name of what comes along.
            beside: the folder that a relative path starts from.
        """
        path = beside / named
        spelt_out = path.with_name(path.name + SUFFIX) if path.name else path
        for candidate in (path, spelt_out):
            if _is_file(candidate):
                return candidate
        return self.path / spelt_out.name if self.has(named) else path

    def has(self, named: Path) -> bool:
        """Return whether a path is the bare name of something that comes along."""
        return len(named.parts) == 1 and named.name in self.names

    def read(self, named: Path, findings: list[Finding], beside: Path = Path()) -> Document | None:
        """Read what a path or a name stands for; what is wrong with it becomes one finding, and the result None.

        What comes along is called by its name, everything else by the path of its file; `-` is stdin.
        """
        if named == STANDARD:
            return read_document(named, findings)
        document = read_document(self.file(named, beside), findings, self.names)
        return None if document is None else Document(str(self.meant(named, beside)), document.text)

    def meant(self, named: Path, beside: Path = Path()) -> Path:
        """Return what users call the file that a path or a name stands for.

        That is the name of what comes along, and the path of every other file.
        """
        file = self.file(named, beside)
        return named if self.has(named) and file.parent == self.path else file

    def finds(self, named: Path, beside: Path = Path()) -> bool:
        """Return whether a path or a name stands for a file that exists."""
        return _is_file(self.file(named, beside))

    def missing(self, named: Path, beside: Path = Path()) -> str:
        """Return the message that nothing is found under a path or a name."""
        return missing_file(beside / named, self.names)


def _is_file(path: Path) -> bool:
    """Return whether there is such a file; a path that the system does not even accept is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


@cache
def _names(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(file.stem for file in folder.glob(f"*{SUFFIX}")))


TRACKS = Collection("tracks")
AIRCRAFT = Collection("configs")
