"""Logs as GPX 1.0 and 1.1: the points of its tracks, in order."""

import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, tzinfo
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from airrace.logs.recording import ColumnLayout, Recording, SampleTable, instant, refuse


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
    return builder.close()


def read_gpx(path: str, content: bytes, layout: ColumnLayout) -> Recording:
    """Return the first track of a GPX file that has points with times.

    Args:
        path: of the file, for messages.
        content: of the file.
        layout: the zone of times that name none.

    Raises:
        InputError: it is no GPX, points lack times or heights, or time runs backwards.
    """
    samples, tracks, chosen = SampleTable(path, 4, "points"), 0, -1

    def take(element: Element, line: int) -> None:
        nonlocal tracks, chosen
        if element.tag == "trk":
            tracks += 1
        if element.tag == "trkpt":
            chosen = tracks if chosen < 0 else chosen
            if tracks == chosen:
                texts = {key: element.get(key, "") for key in ("lat", "lon")}
                texts |= {key: (element.findtext(key) or "").strip() for key in ("ele", "time")}
                altitude = samples.number(line, texts["ele"], "ele") if texts["ele"] else math.nan
                place = (samples.number(line, texts[key], key, finite=False) for key in ("lat", "lon"))
                samples.append(line, _instant(path, line, texts["time"], layout.zone), *place, altitude)
            element.clear()

    xml_tree(path, content, take)
    lines, (time, latitude, longitude, altitude) = samples.arrays("holds no recorded track (`trkpt` with `time`)")
    samples.ensure_rising(time, "time runs backwards; a track must be in the order of its time", "time")
    more = f"it holds {tracks} tracks, of which the first one with points is read"
    columns = {"latitude": np.radians(latitude), "longitude": np.radians(longitude), "altitude": altitude}
    remarks = (more,) if tracks > 1 else ()
    return Recording(path, "gpx", time - time[0], columns, lines, instant(float(time[0])), remarks)


def _instant(path: str, line: int, text: str, zone: tzinfo | None) -> float:
    """Return seconds since 1970."""
    if not text:
        refuse(path, line, "a point of the track has no time; only a recorded track can be imported", "time")
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        refuse(path, line, f"`{text[:40]}` is no time; expected one such as 2016-03-12T14:03:07Z", "time")
    return (when if when.tzinfo is not None else when.replace(tzinfo=zone or UTC)).timestamp()
