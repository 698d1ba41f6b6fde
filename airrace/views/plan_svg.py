"""A course from above for web pages and notebooks: inline SVG, north up, with a flight over it if there is one."""

import html
import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from airrace.quantities import KNOT
from airrace.records import record
from airrace.track.course import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point
from airrace.trajectory import Array, Trajectory
from airrace.views.labels import Box, placed
from airrace.views.map_model import MapModel, round_length
from airrace.views.plain_text import plain

LONGER_EDGE = 560.0
"""The longer edge of the map, pixels."""
MARGIN = 34.0
"""The margin around what is drawn, pixels."""
FONT = 11.0
"""The size of letters, pixels."""
LETTER = 0.58
"""The width of a letter as a share of its size."""
GATE_LEAST = 5.0
"""The least length of a gate to either side, pixels: gates are to scale, but long enough to be seen."""
LABELS_MAX = 60
"""The largest number of elements whose names are written."""
COLOURS = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#d8c00f")  # from slow to fast
BLACK, GREY, RED, AMBER, BLUE = "#222222", "#9a9a9a", "#c0392b", "#b8860b", "#34568b"


@record
class _Sheet:
    """The mapping from places to the drawing: `scale` pixels per metre, the corner in the north-west."""

    north: float
    west: float
    scale: float
    width: float
    height: float

    def at(self, north: float, east: float) -> tuple[float, float]:
        """Return the pixels of a place to the right and down."""
        return MARGIN + (east - self.west) * self.scale, MARGIN + (self.north - north) * self.scale

    def points(self, places: Array) -> str:
        """Return places of shape (n, 2), north and east in m, as the points of a line."""
        return " ".join("{:.1f},{:.1f}".format(*self.at(north, east)) for north, east in places.tolist())


def plan_svg(seen: MapModel, flight: Trajectory | None = None) -> str:
    """Return the drawing, complete with its scale.

    Args:
        seen: the course from above.
        flight: drawn in the colours of its speed; without one the way is drawn as planned.
    """
    sheet = _sheet(seen, flight)
    way = _planned(sheet, seen) if flight is None else _flown(sheet, flight)
    parts = [*_surroundings(sheet, seen), *way, *_marks(sheet, seen), *_labels(sheet, seen), *_scale(sheet, flight)]
    title = html.escape(plain(seen.course.name))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{sheet.width:.0f}" height="{sheet.height:.0f}" '
        f'viewBox="0 0 {sheet.width:.0f} {sheet.height:.0f}" role="img" '
        f'style="background: white; font: {FONT:g}px sans-serif">'
        f"<title>{title} from above</title>{''.join(parts)}</svg>"
    )


def _sheet(seen: MapModel, flight: Trajectory | None) -> _Sheet:
    south, north, west, east = seen.south, seen.north, seen.west, seen.east
    if flight is not None:
        x, y = flight.of("x"), flight.of("y")
        south, north = min(south, float(x.min())), max(north, float(x.max()))
        west, east = min(west, float(y.min())), max(east, float(y.max()))
    scale = LONGER_EDGE / max(north - south, east - west)
    width, height = (east - west) * scale + 2 * MARGIN, (north - south) * scale + 2 * MARGIN + 2 * FONT
    return _Sheet(north, west, scale, width, height)


def _surroundings(sheet: _Sheet, seen: MapModel) -> list[str]:
    """Return airspace, people with their distance, and safety lines."""
    parts = [_crowd(sheet, crowd) for crowd in seen.course.crowd]
    if seen.course.airspace:
        parts.append(_shape("polygon", sheet.points(_places(seen.course.airspace)), BLUE, dash="8 3 2 3"))
    return [*parts, *(_safety_line(sheet, line) for line in seen.lines)]


def _crowd(sheet: _Sheet, crowd: Crowd) -> str:
    """Return the people, and the ground within their distance as a wide, pale stroke around them."""
    places = _places(crowd.corners)
    shape = "polygon" if crowd.shape is CrowdShape.AREA else "polyline"
    if crowd.shape is CrowdShape.POINT:
        places = np.repeat(places, 2, axis=0)
    points, fill = sheet.points(places), RED if shape == "polygon" else "none"
    wide = 2.0 * crowd.distance * sheet.scale
    style = f'stroke="{RED}" stroke-linejoin="round" stroke-linecap="round" fill="{fill}"'
    return (
        f'<{shape} points="{points}" {style} stroke-width="{wide:.1f}" opacity="0.1"/>'
        f'<{shape} points="{points}" {style} stroke-width="4" opacity="0.7"/>'
    )


def _safety_line(sheet: _Sheet, line: SafetyLine) -> str:
    return _shape("polyline", sheet.points(_places((line.start, line.end))), AMBER, dash="6 3")


def _planned(sheet: _Sheet, seen: MapModel) -> list[str]:
    return [
        _shape("polyline", sheet.points(way.line), BLUE if way.planned else GREY, dash="" if way.planned else "3 4")
        for way in seen.ways
    ]


def _flown(sheet: _Sheet, flight: Trajectory) -> list[str]:
    """Return the path over ground, in pieces of one colour each."""
    places = np.stack([flight.of("x"), flight.of("y")], axis=1)
    colours = _colours(flight.of("V_K"))
    begins = [0, *(np.flatnonzero(np.diff(colours)) + 1).tolist(), len(colours)]
    return [
        _shape("polyline", sheet.points(places[begin : end + 1]), COLOURS[int(colours[begin])], width=2.4)
        for begin, end in pairwise(begins)
    ]


def _colours(speed: Array) -> NDArray[np.int64]:
    """Return the number of a colour per interval of the mesh, shape (N,)."""
    slowest, fastest = float(speed.min()), float(speed.max())
    middle = 0.5 * (speed[1:] + speed[:-1])
    share = (middle - slowest) / max(fastest - slowest, 1e-9)
    return np.minimum((share * len(COLOURS)).astype(np.int64), len(COLOURS) - 1)


def _marks(sheet: _Sheet, seen: MapModel) -> list[str]:
    """Return the elements: what is flown through as a stroke long enough to be seen, and all else as a dot."""
    parts: list[str] = []
    for mark in seen.marks:
        x, y = sheet.at(mark.north, mark.east)
        across = mark.element.drawing().across
        if across is None:
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.2" fill="{BLACK}"/>')
            continue
        (left, top), (right, bottom) = (sheet.at(point.north, point.east) for point in across)
        longer = max(1.0, 2.0 * GATE_LEAST / max(math.hypot(right - left, bottom - top), 1e-9))
        half = 0.5 * longer * (right - left), 0.5 * longer * (bottom - top)
        ends = f'x1="{x - half[0]:.1f}" y1="{y - half[1]:.1f}" x2="{x + half[0]:.1f}" y2="{y + half[1]:.1f}"'
        parts.append(f'<line {ends} stroke="{BLACK}" stroke-width="3.5" stroke-linecap="round"/>')
    return parts


def _labels(sheet: _Sheet, seen: MapModel) -> list[str]:
    """Return names beside the marks, where they hide least."""
    named = [mark for mark in seen.marks if mark.label]
    if not named or len(named) > LABELS_MAX:
        return []
    anchors = [(x, -y) for x, y in (sheet.at(mark.north, mark.east) for mark in named)]
    sizes = [(len(mark.label) * LETTER * FONT, FONT) for mark in named]
    ways = [np.array([sheet.at(*place) for place in way.line.tolist()]) * (1.0, -1.0) for way in seen.ways]
    drawn = np.concatenate([*ways, np.array(anchors)])
    frame = Box(0.0, -sheet.height, sheet.width, sheet.height)
    boxes = placed(anchors, sizes, drawn, frame, 7.0)
    return [
        f'<text x="{box.left:.1f}" y="{-box.bottom - 0.15 * FONT:.1f}" fill="{BLACK}">'
        f"{html.escape(plain(mark.label))}</text>"
        for box, mark in zip(boxes, named, strict=True)
    ]


def _scale(sheet: _Sheet, flight: Trajectory | None) -> list[str]:
    """Return a bar of round length, with a note of where north is and of what the colours mean."""
    metres = round_length(0.25 * sheet.width / sheet.scale)
    base, left = sheet.height - 0.8 * FONT, 10.0
    right = left + metres * sheet.scale
    note = f"{metres:g} m, north is up"
    if flight is not None:
        speeds = flight.of("V_K") / KNOT
        note += f"; {speeds.min():.0f} kt"
    x = right + 6.0
    parts = [
        f'<path d="M{left:.1f},{base - 4:.1f}V{base:.1f}H{right:.1f}V{base - 4:.1f}" fill="none" stroke="{BLACK}"/>',
        f'<text x="{x:.1f}" y="{base:.1f}" fill="{BLACK}">{note}</text>',
    ]
    if flight is not None:
        x += len(note) * LETTER * FONT
        for number, colour in enumerate(COLOURS):
            parts.append(f'<rect x="{x + 12 * number:.1f}" y="{base - 8:.1f}" width="12" height="8" fill="{colour}"/>')
        x += 12 * len(COLOURS) + 4
        parts.append(f'<text x="{x:.1f}" y="{base:.1f}" fill="{BLACK}">{(flight.of("V_K") / KNOT).max():.0f} kt</text>')
    return parts


def _shape(kind: str, points: str, colour: str, *, width: float = 1.4, dash: str = "") -> str:
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<{kind} points="{points}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashed}/>'


def _places(corners: tuple[Point, ...]) -> Array:
    return np.array([[corner.north, corner.east] for corner in corners])
