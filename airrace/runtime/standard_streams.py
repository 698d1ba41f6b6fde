"""The standard streams as files: `-` is read from stdin and written to stdout."""

import os
import sys
from functools import lru_cache
from pathlib import Path
from typing import TextIO

STANDARD = Path("-")
"""The path that stands for stdin or stdout."""
ONE_ON_STDOUT = "only one result can go to stdout: name a file for the others, and leave --json out"
"""The message that more than one thing would be written to stdout."""


def read_bytes(path: Path, most: int) -> bytes:
    """Return at most `most` bytes from the start of a file, or of stdin.

    Raises:
        OSError: the system refused.
    """
    if path == STANDARD:
        return _piped_in(sys.stdin, most)
    with path.open("rb") as file:
        return file.read(most)


def write_stdout(content: bytes) -> None:
    """Write to stdout; a pipe that its reader has closed is no error.

    Raises:
        OSError: the system refused.
    """
    try:
        sys.stdout.flush()
        sys.stdout.buffer.write(content)
        sys.stdout.flush()
    except BrokenPipeError:
        abandon_stdout()


def abandon_stdout() -> None:
    """Redirect stdout to the null device, so that the interpreter's last flush does not fail."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def name_of(path: Path) -> str:
    """Return the name of an input file in messages."""
    return "stdin" if path == STANDARD else str(path)


def stem_of(path: Path) -> str:
    """Return the name of an input file without its folder and suffix."""
    return Path(name_of(path)).stem


@lru_cache(maxsize=1)
def _piped_in(stream: TextIO, most: int) -> bytes:
    """Return what a stream holds; kept, as it can be read only once."""
    return stream.buffer.read(most)
