"""What the import of a course works with: its plane and the names in it, and what is guessed or lost on the way."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.files.export.globe import printable
from airrace.files.inputs.course_words import Subject, plain_text, subject_in
from airrace.files.inputs.placemarks import HOLE, Placemark, PlacemarkShape
from airrace.model.track.course import Origin, geodetic, metres
from airrace.model.track.polygons import Point

NAME_MAX = 100
"""The letters of a name that are kept."""


@dataclass(frozen=True)
class ImportRemark:
    """A guess about a placemark or a key of the course, or why a placemark is not taken over.

    Attributes:
        name: of the placemark.
        form: its shape and the number of its places, in words.
        taken_as: what it was taken for; empty where it is not taken over.
        reason: why, a clause.
    """

    name: str
    form: str
    taken_as: str
    reason: str

    @property
    def text(self) -> str:
        """The remark in words."""
        thing = f"'{self.name}', {self.form}" if self.name else f"{self.form} without a name"
        if self.taken_as:
            return f"guessed: {thing}, is {self.taken_as}: {self.reason}"
        return f"not taken over: {thing}: {self.reason}"


class ImportSketch:
    """The plane of a course, the names in it, and the remarks of its import."""

    def __init__(self, origin: Origin) -> None:
        self.origin = origin
        self.remarks: list[ImportRemark] = []
        self._people: list[ImportRemark] = []  # left out, though people, safety lines, or lines that may be either
        self._unknown: list[ImportRemark] = []  # left out, whatever they are
        self._names: set[str] = set()

    def guess(self, mark: Placemark, taken_as: str, reason: str) -> None:
        """Remark on a placemark that is taken for something."""
        self.remarks.append(ImportRemark(printable(mark.name)[:NAME_MAX], form_of(mark), taken_as, reason))

    def guess_part(self, name: str, form: str, taken_as: str, reason: str) -> None:
        """Remark on a part of the course."""
        self.remarks.append(ImportRemark(name, form, taken_as, reason))

    def drop(self, mark: Placemark, reason: str) -> None:
        """Remark on a placemark that is left out."""
        self.guess(mark, "", reason)
        subject = mark.subject
        if mark.shape is PlacemarkShape.LINE and subject is Subject.ELEMENT:
            subject = mark.hinted_subject or subject_in(mark.name)  # a number as a name is any line's
        if subject in (Subject.CROWD, Subject.SAFETY_LINE) and mark.hint != HOLE:
            self._people.append(self.remarks[-1])
        elif subject is None and mark.shape is PlacemarkShape.LINE:
            self._people.append(self.remarks[-1])  # what else is drawn as a long line
        elif subject is None and mark.shape is not PlacemarkShape.OTHER:
            self._unknown.append(self.remarks[-1])

    def lost(self, *, has_people: bool) -> tuple[ImportRemark, ...]:
        """Return what is left out and may keep aircraft from people; points only where the course holds no people."""
        return (*self._people, *(() if has_people else self._unknown))

    def key(self, name: str) -> str:
        """Return a name as a unique key."""
        plain = "_".join(re.findall(r"[A-Za-z0-9]+", plain_text(name)))[:40] or "g"
        plain = f"g_{plain}" if plain[0].isdigit() else plain
        number, key = 2, plain
        while key in self._names:
            key, number = f"{plain}_{number}", number + 1
        self._names.add(key)
        return key

    def geodetic(self, points: Sequence[Point]) -> tuple[tuple[float, float], ...]:
        """Return latitude and longitude of points, degrees."""
        north, east = np.array([point.north for point in points]), np.array([point.east for point in points])
        latitude, longitude = (np.degrees(angles).tolist() for angles in geodetic(north, east, self.origin))
        return tuple(zip(latitude, longitude, strict=True))

    def points(self, places: Sequence[tuple[float, float]]) -> tuple[Point, ...]:
        """Return places in metres."""
        latitude, longitude = np.radians(np.array(places, np.float64)).T
        north, east, _ = metres(latitude, longitude, self.origin)
        return tuple(Point(float(n), float(e)) for n, e in zip(north, east, strict=True))


def distance(points: Sequence[Point]) -> float:
    """Return the distance from the first to the last of some points, m."""
    return math.hypot(points[-1].north - points[0].north, points[-1].east - points[0].east)


def middle_of(points: Sequence[Point]) -> Point:
    """Return the mean of some points."""
    count = len(points)
    return Point(sum(point.north for point in points) / count, sum(point.east for point in points) / count)


def form_of(mark: Placemark) -> str:
    """Return the shape of a placemark in words."""
    if mark.joint:
        return mark.joint
    match mark.shape:
        case PlacemarkShape.POINT:
            return "a point"
        case PlacemarkShape.LINE:
            return f"a line of {len(mark.places)} places"
        case PlacemarkShape.AREA:
            return f"an area of {len(mark.places)} corners"
        case PlacemarkShape.OTHER:
            return "no point, line or area"


def degrees(places: Sequence[tuple[float, float]]) -> list[dict[str, float]]:
    """Return the keys of places, which are in degrees."""
    return [
        {"latitude_deg": round(latitude, 8), "longitude_deg": round(longitude, 8)} for latitude, longitude in places
    ]
