"""The reader of logs: which format a file has, and how much of it is believed."""

import io
import logging
import os
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, BinaryIO

from airrace.logs.acmi_log import read_acmi
from airrace.logs.csv_log import read_csv
from airrace.logs.gpx_log import read_gpx
from airrace.logs.igc_log import read_igc
from airrace.logs.recording import ColumnLayout, Recording, refuse
from airrace.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

SIZE_MAX = 1024**3
"""The size of the largest log that is read, bytes, unpacked."""
GPX_SIZE_MAX = 256 * 1024**2
"""The largest size of a GPX file, which is held in memory, bytes."""
LINE_MAX = 1_000_000
"""The length of the longest line that is read, bytes."""
SUFFIXES = (".csv", ".txt", ".tsv", ".gpx", ".igc", ".acmi", ".zip")
"""The names' ends by which a log is told from other files."""


def read_log(path: Path, layout: ColumnLayout | None = None, *, aircraft: str | None = None) -> Recording:
    """Return the recording in a file: CSV, GPX, IGC, or ACMI as text or zipped; its first bytes say which.

    Args:
        path: the file; `-` for stdin.
        layout: how it is to be understood where it does not say so itself.
        aircraft: which one of an ACMI recording; None for the first.

    Raises:
        InputError: there is no such file, it is too large, or it is damaged; it names the line.
    """
    known, name = layout or ColumnLayout(), name_of(path)
    try:
        with _opened(path) as file:
            logger.info("%s is read", name)
            first = file.read(512)
            file.seek(0)
            if first.startswith(b"PK"):
                return _zipped(name, file, aircraft)
            plain = first.lstrip(b"\xef\xbb\xbf \t\r\n")
            if plain.startswith(b"<"):
                return read_gpx(name, _limited(name, file, GPX_SIZE_MAX), known)
            if plain.startswith(b"FileType=text/acmi"):
                return read_acmi(name, _lines(name, file), aircraft)
            if plain.startswith(b"A") and (path.suffix.lower() == ".igc" or (path == STANDARD and b"\nHF" in plain)):
                return read_igc(name, _lines(name, file))
            if b"\0" in first:
                refuse(name, 0, "is no log: expected CSV, GPX, IGC or ACMI")
            return read_csv(name, _lines(name, file), known)
    except FileNotFoundError:
        refuse(name, 0, "no such file")
    except OSError as error:
        refuse(name, 0, f"cannot be read: {error.strerror or error}")


def is_log(path: Path) -> bool:
    """Return whether a file is called as logs are."""
    return path.suffix.lower() in SUFFIXES


def _opened(path: Path) -> BinaryIO:
    large = f"is larger than {SIZE_MAX // 1024**3} GiB; cut the log to the flight"
    if path == STANDARD:
        content = read_bytes(path, SIZE_MAX + 1)
        if len(content) > SIZE_MAX:
            refuse(name_of(path), 0, large)
        return io.BytesIO(content)
    # A named pipe without a writer would block a plain open.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    status = os.fstat(descriptor)
    regular = stat.S_ISREG(status.st_mode)
    if not regular or status.st_size > SIZE_MAX:
        os.close(descriptor)
        refuse(str(path), 0, large if regular else "is not a file")
    return open(descriptor, "rb")


def _limited(path: str, file: BinaryIO, most: int) -> bytes:
    content = file.read(most + 1)
    if len(content) > most:
        refuse(path, 0, f"is larger than {most // 1024**2} MiB; cut the log to the flight")
    return content


def _lines(path: str, file: IO[bytes]) -> Iterator[str]:
    """Yield the lines, none of them without end and all of them together no longer than they may be."""
    number, size = 0, 0
    while line := file.readline(LINE_MAX):
        number, size = number + 1, size + len(line)
        if len(line) >= LINE_MAX:
            refuse(path, number, "has a line without end; is this a text file?")
        if size > SIZE_MAX:
            refuse(path, number, f"is larger than {SIZE_MAX // 1024**3} GiB unpacked; cut the log to the flight")
        yield line.decode("utf-8", "replace")


def _zipped(path: str, file: BinaryIO, aircraft: str | None) -> Recording:
    """Return the recording in an archive, of whose names nothing is believed: its first ACMI text is read."""
    try:
        with zipfile.ZipFile(file) as archive:
            entry = next((one for one in archive.infolist() if one.filename.lower().endswith((".acmi", ".txt"))), None)
            if entry is None:
                refuse(path, 0, "is an archive without an ACMI recording")
            with archive.open(entry) as unpacked:
                return read_acmi(path, _lines(path, unpacked), aircraft)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        refuse(path, 0, f"is a damaged archive: {error}")
