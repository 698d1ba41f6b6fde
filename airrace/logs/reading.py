"""The reader of logs: which format a file has, how much of it is trusted, and the formats besides CSV.

GPX 1.0 and 1.1; IGC by the FAI's technical specification for GNSS flight recorders, appendix A; Tacview's ACMI 2.x as
text, in which what a line leaves out is as in the line before.
"""

import io
import logging
import math
import os
import re
import stat
import zipfile
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime, tzinfo
from pathlib import Path
from typing import IO, BinaryIO
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from airrace.logs.csv_log import ColumnLayout, read_csv
from airrace.logs.recording import (
    LIMITS,
    Recording,
    SampleTable,
    enumerate_words,
    instant,
    iso_seconds,
    refuse,
    unwrap_days,
)
from airrace.standard_streams import STANDARD, name_of, read_bytes

logger = logging.getLogger(__name__)

SUFFIXES = (".csv", ".txt", ".tsv", ".gpx", ".igc", ".acmi", ".zip")
"""The names' ends by which logs are recognised."""
_FIX = re.compile(r"B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])([AV])(-\d{4}|\d{5})(-\d{4}|\d{5})")
_DATE = re.compile(r"H[FOP]DTE(?:DATE)?:?\s*(\d\d)(\d\d)(\d\d)")
_ADDITION = re.compile(r"(\d\d)(\d\d)([A-Z]{3})")
_PLACE = ("longitude", "latitude", "altitude", "phi", "theta", "psi")
_PLACE_VALUES = {3: 3, 5: 3, 6: 6, 9: 6}
"""The number of values of a transform that are in `_PLACE`, by the number of all its values."""
_PROPERTIES = {"TAS": "V_A", "IAS": "V_I", "VerticalGForce": "n_z"}
_COLUMNS = (*_PLACE, *_PROPERTIES.values())


def is_log(path: Path) -> bool:
    """Return whether a file is called as logs are."""
    return path.suffix.lower() in SUFFIXES


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
        with _open(path) as file:
            logger.info("%s is read", name)
            first = file.read(512)
            file.seek(0)
            if first.startswith(b"PK"):
                return _read_archive(name, file, aircraft)
            plain = first.lstrip(b"\xef\xbb\xbf \t\r\n")
            if plain.startswith(b"<"):
                content = file.read(LIMITS.gpx_size + 1)
                if len(content) > LIMITS.gpx_size:
                    refuse(name, 0, f"is larger than {LIMITS.gpx_size // 1024**2} MiB; cut the log to the flight")
                return read_gpx(name, content, known.zone)
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


def _open(path: Path) -> BinaryIO:
    large = f"is larger than {LIMITS.size // 1024**3} GiB; cut the log to the flight"
    if path == STANDARD:
        content = read_bytes(path, LIMITS.size + 1)
        if len(content) > LIMITS.size:
            refuse(name_of(path), 0, large)
        return io.BytesIO(content)
    # A named pipe without a writer would block a plain open.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    status = os.fstat(descriptor)
    regular = stat.S_ISREG(status.st_mode)
    if not regular or status.st_size > LIMITS.size:
        os.close(descriptor)
        refuse(str(path), 0, large if regular else "is not a file")
    return open(descriptor, "rb")


def _lines(path: str, file: IO[bytes]) -> Iterator[str]:
    """Yield the lines, none of them without end and all of them together no longer than they may be."""
    number, size = 0, 0
    while line := file.readline(LIMITS.line):
        number, size = number + 1, size + len(line)
        if len(line) >= LIMITS.line:
            refuse(path, number, "has a line without end; is this a text file?")
        if size > LIMITS.size:
            refuse(path, number, f"is larger than {LIMITS.size // 1024**3} GiB unpacked; cut the log to the flight")
        yield line.decode("utf-8", "replace")


def _read_archive(path: str, file: BinaryIO, aircraft: str | None) -> Recording:
    """Return the recording in an archive, whose names are not trusted: its first ACMI text is read."""
    try:
        with zipfile.ZipFile(file) as archive:
            entry = next((one for one in archive.infolist() if one.filename.lower().endswith((".acmi", ".txt"))), None)
            if entry is None:
                refuse(path, 0, "is an archive without an ACMI recording")
            with archive.open(entry) as unpacked:
                return read_acmi(path, _lines(path, unpacked), aircraft)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        refuse(path, 0, f"is a damaged archive: {error}")


def xml_tree(path: str, content: bytes, take: Callable[[Element, int], None] = lambda element, line: None) -> Element:
    """Return the root of a document; elements are named without their namespaces.

    A document type is refused: its entities could grow beyond all memory.

    Args:
        path: of the file, for messages.
        content: of the file.
        take: called with every element as it ends, and with its last line.

    Raises:
        InputError: it is no XML, or holds a document type.
    """
    builder, parser = TreeBuilder(), expat.ParserCreate(namespace_separator=" ")

    def begin(name: str, attributes: Mapping[str, str]) -> None:
        builder.start(name.rpartition(" ")[2], dict(attributes))

    def end(name: str) -> None:
        take(builder.end(name.rpartition(" ")[2]), parser.CurrentLineNumber)

    def doctype(*_: object) -> None:
        refuse(path, parser.CurrentLineNumber, "holds a document type; such a file needs none")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        refuse(path, error.lineno, f"is no XML: {expat.ErrorString(error.code)}")
    except (LookupError, ValueError):  # Python's codecs, of which expat takes those of a byte per letter
        refuse(path, 1, "declares an encoding that is not read; save it as UTF-8")
    return builder.close()


def read_gpx(path: str, content: bytes, zone: tzinfo | None) -> Recording:
    """Return the first track of a GPX file that has points with times.

    Args:
        path: of the file, for messages.
        content: of the file.
        zone: of times that name none; None for UTC.

    Raises:
        InputError: it is no GPX, points lack times or heights, or time runs backwards.
    """
    samples, tracks, chosen = SampleTable(path, 4, "points"), 0, -1

    def take(element: Element, line: int) -> None:
        nonlocal tracks, chosen
        tracks += element.tag == "trk"
        if element.tag != "trkpt":
            return
        chosen = tracks if chosen < 0 else chosen
        if tracks == chosen:
            height, when = ((element.findtext(key) or "").strip() for key in ("ele", "time"))
            altitude = samples.number(line, height, "ele") if height else math.nan
            place = [samples.number(line, element.get(key, ""), key, finite=False) for key in ("lat", "lon")]
            if not when:
                refuse(path, line, "a point of the track has no time; only a recorded track can be imported", "time")
            try:
                time = iso_seconds(when, zone)
            except ValueError:
                refuse(path, line, f"`{when[:40]}` is no time; expected one such as 2016-03-12T14:03:07Z", "time")
            samples.append(line, time, *place, altitude)
        element.clear()

    xml_tree(path, content, take)
    lines, (time, latitude, longitude, altitude) = samples.arrays("holds no recorded track (`trkpt` with `time`)")
    samples.ensure_rising(time, "time runs backwards; a track must be in the order of its time", "time")
    columns = {"latitude": np.radians(latitude), "longitude": np.radians(longitude), "altitude": altitude}
    remarks = (f"it holds {tracks} tracks, of which the first one with points is read",) if tracks > 1 else ()
    return Recording(path, "gpx", time - time[0], columns, lines, instant(float(time[0])), remarks)


def read_igc(path: str, lines: Iterable[str]) -> Recording:
    """Return the fixes (B records) of an IGC file, with the additions that its I record declares.

    Heights are those of the satellites, those of the barometer where they are zero.

    Args:
        path: of the file, for messages.
        lines: of the file.

    Raises:
        InputError: it holds no fixes, or one of them is damaged.
    """
    samples = SampleTable(path, 5)
    additions: dict[str, tuple[int, int]] = {}
    date: float | None = None
    for number, line in enumerate(map(str.rstrip, lines), start=1):
        if found := _DATE.match(line):
            day, month, year = (int(one) for one in found.groups())
            try:
                date = datetime(2000 + year if year < 80 else 1900 + year, month, day, tzinfo=UTC).timestamp()
            except ValueError:
                refuse(path, number, f"{day:02}{month:02}{year:02} is no date (day, month, year)")
        elif line.startswith("I"):
            additions = {code: (int(first) - 1, int(last)) for first, last, code in _ADDITION.findall(line[3:])}
        elif line.startswith("B"):
            fix = _FIX.match(line)
            if not fix:
                refuse(path, number, f"is no fix of a flight recorder: `{line[:40]}`; expected BHHMMSSDDMMmmmN...")
            more = {code: text for code, (first, last) in additions.items() if (text := line[first:last]).isdigit()}
            samples.append(number, *_fix_values(fix, more))
    lines_of, (clock, latitude, longitude, gnss, baro) = samples.arrays("holds no fixes (B records)")
    time = unwrap_days(clock)
    samples.ensure_rising(time, "time runs backwards; fixes must be in the order of their time")
    barometric = not np.any(gnss)
    columns = {"latitude": latitude, "longitude": longitude, "altitude": baro if barometric else gnss}
    remarks = ["heights are those of the barometer, in the standard atmosphere"] if barometric else []
    if "TDS" not in additions:
        remarks.append("times are whole seconds, as this recorder writes them")
    begins = None if date is None else instant(date + float(clock[0]) % 86400.0)
    return Recording(path, "igc", time - time[0], columns, lines_of, begins, tuple(remarks))


def _fix_values(fix: re.Match[str], more: dict[str, str]) -> tuple[float, ...]:
    """Return time of day (s), latitude and longitude (rad), and the heights of satellites and barometer (m).

    `more` holds the further digits of the second (TDS) and of the minutes of both angles (LAD, LOD).
    """
    hours, minutes, seconds, south, north, ns, east, rest, ew, _, baro, gnss = fix.groups()
    fraction, latitude, longitude = (float(f"0.{more.get(code, '0')}") for code in ("TDS", "LAD", "LOD"))
    latitude = math.radians(float(south) + float(north) / 60000.0) + math.radians(latitude / 60000.0)
    longitude = math.radians(float(east) + float(rest) / 60000.0) + math.radians(longitude / 60000.0)
    time = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + fraction
    signs = 1.0 if ns == "N" else -1.0, 1.0 if ew == "E" else -1.0
    return time, signs[0] * latitude, signs[1] * longitude, float(gnss), float(baro)


class _RecordedAircraft:
    """An object of an ACMI recording: its properties, its present values by `_COLUMNS`, and its samples."""

    def __init__(self, path: str) -> None:
        self.properties: dict[str, str] = {}
        self.now = array("d", [math.nan] * len(_COLUMNS))
        self.samples = SampleTable(path, 1 + len(_COLUMNS))

    def update(self, line: int, properties: Mapping[str, str]) -> None:
        """Take the properties of a line as the present values."""
        for key, value in properties.items():
            if key == "T":
                parts = value.split("|")
                if len(parts) not in _PLACE_VALUES:
                    refuse(self.samples.path, line, f"a place has {len(parts)} values; expected 3, 5, 6 or 9", "T")
                for slot, part in enumerate(parts[: _PLACE_VALUES[len(parts)]]):
                    if part.strip():
                        self.now[slot] = self.samples.number(line, part, "T")
            elif key in _PROPERTIES:
                self.now[_COLUMNS.index(_PROPERTIES[key])] = self.samples.number(line, value, key)
            else:
                self.properties[key] = value


def read_acmi(path: str, lines: Iterable[str], wanted: str | None = None) -> Recording:
    """Return the flight of one aircraft of an ACMI recording.

    Args:
        path: of the file, for messages.
        lines: of the file.
        wanted: the name, pilot, call sign or number of the aircraft; None for the only one, or the first.

    Raises:
        InputError: it is no such recording, time runs backwards, or there is no such aircraft.
    """
    objects: dict[str, _RecordedAircraft] = {}
    common: dict[str, str] = {}
    read = SampleTable(path, 0)  # of all objects
    time = 0.0
    for number, raw in enumerate(lines, start=1):
        line = raw.rstrip("\r\n").lstrip("\ufeff")
        if number == 1 and line != "FileType=text/acmi/tacview":
            refuse(path, 1, "is no ACMI recording: expected `FileType=text/acmi/tacview` in the first line")
        if number == 2 and not line.startswith("FileVersion=2."):
            refuse(path, 2, f"expected `FileVersion=2.x`, found `{line[:40]}`")
        if number <= 2 or not line or line.startswith(("//", "-")):
            continue
        if line.startswith("#"):
            before, time = time, read.number(number, line[1:], "#")
            if time < before:
                refuse(path, number, f"time runs backwards: {time:g} s comes behind {before:g} s")
            continue
        name, *parts = line.replace("\\,", "\0").split(",")  # commas behind a backslash belong to a value
        name = name.strip().lower()
        properties = {key: value for key, _, value in (one.replace("\0", ",").partition("=") for one in parts)}
        if name == "0":
            common |= properties
            continue
        one = objects[name] = objects.get(name) or _RecordedAircraft(path)
        one.update(number, properties)
        if "T" in properties:
            read.append(number)
            one.samples.append(number, time, *one.now)
    name, count, names = _choose_aircraft(path, objects, wanted)
    samples = objects[name].samples
    lines_of, (times, *values) = samples.arrays("")
    columns = dict(zip(_COLUMNS, values, strict=True))
    for one in _PLACE:
        columns[one] = columns[one] if one == "altitude" else np.radians(columns[one])
    for one, key in (("longitude", "ReferenceLongitude"), ("latitude", "ReferenceLatitude")):
        if key in common:
            columns[one] = columns[one] + math.radians(samples.number(0, common[key], key))
    columns = {one: values for one, values in columns.items() if np.isfinite(values).any()}
    remarks = (f"it holds {count} aircraft, of which {names[-1]} is read",) if count > 1 else ()
    try:
        begins = instant(datetime.fromisoformat(common["ReferenceTime"]).timestamp() + times[0])
    except (KeyError, ValueError):
        begins = None
    return Recording(path, "acmi", times - times[0], columns, lines_of, begins, remarks)


def _choose_aircraft(
    path: str, objects: Mapping[str, _RecordedAircraft], wanted: str | None
) -> tuple[str, int, list[str]]:
    """Return the number of the aircraft that is read, of how many that move, and all its names."""
    flying = {name: one for name, one in objects.items() if len(set(one.samples.columns[0])) >= 2}
    names = {
        name: [name, *(one.properties[key] for key in ("Name", "CallSign", "Pilot") if key in one.properties)]
        for name, one in flying.items()
    }
    chosen = [name for name in flying if wanted is None or wanted in names[name]]
    if not chosen:
        known = enumerate_words([each[-1] for each in names.values()]) or "none that moves"
        asked = "an aircraft" if wanted is None else f"`{wanted[:60]}`"
        refuse(path, 0, f"holds no flight of {asked}; it has {known}")
    name = next((name for name in chosen if "Air" in flying[name].properties.get("Type", "")), chosen[0])
    return name, len(flying), names[name]
