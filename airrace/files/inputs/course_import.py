"""A draft of a course from placemarks of other programs: a track file to be checked and completed.

Gates and pylons are found by `airrace.files.inputs.element_import`. People, obstacles, safety lines and the airspace
are recognised by their names (`airrace.files.inputs.course_words`); of the other areas one around all elements is the
airspace, the rest are people. An obstacle is a mast, or boxes, of the height in its name. Every guess, and every
placemark that is not taken over, is reported.
"""

import math
from collections.abc import Sequence, Sized
from dataclasses import dataclass
from itertools import pairwise

import yaml

from airrace.files.export.globe import printable
from airrace.files.inputs.course_words import HEIGHT, Subject, plain_text
from airrace.files.inputs.element_import import ElementImport, SketchedElement, SketchedOrder
from airrace.files.inputs.import_sketch import NAME_MAX, ImportRemark, ImportSketch, degrees
from airrace.files.inputs.nodes import CORNERS_MAX, CROWDS_MAX, OBSTACLES_MAX, SAFETY_LINES_MAX
from airrace.files.inputs.placemarks import Placemark, PlacemarkFile, PlacemarkShape
from airrace.files.inputs.surroundings import BOX_MAX, OBSTACLE_HEIGHT_MAX
from airrace.flights.logs.recording import refuse
from airrace.model.track import polygons
from airrace.model.track.course import Origin
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import FOOT

STRAIGHTNESS = 1.0
"""The distance of its corners from the line through its ends up to which a line is straight, m."""
# What a file does not say; assumptions.
AIRCRAFT = "edge540"
RULES = {"n_z_max": 10, "floor_m": 10, "start_speed_max_kt": 200}
CROWD_DISTANCE = 100.0  # m
OBSTACLE_HEIGHT = 50.0  # m
OBSTACLE_HEIGHT_MIN = 0.1
"""The least height of an obstacle, m; one of 0 m is none."""
NOTICE = """\
# Sketched from {path}. Look at it with `airrace check`, and put right what no placemark says:
# the order and its laps, which way gates are passed and on which side pylons are passed, the rules, the aircraft,
# the distance from people, and the elevation of the origin.
"""


@dataclass(frozen=True)
class SketchedCourse:
    """The text of a track file, and the remarks on the placemarks it was made of.

    Attributes:
        lost: those on what is left out and may keep aircraft from people.
    """

    text: str
    remarks: tuple[ImportRemark, ...]
    lost: tuple[ImportRemark, ...]


def sketch_course(path: str, title: str, file: PlacemarkFile) -> SketchedCourse:
    """Return a track file.

    Args:
        path: of the file with the placemarks, for messages.
        title: the name of the course where that file has none.
        file: its placemarks.

    Raises:
        InputError: they hold no two elements.
    """
    marks = file.marks
    latitude, longitude = next(mark.places[0] for mark in marks if mark.places)
    elevation = next((mark.elevation for mark in marks if math.isfinite(mark.elevation)), None)
    sketch = ImportSketch(Origin(math.radians(latitude), math.radians(longitude)))
    importing = ElementImport(sketch)
    around = importing.take(marks)
    if not importing.elements:
        importing.place_first_gates(around)
    _guess_rules(sketch, elevation)
    if len(importing.elements) < 2:
        refuse(path, 0, "holds no two gates or pylons: expected points, or lines from pylon to pylon")
    order = SketchedOrder(importing.elements, sketch)
    surroundings = _Surroundings(sketch, order.elements)
    for mark in sorted(around, key=lambda mark: mark.named_subject is not Subject.AIRSPACE):
        surroundings.take(mark)
    entries, passings = order.entries(), _passings(order, surroundings)
    end = {"finish": passings.pop()} if order.closed else {}
    track = {
        "schema": "airrace/track/2",
        "name": (printable(file.title) or printable(title))[:NAME_MAX],
        "aircraft": AIRCRAFT,
        "origin": {**degrees([(latitude, longitude)])[0], "elevation_m": round(elevation or 0.0, 1)},
        "rules": dict(RULES),
        "gates": entries,
        "safety_lines": surroundings.lines,
        "crowd": surroundings.crowd,
        "obstacles": surroundings.obstacles,
        "airspace": surroundings.airspace,
        "course": {"start": order.elements[0].name, "lap": passings, **end},
    }
    track = {key: value for key, value in track.items() if value not in ({}, [])}
    text = yaml.safe_dump(track, sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)
    remarks = "".join(f"# {remark.text}\n" for remark in sketch.remarks)
    lost = sketch.lost(has_people=bool(surroundings.crowd))
    text = NOTICE.format(path=printable(path)[:NAME_MAX]) + text + remarks
    return SketchedCourse(text, tuple(sketch.remarks), lost)


def _guess_rules(sketch: ImportSketch, elevation: float | None) -> None:
    """Report where the elevation of the origin comes from, and what no placemark says."""
    taken = "0 m above the sea" if elevation is None else f"{elevation:.0f} m above the sea"
    reason = "the first placemark with an elevation is"
    if elevation is None:
        reason = "the file states no elevation; far from the sea the air is thinner, so state `origin.elevation_m`"
    sketch.guess_part("origin", "the place of the first placemark", taken, reason)
    numbers = ", ".join(f"{key} {value}" for key, value in RULES.items())
    taken = f"{AIRCRAFT}, {numbers}, {CROWD_DISTANCE:.0f} m from people"
    sketch.guess_part("rules", "the aircraft and the rules", taken, "no placemark says them")


def _passings(order: SketchedOrder, surroundings: "_Surroundings") -> list[object]:
    """Return the passings after the start with the safety lines that do not hold everywhere."""
    passings: list[object] = []
    for position in range(1, len(order.elements)):
        passing = order.passing(position)
        if lines := surroundings.lines_to(position):
            passing["safety_lines"] = lines
        passings.append(passing if len(passing) > 1 else passing["gate"])
    return passings


class _Surroundings:
    """What lies around the elements, which are in race order."""

    def __init__(self, sketch: ImportSketch, elements: Sequence[SketchedElement]) -> None:
        self.sketch, self.elements = sketch, elements
        self.lines: dict[str, object] = {}
        self.crowd: dict[str, object] = {}
        self.obstacles: dict[str, object] = {}
        self.airspace: list[dict[str, float]] = []
        self._sides: dict[str, list[bool]] = {}  # of a line that does not hold everywhere, which elements are beside it

    def lines_to(self, position: int) -> list[str]:
        """Return the lines that hold on the leg to a passing, of those that do not hold everywhere."""
        return [name for name, sides in self._sides.items() if sides[position - 1] and sides[position]]

    def take(self, mark: Placemark) -> None:
        """Take people, obstacles, safety lines and airspace."""
        is_area, subject = mark.shape is PlacemarkShape.AREA, mark.subject
        if mark.joint:
            self.sketch.guess(mark, f"one {mark.shape.value}", "a single point draws none")
        if len(mark.places) > CORNERS_MAX:
            self.sketch.drop(mark, f"a course has room for {CORNERS_MAX} corners of a thing; draw it with fewer")
        elif subject is Subject.CROWD:
            self._take_crowd(mark)
        elif subject is Subject.SAFETY_LINE and mark.shape is PlacemarkShape.LINE:
            self._take_safety_line(mark)
        elif subject is Subject.OBSTACLE:
            self._take_obstacle(mark)
        elif subject is Subject.AIRSPACE and len(mark.places) > 2:
            self._take_airspace(mark)
        elif is_area and subject is not Subject.ELEMENT:
            corners = self.sketch.points(mark.places)
            encloses_all = all(polygons.inside(element.middle, corners) for element in self.elements)
            if encloses_all and not self.airspace:
                self._take_airspace(mark)
            else:
                self._take_crowd(mark)
        else:
            self.sketch.drop(mark, f"that is no {subject.value if subject else 'gate'}")

    def _take_crowd(self, mark: Placemark) -> None:
        if not self._has_room(mark, self.crowd, 1, CROWDS_MAX, "groups of people"):
            return
        shape = {PlacemarkShape.POINT: "point", PlacemarkShape.LINE: "line", PlacemarkShape.AREA: "polygon"}[mark.shape]
        places = degrees(mark.places)
        where: object = places[0] if shape == "point" else places
        self.crowd[self.sketch.key(mark.name or "crowd")] = {shape: where, "distance_m": CROWD_DISTANCE}
        if mark.named_subject is not Subject.CROWD:
            self.sketch.guess(mark, "people", "its name does not say")

    def _take_obstacle(self, mark: Placemark) -> None:
        """Take a mast, a box along every stretch of a line, or one around an area."""
        texts = [plain_text(text).lower() for text in (mark.name, mark.note)]
        match = HEIGHT.search(texts[0]) or HEIGHT.search(texts[1])
        stated = OBSTACLE_HEIGHT
        if match:
            stated = float(match[1].replace(",", ".")) * (1.0 if match[2].startswith("m") else FOOT)
        height = min(max(stated, OBSTACLE_HEIGHT_MIN), OBSTACLE_HEIGHT_MAX)
        points, what = self.sketch.points(mark.places), "an obstacle"
        boxes: list[dict[str, float]] = degrees(mark.places) if mark.shape is PlacemarkShape.POINT else []
        if mark.shape is PlacemarkShape.LINE:
            boxes, what = [_box_around(ends) for ends in pairwise(points)], "an obstacle of 2 m width"
        elif mark.shape is PlacemarkShape.AREA:
            boxes, what = [_box_around(points)], "an obstacle, a box around it"
        longest = max(box.get(side, 0.0) for box in boxes for side in ("length_m", "width_m"))
        if longest > BOX_MAX:
            reason = f"an obstacle is no longer than {BOX_MAX / 1000.0:g} km, and this is {longest / 1000.0:.1f} km"
            self.sketch.drop(mark, f"{reason}; draw it in parts")
            return
        if not self._has_room(mark, self.obstacles, len(boxes), OBSTACLES_MAX, "obstacles"):
            return
        for box in boxes:
            self.obstacles[self.sketch.key(mark.name or "obstacle")] = {**box, "height_m": round(height, 1)}
        if not match:
            self.sketch.guess(mark, f"{what} {height:.0f} m high", "neither name nor note has a height such as `60 m`")
        elif height != stated:
            limits = f"the height of an obstacle is more than 0 and at most {OBSTACLE_HEIGHT_MAX:g} m"
            self.sketch.guess(mark, f"{what} {height:g} m high", f"{limits}, and {stated:.4g} m are named")
        elif mark.named_subject is not Subject.OBSTACLE or mark.shape is not PlacemarkShape.POINT:
            drawn = "a course knows masts, cylinders and boxes"
            self.sketch.guess(mark, what, "its name does not say" if mark.shape is PlacemarkShape.POINT else drawn)

    def _take_airspace(self, mark: Placemark) -> None:
        if self.airspace:
            self.sketch.drop(mark, "a course has one airspace, and another one is taken over")
            return
        self.airspace = degrees(mark.places)
        if mark.stated is Subject.AIRSPACE and mark.note:
            reason = f"its heights, {mark.note}, are not those of the race: `floor_m` and `ceiling_m` of `rules` are"
            self.sketch.guess(mark, "the border of the airspace", reason)
        if mark.shape is PlacemarkShape.LINE:
            self.sketch.guess(mark, "the border of the airspace", "it is not closed")
        elif mark.named_subject is not Subject.AIRSPACE:
            self.sketch.guess(mark, "the airspace", "all gates and pylons lie within it, and its name does not say")

    def _take_safety_line(self, mark: Placemark) -> None:
        """Take a straight line, or every stretch of a bent one: on the side on which most elements stand."""
        points, places = self.sketch.points(mark.places), mark.places
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
                self.sketch.drop(mark, f"no leg lies on one side of {where}")
                continue
            key, (first, last) = self.sketch.key(mark.name or "safety_line"), degrees(corners)
            self.lines[key] = {"from": first, "to": last, "keep": "right" if right else "left"}
            if legs < len(sides) - 1:
                self._sides[key] = beside
                what += f" on {legs} of {len(sides) - 1} legs"
                self.sketch.guess(
                    mark, what, "the others begin or end on the other side, on which fewer elements stand"
                )
            elif len(points) > 2:
                self.sketch.guess(mark, what, "a safety line of a course is straight, and this one is bent")

    def _has_room(self, mark: Placemark, members: Sized, more: int, most: int, what: str) -> bool:
        """Return whether a course has room for so many more members of a group; drop the placemark if not."""
        total = len(members) + more
        if total > most:
            self.sketch.drop(mark, f"a course has room for {most} {what}, and with it there were {total}")
        return total <= most


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
