"""A course from above for web pages and notebooks: inline SVG, north up, with a flight over it if there is one."""

import html
import math
from dataclasses import dataclass

import numpy as np

from airrace.model.track.course import CrowdShape
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.drawing import AMBER, BLACK, BLUE, RED, Box, place_labels
from airrace.pages.views.map_model import ColouredTrack, MapModel, coordinates, round_length
from airrace.pages.views.plain_text import plain

LONGER_EDGE = 560.0
"""Of the map, pixels."""
MARGIN = 34.0
"""Around what is drawn, pixels."""
FONT = 11.0
"""The size of letters, pixels."""
LETTER = 0.58
"""The width of a letter as a share of its size."""
GATE = 5.0
"""The least length of a gate to either side, pixels: gates are to scale, but long enough to be seen."""
LABELS_MAX = 60
"""The largest number of elements whose names are written."""
LEGEND = 540.0
"""The width that scale and colours need, pixels."""
GREY = "#9a9a9a"  # lighter than on paper


@dataclass(frozen=True)
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


def pixels_per_metre(map_: MapModel) -> float:
    """Return the scale of a drawing."""
    return LONGER_EDGE / max(map_.north - map_.south, map_.east - map_.west)


def plan_svg(map_: MapModel, coloured: ColouredTrack | None = None, *, scale: bool = True) -> str:
    """Return the drawing.

    Args:
        map_: the race from above.
        coloured: a track that is drawn in the place of those of the map that are not dashed; None for none.
        scale: whether its scale and the meaning of the colours stand below it.
    """
    pixels = pixels_per_metre(map_)
    width = (map_.east - map_.west) * pixels + 2 * MARGIN
    width = width if coloured is None or not scale else max(width, LEGEND)
    height = (map_.north - map_.south) * pixels + 2 * MARGIN + 2 * FONT * scale
    sheet = _Sheet(map_.north, map_.west, pixels, width, height)
    tracks: list[str] = []
    for way in map_.ways:
        if not way.planned:
            tracks.append(_shape("polyline", sheet.points(way.line), GREY, dash="3 4"))
        elif coloured is None:
            tracks.append(_shape("polyline", sheet.points(way.line), BLUE))
    if coloured is not None:
        tracks += [_shape("polyline", sheet.points(line), colour, width=2.4) for line, colour in coloured.pieces()]
    parts = [
        *_surroundings(sheet, map_),
        *tracks,
        *_marks(sheet, map_),
        *_labels(sheet, map_),
        *(_scale(sheet, coloured) if scale else ()),
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{sheet.width:.0f}" height="{sheet.height:.0f}" '
        f'viewBox="0 0 {sheet.width:.0f} {sheet.height:.0f}" role="img" '
        f'style="background: white; font: {FONT:g}px sans-serif">'
        f"<title>{html.escape(plain(map_.name))} from above</title>{''.join(parts)}</svg>"
    )


def _surroundings(sheet: _Sheet, map_: MapModel) -> list[str]:
    """Return airspace, people with the ground within their distance as a wide, pale stroke around them, obstacles, and
    lines.
    """
    parts: list[str] = []
    for crowd in map_.crowd:
        places, closed = coordinates(crowd.corners), crowd.shape is CrowdShape.AREA
        points = sheet.points(np.repeat(places, 2, axis=0) if crowd.shape is CrowdShape.POINT else places)
        style = f'stroke="{RED}" stroke-linejoin="round" stroke-linecap="round" fill="{RED if closed else "none"}"'
        shape = f'<{"polygon" if closed else "polyline"} points="{points}" {style}'
        parts.append(f'{shape} stroke-width="{2.0 * crowd.distance * sheet.scale:.1f}" opacity="0.1"/>')
        parts.append(f'{shape} stroke-width="4" opacity="0.7"/>')
    for _, outline in map_.obstacles:
        parts.append(f'<polygon points="{sheet.points(outline[:-1])}" fill="{GREY}" stroke="{BLACK}"/>')
    if map_.airspace is not None:
        parts.append(_shape("polygon", sheet.points(map_.airspace[:-1]), BLUE, dash="8 3 2 3"))
    return [*parts, *(_shape("polyline", sheet.points(line.ends), AMBER, dash="6 3") for line in map_.lines)]


def _marks(sheet: _Sheet, map_: MapModel) -> list[str]:
    """Return the elements: gates as a stroke long enough to be seen, and all else as a dot."""
    parts: list[str] = []
    for mark in map_.marks:
        x, y = sheet.at(mark.north, mark.east)
        if mark.stroke is None:
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.2" fill="{BLACK}"/>')
            continue
        (left, top), (right, bottom) = (sheet.at(*end) for end in mark.stroke.tolist())
        longer = max(1.0, 2.0 * GATE / max(math.hypot(right - left, bottom - top), 1e-9))
        half = 0.5 * longer * (right - left), 0.5 * longer * (bottom - top)
        ends = f'x1="{x - half[0]:.1f}" y1="{y - half[1]:.1f}" x2="{x + half[0]:.1f}" y2="{y + half[1]:.1f}"'
        parts.append(f'<line {ends} stroke="{BLACK}" stroke-width="3.5" stroke-linecap="round"/>')
    return parts


def _labels(sheet: _Sheet, map_: MapModel) -> list[str]:
    """Return names beside the marks, where they hide least."""
    labelled_marks = [mark for mark in map_.marks if mark.label]
    if not labelled_marks or len(labelled_marks) > LABELS_MAX:
        return []
    anchors = [(x, -y) for x, y in (sheet.at(mark.north, mark.east) for mark in labelled_marks)]
    sizes = [(len(mark.label) * LETTER * FONT, FONT) for mark in labelled_marks]
    ways = [np.array([sheet.at(*place) for place in way.line.tolist()]) * (1.0, -1.0) for way in map_.ways]
    points = np.concatenate([*ways, np.array(anchors)])
    frame = Box(0.0, -sheet.height, sheet.width, sheet.height)
    boxes = place_labels(anchors, sizes, points, frame, 7.0)
    return [
        f'<text x="{box.left:.1f}" y="{-box.bottom - 0.15 * FONT:.1f}" fill="{BLACK}">'
        f"{html.escape(plain(mark.label))}</text>"
        for box, mark in zip(boxes, labelled_marks, strict=True)
    ]


def _scale(sheet: _Sheet, coloured: ColouredTrack | None) -> list[str]:
    """Return a bar of round length, with a note of where north is and of what the colours mean."""
    metres = round_length(0.25 * sheet.width / sheet.scale)
    base, left = sheet.height - 0.8 * FONT, 10.0
    right = left + metres * sheet.scale
    x, note = right + 6.0, f"{metres:g} m, north is up"
    if coloured is not None:
        note += f"; {coloured.ends[0]}"
    parts = [
        f'<path d="M{left:.1f},{base - 4:.1f}V{base:.1f}H{right:.1f}V{base - 4:.1f}" fill="none" stroke="{BLACK}"/>',
        f'<text x="{x:.1f}" y="{base:.1f}" fill="{BLACK}">{note}</text>',
    ]
    if coloured is not None:
        x += len(note) * LETTER * FONT
        for number, colour in enumerate(coloured.colours):
            parts.append(f'<rect x="{x + 12 * number:.1f}" y="{base - 8:.1f}" width="12" height="8" fill="{colour}"/>')
        x += 12 * len(coloured.colours) + 4
        parts.append(f'<text x="{x:.1f}" y="{base:.1f}" fill="{BLACK}">{coloured.ends[1]}</text>')
    return parts


def _shape(kind: str, points: str, colour: str, *, width: float = 1.4, dash: str = "") -> str:
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<{kind} points="{points}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashed}/>'
