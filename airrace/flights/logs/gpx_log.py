"""Tracks of GPX 1.0 and 1.1."""

import math
from dataclasses import replace
from datetime import tzinfo
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np

from airrace.flights.logs.clocks import instant, iso_seconds
from airrace.flights.logs.quality import fix_type
from airrace.flights.logs.recording import Recording, SampleTable, refuse
from airrace.flights.logs.xml_document import parse_xml

_QUALITY = ("satellites", "hdop", "vdop", "pdop", "fix_type")
"""The columns of what a GPX point says of its quality."""
_PLANNED = "a point of the track has no time; only a recorded track can be imported"


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
        parse_xml(path, content, take, ("trkpt",))
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
