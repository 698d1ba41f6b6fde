"""The reader of logs: which format and encoding a file has, and how much of it is trusted."""

import codecs
import contextlib
import io
import logging
import os
import re
import stat
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, BinaryIO, cast

from airrace.flights.logs.csv_log import ColumnLayout, read_csv
from airrace.flights.logs.foreign_formats import foreign_format, refuse_foreign
from airrace.flights.logs.gpx_log import read_gpx
from airrace.flights.logs.kml_track import read_kml
from airrace.flights.logs.nmea import POSITION, read_nmea
from airrace.flights.logs.quality import without_fix_left_out
from airrace.flights.logs.recorders import FIX, read_acmi, read_fit, read_igc
from airrace.flights.logs.recording import GPX_SIZE_MAX, LINE_MAX, SIZE_MAX, Recording, refuse
from airrace.runtime.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

SUFFIXES = (".csv", ".txt", ".tsv", ".gpx", ".igc", ".acmi", ".zip", ".vbo", ".fit", ".nmea", ".kml", ".kmz")
"""The names' ends by which logs are recognised."""
_KML = re.compile(rb"<(\w+:)?(kml|Document|Folder)\b")
DAMAGES = (
    *(zipfile.BadZipFile, zlib.error, OSError),  # of the archive, and of its streams
    *(NotImplementedError, RuntimeError, EOFError, ValueError),
)
"""What `zipfile` raises for archives that it cannot unpack."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The methods whose unpackers need a fixed amount of memory: LZMA reserves as much as its header claims."""
_PACKED, _SMALL = 200, 10_000_000
"""Times the size of an archive that a large content may have (texts of flights are packed to a tenth); bytes of one."""


FORMATS = "CSV, GPX, KML, NMEA, IGC, ACMI or FIT"
"""The formats of logs, for messages."""


def is_log(path: Path) -> bool:
    """Return whether a file is called as logs are."""
    return path.suffix.lower() in SUFFIXES


def read_log(path: Path, layout: ColumnLayout | None = None, *, aircraft: str | None = None) -> Recording:
    """Return the recording in a file: its first bytes say of which format.

    Args:
        path: the file; `-` for stdin.
        layout: its meaning where the file does not state it.
        aircraft: which one of an ACMI recording; None for the first.

    Raises:
        InputError: there is no such file, it is too large, or it is damaged; it names the line.
    """
    columns = layout or ColumnLayout()
    recording = _read(path, columns, aircraft)
    tracks = tuple(
        without_fix_left_out(replace(track, accuracy=columns.accuracy)) for track in (recording, *recording.others)
    )
    return replace(tracks[0], others=tracks[1:])


def _read(path: Path, layout: ColumnLayout, aircraft: str | None) -> Recording:
    name = name_of(path)
    try:
        with _open(path) as file:
            logger.info("%s is read", name)
            first = file.read(4096)
            file.seek(0)
            if first.startswith(b"PK"):
                return _read_archive(name, file, layout, aircraft)
            encoding = text_encoding(first)
            plain = first.decode(encoding, "replace").lstrip("\ufeff \t\r\n")
            if plain.startswith("<"):
                return _read_xml(name, _content(name, file), layout)
            if plain.startswith("FileType=text/acmi"):
                return read_acmi(name, _lines(name, file, encoding), aircraft)
            if any(POSITION.search(line) for line in plain.splitlines()):
                return read_nmea(name, _lines(name, file, encoding))
            if path.suffix.lower() == ".igc" or any(FIX.match(line) for line in plain.splitlines()[:-1]):
                return read_igc(name, _lines(name, file, encoding))
            if first[8:12] == b".FIT":
                return read_fit(name, file)
            if (foreign := foreign_format(first)) is not None and not foreign.is_log:
                refuse_foreign(name, foreign)
            if "\0" in plain[:512]:
                refuse(name, 0, f"is no log: expected {FORMATS}")
            return read_csv(name, _lines(name, file, encoding), layout)
    except FileNotFoundError:
        refuse(name, 0, "no such file")
    except OSError as error:
        refuse(name, 0, f"cannot be read: {error.strerror or error}")


def _open(path: Path) -> BinaryIO:
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


def _content(path: str, file: IO[bytes]) -> bytes:
    """Return a document as a whole."""
    content = file.read(GPX_SIZE_MAX + 1)
    if len(content) > GPX_SIZE_MAX:
        refuse(path, 0, f"is larger than {GPX_SIZE_MAX // 1024**2} MiB; cut the log to the flight")
    return content


def text_encoding(first: bytes) -> str:
    """Return the encoding of a text by its first bytes: UTF-16 by its mark or by its zeros, UTF-8, else Windows'."""
    if first.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    zeros = [first[begin:512:2].count(0) > 0.4 * len(first[begin:512:2]) for begin in (0, 1)]
    if zeros[0] != zeros[1] and len(first) > 8:
        return "utf-16-be" if zeros[0] else "utf-16-le"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(first)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _lines(path: str, file: IO[bytes], encoding: str) -> Iterator[str]:
    """Yield the lines with any kind of end, limited in length and in total size."""
    number, size = 0, 0
    text = io.TextIOWrapper(cast(BinaryIO, file), encoding, errors="replace", newline=None)
    try:
        while line := text.readline(LINE_MAX):
            number, size = number + 1, size + len(line)
            if len(line) >= LINE_MAX:
                refuse(path, number, "has a line without end; is this a text file?")
            if size > SIZE_MAX:
                refuse(path, number, f"is larger than {SIZE_MAX // 1024**3} GiB unpacked; cut the log to the flight")
            yield line
    finally:
        with contextlib.suppress(ValueError):  # it may be closed already
            text.detach()  # the caller closes the file


def archive_entry(path: str, archive: zipfile.ZipFile, suffixes: tuple[str, ...], what: str) -> zipfile.ZipInfo:
    """Return the first entry of an archive by the ends of its name, in small letters.

    Args:
        path: of the archive, for messages.
        archive, suffixes: it is searched in its own order.
        what: the entry is, for messages.

    Raises:
        InputError: there is none, or it is packed by a method that may need any amount of memory.
    """
    entry = next((file for file in archive.infolist() if file.filename.lower().endswith(suffixes)), None)
    if entry is None:
        refuse(path, 0, f"is an archive without {what}")
    if entry.compress_type not in _METHODS:
        refuse(
            path, 0, f"holds {what} that is neither stored nor deflated (method {entry.compress_type}); pack it again"
        )
    return entry


def _read_xml(path: str, content: bytes, layout: ColumnLayout) -> Recording:
    """Return the recording in a document, KML or GPX."""
    first = content[:4096]
    if (foreign := foreign_format(first)) is not None:
        refuse_foreign(path, foreign)
    read = read_kml if _KML.search(first) else read_gpx
    return read(path, content.lstrip(), layout.zone)


def _read_archive(path: str, file: BinaryIO, layout: ColumnLayout, aircraft: str | None) -> Recording:
    """Return the recording in an archive, whose names are not trusted: its first KML, or ACMI text, is read."""
    try:
        with zipfile.ZipFile(file) as archive:
            is_kmz = any(file.filename.lower().endswith(".kml") for file in archive.infolist())
            suffixes, what = ((".kml",), "a KML document") if is_kmz else ((".acmi", ".txt"), "an ACMI recording")
            names = b"PK" + " ".join(archive.namelist()[:20]).encode()
            if not is_kmz and (foreign := foreign_format(names)) is not None:
                refuse_foreign(path, foreign)
            entry = archive_entry(path, archive, suffixes, what)
            if entry.file_size > max(_PACKED * entry.compress_size, _SMALL):
                refuse(path, 0, f"is packed to less than a {_PACKED}th, as no flight is; unpack it and cut it to that")
            with archive.open(entry) as unpacked:
                if is_kmz:
                    return _read_xml(path, _content(path, unpacked), layout)
                return read_acmi(path, _lines(path, unpacked, "utf-8-sig"), aircraft)
    except DAMAGES as error:
        refuse(path, 0, f"is a damaged archive: {error}")
