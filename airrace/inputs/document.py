"""Documents: the text of an input file together with the path under which messages name it."""

import difflib
import logging
from collections.abc import Sequence
from pathlib import Path

from airrace.errors import Finding
from airrace.records import record
from airrace.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

SIZE_MAX = 2 * 1024 * 1024
"""The size of the largest input file that is read, bytes; the largest real course needs a hundredth of it."""


@record
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

    def refuse(message: str) -> None:
        findings.append(Finding(name_of(path), 0, 0, "", message))

    try:
        if path != STANDARD and not path.exists():
            return refuse(missing_file(path, names))
        if path != STANDARD and not path.is_file():
            return refuse("is not a file")
        content = read_bytes(path, SIZE_MAX + 1)
        logger.info("%s is read", name_of(path))
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = error.strerror if isinstance(error, OSError) else str(error)
        return refuse(f"cannot be read: {reason}")
    if len(content) > SIZE_MAX:
        return refuse(f"is too large: at most {SIZE_MAX} bytes are read")
    try:
        return Document(name_of(path), content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        return refuse(f"is not UTF-8 text (byte {error.start}); save it as UTF-8")


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
