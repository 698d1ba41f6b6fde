"""The pieces of a layout as the track file places them, and the edits that move, turn, add and remove them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from airrace.design.edits import Edit, Insert, Put, Remove
from airrace.errors import UsageError
from airrace.files.inputs import Inputs
from airrace.files.inputs.course_order import CourseReference, references_of
from airrace.files.inputs.nodes import KeyPath, MappingNode, dotted
from airrace.files.inputs.places import GEODETIC, METRIC
from airrace.files.inputs.yaml_reader import read_yaml
from airrace.model.track.course import Origin, geodetic, metres
from airrace.model.track.polygons import Point

Plain = Mapping[str, Any]  # JSON of a track that is known to be without fault


# What a new piece has until its user changes it, m; assumptions.
MAST_HEIGHT = 30.0
CROWD_SIDE, CROWD_DISTANCE = 40.0, 100.0
SAFETY_LINE_LENGTH = 300.0
AIRSPACE_MARGIN = 500.0  # beyond the gates
METRIC_DECIMALS, GEODETIC_DECIMALS = 2, 7
"""The decimals of positions, m and degrees: a centimetre either way."""
TURNS = ("heading_deg", "pass_side_deg")
"""The keys that say how a piece is turned."""
GROUPS = ("gates", "obstacles", "crowd", "safety_lines")
"""The groups of the track file whose entries are pieces."""
KINDS = ("level", "knife-edge", "pylon", "obstacle", "crowd", "safety line", "airspace")
"""What can be added."""


@dataclass(frozen=True)
class Spot:
    """A place in the track file by its path, m."""

    path: KeyPath
    north: float
    east: float


@dataclass(frozen=True)
class Piece:
    """A thing that can be dragged.

    Attributes:
        path: of its entry.
        kind: of gate, or what it is.
        spots: the places that it is given by; none where it stands anywhere.
        turn: the key that says how it is turned, and its value, degrees; None where there is none.
        entry: its entry as it stands in the file.
        strokes: lines to be drawn, north and east, m; a single point is a post.
        closed: whether its spots are corners of an area.
        distance: to be kept from it, m; of a safety line the margin.
    """

    path: KeyPath
    kind: str
    spots: tuple[Spot, ...]
    turn: tuple[str, float] | None
    entry: Any  # JSON
    strokes: tuple[tuple[tuple[float, float], ...], ...] = ()
    closed: bool = False
    distance: float = 0.0


@dataclass(frozen=True)
class EditableCourse:
    """The pieces of a course, and the edits of the track file that change them."""

    inputs: Inputs
    plain: Plain
    references: tuple[CourseReference, ...]
    pieces: tuple[Piece, ...]

    def moved(self, places: Sequence[Spot], turns: Mapping[KeyPath, float]) -> list[Edit]:
        """Return the edits that put spots to other places and turn pieces; `UsageError` if there is no such one."""
        spots = {spot.path for piece in self.pieces for spot in piece.spots}
        edits = list[Edit]()
        for spot in places:
            if spot.path not in spots:
                raise UsageError(f"there is no place {dotted(spot.path)}")
            entry: Any = self.plain
            for part in spot.path:
                entry = entry[part]
            values = self._position(spot.north, spot.east, metric=METRIC[0] in entry)
            edits += [Put((*spot.path, key), value) for key, value in values.items() if entry.get(key) != value]
        for path, degrees in turns.items():
            turn = self.piece(path).turn
            if turn is None:
                raise UsageError(f"{dotted(path)} cannot be turned")
            edits.append(Put((*path, turn[0]), round(degrees % 360.0, 1)))
        return edits

    def piece(self, path: KeyPath) -> Piece:
        """Return a piece by its path; `UsageError` if there is none."""
        for piece in self.pieces:
            if piece.path == path:
                return piece
        raise UsageError(f"there is no {dotted(path)}")

    def setting(self, path: KeyPath, value: object) -> list[Edit]:
        """Return the edit that gives an entry of a piece a value, as deep in it as the file has one already.

        Raises:
            UsageError: there is no such piece, or nothing there.
        """
        piece = next((piece for piece in self.pieces if piece.path == path[: len(piece.path)]), None)
        holder: Any = None if piece is None else piece.entry
        for part in path[len(piece.path) : -1] if piece else ():
            holder = holder[part]
        if piece is None or path == piece.path or value is None:
            raise UsageError(f"there is no {dotted(path)}")
        if isinstance(holder, list) or (len(path) > len(piece.path) + 1 and path[-1] not in holder):
            raise UsageError(f"there is no {dotted(path)}")
        return [Put(path, value)]

    def removal(self, path: KeyPath) -> list[Edit]:
        """Return the edits that remove a piece, and its passings; `UsageError` for the start and the finish."""
        group, name = self.piece(path).path[0], path[-1]
        edits = list[Edit]()
        for reference in reversed(self.references):
            at = reference.path
            if group == "gates" and reference.gate == name:
                if at[1] in ("start", "finish"):
                    raise UsageError(f"{name} is the {at[1]} of the course: name another one in the file first")
                edits.append(Remove(at))
            elif group == "safety_lines":
                indices = [index for index, line in reference.safety_lines if line == name]
                edits += [Remove((*at, "safety_lines", index)) for index in indices[:1]]
        return [*edits, Remove(path)]

    def addition(self, kind: str, at: Point) -> list[Edit]:
        """Return the edits that put a new piece down; a gate is passed where that makes the least detour."""
        spots = [spot for piece in self.pieces if piece.path[0] == "gates" for spot in piece.spots]
        gates = np.array([(spot.north, spot.east) for spot in spots] or [(at.north, at.east)])
        metric = "latitude_deg" not in str(self.plain["gates"])

        def place(north: float, east: float) -> dict[str, float]:
            return self._position(at.north + north, at.east + east, metric=metric)

        match kind:
            case "obstacle":
                return self._insertion("obstacles", "mast", {**place(0.0, 0.0), "height_m": MAST_HEIGHT})
            case "crowd":
                half = 0.5 * CROWD_SIDE
                corners = [place(a * half, b * half) for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))]
                return self._insertion("crowd", "crowd", {"polygon": corners, "distance_m": CROWD_DISTANCE})
            case "safety line":  # with the middle of the course to its left
                north, east = gates.mean(axis=0) - (at.north, at.east)
                along = 0.5 * SAFETY_LINE_LENGTH / (math.hypot(north, east) or 1.0) * np.array([-east, north])
                line = {"from": place(*-along), "to": place(*along), "keep": "left"}
                return self._insertion("safety_lines", "line", line)
            case "airspace" if "airspace" not in self.plain:
                (south, west), (north, east) = gates.min(axis=0) - AIRSPACE_MARGIN, gates.max(axis=0) + AIRSPACE_MARGIN
                ends = [(north, west), (north, east), (south, east), (south, west)]
                return [Put(("airspace",), [place(a - at.north, b - at.east) for a, b in ends])]
            case "level" | "knife-edge" | "pylon":
                return self._added_gate(kind, at, place(0.0, 0.0))
            case _:
                raise UsageError(f"no {kind} can be added")

    def _added_gate(self, kind: str, at: Point, place: dict[str, float]) -> list[Edit]:
        def detour(leg: tuple[KeyPath, Point, Point]) -> float:
            _, begin, end = leg
            north, east = begin.north - at.north, begin.east - at.east
            to_north, to_east = end.north - at.north, end.east - at.east
            return (
                math.hypot(north, east) + math.hypot(to_north, to_east) - math.hypot(north - to_north, east - to_east)
            )

        legs = sorted(self._legs(), key=detour)
        if not legs:
            raise UsageError("no leg of the course has two ends with a place: name the gate in the file")
        best_of_lap = {path[:-1]: path for path, _, _ in reversed(legs)}
        _, begin, end = legs[0]
        north, east = end.north - begin.north, end.east - begin.east
        course = math.degrees(math.atan2(east, north))
        # A pylon is passed on the side of the straight leg.
        to_right = (at.east - begin.east) * north - (at.north - begin.north) * east > 0.0
        key, turn = ("pass_side_deg", course - 90.0 if to_right else course + 90.0)
        if kind != "pylon":
            key, turn = "heading_deg", course
        insertion = self._insertion("gates", "g", {"type": kind, **place, key: round(turn % 360.0, 1)})
        return [*insertion, *(Insert(path, insertion[0].path[1]) for path in best_of_lap.values())]

    def _legs(self) -> Iterator[tuple[KeyPath, Point, Point]]:
        """Yield the legs with two known ends, each with the place in its lap where a new passing comes between."""
        spots_of = {piece.path[-1]: piece.spots for piece in self.pieces if piece.path[0] == "gates"}
        before: Point | None = None
        path: KeyPath = ()
        for reference in self.references:
            spots = spots_of.get(reference.gate or "")
            middle = Point(*np.mean([(spot.north, spot.east) for spot in spots], axis=0).tolist()) if spots else None
            if reference.path[1] not in ("start", "finish"):
                path = reference.path
            elif path:  # behind the last one
                path = cast(KeyPath, (*path[:-1], int(path[-1]) + 1))
            if before is not None and middle and path:
                yield path, before, middle
            before = middle

    def _insertion(self, group: str, stem: str, entry: dict[str, Any]) -> list[Edit]:
        entries: Plain = self.plain.get(group) or {}
        number = 1
        while f"{stem}{number}" in entries:
            number += 1
        return [Put((group, f"{stem}{number}"), entry)]

    def _position(self, north: float, east: float, *, metric: bool) -> dict[str, float]:
        """Return a position as the file gives it."""
        if metric:
            return {METRIC[0]: round(float(north), METRIC_DECIMALS), METRIC[1]: round(float(east), METRIC_DECIMALS)}
        latitude, longitude = geodetic(np.array([north]), np.array([east]), self.inputs.race.course.origin)
        degrees = (math.degrees(latitude[0]), math.degrees(longitude[0]))
        return dict(zip(GEODETIC, (round(value, GEODETIC_DECIMALS) for value in degrees), strict=True))


def layout_of(inputs: Inputs) -> EditableCourse:
    """Return the pieces of a course whose track file is known to be without fault."""
    root = cast(MappingNode, read_yaml(inputs.track.path, inputs.track.text))
    references = references_of(cast(MappingNode, root.get("course")))
    plain: Any = root.plain()
    course = inputs.race.course
    drawings = dict[str, tuple[tuple[Point, ...], ...]]()
    for element in {passage.element.name: passage.element for passage in course.passages}.values():
        drawing = element.drawing()
        strokes = (*((post,) for post in drawing.posts), *((drawing.across,) if drawing.across else ()))
        drawings[element.base_name] = drawings.get(element.base_name, ()) + strokes
    for obstacle in course.obstacles:
        drawings[f"obstacles {obstacle.name}"] = ((*obstacle.outline, obstacle.outline[0]),)
    distances = {("crowd", crowd.name): crowd.distance for crowd in course.crowd}
    distances |= {("obstacles", obstacle.name): obstacle.clearance for obstacle in course.obstacles}
    for passage in course.passages:
        distances |= {("safety_lines", line.name): line.margin for line in passage.safety_lines}
    entries = list[tuple[KeyPath, Any, str]]()
    for group in GROUPS:
        members: dict[str, Plain] = plain.get(group) or {}
        kind = group.replace("_", " ").rstrip("s")
        entries += [((group, name), entry, entry.get("type", kind)) for name, entry in members.items()]
    if "airspace" in plain:
        entries.append((("airspace",), plain["airspace"], "airspace"))
    pieces = list[Piece]()
    for path, entry, kind in entries:
        turn = next(((key, float(entry[key])) for key in TURNS if key in entry), None)
        drawing = drawings.get(str(path[-1]) if path[0] == "gates" else f"obstacles {path[-1]}", ())
        strokes = tuple(tuple((point.north, point.east) for point in stroke) for stroke in drawing)
        closed = kind == "airspace" or "polygon" in entry
        spots, distance = tuple(_spots(path, entry, course.origin)), distances.get((str(path[0]), str(path[-1])), 0.0)
        pieces.append(Piece(path, kind, spots, turn, entry, strokes, closed, distance))
    return EditableCourse(inputs, plain, tuple(references), tuple(pieces))


def _spots(path: KeyPath, entry: Any, origin: Origin) -> Iterator[Spot]:
    """Yield all places below an entry, in the order of the file."""
    if isinstance(entry, dict):
        if METRIC[0] in entry:
            yield Spot(path, *(float(cast(Plain, entry)[key]) for key in METRIC))
        elif GEODETIC[0] in entry:
            north, east, _ = metres(*(np.radians([cast(Plain, entry)[key]]) for key in GEODETIC), origin=origin)
            yield Spot(path, float(north[0]), float(east[0]))
    if isinstance(entry, dict | list):
        parts = enumerate(cast(list[Any], entry)) if isinstance(entry, list) else cast(dict[str, Any], entry).items()
        for part, child in parts:
            yield from _spots((*path, part), child, origin)
