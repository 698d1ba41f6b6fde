"""The reader of logs: which format and encoding a file has, how much of it is trusted, and GPX 1.0 and 1.1."""

import codecs
import contextlib
import io
import logging
import math
import os
import re
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from datetime import tzinfo
from pathlib import Path
from typing import IO, BinaryIO, cast
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from airrace.flights.logs.clocks import instant, iso_seconds
from airrace.flights.logs.csv_log import ColumnLayout, read_csv
from airrace.flights.logs.nmea import POSITION, read_nmea
from airrace.flights.logs.quality import fix_type, without_fix_left_out
from airrace.flights.logs.recorders import FIX, read_acmi, read_fit, read_igc
from airrace.flights.logs.recording import DEPTH_MAX, GPX_SIZE_MAX, LINE_MAX, SIZE_MAX, Recording, SampleTable, refuse
from airrace.runtime.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

SUFFIXES = (".csv", ".txt", ".tsv", ".gpx", ".igc", ".acmi", ".zip", ".vbo", ".fit")
"""The names' ends by which logs are recognised."""
_DECLARED = re.compile(rb"^<\?xml[^>]{0,200}?encoding=[\"']([A-Za-z0-9._-]{1,40})[\"']")
_MULTIBYTE = frozenset(
    ("shift_jis", "cp932", "euc_jp", "iso2022_jp", "gb2312", "gbk", "gb18030", "big5", "cp950", "euc_kr", "cp949")
)
"""Encodings of several bytes per letter, by the names of their codecs, which expat does not know."""
_QUALITY = ("satellites", "hdop", "vdop", "pdop", "fix_type")
"""The columns of what a GPX point says of its quality."""
_PLANNED = "a point of the track has no time; only a recorded track can be imported"

DAMAGES = (
    *(zipfile.BadZipFile, zlib.error, OSError),  # of the archive, and of its streams
    *(NotImplementedError, RuntimeError, EOFError, ValueError),
)
"""What `zipfile` raises for archives that it cannot unpack."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The methods whose unpackers need a fixed amount of memory: LZMA reserves as much as its header claims."""
_PACKED, _SMALL = 200, 10_000_000
"""Times the size of an archive that a large content may have (texts of flights are packed to a tenth); bytes of one."""


def is_log(path: Path) -> bool:
    """Return whether a file is called as logs are."""
    return path.suffix.lower() in SUFFIXES


def read_log(path: Path, layout: ColumnLayout | None = None, *, aircraft: str | None = None) -> Recording:
    """Return the recording in a file: CSV, GPX, IGC, or ACMI as text or zipped; its first bytes say which.

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
                return _read_archive(name, file, aircraft)
            encoding = _encoding(first)
            plain = first.decode(encoding, "replace").lstrip("\ufeff \t\r\n")
            if plain.startswith("<"):
                content = file.read(GPX_SIZE_MAX + 1)
                if len(content) > GPX_SIZE_MAX:
                    refuse(name, 0, f"is larger than {GPX_SIZE_MAX // 1024**2} MiB; cut the log to the flight")
                return read_gpx(name, content.lstrip(), layout.zone)
            if plain.startswith("FileType=text/acmi"):
                return read_acmi(name, _lines(name, file, encoding), aircraft)
            if any(POSITION.search(line) for line in plain.splitlines()):
                return read_nmea(name, _lines(name, file, encoding))
            if path.suffix.lower() == ".igc" or any(FIX.match(line) for line in plain.splitlines()[:-1]):
                return read_igc(name, _lines(name, file, encoding))
            if first[8:12] == b".FIT":
                return read_fit(name, file)
            if "\0" in plain[:512]:
                refuse(name, 0, "is no log: expected CSV, GPX, IGC or ACMI")
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


def _encoding(first: bytes) -> str:
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


def _read_archive(path: str, file: BinaryIO, aircraft: str | None) -> Recording:
    """Return the recording in an archive, whose names are not trusted: its first ACMI text is read."""
    try:
        with zipfile.ZipFile(file) as archive:
            entry = archive_entry(path, archive, (".acmi", ".txt"), "an ACMI recording")
            if entry.file_size > max(_PACKED * entry.compress_size, _SMALL):
                refuse(path, 0, f"is packed to less than a {_PACKED}th, as no flight is; unpack it and cut it to that")
            with archive.open(entry) as unpacked:
                return read_acmi(path, _lines(path, unpacked, "utf-8-sig"), aircraft)
    except DAMAGES as error:
        refuse(path, 0, f"is a damaged archive: {error}")


def xml_tree(path: str, content: bytes) -> Element:
    """Return the root of a document; elements are named without their namespaces.

    A document type is refused: its entities could grow beyond all memory.

    Args:
        path: of the file, for messages.
        content: of the file.

    Raises:
        InputError: it is no XML, or holds a document type.
    """
    try:
        root = _parse(path, content)
        assert root is not None  # all is read
        return root
    except expat.ExpatError as error:
        refuse(path, error.lineno, f"is no XML: {expat.ErrorString(error.code)}")


def _codec(name: str) -> str:
    try:
        return codecs.lookup(name).name
    except LookupError:
        return ""


def _parse(
    path: str, content: bytes, take: Callable[[Element, int], None] = lambda element, line: None, only: str = ""
) -> Element | None:
    """Return the root of a document, as `xml_tree` does; raise an ExpatError where it is no XML.

    Every element is taken as it ends, with its last line. Where only elements of one name are to be read (`only`) with
    what they hold, all others are taken empty and there is no root, so the rest of the document needs no memory.
    """
    encoding = None
    if (declared := _DECLARED.match(content)) and (codec := _codec(declared[1].decode())) in _MULTIBYTE:
        content, encoding = content.decode(codec, "replace").encode(), "utf-8"
    builder, parser = TreeBuilder(), expat.ParserCreate(encoding, namespace_separator=" ")
    depth, inside = 0, 0  # of all elements, and of those that are read

    def begin(name: str, attributes: Mapping[str, str]) -> None:
        nonlocal depth, inside
        tag, depth = name.rpartition(" ")[2], depth + 1
        if depth > DEPTH_MAX:
            refuse(path, parser.CurrentLineNumber, f"holds elements within elements, more than {DEPTH_MAX} deep")
        if inside or not only or tag == only:
            inside += 1
            builder.start(tag, dict(attributes))

    def end(name: str) -> None:
        nonlocal builder, depth, inside
        tag, depth = name.rpartition(" ")[2], depth - 1
        if not inside:
            take(Element(tag), parser.CurrentLineNumber)
            return
        inside -= 1
        take(builder.end(tag), parser.CurrentLineNumber)
        if only and not inside:
            builder = TreeBuilder()

    def data(text: str) -> None:
        if inside:
            builder.data(text)

    def doctype(*_: object) -> None:
        refuse(path, parser.CurrentLineNumber, "holds a document type; such a file needs none")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except (LookupError, ValueError):  # Python's codecs, of which expat takes those of a byte per letter
        refuse(path, 1, "declares an encoding that is not read; save it as UTF-8")
    return None if only else builder.close()


def read_gpx(path: str, content: bytes, zone: tzinfo | None) -> Recording:
    """Return the first track of a GPX file that has points with times, with the other such tracks.

    Args:
        path: of the file, for messages.
        content: of the file.
        zone: of times that name none; None for UTC.

    Raises:
        InputError: it is no GPX, or no two points have a time.
    """
    read = SampleTable(path, 0, "point")  # of all tracks
    tracks = [SampleTable(path, 4 + len(_QUALITY))]

    def take(element: Element, line: int) -> None:
        if element.tag == "trk" and tracks[-1].lines:
            tracks.append(SampleTable(path, 4 + len(_QUALITY)))
        if element.tag == "trkpt":
            height, when = ((element.findtext(key) or "").strip() for key in ("ele", "time"))
            try:
                time = iso_seconds(when, zone)
            except (ValueError, OverflowError):
                message = f"`{when[:40]}` is no time; expected one such as 2016-03-12T14:03:07Z"
                read.leave_out(line, message if when else _PLANNED, "time")
                return
            place = [read.number(line, element.get(key, ""), key) for key in ("lat", "lon")]
            read.append(line)
            quality = [_gpx_number(element, key) for key in ("sat", "hdop", "vdop", "pdop")]
            fix = element.findtext("fix")
            up = read.number(line, height, "ele") if height else math.nan
            tracks[-1].append(line, time, *place, up, *quality, math.nan if fix is None else fix_type(fix))

    try:
        _parse(path, content, take, "trkpt")
    except expat.ExpatError as error:
        broken = f"is no XML: {expat.ErrorString(error.code)}"
        if len(read.lines) < 2:
            refuse(path, error.lineno, broken)
        read.leave_out(error.lineno, broken, "rest")
    recorded = [track for track in tracks if len(track.lines) > 1]
    if not recorded:
        read.refuse_first_fault()
        refuse(path, 0, "holds no recorded track (`trkpt` with `time`)")
    remarks = read.remarks
    if len(recorded) > 1:
        remarks += (f"it holds {len(recorded)} recorded tracks",)
    first, *further = [_gpx_track(path, table, remarks, f"track {row}") for row, table in enumerate(recorded, 1)]
    return replace(first, others=tuple(further))


def _gpx_number(element: Element, key: str) -> float:
    """Return a number of a point's quality; NaN where there is none."""
    try:
        return float(element.findtext(key) or "nan")
    except ValueError:
        return math.nan


def _gpx_track(path: str, samples: SampleTable, remarks: tuple[str, ...], label: str) -> Recording:
    lines, (time, latitude, longitude, altitude, *quality) = samples.arrays("")
    columns = {"latitude": np.radians(latitude), "longitude": np.radians(longitude), "altitude": altitude}
    columns |= {name: values for name, values in zip(_QUALITY, quality, strict=True) if np.isfinite(values).any()}
    return Recording(path, "gpx", time - time[0], columns, lines, instant(float(time[0])), remarks, label=label)
