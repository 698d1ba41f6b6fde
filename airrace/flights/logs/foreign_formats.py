"""Formats that are no logs, or no courses, by their first bytes: a file of one is refused by its name, with advice."""

import re
from dataclasses import dataclass
from typing import Never

from airrace.flights.logs.recording import refuse

_COURSE = "`airrace init NAME --from {path}` makes a course of it"
_LOG = "`airrace import {path} --course TRACK` reads it"
_TO_CSV = "export it as CSV, GPX or KML"


@dataclass(frozen=True)
class ForeignFormat:
    """A format.

    Attributes:
        name: what people call it, with its content.
        begin: how its files begin, a regular expression that is searched in their first bytes.
        advice: what to do with a file, of which `path` is the name.
        is_log, is_course: whether logs, or courses, are read from it.
    """

    name: str
    begin: bytes
    advice: str
    is_log: bool = False
    is_course: bool = False


FOREIGN_FORMATS = (
    ForeignFormat("OpenAir, which describes airspace", rb"(?m)^(AC [A-Z]|DP \d|V [XD] ?=)", _COURSE, is_course=True),
    ForeignFormat(
        "SeeYou CUP, a list of waypoints", rb'(?i)^"?(name|title)"?,"?code"?,"?country', _COURSE, is_course=True
    ),
    ForeignFormat(
        "GeoJSON, which describes places", rb'^\{(?=.{0,2000}"(Feature|FeatureCollection)")', _COURSE, is_course=True
    ),
    ForeignFormat("NMEA, the sentences of a receiver", rb"\$[A-Z]{2}(RMC|GGA|GNS),", _LOG, is_log=True),
    ForeignFormat("IGC, a flight log", rb"(?m)^(HFDTE|B\d{13}[NS]\d{8}[EW])", _LOG, is_log=True),
    ForeignFormat("ACMI, a recording of Tacview", rb"^FileType=text/acmi", _LOG, is_log=True),
    ForeignFormat("FIT, of a sports watch", rb"^.{8}\.FIT", _LOG, is_log=True),
    ForeignFormat("TCX, of a sports watch", rb"<TrainingCenterDatabase", "export it as GPX or FIT"),
    ForeignFormat(
        "a log of PX4", rb"^ULog", "convert it with `ulog2csv {path}` and take the file of vehicle_gps_position"
    ),
    ForeignFormat(
        "a log of ArduPilot",
        rb"^\xa3\x95|^FMT, ?128, ?89",
        "convert it with `mavlogdump.py --format csv --types GPS {path}`",
    ),
    ForeignFormat("UBX, of a u-blox receiver", rb"^\xb5b", "convert it to NMEA with u-center"),
    ForeignFormat("RINEX, raw measurements of a receiver", rb"RINEX VERSION", "convert it to positions first"),
    ForeignFormat("a file of airrace", rb"(?m)^schema: ?airrace/", "it is an input, given by its own option"),
    ForeignFormat("HDF5", rb"^\x89HDF", "a run is shown by `airrace show {path}`"),
    ForeignFormat("a workbook", rb"^PK.{0,2000}(xl/|content\.xml|mimetype)|^\xd0\xcf\x11\xe0", "save it as CSV"),
    ForeignFormat("a database", rb"^SQLite format 3", _TO_CSV),
    ForeignFormat("a file of MATLAB", rb"^MATLAB 5", _TO_CSV),
    ForeignFormat("a drawing (DXF)", rb"^\s*0\s+SECTION\b", "export it as KML or GeoJSON"),
    ForeignFormat("a shapefile", rb"^\0\0\x27\x0a", "export it as KML or GeoJSON"),
    ForeignFormat("a web page", rb"(?i)^<!doctype html|^<html", "the download of the file itself may have failed"),
    ForeignFormat("a PDF", rb"^%PDF", _TO_CSV),
    ForeignFormat("a picture", rb"^(\x89PNG|\xff\xd8\xff|GIF8|RIFF....WEBP)", _TO_CSV),
    ForeignFormat("compressed", rb"^(\x1f\x8b|BZh|\xfd7zXZ|7z\xbc\xaf|Rar!)", "unpack it"),
)
"""The formats, those of text that others may hold first."""
_PATTERNS = [(form, re.compile(form.begin, re.DOTALL)) for form in FOREIGN_FORMATS]


def foreign_format(first: bytes) -> ForeignFormat | None:
    """Return the format of a file by its first bytes; None where it is none of these."""
    plain = first.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n") if not first.startswith(b"\0") else first
    return next((form for form, pattern in _PATTERNS if pattern.search(plain)), None)


def refuse_foreign(path: str, form: ForeignFormat) -> Never:
    """Refuse a file by the name of its format.

    Raises:
        InputError: always.
    """
    refuse(path, 0, f"this is {form.name}; {form.advice.format(path=path)}")
