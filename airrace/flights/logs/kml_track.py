"""KML as a log: tracks (`gx:Track`, also of KML 2.3), points with a time stamp, and lines with a time span.

Its heights are above the sea, above the ground where its mode says so, and none where it is clamped to the ground.
"""

import math
import re
from dataclasses import dataclass, field, replace
from datetime import tzinfo
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np

from airrace.flights.logs.clocks import instant, iso_seconds
from airrace.flights.logs.recording import Recording, SampleTable, refuse
from airrace.flights.logs.xml_document import parse_xml

_LEAVES = ("name", "when", "coord", "angles", "coordinates", "altitudeMode", "begin", "end")
_COLUMNS: tuple[str, ...] = ("latitude", "longitude", "altitude", "psi", "theta", "phi")
_UNTIMED = (
    "is KML without times, and a line alone is no recording; write the flight as a track with times (gx:Track), or "
    "import the recorder's own file"
)

Text = tuple[int, str]
"""A text and its line."""


@dataclass
class _Placemark:
    """What is read of a placemark so far: texts of its elements, and the samples of its tracks."""

    samples: SampleTable
    texts: dict[str, list[Text]] = field(default_factory=lambda: {name: [] for name in _LEAVES})
    modes: set[str] = field(default_factory=set[str])
    stamp: Text | None = None

    def last(self, name: str) -> Text:
        """Return the last text of an element; empty where there is none."""
        return self.texts[name][-1] if self.texts[name] else (0, "")


class _KmlReader:
    """The samples of a document, as its elements end."""

    def __init__(self, path: str, zone: tzinfo | None) -> None:
        self.path, self._zone = path, zone
        self.faults = SampleTable(path, 0, "point")
        self.tracks: list[tuple[str, _Placemark]] = []
        self._moments = self._placemark()  # of points and lines, each a placemark of its own
        self._mark = self._placemark()

    def _placemark(self) -> _Placemark:
        return _Placemark(SampleTable(self.path, 1 + len(_COLUMNS)))

    def take(self, element: Element, line: int) -> None:
        """Take an element that has ended in a line."""
        mark, tag, text = self._mark, element.tag, (element.text or "").strip()
        if tag in _LEAVES:
            mark.texts[tag].append((line, text))
        elif tag == "TimeStamp" and mark.texts["when"]:
            mark.stamp = mark.texts["when"].pop()
        elif tag == "Track":
            self._take_track()
        elif tag == "Placemark":
            self._take_placemark()

    def _take_track(self) -> None:
        mark = self._mark
        whens, coords, angles = (mark.texts[name] for name in ("when", "coord", "angles"))
        if whens and len(whens) != len(coords):
            line = coords[-1][0] if coords else whens[-1][0]
            counts = f"{len(whens)} times for {len(coords)} places"
            self.faults.leave_out(line, f"a track has {counts}; those without a partner are not used", "pairs")
        turned = angles if len(angles) == len(coords) else [(0, "")] * len(coords)
        for when, place, turn in zip(whens, coords, turned, strict=False):
            self._append(mark, when, place, turn[1])
        for texts in (whens, coords, angles):
            texts.clear()

    def _take_placemark(self) -> None:
        mark, whole = self._mark, self._moments
        line, text = mark.last("coordinates")
        places = [(line, place) for place in re.sub(r"\s*,\s*", ",", text).split()]
        begin, end = mark.last("begin"), mark.last("end")
        if mark.stamp is not None and len(places) == 1:
            self._append(whole, mark.stamp, places[0])
        elif begin[1] and end[1] and len(places) == 2:
            self._append(whole, begin, places[0])
            self._append(whole, end, places[1])
        if mark.samples.lines:
            self.tracks.append((mark.last("name")[1], mark))
        self._mark = self._placemark()

    def _append(self, mark: _Placemark, when: Text, place: Text, turn: str = "") -> None:
        mark.modes.add(self._mark.last("altitudeMode")[1])
        line, text = place
        try:
            time = iso_seconds(when[1], self._zone)
        except (ValueError, OverflowError):
            self.faults.leave_out(
                when[0], f"`{when[1][:40]}` is no time; expected one such as 2016-03-12T14:03:07Z", "when"
            )
            return
        numbers = re.split(r"[,\s]+", text) if text else []
        if len(numbers) < 2:
            self.faults.leave_out(line, "has no position", "coord")
            return
        longitude, latitude, *up = (self.faults.number(line, number, "coord") for number in numbers[:3])
        angles = [self.faults.number(line, number, "angles") for number in turn.split()[:3]]
        angles += [math.nan] * (3 - len(angles))
        mark.samples.append(line, time, latitude, longitude, up[0] if up else math.nan, *angles)
        self.faults.append(line)

    def recordings(self) -> list[Recording]:
        """Return all that was recorded with times, tracks first.

        Raises:
            InputError: nothing was.
        """
        marks = [*self.tracks, ("points", self._moments)]
        marks = [(name, mark) for name, mark in marks if len(mark.samples.lines) > 1]
        if not marks:
            self.faults.refuse_first_fault()
            refuse(self.path, 0, _UNTIMED)
        return [self._recording(name or f"track {row}", mark) for row, (name, mark) in enumerate(marks, 1)]

    def _recording(self, name: str, mark: _Placemark) -> Recording:
        lines, (time, *columns) = mark.samples.arrays("")
        histories = dict(zip(_COLUMNS, columns, strict=True))
        for angle in ("latitude", "longitude", "psi", "theta", "phi"):
            histories[angle] = np.radians(histories[angle])
        up, remarks = histories.pop("altitude"), [*self.faults.remarks]
        modes = mark.modes
        if modes & {"relativeToGround", "relativeToSeaFloor"}:
            histories["height"] = up
            remarks.append("heights are above the ground, and taken as above the origin of the course")
        elif np.any(np.nan_to_num(up)):
            histories["altitude"] = up
            if "absolute" not in modes:
                remarks.append("the file does not say from where heights count: they are taken as above the sea")
        for angle in ("psi", "theta", "phi"):  # zeros are what programs write that know no attitude
            if not np.any(np.nan_to_num(histories[angle])):
                del histories[angle]
        begins = instant(float(time[0]))
        return Recording(self.path, "kml", time - time[0], histories, lines, begins, tuple(remarks), label=name)


def read_kml(path: str, content: bytes, zone: tzinfo | None) -> Recording:
    """Return the first track of a KML document with times, with the other such tracks.

    Args:
        path: of the file, for messages.
        content: of the document.
        zone: of times that name none; None for UTC.

    Raises:
        InputError: it is no XML, or holds no places with times.
    """
    reader = _KmlReader(path, zone)
    try:
        parse_xml(path, content, reader.take, _LEAVES)
    except expat.ExpatError as error:
        broken = f"is no XML: {expat.ErrorString(error.code)}"
        reader.take(Element("Track"), error.lineno)  # what a cut file holds
        reader.take(Element("Placemark"), error.lineno)
        if len(reader.faults.lines) < 2:
            refuse(path, error.lineno, broken)
        reader.faults.leave_out(error.lineno, broken, "rest")
    first, *further = reader.recordings()
    if further:
        first = replace(first, remarks=(*first.remarks, f"it holds {1 + len(further)} recorded tracks"))
    return replace(first, others=tuple(further))
