"""Documents: the texts of input files with the paths that messages name, and the shipped courses and aircraft."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from airrace.errors import Finding
from airrace.files.inputs.nodes import SIZE_MAX, most_similar
from airrace.runtime.extensions import installed_aircraft
from airrace.runtime.resources import shipped_folder
from airrace.runtime.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

SUFFIX = ".yaml"
AIRCRAFT_FOLDER = "configs"


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
            content = read_bytes(path, SIZE_MAX + 1)
            logger.info("%s is read", name_of(path))
            if len(content) <= SIZE_MAX:
                return content
            problem = f"is too large: at most {SIZE_MAX} bytes are read"
        else:
            problem = "is not a file" if path.exists() else missing_file(path, names)
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = error.strerror if isinstance(error, OSError) else str(error)
        problem = f"cannot be read: {reason}"
    findings.append(Finding(name_of(path), 0, 0, "", problem))
    return None


def missing_file(path: Path, names: Sequence[str] = ()) -> str:
    """Return the message that a file does not exist, with the most similar file beside it or else of `names`."""
    try:
        neighbours = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return f"no such file: {path} (its folder does not exist either)"
    if similar := most_similar(path.name, neighbours):
        return f"no such file: {path}; did you mean `{similar}`?"
    if similar := most_similar(path.name, names):
        return f"no such file: {path}; did you mean `{similar}`, which comes with airrace?"
    return f"no such file: {path}"


@dataclass(frozen=True)
class Collection:
    """The shipped documents of one kind, each named like its file without the suffix, in a folder of the package.

    Aircraft of installed packages are found by their names in the same way.
    """

    folder: str

    @property
    def path(self) -> Path:
        """The folder of the documents."""
        return shipped_folder(self.folder)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all documents, in alphabetical order, those of installed packages behind the shipped ones."""
        return (*_names(self.path), *sorted(self._installed.keys() - set(_names(self.path))))

    @property
    def _installed(self) -> dict[str, Path]:
        return installed_aircraft() if self.folder == AIRCRAFT_FOLDER else {}

    # `name` is a path, relative to the folder `beside`, or the bare name of a shipped document.

    def file(self, name: Path, beside: Path = Path()) -> Path:
        """Return the file: at the path, at the path with `.yaml`, or shipped; the path itself where there is none."""
        path = beside / name
        with_suffix = path.with_name(path.name + SUFFIX) if path.name else path
        for candidate in (path, with_suffix):
            if _is_file(candidate):
                return candidate
        if not self.has(name):
            return path
        return self.named(name.name)

    def named(self, name: str) -> Path:
        """Return the file of a document of this name, shipped or of an installed package, never one elsewhere."""
        shipped = self.path / f"{name}{SUFFIX}"
        return shipped if name in _names(self.path) else self._installed.get(name, shipped)

    def has(self, name: Path) -> bool:
        """Return whether a path is the bare name of a shipped document."""
        return len(name.parts) == 1 and name.name in self.names

    def read(self, name: Path, findings: list[Finding], beside: Path = Path()) -> Document | None:
        """Read a document, `-` from stdin; what is wrong with it becomes one finding, and the result None.

        A shipped document is called by its name, any other by the path of its file.
        """
        if name == STANDARD:
            return read_document(name, findings)
        document = read_document(self.file(name, beside), findings, self.names)
        return None if document is None else Document(str(self.label(name, beside)), document.text)

    def label(self, name: Path, beside: Path = Path()) -> Path:
        """Return the name of a shipped document, and the path of any other file."""
        file = self.file(name, beside)
        return name if self.has(name) and file == self.named(name.name) else file

    def finds(self, name: Path, beside: Path = Path()) -> bool:
        """Return whether there is such a file."""
        return _is_file(self.file(name, beside))

    def missing(self, name: Path, beside: Path = Path()) -> str:
        """Return the message that there is no such file."""
        return missing_file(beside / name, self.names)


def _is_file(path: Path) -> bool:
    """Return whether there is such a file; a path that the system refuses is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


@cache
def _names(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(file.stem for file in folder.glob(f"*{SUFFIX}")))


TRACKS = Collection("tracks")
AIRCRAFT = Collection(AIRCRAFT_FOLDER)
