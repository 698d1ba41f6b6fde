"""A draft of a course from placemarks of other programs: a track file to be checked and completed.

A line between two places, no longer than 60 m, is a gate between its two pylons, and so are two points whose names
differ by their side alone; any other point is a single pylon. People, obstacles, safety lines and the airspace are
recognised by their names (`airrace.files.inputs.placemarks.WORDS`); of the other areas one around all elements is the
airspace, the rest are people. Elements are passed in the order of the file: gates in the direction of flight, pylons on
the outside of the turn. An obstacle is a mast, or boxes, of the height in its name. Every guess, and every placemark
that is not taken over, is reported.
"""

import math
import re
from collections.abc import Mapping, Sequence, Sized
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import yaml

from airrace.files.export.globe import printable
from airrace.files.inputs.nodes import CORNERS_MAX, CROWDS_MAX, OBSTACLES_MAX, SAFETY_LINES_MAX
from airrace.files.inputs.placemarks import (
    FINISH,
    KNIFE,
    SIDES,
    Placemark,
    PlacemarkShape,
    Subject,
    split_words,
    words_of,
)
from airrace.files.inputs.surroundings import BOX_MAX, OBSTACLE_HEIGHT_MAX
from airrace.flights.logs.recording import refuse
from airrace.model.track import polygons
from airrace.model.track.course import Origin, geodetic, metres
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import FOOT

NAME_MAX = 100
"""The letters of a name that are kept."""
GATE_WIDTH_MAX = 60.0
"""The length beyond which a line is no gate, m."""
STRAIGHTNESS = 1.0
"""The distance of its corners from the line through its ends up to which a line is straight, m."""
# What a file does not say, m; assumptions.
CROWD_DISTANCE = 100.0
OBSTACLE_HEIGHT = 50.0
OBSTACLE_HEIGHT_MIN = 0.1
"""The least height of an obstacle, m; one of 0 m is none."""
HEIGHT = re.compile(r"(\d+(?:[.,]\d+)?) ?(m|ft|feet|metres?|meters?)\b", re.IGNORECASE)
SIDE = re.compile(rf"[ _-]*(?<![a-z])({'|'.join(SIDES)})(?![a-z])", re.IGNORECASE)
FIRST_GATES = 300.0, 7.0
"""The distances of the gates of an airspace alone from its middle, and of their pylons from theirs, m."""
STRAIGHT_ROW = 0.02
"""The share of the way from the element before to the one behind by which a pylon is aside at a turn at least."""
NOTICE = """\
# Sketched from {path}. Look at it with `airrace check`, and put right what no placemark says:
# the order and its laps, which way gates are passed and on which side pylons are passed, the rules, the aircraft,
# the distance from people, and the elevation of the origin.
"""


@dataclass(frozen=True)
class ImportRemark:
    """A guess about a placemark, or why it is not taken over.

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


@dataclass(frozen=True)
class SketchedCourse:
    """The text of a track file, and the remarks on the placemarks it was made of."""

    text: str
    remarks: tuple[ImportRemark, ...]


@dataclass(frozen=True)
class _SketchedElement:
    """A gate or a pylon.

    Attributes:
        places, points: of its pylons, one or two: latitude and longitude, degrees, and metres.
        sided: whether the names of its pylons say left and right.
        words: of its name, in small letters.
    """

    name: str
    places: tuple[tuple[float, float], ...]
    points: tuple[Point, ...]
    sided: bool = False
    words: str = ""

    @property
    def middle(self) -> Point:
        north, east = sum(point.north for point in self.points), sum(point.east for point in self.points)
        return Point(north / len(self.points), east / len(self.points))


def sketch_course(path: str, title: str, marks: Sequence[Placemark]) -> SketchedCourse:
    """Return a track file.

    Args:
        path: of the file with the placemarks, for messages.
        title: the name of the course.
        marks: the placemarks, in race order.

    Raises:
        InputError: they hold no two elements.
    """
    latitude, longitude = next(mark.places[0] for mark in marks if mark.places)
    elevation = next((mark.elevation for mark in marks if math.isfinite(mark.elevation)), None)
    sketch = _Sketch(Origin(math.radians(latitude), math.radians(longitude)))
    surroundings = sketch.take_elements(marks)
    if not sketch.elements:
        sketch.place_first_gates(surroundings)
    sketch.guess_elevation(elevation)
    if len(sketch.elements) < 2:
        refuse(path, 0, "holds no two gates or pylons: expected points, or lines from pylon to pylon")
    for mark in sorted(surroundings, key=lambda mark: mark.named_subject is not Subject.AIRSPACE):
        sketch.take_surroundings(mark)
    elements, lap = sketch.elements, sketch.passings()
    track = {
        "schema": "airrace/track/2",
        "name": printable(title)[:NAME_MAX],
        "aircraft": "edge540",
        "origin": {**_degrees([(latitude, longitude)])[0], "elevation_m": round(elevation or 0.0, 1)},
        "rules": {"n_z_max": 10, "floor_m": 10, "start_speed_max_kt": 200},
        "gates": {element.name: sketch.element(index) for index, element in enumerate(elements)},
        "safety_lines": sketch.lines,
        "crowd": sketch.crowd,
        "obstacles": sketch.obstacles,
        "airspace": sketch.airspace,
        "course": {"start": elements[0].name, "lap": lap, **sketch.finish()},
    }
    track = {key: value for key, value in track.items() if value not in ({}, [])}
    text = yaml.safe_dump(track, sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)
    remarks = "".join(f"# {remark.text}\n" for remark in sketch.remarks)
    return SketchedCourse(NOTICE.format(path=printable(path)[:NAME_MAX]) + text + remarks, tuple(sketch.remarks))


class _Sketch:
    """A course as far as it is sketched."""

    def __init__(self, origin: Origin) -> None:
        self.origin = origin
        self.elements: list[_SketchedElement] = []
        self.lines: dict[str, object] = {}
        self.crowd: dict[str, object] = {}
        self.obstacles: dict[str, object] = {}
        self.airspace: list[dict[str, float]] = []
        self.remarks: list[ImportRemark] = []
        self._sides: dict[str, list[bool]] = {}  # of a line that does not hold everywhere, which elements are beside it
        self._names: set[str] = set()

    # Gates and pylons.

    def take_elements(self, marks: Sequence[Placemark]) -> list[Placemark]:
        """Take the elements; return the placemarks that may be something else."""
        partners, has_names = _partners(marks), any(mark.named_subject is Subject.ELEMENT for mark in marks)
        surroundings: list[Placemark] = []
        for index, mark in enumerate(marks):
            if index in partners:
                self._take_pair(mark, marks[partners[index]])
            elif index in partners.values():
                continue
            elif mark.shape is PlacemarkShape.OTHER:
                self._drop(mark, mark.hint)
            elif mark.subject is Subject.FLIGHT:
                self._drop(mark, "it belongs to a flight")
            elif mark.shape is PlacemarkShape.AREA or mark.subject not in (None, Subject.ELEMENT):
                surroundings.append(mark)
            elif mark.shape is PlacemarkShape.LINE:
                self._take_line(mark)
            elif mark.subject is None and mark.name and has_names:
                self._drop(mark, "its name is not that of a gate or a pylon, as names of others are")
            else:
                self._add(mark.name, mark.places)
                if _side(mark):
                    self._guess(mark, "a single pylon", "there is none of the other side")
                elif mark.named_subject is not Subject.ELEMENT:
                    self._guess(mark, "a pylon of the race", "its name does not say")
        return surroundings

    def _take_pair(self, first: Placemark, second: Placemark) -> None:
        left, right = (first, second) if _side(first) == "l" else (second, first)
        places = (*left.places, *right.places)
        width = _width(self._points(places))
        if 0.0 < width <= GATE_WIDTH_MAX:
            self._add(SIDE.sub("", split_words(first.name)), places, sided=True)
            return
        for mark in (first, second):
            self._add(mark.name, mark.places)
            self._guess(mark, "a single pylon", f"the one of the other side stands {width:.0f} m away")

    def _take_line(self, mark: Placemark) -> None:
        width = _width(self._points(mark.places))
        if len(mark.places) > 2:
            self._drop(mark, "a gate is a line from pylon to pylon, and no word of its name marks it as anything else")
        elif not 0.0 < width <= GATE_WIDTH_MAX:
            self._drop(mark, f"it is {width:.0f} m long, and a gate no wider than {GATE_WIDTH_MAX:.0f} m")
        else:
            self._add(mark.name, mark.places)
            if mark.name and mark.subject is not Subject.ELEMENT:
                self._guess(mark, "a gate", "its name does not say")

    def _add(self, name: str, places: tuple[tuple[float, float], ...], *, sided: bool = False) -> None:
        key = _key(name or f"g{len(self.elements)}", self._names)
        self.elements.append(_SketchedElement(key, places, self._points(places), sided, " ".join(words_of(name))))

    def place_first_gates(self, marks: Sequence[Placemark]) -> None:
        """Place a start and a finish in the first airspace, along its longest side."""
        area = next((mark for mark in marks if mark.subject is Subject.AIRSPACE and len(mark.places) > 2), None)
        if area is None:
            return
        corners = self._points(area.places)
        count = len(corners)
        middle = Point(sum(corner.north for corner in corners) / count, sum(corner.east for corner in corners) / count)
        begin, end = max(polygons.edges(corners, closed=True), key=_width)
        length = _width((begin, end))
        along = Point((end.north - begin.north) / length, (end.east - begin.east) / length)
        (far, half), gates = FIRST_GATES, list[tuple[str, list[Point]]]()
        for name, ahead in (("start", -far), ("finish", far)):
            posts = [
                Point(
                    middle.north + ahead * along.north - aside * along.east,
                    middle.east + ahead * along.east + aside * along.north,
                )
                for aside in (-half, half)
            ]
            gates.append((name, posts))
        if not all(polygons.inside(post, corners) for _, posts in gates for post in posts):
            return
        for name, posts in gates:
            self._add(name, self._geodetic(posts))
        reason = "the file holds an airspace and no gate or pylon: move them, and add the others"
        self.remarks.append(ImportRemark("start, finish", "two gates", "a course to begin with", reason))

    def guess_elevation(self, stated: float | None) -> None:
        """Report where the elevation of the origin comes from."""
        taken = "0 m above the sea" if stated is None else f"{stated:.0f} m above the sea"
        reason = "the file states no elevation" if stated is None else "the first placemark with an elevation is"
        self.remarks.append(ImportRemark("origin", "the place of the first placemark", taken, reason))

    def finish(self) -> Mapping[str, object]:
        """Return the key of the finish where the start is also that by its name."""
        first = self.elements[0]
        if not re.search(rf"\bstart\b.*\b({FINISH})\b", first.words):
            return {}
        self.remarks.append(ImportRemark(first.name, "a gate", "start and finish", "its name says both"))
        return {"finish": first.name}

    def element(self, index: int) -> Mapping[str, object]:
        """Return the keys of an element."""
        element = self.elements[index]
        before, after = self._neighbours(index)
        way = Point(after.north - before.north, after.east - before.east)
        if len(element.points) == 1:
            return {"type": "pylon", **_degrees(element.places)[0], "pass_side_deg": self._pass_side(index)}
        left, right = element.points
        # the axis is a quarter turn to the left of the way from the left pylon to the right one
        forward = (right.east - left.east) * way.north - (right.north - left.north) * way.east
        if element.sided and forward < 0.0:
            reason = "the way leads through it with its left pylon on the right"
            self.remarks.append(ImportRemark(element.name, "two points", "a gate", reason))
        kind = "knife-edge" if re.search(rf"\b({KNIFE})\b", element.words) else "level"
        return {"type": kind, "pylons": _degrees(element.places if forward >= 0.0 else element.places[::-1])}

    def _pass_side(self, index: int) -> int:
        """Return the azimuth at which a pylon is passed, deg: on the outside of the turn, along its bisector.

        In a straight row it is square to the way, on the other side than that of the pylon before, as in a slalom.
        """
        (before, after), pylon = self._neighbours(index), self.elements[index].middle
        aside, _ = self._aside(index)
        if aside:
            near, far = _width((before, pylon)), _width((pylon, after))
            north = (pylon.north - before.north) / near + (pylon.north - after.north) / far
            east = (pylon.east - before.east) / near + (pylon.east - after.east) / far
            side = round(math.degrees(math.atan2(east, north))) % 360
        else:
            azimuth = math.degrees(math.atan2(after.east - before.east, after.north - before.north))
            side = round(azimuth + (90.0 if self._is_passed_right(index) else -90.0)) % 360
        reason = "that is the outside of the turn" if aside else "pylons of a straight row are passed in turns"
        name = self.elements[index].name
        self.remarks.append(ImportRemark(name, "a point", f"passed on its side at {side} deg", reason))
        return side

    def _is_passed_right(self, index: int) -> bool:
        """Return whether a pylon is passed on the right of the way."""
        aside, to_right = self._aside(index)
        if aside or index == 0 or len(self.elements[index - 1].points) > 1:
            return to_right or not aside
        return not self._is_passed_right(index - 1)

    def _aside(self, index: int) -> tuple[bool, bool]:
        """Return whether a pylon stands beside the way between its neighbours, and whether to its right."""
        (before, after), pylon = self._neighbours(index), self.elements[index].middle
        length = _width((before, after))
        across = polygons.to_right(before, after, pylon) if length > 0.0 else 0.0
        return abs(across) >= STRAIGHT_ROW * length and across != 0.0, across > 0.0

    def _neighbours(self, index: int) -> tuple[Point, Point]:
        """Return the middles of the elements before and behind one, itself where there is none."""
        last = len(self.elements) - 1
        return self.elements[max(index - 1, 0)].middle, self.elements[min(index + 1, last)].middle

    def passings(self) -> list[object]:
        """Return the elements after the start with the safety lines that do not hold everywhere."""
        lap: list[object] = []
        for index, element in enumerate(self.elements[1:], start=1):
            lines = [name for name, sides in self._sides.items() if sides[index - 1] and sides[index]]
            lap.append({"gate": element.name, "safety_lines": lines} if lines else element.name)
        return lap

    # What lies around.

    def take_surroundings(self, mark: Placemark) -> None:
        """Take people, obstacles, safety lines and airspace."""
        is_area, subject = mark.shape is PlacemarkShape.AREA, mark.subject
        if len(mark.places) > CORNERS_MAX:
            self._drop(mark, f"a course has room for {CORNERS_MAX} corners of a thing; draw it with fewer")
        elif subject is Subject.CROWD:
            self._take_crowd(mark)
        elif subject is Subject.SAFETY_LINE and mark.shape is PlacemarkShape.LINE:
            self._take_safety_line(mark)
        elif subject is Subject.OBSTACLE:
            self._take_obstacle(mark)
        elif subject is Subject.AIRSPACE and len(mark.places) > 2:
            self._take_airspace(mark)
        elif is_area and subject is not Subject.ELEMENT:
            corners = self._points(mark.places)
            encloses_all = all(polygons.inside(element.middle, corners) for element in self.elements)
            if encloses_all and not self.airspace:
                self._take_airspace(mark)
            else:
                self._take_crowd(mark)
        else:
            self._drop(mark, f"that is no {subject.value if subject else 'gate'}")

    def _take_crowd(self, mark: Placemark) -> None:
        if not self._has_room(mark, self.crowd, 1, CROWDS_MAX, "groups of people"):
            return
        shape = {PlacemarkShape.POINT: "point", PlacemarkShape.LINE: "line", PlacemarkShape.AREA: "polygon"}[mark.shape]
        places = _degrees(mark.places)
        where: object = places[0] if shape == "point" else places
        self.crowd[_key(mark.name or "crowd", self._names)] = {shape: where, "distance_m": CROWD_DISTANCE}
        if mark.named_subject is not Subject.CROWD:
            self._guess(mark, "people", "its name does not say")

    def _take_obstacle(self, mark: Placemark) -> None:
        """Take a mast, a box along every stretch of a line, or one around an area."""
        match = HEIGHT.search(mark.name) or HEIGHT.search(mark.note)
        stated = OBSTACLE_HEIGHT
        if match:
            stated = float(match[1].replace(",", ".")) * (FOOT if match[2][0] in "fF" else 1.0)
        height = min(max(stated, OBSTACLE_HEIGHT_MIN), OBSTACLE_HEIGHT_MAX)
        points, what = self._points(mark.places), "an obstacle"
        boxes: list[dict[str, float]] = _degrees(mark.places) if mark.shape is PlacemarkShape.POINT else []
        if mark.shape is PlacemarkShape.LINE:
            boxes, what = [_box_around(ends) for ends in pairwise(points)], "an obstacle of 2 m width"
        elif mark.shape is PlacemarkShape.AREA:
            boxes, what = [_box_around(points)], "an obstacle, a box around it"
        longest = max(box.get(side, 0.0) for box in boxes for side in ("length_m", "width_m"))
        if longest > BOX_MAX:
            reason = f"an obstacle is no longer than {BOX_MAX / 1000.0:g} km, and this is {longest / 1000.0:.1f} km"
            self._drop(mark, f"{reason}; draw it in parts")
            return
        if not self._has_room(mark, self.obstacles, len(boxes), OBSTACLES_MAX, "obstacles"):
            return
        for box in boxes:
            self.obstacles[_key(mark.name or "obstacle", self._names)] = {**box, "height_m": round(height, 1)}
        if not match:
            self._guess(mark, f"{what} {height:.0f} m high", "neither name nor note has a height such as `60 m`")
        elif height != stated:
            limits = f"the height of an obstacle is more than 0 and at most {OBSTACLE_HEIGHT_MAX:g} m"
            self._guess(mark, f"{what} {height:g} m high", f"{limits}, and {stated:.4g} m are named")
        elif mark.named_subject is not Subject.OBSTACLE or mark.shape is not PlacemarkShape.POINT:
            drawn = "a course knows masts, cylinders and boxes"
            self._guess(mark, what, "its name does not say" if mark.shape is PlacemarkShape.POINT else drawn)

    def _take_airspace(self, mark: Placemark) -> None:
        if self.airspace:
            self._drop(mark, "a course has one airspace, and another one is taken over")
            return
        self.airspace = _degrees(mark.places)
        if mark.stated is Subject.AIRSPACE and mark.note:
            reason = f"its heights, {mark.note}, are not those of the race: `floor_m` and `ceiling_m` of `rules` are"
            self._guess(mark, "the border of the airspace", reason)
        if mark.shape is PlacemarkShape.LINE:
            self._guess(mark, "the border of the airspace", "it is not closed")
        elif mark.named_subject is not Subject.AIRSPACE:
            self._guess(mark, "the airspace", "all gates and pylons lie within it, and its name does not say")

    def _take_safety_line(self, mark: Placemark) -> None:
        """Take a straight line, or every stretch of a bent one: on the side on which most elements stand."""
        points, places = self._points(mark.places), mark.places
        if all(abs(polygons.to_right(points[0], points[-1], point)) <= STRAIGHTNESS for point in points[1:-1]):
            points, places = (points[0], points[-1]), (places[0], places[-1])
        if not self._has_room(mark, self.lines, len(points) - 1, SAFETY_LINES_MAX, "safety lines"):
            return
        for number, ((start, end), corners) in enumerate(zip(pairwise(points), pairwise(places), strict=True), start=1):
            sides = [polygons.to_right(start, end, element.middle) > 0.0 for element in self.elements]
            right = 2 * sum(sides) >= len(sides)
            beside = [side is right for side in sides]
            legs = sum(a and b for a, b in pairwise(beside))
            what, where = "a safety line", "it"
            if len(points) > 2:
                what, where = f"a safety line along its stretch {number}, without ends", f"its stretch {number}"
            if not legs:
                self._drop(mark, f"no leg lies on one side of {where}")
                continue
            key, (first, last) = _key(mark.name or "safety_line", self._names), _degrees(corners)
            self.lines[key] = {"from": first, "to": last, "keep": "right" if right else "left"}
            if legs < len(sides) - 1:
                self._sides[key] = beside
                what += f" on {legs} of {len(sides) - 1} legs"
                self._guess(mark, what, "the others begin or end on the other side, on which fewer elements stand")
            elif len(points) > 2:
                self._guess(mark, what, "a safety line of a course is straight, and this one is bent")

    # Remarks.

    def _guess(self, mark: Placemark, taken_as: str, reason: str) -> None:
        self.remarks.append(ImportRemark(printable(mark.name)[:NAME_MAX], _form(mark), taken_as, reason))

    def _drop(self, mark: Placemark, reason: str) -> None:
        self._guess(mark, "", reason)

    def _has_room(self, mark: Placemark, members: Sized, more: int, most: int, what: str) -> bool:
        """Return whether a course has room for so many more members of a group; drop the placemark if not."""
        total = len(members) + more
        if total > most:
            self._drop(mark, f"a course has room for {most} {what}, and with it there were {total}")
        return total <= most

    def _geodetic(self, points: Sequence[Point]) -> tuple[tuple[float, float], ...]:
        """Return latitude and longitude of points, degrees."""
        north, east = np.array([point.north for point in points]), np.array([point.east for point in points])
        latitude, longitude = (np.degrees(angles).tolist() for angles in geodetic(north, east, self.origin))
        return tuple(zip(latitude, longitude, strict=True))

    def _points(self, places: Sequence[tuple[float, float]]) -> tuple[Point, ...]:
        latitude, longitude = np.radians(np.array(places, np.float64)).T
        north, east, _ = metres(latitude, longitude, self.origin)
        return tuple(Point(float(n), float(e)) for n, e in zip(north, east, strict=True))


def _partners(marks: Sequence[Placemark]) -> dict[int, int]:
    """Return the pairs of points whose names differ by their side alone: the index of the second by the first."""
    partners: dict[int, int] = {}
    waiting: dict[tuple[tuple[str, ...], str], int] = {}
    for index, mark in enumerate(marks):
        side = _side(mark)
        if mark.shape is PlacemarkShape.POINT and side and mark.subject in (None, Subject.ELEMENT):
            name = tuple(word for word in words_of(mark.name) if word not in SIDES)
            first = waiting.pop((name, "r" if side == "l" else "l"), None)
            if first is None:
                waiting[name, side] = index
            else:
                partners[first] = index
    return partners


def _side(mark: Placemark) -> str:
    """Return the side in a name: `l`, `r` or nothing."""
    sides = [SIDES[word] for word in words_of(mark.name) if word in SIDES]
    return sides[0] if len(sides) == 1 else ""


def _box_around(points: Sequence[Point]) -> dict[str, float]:
    """Return the keys of the smallest box along a side of a polygon; it is 2 m wide at least."""
    boxes: list[tuple[float, dict[str, float]]] = []
    for a, b in polygons.edges(points, closed=True):
        heading = math.atan2(b.east - a.east, b.north - a.north)
        cos, sin = math.cos(heading), math.sin(heading)
        along = [point.north * cos + point.east * sin for point in points]
        across = [point.east * cos - point.north * sin for point in points]
        u, v = 0.5 * (min(along) + max(along)), 0.5 * (min(across) + max(across))
        length, width = max(max(along) - min(along), 2.0), max(max(across) - min(across), 2.0)
        place = {"north_m": round(u * cos - v * sin, 2), "east_m": round(u * sin + v * cos, 2)}
        size = {"length_m": round(length, 2), "width_m": round(width, 2)}
        boxes.append((length * width, {**place, **size, "heading_deg": round(math.degrees(heading) % 360.0, 2)}))
    return min(boxes, key=lambda box: box[0])[1]


def _width(points: Sequence[Point]) -> float:
    return math.hypot(points[-1].north - points[0].north, points[-1].east - points[0].east)


def _form(mark: Placemark) -> str:
    match mark.shape:
        case PlacemarkShape.POINT:
            return "a point"
        case PlacemarkShape.LINE:
            return f"a line of {len(mark.places)} places"
        case PlacemarkShape.AREA:
            return f"an area of {len(mark.places)} corners"
        case PlacemarkShape.OTHER:
            return "no point, line or area"


def _degrees(places: Sequence[tuple[float, float]]) -> list[dict[str, float]]:
    return [
        {"latitude_deg": round(latitude, 8), "longitude_deg": round(longitude, 8)} for latitude, longitude in places
    ]


def _key(name: str, names: set[str]) -> str:
    """Return a name as a unique key."""
    plain = "_".join(re.findall(r"[A-Za-z0-9]+", name))[:40] or "g"
    plain = f"g_{plain}" if plain[0].isdigit() else plain
    number, key = 2, plain
    while key in names:
        key, number = f"{plain}_{number}", number + 1
    names.add(key)
    return key
