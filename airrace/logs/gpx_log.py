"""Logs as GPX 1.0 and 1.1: the points of its tracks, in order."""

import math
from array import array
from collections.abc import Mapping
from datetime import UTC, datetime
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from airrace.logs.csv_log import ROWS_MAX
from airrace.logs.recording import ColumnLayout, Recording, first_backwards, instant, refuse


def xml_tree(path: str, content: bytes) -> Element:
    """Return the root of a document; elements are named without their namespaces.

    Args:
        path: of the file, for messages.
        content: of the file.

    Raises:
        InputError: it is no XML, or holds a document type.
    """
    builder, parser = TreeBuilder(), expat.ParserCreate(namespace_separator=" ")

    def begin(name: str, attributes: Mapping[str, str]) -> None:
        builder.start(name.rpartition(" ")[2], dict(attributes))

    def end(name: str) -> None:
        builder.end(name.rpartition(" ")[2])

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


_TOLD = {"time", "ele"}


def read_gpx(path: str, content: bytes, layout: ColumnLayout) -> Recording:
    """Return the first track of a GPX file that has points with times.

    A document type is refused: GPX needs none, and entities could grow beyond all memory.

    Args:
        path: of the file, for messages.
        content: of the file.
        layout: the zone of times that name none.

    Raises:
        InputError: it is no GPX, points lack times or heights, or time runs backwards.
    """
    reader = _GpxReader(path, layout)
    try:
        reader.parser.Parse(content, True)
    except expat.ExpatError as error:
        refuse(path, error.lineno, f"is no XML: {expat.ErrorString(error.code)}")
    return reader.recording()


class _GpxReader:
    """The parser's callbacks; a point is taken when its element ends."""

    def __init__(self, path: str, layout: ColumnLayout) -> None:
        self._path, self._layout = path, layout
        self._rows = tuple(array("d") for _ in range(4))
        self._lines = array("q")
        self._track, self._tracks, self._taken = 0, 0, 0
        self._text: list[str] | None = None
        self._inside = False
        self._point: dict[str, str] = {}
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._data
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _doctype(self, *_: object) -> None:
        refuse(self._path, self.parser.CurrentLineNumber, "holds a document type; a GPX file has none")

    def _start(self, name: str, attributes: Mapping[str, str]) -> None:
        plain = name.rpartition(" ")[2]
        if plain == "trk":
            self._tracks += 1
        elif plain == "trkpt":
            self._inside = True
            self._point = {"lat": attributes.get("lat", ""), "lon": attributes.get("lon", "")}
        elif self._inside and plain in _TOLD:
            self._text = []

    def _data(self, text: str) -> None:
        if self._text is not None:
            self._text.append(text)

    def _end(self, name: str) -> None:
        plain = name.rpartition(" ")[2]
        if plain in _TOLD and self._text is not None:
            self._point[plain] = "".join(self._text).strip()
            self._text = None
        elif plain == "trkpt":
            self._inside = False
            self._take(self.parser.CurrentLineNumber)

    def _take(self, line: int) -> None:
        self._taken = self._taken or self._tracks
        if self._tracks != self._taken:
            return
        if len(self._lines) >= ROWS_MAX:
            refuse(self._path, line, f"holds more than {ROWS_MAX} points; cut the log to the flight")
        place = [self._number(line, key) for key in ("lat", "lon", "ele")]
        for values, value in zip(self._rows, (self._when(line), *place), strict=True):
            values.append(value)
        self._lines.append(line)

    def _when(self, line: int) -> float:
        text = self._point.get("time", "")
        if not text:
            refuse(self._path, line, "a point of the track has no time; only a recorded track can be imported", "time")
        try:
            when = datetime.fromisoformat(text)
        except ValueError:
            refuse(self._path, line, f"`{text[:40]}` is no time; expected one such as 2016-03-12T14:03:07Z", "time")
        return (when if when.tzinfo is not None else when.replace(tzinfo=self._layout.zone or UTC)).timestamp()

    def _number(self, line: int, key: str) -> float:
        text = self._point.get(key, "")
        if not text and key == "ele":
            return math.nan
        try:
            return float(text)
        except ValueError:
            refuse(self._path, line, f"`{text[:40]}` is no number", key)

    def recording(self) -> Recording:
        """Return all points of the track.

        Raises:
            InputError: there are none, or time runs backwards.
        """
        if len(self._lines) < 2:
            refuse(self._path, 0, "holds no recorded track (`trkpt` with `time`)")
        time, latitude, longitude, altitude = (np.array(one, np.float64) for one in self._rows)
        lines = np.array(self._lines, np.int64)
        if (row := first_backwards(time)) is not None:
            refuse(self._path, int(lines[row]), "time runs backwards; a track must be in the order of its time", "time")
        more = f"it holds {self._tracks} tracks, of which the first one with points is read"
        columns = {"latitude": np.radians(latitude), "longitude": np.radians(longitude), "altitude": altitude}
        remarks = (more,) if self._tracks > 1 else ()
        return Recording(self._path, "gpx", time - time[0], columns, lines, instant(float(time[0])), remarks)
