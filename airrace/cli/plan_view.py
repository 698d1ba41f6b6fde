"""A course in the terminal, seen from above: dots, eight to a cell, north up, both directions at one scale."""

import math
from collections.abc import Sequence

import numpy as np
from rich.console import Group
from rich.text import Text

from airrace.environment.air import StaticWind
from airrace.planning.clearances import ground_distance
from airrace.quantities import KNOT
from airrace.records import record
from airrace.track.course import Crowd, CrowdShape
from airrace.track.polygons import edges
from airrace.trajectory import Array
from airrace.views.map_model import MapLine, MapModel, Mark, coordinates, round_length

ACROSS, DOWN = 2, 4
"""The dots of a cell; it is twice as high as wide, so the dots lie on a square grid."""
_BLANK = 0x2800
"""The first of the Braille patterns, whose lower eight bits are the dots."""
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


@record
class Layer:
    """The look of a kind of dots: its style on a terminal, and its character where there are no Braille patterns."""

    style: str
    plain: str


class Canvas:
    """A canvas of cells by row and column; places on it are north and east in metres.

    Args:
        columns, rows: the size of the canvas, cells.
        north, west: the place of the upper left corner, m.
        dot: the edge of a dot, m.
    """

    def __init__(self, columns: int, rows: int, north: float, west: float, dot: float) -> None:
        self.columns, self.rows = columns, rows
        self.north, self.west = north, west
        self.dot = dot
        self._dots = np.zeros((rows * DOWN, columns * ACROSS), bool)
        self._top = np.zeros((rows, columns), int)  # number of the uppermost layer in each cell
        self._layers: list[Layer] = []
        self._texts: dict[tuple[int, int], tuple[str, str]] = {}

    @property
    def centres(self) -> Array:
        """North and east of all dots, shape (dots down, dots across, 2), m."""
        north = self.north - self.dot * (np.arange(self.rows * DOWN) + 0.5)
        east = self.west + self.dot * (np.arange(self.columns * ACROSS) + 0.5)
        return np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).astype(np.float64)

    def paint(self, layer: Layer, dots: np.ndarray) -> None:
        """Lay dots, shape (dots down, dots across), over what there is."""
        self._lay(layer, *np.nonzero(dots))

    def line(self, layer: Layer, points: Array, *, on: int = 1, off: int = 0) -> None:
        """Lay a line through points of shape (n, 2) over what there is, `on` dots drawn and `off` left out in turn."""
        down, across = (self.north - points[:, 0]) / self.dot, (points[:, 1] - self.west) / self.dot
        lengths = np.maximum(np.abs(np.diff(down)), np.abs(np.diff(across)))
        begins = np.concatenate([[0.0], np.cumsum(lengths)])
        steps = np.arange(0.0, begins[-1] + 0.5)
        steps = steps[steps % (on + off) < on]
        row, column = (np.floor(np.interp(steps, begins, one)).astype(int) for one in (down, across))
        within = (row >= 0) & (row < self._dots.shape[0]) & (column >= 0) & (column < self._dots.shape[1])
        self._lay(layer, row[within], column[within])

    def _lay(self, layer: Layer, row: np.ndarray, column: np.ndarray) -> None:
        if layer not in self._layers:
            self._layers.append(layer)
        self._dots[row, column] = True
        self._top[row // DOWN, column // ACROSS] = self._layers.index(layer)

    def cell(self, north: float, east: float) -> tuple[int, int]:
        """Return the row and column of a place; it may lie outside."""
        return (
            math.floor((self.north - north) / self.dot / DOWN),
            math.floor((east - self.west) / self.dot / ACROSS),
        )

    def write(self, row: int, column: int, text: str, style: str) -> bool:
        """Put a text over the dots, unless it would leave the canvas or cover another; return whether it was put."""
        cells = [(row, column + index) for index in range(len(text))]
        if not 0 <= row < self.rows or column < 0 or column + len(text) > self.columns:
            return False
        if any(cell in self._texts for cell in cells):
            return False
        self._texts.update({cell: (letter, style) for cell, letter in zip(cells, text, strict=True)})
        return True

    def covered(self, row: int, column: int, length: int) -> int:
        """Return the number of dots that a text of this length would hide; outside of the canvas there are none."""
        top, left, right = row * DOWN, column * ACROSS, (column + length) * ACROSS
        return int(self._dots[max(top, 0) : max(top + DOWN, 0), max(left, 0) : max(right, 0)].sum())

    def drawn(self, *, plain: bool) -> list[Text]:
        """Return the rows from north to south; with `plain` in ASCII alone."""
        cells = self._dots.reshape(self.rows, DOWN, self.columns, ACROSS)
        bits = (cells * _BITS[:, None, :]).sum(axis=(1, 3))
        return [self._row(row, bits[row], plain=plain) for row in range(self.rows)]

    def _row(self, row: int, bits: np.ndarray, *, plain: bool) -> Text:
        drawn = Text(no_wrap=True, overflow="ignore")
        for column in range(self.columns):
            if (row, column) in self._texts:
                drawn.append(*self._texts[row, column])
            elif bits[column] == 0:
                drawn.append(" ")
            else:
                layer = self._layers[int(self._top[row, column])]
                drawn.append(layer.plain if plain else chr(_BLANK + int(bits[column])), layer.style)
        drawn.rstrip()
        return drawn


COLUMNS, ROWS = 100, 35
"""The cells that the picture may fill, with its scale and its legend; columns only where no terminal says."""
NOTES = 3
"""The rows of the scale and the legend."""
MARGIN = 2
"""The cells left free around what is drawn."""
MARKS_MAX = 400
"""The largest number of elements that are marked; more would but hide the way."""
LABELS_MAX = 60
"""The largest number of elements whose names are written."""
ARROWS_MAX = 60
"""The largest number of ways that get an arrow."""

LAPS = ("cyan", "magenta", "green", "blue")
AIRSPACE = Layer("blue", ":")
CROWD = Layer("red", "x")
DISTANCE = Layer("red", ",")
SAFETY = Layer("yellow", "=")
GATE = Layer("bold white", "#")
PYLON = "bold white"
LABEL = "bold"
_ARROWS = "\u2191\u2197\u2192\u2198\u2193\u2199\u2190\u2196"  # from north, clockwise
_PLAIN_ARROWS = "^>>>v<<<"
_AROUND = ((0, 2), (0, -2), (-1, 1), (1, 1), (-1, -1), (1, -1), (-1, 0), (1, 0), (0, 3), (0, -3), (-2, 0), (2, 0))


def plan_view(map_: MapModel, *, columns: int = COLUMNS, plain: bool = False) -> Group:
    """Return the picture with its scale, wind and legend.

    Args:
        columns: the width of the terminal.
        plain: whether only ASCII is drawn.
    """
    canvas = _canvas(map_, max(columns, 40))
    _draw_surroundings(canvas, map_)
    _draw_ways(canvas, map_)
    if len(map_.marks) <= MARKS_MAX:
        for mark in map_.marks:
            _draw_mark(canvas, mark, plain=plain)
    if len(map_.marks) <= LABELS_MAX:
        for mark in map_.marks:
            _write_beside(canvas, mark.north, mark.east, mark.label, LABEL)
    for crowd in map_.crowd:
        _write_beside(canvas, crowd.corners[0].north, crowd.corners[0].east, crowd.name, CROWD.style)
    for line in map_.lines:
        _write_beside(canvas, line.line.start.north, line.line.start.east, line.line.name, SAFETY.style)
    if len(map_.ways) <= ARROWS_MAX:
        _write_arrows(canvas, map_, plain=plain)
    return Group(*_trimmed(canvas.drawn(plain=plain)), Text(""), *_notes(canvas, map_, plain=plain))


def _trimmed(rows: Sequence[Text]) -> Sequence[Text]:
    """Return the rows without the empty ones above and below."""
    filled = [number for number, row in enumerate(rows) if row.plain]
    return rows[filled[0] : filled[-1] + 1] if filled else []


def _canvas(map_: MapModel, columns: int) -> Canvas:
    """Return a canvas as large as what is to be seen, within the limits."""
    names = max((len(mark.label) for mark in map_.marks), default=0) if len(map_.marks) <= LABELS_MAX else 0
    across = (columns - 2 * MARGIN - min(names, columns // 4)) * ACROSS
    down = (ROWS - NOTES - 2 * MARGIN) * DOWN
    height, width = map_.north - map_.south, map_.east - map_.west
    dot = max(width / across, height / down)
    return Canvas(
        columns=min(columns, math.ceil(width / dot / ACROSS) + 2 * MARGIN + names),
        rows=min(ROWS - NOTES, math.ceil(height / dot / DOWN) + 2 * MARGIN),  # what fits exactly may be rounded up
        north=map_.north + MARGIN * DOWN * dot,
        west=map_.west - MARGIN * ACROSS * dot,
        dot=dot,
    )


def _draw_surroundings(canvas: Canvas, map_: MapModel) -> None:
    if map_.airspace is not None:
        canvas.line(AIRSPACE, map_.airspace, on=1, off=2)
    for crowd in map_.crowd:
        _draw_crowd(canvas, crowd)
    for line in map_.lines:
        _draw_safety_line(canvas, line)


def _draw_crowd(canvas: Canvas, crowd: Crowd) -> None:
    """Draw the people themselves, and dots where their distance ends."""
    away = ground_distance(canvas.centres, crowd)
    down, across = np.ogrid[: away.shape[0], : away.shape[1]]
    raster = (down + across) % 2 == 0
    canvas.paint(DISTANCE, (np.abs(away - crowd.distance) < 0.5 * canvas.dot) & raster)
    closed = crowd.shape is CrowdShape.AREA
    if closed:
        canvas.paint(CROWD, (away == 0.0) & raster)
    for a, b in edges(crowd.corners, closed=closed):
        canvas.line(CROWD, coordinates((a, b)))
    if crowd.shape is CrowdShape.POINT:
        canvas.paint(CROWD, away < canvas.dot)


def _draw_safety_line(canvas: Canvas, line: MapLine) -> None:
    """Draw a line from border to border, with a shade on the side that is forbidden."""
    centres = canvas.centres
    forbidden = (centres - line.ends[0]) @ line.forbidden
    down, across = np.ogrid[: centres.shape[0], : centres.shape[1]]
    shade = (down + 2 * across) % 5 == 0
    canvas.paint(
        SAFETY, (np.abs(forbidden) < 0.5 * canvas.dot) | ((forbidden > 0) & (forbidden < 4 * canvas.dot) & shade)
    )


def _draw_ways(canvas: Canvas, map_: MapModel) -> None:
    """Draw later laps first, so that the first one is seen where they coincide."""
    for way in reversed(map_.ways):
        canvas.line(_lap(way.lap), way.line, on=1 if way.planned else 2, off=0 if way.planned else 2)


def _lap(lap: int) -> Layer:
    return Layer(LAPS[(max(lap, 1) - 1) % len(LAPS)], ".")


def _draw_mark(canvas: Canvas, mark: Mark, *, plain: bool) -> None:
    """Draw what is flown through as a stroke across its axis, long enough to be seen, and all else as a dot."""
    ends = mark.stroke
    if ends is not None:
        middle, half = ends.mean(axis=0), 0.5 * (ends[1] - ends[0])
        half *= max(1.0, 3.0 * canvas.dot / float(np.hypot(*half)))
        canvas.line(GATE, np.array([middle - half, middle + half]))
        return
    canvas.write(*canvas.cell(mark.north, mark.east), "o" if plain else "\u2022", PYLON)


def _write_beside(canvas: Canvas, north: float, east: float, text: str, style: str) -> None:
    """Write a text near a place, where it hides least; nowhere if there is no room."""
    row, column = canvas.cell(north, east)
    choices: list[tuple[int, int, int]] = []
    for number, (down, across) in enumerate(_AROUND):
        begin = column + (across if across > 0 else across - len(text) + 1 if across < 0 else -(len(text) // 2))
        choices.append((4 * canvas.covered(row + down, begin, len(text)) + number, row + down, begin))
    for _, at_row, begin in sorted(choices):
        if text and canvas.write(at_row, begin, text, style):
            return


def _write_arrows(canvas: Canvas, map_: MapModel, *, plain: bool) -> None:
    """Draw an arrow in the direction of flight in the middle of every way that is long enough."""
    arrows = _PLAIN_ARROWS if plain else _ARROWS
    for way in map_.ways:
        middle = len(way.line) // 2
        step = way.line[middle] - way.line[middle - 1]
        if np.ptp(way.line, axis=0).max() < 8 * DOWN * canvas.dot * 0.5:
            continue
        octant = round(math.degrees(math.atan2(step[1], step[0])) / 45.0) % 8
        where = 0.5 * (way.line[middle] + way.line[middle - 1])
        canvas.write(*canvas.cell(float(where[0]), float(where[1])), arrows[octant], _lap(way.lap).style)


def _notes(canvas: Canvas, map_: MapModel, *, plain: bool) -> list[Text]:
    """Return the scale, north and wind in one row, and the legend in another."""
    metres, cells = _bar(canvas)
    left, rule, right = "|-|" if plain else "\u251c\u2500\u2524"
    bar = f"{left}{rule * (cells - 2)}{right}"
    north = "north is up" if plain else "\u2191 north"
    scale = f"{bar} {metres:g} m   {north}   {_wind(map_.wind, plain=plain)}"
    return [Text(scale, no_wrap=True, overflow="ignore"), _legend(map_, plain=plain)]


def _legend(map_: MapModel, *, plain: bool) -> Text:
    """Return the legend of what there is to see, in its colours; in ASCII with its character."""
    laps = sorted({max(way.lap, 1) for way in map_.ways})
    entries = [(f"lap {lap}", _lap(lap), True) for lap in (laps if len(laps) <= len(LAPS) else [])]
    entries += [
        ("gate", GATE, any(mark.stroke is not None for mark in map_.marks)),
        ("crowd and its distance", CROWD, bool(map_.crowd)),
        ("safety line, shaded where forbidden", SAFETY, bool(map_.lines)),
        ("airspace", AIRSPACE, map_.airspace is not None),
    ]
    texts = [Text(f"{layer.plain} {name}" if plain else name, layer.style) for name, layer, shown in entries if shown]
    legend = Text("  ").join(texts)
    legend.no_wrap, legend.overflow = True, "ignore"
    return legend


def _bar(canvas: Canvas) -> tuple[float, int]:
    """Return a round length of about an eighth of the largest width, m, and the number of cells it takes."""
    cell = ACROSS * canvas.dot
    metres = round_length(COLUMNS / 8 * cell)
    return metres, max(2, round(metres / cell))


def _wind(wind: StaticWind | None, *, plain: bool) -> str:
    if wind is None:
        return "no wind"
    towards = round((math.degrees(wind.origin) + 180.0) / 45.0) % 8
    arrow = "" if plain else f"{_ARROWS[towards]} "
    return f"{arrow}wind from {math.degrees(wind.origin) % 360.0:.0f} deg, {wind.speed / KNOT:.0f} kt"
