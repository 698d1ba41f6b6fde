"""Gates and pylons of placemarks: which of them make one element, in which order, and how they are passed.

A line of up to 60 m, or two points of one gate, is a gate; four points or corners that are called a quad are one; any
other point is a single pylon. Start and finish are known by their names. In between the numbers of the names are the
order where all have one, else the file's order is. Gates are passed in the direction of flight, pylons on the outside
of the turn; in a slalom on alternate sides.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from airrace.files.inputs.course_words import (
    FINISH,
    HEIGHT,
    KNIFE_EDGE,
    QUAD,
    SLALOM,
    START,
    Subject,
    gate_words,
    has_word,
    numbers_in,
    plain_text,
    side_in,
    without_side,
)
from airrace.files.inputs.import_sketch import ImportSketch, degrees, distance, middle_of
from airrace.files.inputs.placemarks import Placemark, PlacemarkShape
from airrace.model.track import polygons
from airrace.model.track.polygons import Point

GATE_WIDTH_MAX = 60.0
"""The length beyond which a line is no gate, m."""
PYLON_SIZE_MAX = 6.0
"""The length up to which an area is a pylon rather than a gate, m."""
FIRST_GATES = 300.0, 7.0
"""The distances of the gates of an airspace alone from its middle, and of their pylons from theirs, m."""
SLALOM_TURN_MAX = math.radians(30.0)
"""The largest turn of the way at a pylon in a slalom, rad; a turn that is flown around one pylon is larger."""
ARC_TURN_MIN = math.radians(8.0)
"""The least turn of the way at pylons that all turn it to one side, as an arc does, rad."""


@dataclass(frozen=True)
class SketchedElement:
    """A gate, a quad or a pylon.

    Attributes:
        name: its key.
        title: its name in the file, with that of its folder.
        places, points: of its pylons, one, two or four: latitude and longitude, degrees, and metres.
        sided: whether the names of its pylons say left and right.
    """

    name: str
    title: str
    places: tuple[tuple[float, float], ...]
    points: tuple[Point, ...]
    sided: bool = False

    @property
    def middle(self) -> Point:
        return middle_of(self.points)

    @property
    def is_pylon(self) -> bool:
        return len(self.points) == 1 and not has_word(self.title, QUAD)

    def has(self, words: str) -> bool:
        return has_word(self.title, words)


class SketchedOrder:
    """Elements in race order; the start that is also the finish stands at both ends.

    Attributes:
        elements: the elements of all passings.
        closed: whether the start is the finish.
    """

    def __init__(self, elements: Sequence[SketchedElement], sketch: ImportSketch) -> None:
        self.sketch = sketch
        starts = [element for element in elements if element.has(START)]
        finishes = [element for element in elements if element.has(FINISH)]
        first = starts if len(starts) == 1 else []
        self.closed = len(first) == 1 and first == finishes and len(elements) > 1
        last = finishes if len(finishes) == 1 and finishes != first else []
        between = [element for element in elements if element not in (*first, *last)]
        self.elements = [*first, *self._by_number(between), *last]
        if self.elements != list(elements):
            names = ", ".join(element.name for element in self.elements)
            sketch.guess_part("order", "the order of the race", names, "names and numbers say so, the file does not")
        if self.closed:
            self.elements += first
            sketch.guess_part(first[0].name, "a gate", "start and finish", "its name says both")
        self._sides = self._slalom_sides()

    def _by_number(self, elements: Sequence[SketchedElement]) -> list[SketchedElement]:
        """Return elements in the order of their numbers, twice what has two; in that of the file where one has none."""
        passings = [(number, element) for element in elements for number in numbers_in(element.title)]
        numbers = {number for number, _ in passings}
        named = {element.name for _, element in passings}
        if len(numbers) < len(passings) or len(named) < len(elements):
            if any(first > second for (first, _), (second, _) in pairwise(passings)):
                reason = "their numbers are repeated or missing, so that they give no order"
                self.sketch.guess_part("order", "the order of the race", "that of the file", reason)
            return list(elements)
        return [element for _, element in sorted(passings, key=lambda passing: passing[0])]

    def entries(self) -> Mapping[str, Mapping[str, object]]:
        """Return the keys of every element, by their first passing."""
        entries: dict[str, Mapping[str, object]] = {}
        for position, element in enumerate(self.elements):
            if element.name not in entries:
                entries[element.name] = self._entry(position)
        return entries

    def passing(self, position: int) -> dict[str, object]:
        """Return the keys of a passing: the element, and the direction where it is passed against that of its first."""
        element = self.elements[position]
        first = self.elements.index(element)
        if first == position or element.is_pylon or self._forward(position) * self._forward(first) >= 0.0:
            return {"gate": element.name}
        number = position + 1
        self.sketch.guess_part(element.name, f"passing {number}", "passed in reverse", "the way leads back through it")
        return {"gate": element.name, "direction": "reverse"}

    def _entry(self, position: int) -> Mapping[str, object]:
        element = self.elements[position]
        if element.is_pylon:
            side = self._pass_side(position)
            return {"type": "pylon", **degrees(element.places)[0], "pass_side_deg": side}
        if element.has(QUAD):
            return self._quad(position)
        forward = self._forward(position)
        if element.sided and forward < 0.0:
            reason = "the way leads through it with its left pylon on the right"
            self.sketch.guess_part(element.name, "two points", "a gate", reason)
        kind = "knife-edge" if element.has(KNIFE_EDGE) else "level"
        return {"type": kind, "pylons": degrees(element.places if forward >= 0.0 else element.places[::-1])}

    def _forward(self, position: int) -> float:
        """Return a number that is positive where the way passes a gate with its first pylon on the left."""
        before, after = self._neighbours(position)
        left, right = self.elements[position].points[:2] if len(self.elements[position].points) > 1 else (before, after)
        # the axis is a quarter turn to the left of the way from the left pylon to the right one
        north, east = after.north - before.north, after.east - before.east
        return (right.east - left.east) * north - (right.north - left.north) * east

    def _quad(self, position: int) -> Mapping[str, object]:
        """Return the keys of a quad, which the way enters between the two pylons that it leads to most squarely."""
        element, (before, after) = self.elements[position], self._neighbours(position)
        way = Point(after.north - before.north, after.east - before.east)
        azimuth = round(math.degrees(math.atan2(way.east, way.north))) % 360
        if position:
            azimuth = round(_azimuth_deg(before, element.middle)) % 360
        reason = "which side comes second, and the bank, are not in the file"
        self.sketch.guess_part(element.name, "a quad", f"first passed at {azimuth} deg, wings level", reason)
        if len(element.points) == 2:
            places = element.places if self._forward(position) >= 0.0 else element.places[::-1]
            return {"type": "quad", "pylons": degrees(places), "then": "either"}
        if len(element.points) == 1:
            return {"type": "quad", **degrees(element.places)[0], "heading_deg": azimuth, "then": "either"}
        centre = element.middle
        heading = math.radians(azimuth)
        corners = sorted(
            zip(element.points, element.places, strict=True),
            key=lambda corner: (
                (corner[0].north - centre.north) * math.cos(heading)
                + (corner[0].east - centre.east) * math.sin(heading)
            ),
        )
        # of the two pylons that are passed first, the left one has the other to the right of the heading
        (a, a_place), (b, b_place) = corners[:2]
        to_right = (b.east - a.east) * math.cos(heading) - (b.north - a.north) * math.sin(heading)
        entrance = (a_place, b_place) if to_right > 0.0 else (b_place, a_place)
        return {"type": "quad", "pylons": degrees(entrance), "then": "either"}

    # Sides of pylons.

    def _pass_side(self, position: int) -> int:
        """Return the azimuth at which a pylon is passed, deg: square to the way in a slalom, else outside the turn."""
        (before, after), pylon = self._neighbours(position), self.elements[position].middle
        turn = self._turn(position)
        if position in self._sides:
            # a turn behind the slalom does not belong to it
            bend = min(max(turn, -SLALOM_TURN_MAX), SLALOM_TURN_MAX)
            side = _azimuth_deg(before, pylon) + 0.5 * math.degrees(bend) + 90.0 * self._sides[position]
            reason = "pylons of a slalom are passed on alternate sides"
            if not any(self.elements[pylon_position].has(SLALOM) for pylon_position in self._sides):
                reason = "pylons of a straight row are passed in turns"
        elif abs(turn) > 1e-3:
            side = _azimuth_deg(before, pylon) + 0.5 * math.degrees(turn) - math.copysign(90.0, turn)
            reason = "that is the outside of the turn"
        else:
            side = _azimuth_deg(before, after) + 90.0
            reason = "nothing says left or right, and the way does not turn there"
        side = round(side) % 360
        self.sketch.guess_part(self.elements[position].name, "a point", f"passed on its side at {side} deg", reason)
        return side

    def _slalom_sides(self) -> dict[int, int]:
        """Return the sides of pylons in slaloms by their positions: 1 where they are passed on the right, else -1.

        A slalom is several pylons one after the other that are called so, or that the way leads along straight ahead.
        Of both ways to begin it, the one with more room outside its turns is taken.
        """
        rows: list[list[int]] = [[]]
        for position, element in enumerate(self.elements):
            straight = element.has(SLALOM) or abs(self._turn(position)) <= SLALOM_TURN_MAX
            if element.is_pylon and straight:
                rows[-1].append(position)
            elif rows[-1]:
                rows.append([])
        sides: dict[int, int] = {}
        for row in rows:
            turns = [self._turn(position) for position in row]
            is_arc = min(turns, default=0.0) > ARC_TURN_MIN or max(turns, default=0.0) < -ARC_TURN_MIN
            if len(row) < 2 or (is_arc and not any(self.elements[position].has(SLALOM) for position in row)):
                continue
            outside = sum(-turn * (-1) ** number for number, turn in enumerate(turns))
            first = 1 if outside >= -1e-6 else -1
            sides |= {position: first * (-1) ** number for number, position in enumerate(row)}
        return sides

    def _turn(self, position: int) -> float:
        """Return the turn of the way at an element, rad, to the right positive."""
        if position in (0, len(self.elements) - 1):
            return 0.0
        (before, after), middle = self._neighbours(position), self.elements[position].middle
        turn = math.radians(_azimuth_deg(middle, after) - _azimuth_deg(before, middle))
        return math.remainder(turn, 2.0 * math.pi)

    def _neighbours(self, position: int) -> tuple[Point, Point]:
        """Return the middles of the elements before and behind one, itself where there is none."""
        last = len(self.elements) - 1
        return self.elements[max(position - 1, 0)].middle, self.elements[min(position + 1, last)].middle


def _azimuth_deg(begin: Point, end: Point) -> float:
    return math.degrees(math.atan2(end.east - begin.east, end.north - begin.north))


class ElementImport:
    """The elements of placemarks, in the order of the file."""

    def __init__(self, sketch: ImportSketch) -> None:
        self.sketch = sketch
        self.elements: list[SketchedElement] = []

    def take(self, marks: Sequence[Placemark]) -> list[Placemark]:
        """Take the elements; return the placemarks that may be something else."""
        marks = [self._as_point(mark) for mark in marks]
        groups = self._groups(marks)
        members = {index for group in groups.values() for index in group}
        has_names = any(mark.named_subject is Subject.ELEMENT for mark in marks)
        surroundings: list[Placemark] = []
        for index, mark in enumerate(marks):
            if index in groups:
                self._take_group([marks[member] for member in groups[index]])
            elif index in members:
                continue
            elif mark.shape is PlacemarkShape.OTHER:
                self.sketch.drop(mark, mark.hint)
            elif mark.subject is Subject.FLIGHT:
                self.sketch.drop(mark, "it belongs to a flight")
            elif mark.shape is PlacemarkShape.AREA and mark.subject is Subject.ELEMENT:
                self._take_area(mark)
            elif mark.shape is PlacemarkShape.AREA or mark.subject not in (None, Subject.ELEMENT):
                surroundings.append(mark)
            elif mark.shape is PlacemarkShape.LINE:
                self._take_line(mark)
            elif mark.subject is None and HEIGHT.search(plain_text(mark.name).lower()):
                surroundings.append(mark)
            elif mark.subject is None and mark.name and has_names:
                self.sketch.drop(mark, "its name is not that of a gate or a pylon, as names of others are")
            else:
                self._add(mark, mark.places)
                if side_in(mark.name):
                    self.sketch.guess(mark, "a single pylon", self._why_alone(mark, marks))
                elif mark.named_subject is not Subject.ELEMENT:
                    self.sketch.guess(mark, "a pylon of the race", "its name does not say")
        return surroundings

    def _groups(self, marks: Sequence[Placemark]) -> dict[int, tuple[int, ...]]:
        """Return the points that make one gate or quad: the indices of all of them by that of the first."""
        groups: dict[int, tuple[int, ...]] = {}
        waiting: dict[tuple[tuple[str, ...], str], int] = {}
        rest: dict[tuple[str, ...], list[int]] = {}
        for index, mark in enumerate(marks):
            if mark.shape is not PlacemarkShape.POINT or mark.subject not in (None, Subject.ELEMENT):
                continue
            side, words = side_in(mark.name), gate_words(mark.name, with_nouns=False)
            first = waiting.pop((words, "r" if side == "l" else "l"), None) if side else None
            if first is not None and self._width((marks[first], mark)) <= GATE_WIDTH_MAX:
                groups[first] = (first, index)
            elif side:
                waiting[words, side] = index
            elif mark.subject is Subject.ELEMENT and not has_word(_title(mark), SLALOM):
                rest.setdefault(gate_words(mark.name, with_nouns=True), []).append(index)
        for indices in rest.values():
            width = self._width([marks[index] for index in indices])
            is_gate = len(indices) == 2 and 0.0 < width <= GATE_WIDTH_MAX
            if is_gate or (len(indices) == 4 and has_word(_title(marks[indices[0]]), QUAD)):
                groups[indices[0]] = tuple(indices)
        return groups

    def _why_alone(self, mark: Placemark, marks: Sequence[Placemark]) -> str:
        words, side = gate_words(mark.name, with_nouns=False), side_in(mark.name)
        for candidate in marks:
            opposite = side_in(candidate.name) not in ("", side) and candidate.shape is PlacemarkShape.POINT
            if opposite and gate_words(candidate.name, with_nouns=False) == words:
                return f"the one of the other side stands {self._width((mark, candidate)):.0f} m away"
        return "there is none of the other side"

    def _width(self, marks: Sequence[Placemark]) -> float:
        return distance(self.sketch.points([mark.places[0] for mark in marks]))

    def _take_group(self, group: Sequence[Placemark]) -> None:
        sided = bool(side_in(group[0].name))
        marks = sorted(group, key=lambda mark: side_in(mark.name)) if sided else group
        self._add(group[0], tuple(mark.places[0] for mark in marks), sided=sided)
        if not sided:
            what = "a quad" if len(group) == 4 else "a gate"
            reason = f"{len(group)} points have its number or name"
            if len(group) == 2:
                reason += f" and stand {self._width(group):.0f} m apart"
            names = ", ".join(mark.name for mark in group)
            self.sketch.guess_part(names, f"{len(group)} points", what, reason)

    def _take_line(self, mark: Placemark) -> None:
        ends = mark.places[0], mark.places[-1]
        width, is_named = distance(self.sketch.points(ends)), mark.subject is Subject.ELEMENT
        if len(mark.places) > 2 and not is_named:
            reason = "a gate is a line from pylon to pylon, and no word of its name marks it as anything else"
            self.sketch.drop(mark, reason)
        elif not 0.0 < width <= GATE_WIDTH_MAX:
            reason = f"it is {width:.0f} m long, and a gate no wider than {GATE_WIDTH_MAX:.0f} m"
            self.sketch.drop(mark, reason)
        else:
            self._add(mark, ends)
            if len(mark.places) > 2:
                self.sketch.guess(mark, "a gate between its ends", "a gate has two pylons")
            elif mark.name and not is_named:
                self.sketch.guess(mark, "a gate", "its name does not say")

    def _as_point(self, mark: Placemark) -> Placemark:
        """Return the middle of an area that is called an element and as small as a pylon; others as they are."""
        if mark.shape is not PlacemarkShape.AREA or mark.subject is not Subject.ELEMENT:
            return mark
        corners = self.sketch.points(mark.places)
        length = max(distance(edge) for edge in polygons.edges(corners, closed=True))
        if length > PYLON_SIZE_MAX:
            return mark
        self.sketch.guess(mark, "a pylon in its middle", f"it is {length:.0f} m long")
        return replace(mark, shape=PlacemarkShape.POINT, places=self.sketch.geodetic([middle_of(corners)]))

    def _take_area(self, mark: Placemark) -> None:
        """Take an area that is called an element: a quad by its corners, or a gate along it."""
        corners = self.sketch.points(mark.places)
        begin, end = max(polygons.edges(corners, closed=True), key=distance)
        length = distance((begin, end))
        if length > GATE_WIDTH_MAX:
            reason = f"it is {length:.0f} m long, and a gate no wider than {GATE_WIDTH_MAX:.0f} m"
            self.sketch.drop(mark, reason)
        elif has_word(_title(mark), QUAD) and len(corners) == 4:
            self._add(mark, mark.places)
        else:
            centre = middle_of(corners)
            north, east = 0.5 * (end.north - begin.north), 0.5 * (end.east - begin.east)
            pylons = [Point(centre.north - north, centre.east - east), Point(centre.north + north, centre.east + east)]
            self._add(mark, self.sketch.geodetic(pylons))
            self.sketch.guess(mark, "a gate along its longest side", f"it is {length:.0f} m long")

    def _add(self, mark: Placemark, places: tuple[tuple[float, float], ...], *, sided: bool = False) -> None:
        name = without_side(mark.name) if sided else mark.name
        key = self.sketch.key(name or f"g{len(self.elements)}")
        self.elements.append(SketchedElement(key, _title(mark), places, self.sketch.points(places), sided))

    def place_first_gates(self, marks: Sequence[Placemark]) -> None:
        """Place a start and a finish in the first airspace, along its longest side."""
        area = next((mark for mark in marks if mark.subject is Subject.AIRSPACE and len(mark.places) > 2), None)
        if area is None:
            return
        corners = self.sketch.points(area.places)
        middle = middle_of(corners)
        begin, end = max(polygons.edges(corners, closed=True), key=distance)
        length = distance((begin, end))
        along = Point((end.north - begin.north) / length, (end.east - begin.east) / length)
        (far, half), gates = FIRST_GATES, list[tuple[str, list[Point]]]()
        for name, ahead in (("start", -far), ("finish", far)):
            pylons = [
                Point(
                    middle.north + ahead * along.north - aside * along.east,
                    middle.east + ahead * along.east + aside * along.north,
                )
                for aside in (-half, half)
            ]
            gates.append((name, pylons))
        if not all(polygons.inside(pylon, corners) for _, pylons in gates for pylon in pylons):
            return
        for name, pylons in gates:
            places = self.sketch.geodetic(pylons)
            self.elements.append(SketchedElement(self.sketch.key(name), name, places, tuple(pylons)))
        reason = "the file holds an airspace and no gate or pylon: move them, and add the others"
        self.sketch.guess_part("start, finish", "two gates", "a course to begin with", reason)


def _title(mark: Placemark) -> str:
    """Return the words that say what kind of element it is: those of its name, else of what stands beside it."""
    kinds = f"{QUAD}|{SLALOM}|{KNIFE_EDGE}"
    return mark.name if has_word(mark.name, kinds) or not has_word(mark.hint, kinds) else f"{mark.name} {mark.hint}"
