"""A course in the terminal, seen from above: dots, eight to a cell, north up, both directions at one scale."""

import math
from dataclasses import dataclass

import numpy as np
from rich.console import Group
from rich.text import Text

from airrace.model.track.course import CrowdShape
from airrace.model.track.polygons import edges
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.map_model import MapModel, Mark, coordinates, round_length
from airrace.procedure.planning.clearance import ground_distance

ACROSS, DOWN = 2, 4
"""The dots of a cell; it is twice as high as wide, so the dots lie on a square grid."""
_BLANK = 0x2800
"""The first of the Braille patterns, whose lower eight bits are the dots."""
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


@dataclass(frozen=True)
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

    def paint(self, layer: Layer, row: np.ndarray, column: np.ndarray) -> None:
        """Lay dots, given by their rows and columns, over what there is."""
        if layer not in self._layers:
            self._layers.append(layer)
        self._dots[row, column] = True
        self._top[row // DOWN, column // ACROSS] = self._layers.index(layer)

    def line(self, layer: Layer, points: Array, *, on: int = 1, off: int = 0) -> None:
        """Lay a line through points of shape (n, 2) over what there is, `on` dots drawn and `off` left out in turn."""
        down, across = (self.north - points[:, 0]) / self.dot, (points[:, 1] - self.west) / self.dot
        lengths = np.maximum(np.abs(np.diff(down)), np.abs(np.diff(across)))
        begins = np.concatenate([[0.0], np.cumsum(lengths)])
        steps = np.arange(0.0, begins[-1] + 0.5)
        steps = steps[steps % (on + off) < on]
        row, column = (np.floor(np.interp(steps, begins, coordinates)).astype(int) for coordinates in (down, across))
        within = (row >= 0) & (row < self._dots.shape[0]) & (column >= 0) & (column < self._dots.shape[1])
        self.paint(layer, row[within], column[within])

    def cell(self, north: float, east: float) -> tuple[int, int]:
        """Return the row and column of a place; it may lie outside."""
        row, column = (self.north - north) / self.dot / DOWN, (east - self.west) / self.dot / ACROSS
        return math.floor(row), math.floor(column)

    def write(self, row: int, column: int, text: str, style: str) -> bool:
        """Put a text over the dots, unless it would leave the canvas or cover another; return whether it was put."""
        cells = [(row, column + index) for index in range(len(text))]
        if not 0 <= row < self.rows or column < 0 or column + len(text) > self.columns:
            return False
        if any(cell in self._texts for cell in cells):
            return False
        self._texts.update({cell: (letter, style) for cell, letter in zip(cells, text, strict=True)})
        return True

    def write_beside(self, north: float, east: float, text: str, style: str) -> None:
        """Write a text near a place, where it hides the fewest dots; nowhere if there is no room."""
        row, column = self.cell(north, east)
        choices: list[tuple[int, int, int]] = []
        for number, (down, across) in enumerate(_AROUND):
            begin = column + (across if across > 0 else across - len(text) + 1 if across < 0 else -(len(text) // 2))
            top, left, right = (row + down) * DOWN, begin * ACROSS, (begin + len(text)) * ACROSS
            hidden = int(self._dots[max(top, 0) : max(top + DOWN, 0), max(left, 0) : max(right, 0)].sum())
            choices.append((4 * hidden + number, row + down, begin))
        for _, at_row, begin in sorted(choices):
            if text and self.write(at_row, begin, text, style):
                return

    def texts(self, *, plain: bool) -> list[Text]:
        """Return the rows from north to south; with `plain` in ASCII alone."""
        cells = self._dots.reshape(self.rows, DOWN, self.columns, ACROSS)
        bits = (cells * _BITS[:, None, :]).sum(axis=(1, 3))
        lines: list[Text] = []
        for row in range(self.rows):
            line = Text(no_wrap=True, overflow="ignore")
            for column in range(self.columns):
                dots = int(bits[row, column])
                if (row, column) in self._texts:
                    line.append(*self._texts[row, column])
                elif dots == 0:
                    line.append(" ")
                else:
                    layer = self._layers[int(self._top[row, column])]
                    line.append(layer.plain if plain else chr(_BLANK + dots), layer.style)
            line.rstrip()
            lines.append(line)
        return lines


COLUMNS = 100
"""The cells that the picture may fill, with its scale and its legend; columns only where no terminal says."""
ROWS = 35
"""The cells that the picture may fill, with its scale and its legend; columns only where no terminal says."""
NOTE_ROWS = 3
"""The rows of the scale and the legend."""
MARGIN = 2
"""The cells left free around what is drawn."""
MARKS_MAX = 400
"""The largest number of elements that are marked; more would but hide the way."""
LABELS_MAX = 60
"""The largest number of elements whose names are written."""
ARROWS_MAX = 60
"""The largest number of ways that get an arrow."""
LAPS = [Layer(style, ".") for style in ("cyan", "magenta", "green", "blue")]
AIRSPACE = Layer("blue", ":")
CROWD = Layer("red", "x")
DISTANCE = Layer("red", ",")
OBSTACLE = Layer("magenta", "%")
SAFETY = Layer("yellow", "=")
GATE = Layer("bold white", "#")
_ARROWS = "\u2191\u2197\u2192\u2198\u2193\u2199\u2190\u2196"  # from north, clockwise
_PLAIN_ARROWS = "^>>>v<<<"
_AROUND = ((0, 2), (0, -2), (-1, 1), (1, 1), (-1, -1), (1, -1), (-1, 0), (1, 0), (0, 3), (0, -3), (-2, 0), (2, 0))
"""The places of a text beside a point, rows down and columns to the right, the best first."""


def plan_view(map_: MapModel, *, columns: int = COLUMNS, plain: bool = False) -> Group:
    """Return the picture with its scale, wind and legend.

    Args:
        columns: the width of the terminal.
        plain: whether only ASCII is drawn.
    """
    canvas = _canvas(map_, max(columns, 40))
    _draw_surroundings(canvas, map_)
    for way in reversed(map_.ways):  # the first lap is seen where others coincide with it
        canvas.line(_lap(way.lap), way.line, on=1 if way.planned else 2, off=0 if way.planned else 2)
    if len(map_.marks) <= MARKS_MAX:
        for mark in map_.marks:
            _draw_mark(canvas, mark, plain=plain)
    if len(map_.marks) <= LABELS_MAX:
        for mark in map_.marks:
            canvas.write_beside(mark.north, mark.east, mark.label, "bold")
    for crowd in map_.crowd:
        canvas.write_beside(crowd.corners[0].north, crowd.corners[0].east, crowd.name, CROWD.style)
    for obstacle, _ in map_.obstacles:
        where = obstacle.places[0].north, obstacle.places[0].east
        if len(obstacle.places) == 1:
            canvas.write(*canvas.cell(*where), OBSTACLE.plain, OBSTACLE.style)
        canvas.write_beside(*where, obstacle.name, OBSTACLE.style)
    for line in map_.lines:
        canvas.write_beside(line.line.start.north, line.line.start.east, line.line.name, SAFETY.style)
    if len(map_.ways) <= ARROWS_MAX:
        _write_arrows(canvas, map_, _PLAIN_ARROWS if plain else _ARROWS)
    rows = canvas.texts(plain=plain)
    filled = [number for number, row in enumerate(rows) if row.plain] or [0, -1]
    return Group(*rows[filled[0] : filled[-1] + 1], Text(""), _scale(canvas, map_, plain=plain), _legend(map_, plain))


def _canvas(map_: MapModel, columns: int) -> Canvas:
    """Return a canvas as large as what is to be seen, within the limits."""
    names = max((len(mark.label) for mark in map_.marks), default=0) if len(map_.marks) <= LABELS_MAX else 0
    rows, margin = ROWS - NOTE_ROWS, MARGIN
    across = (columns - 2 * margin - min(names, columns // 4)) * ACROSS
    down = (rows - 2 * margin) * DOWN
    height, width = map_.north - map_.south, map_.east - map_.west
    dot = max(width / across, height / down)
    return Canvas(
        columns=min(columns, math.ceil(width / dot / ACROSS) + 2 * margin + names),
        rows=min(rows, math.ceil(height / dot / DOWN) + 2 * margin),  # what fits exactly may be rounded up
        north=map_.north + margin * DOWN * dot,
        west=map_.west - margin * ACROSS * dot,
        dot=dot,
    )


def _draw_surroundings(canvas: Canvas, map_: MapModel) -> None:
    """Draw the airspace, people with dots where their distance ends, obstacles, and safety lines, shaded where it is
    forbidden.
    """
    centres = canvas.centres
    down, across = np.ogrid[: centres.shape[0], : centres.shape[1]]
    raster, shade = (down + across) % 2 == 0, (down + 2 * across) % 5 == 0
    if map_.airspace is not None:
        canvas.line(AIRSPACE, map_.airspace, on=1, off=2)
    for crowd in map_.crowd:
        away = ground_distance(centres, crowd)
        closed = crowd.shape is CrowdShape.AREA
        canvas.paint(DISTANCE, *np.nonzero((np.abs(away - crowd.distance) < 0.5 * canvas.dot) & raster))
        if closed:
            canvas.paint(CROWD, *np.nonzero((away == 0.0) & raster))
        for a, b in edges(crowd.corners, closed=closed):
            canvas.line(CROWD, coordinates((a, b)))
        if crowd.shape is CrowdShape.POINT:
            canvas.paint(CROWD, *np.nonzero(away < canvas.dot))
    for _, outline in map_.obstacles:
        canvas.line(OBSTACLE, outline)
    for line in map_.lines:
        beyond = (centres - line.ends[0]) @ line.forbidden
        border = np.abs(beyond) < 0.5 * canvas.dot
        canvas.paint(SAFETY, *np.nonzero(border | ((beyond > 0) & (beyond < 4 * canvas.dot) & shade)))


def _lap(lap: int) -> Layer:
    return LAPS[(max(lap, 1) - 1) % len(LAPS)]


def _draw_mark(canvas: Canvas, mark: Mark, *, plain: bool) -> None:
    """Draw gates as a stroke across its axis, long enough to be seen, and all else as a dot."""
    ends = mark.stroke
    if ends is None:
        canvas.write(*canvas.cell(mark.north, mark.east), "o" if plain else "\u2022", GATE.style)
        return
    middle, half = ends.mean(axis=0), 0.5 * (ends[1] - ends[0])
    half *= max(1.0, 3.0 * canvas.dot / float(np.hypot(*half)))
    canvas.line(GATE, np.array([middle - half, middle + half]))


def _write_arrows(canvas: Canvas, map_: MapModel, arrows: str) -> None:
    """Draw an arrow in the direction of flight in the middle of every way that is long enough."""
    for way in map_.ways:
        middle = len(way.line) // 2
        before, after = way.line[middle - 1], way.line[middle]
        if np.ptp(way.line, axis=0).max() >= 4 * DOWN * canvas.dot:
            octant = round(math.degrees(math.atan2(after[1] - before[1], after[0] - before[0])) / 45.0) % 8
            north, east = 0.5 * (before + after)
            canvas.write(*canvas.cell(float(north), float(east)), arrows[octant], _lap(way.lap).style)


def _scale(canvas: Canvas, map_: MapModel, *, plain: bool) -> Text:
    """Return a bar of a round length of about an eighth of the largest width, north and the wind."""
    cell = ACROSS * canvas.dot
    metres = round_length(COLUMNS / 8 * cell)
    left, rule, right = "|-|" if plain else "\u251c\u2500\u2524"
    bar = f"{left}{rule * (max(2, round(metres / cell)) - 2)}{right}"
    wind = "no wind"
    if map_.wind is not None:
        origin = math.degrees(map_.wind.origin)
        arrow = "" if plain else f"{_ARROWS[round((origin + 180.0) / 45.0) % 8]} "
        wind = f"{arrow}wind from {origin % 360.0:.0f} deg, {map_.wind.speed / KNOT:.0f} kt"
    north = "north is up" if plain else "\u2191 north"
    return Text(f"{bar} {metres:g} m   {north}   {wind}")


def _legend(map_: MapModel, plain: bool) -> Text:
    """Return the legend of what there is to see, in its colours; in ASCII with its character."""
    laps = sorted({max(way.lap, 1) for way in map_.ways})
    entries = [(f"lap {lap}", _lap(lap), len(laps) <= len(LAPS)) for lap in laps]
    entries += [
        ("gate", GATE, any(mark.stroke is not None for mark in map_.marks)),
        ("crowd and its distance", CROWD, bool(map_.crowd)),
        ("obstacle", OBSTACLE, bool(map_.obstacles)),
        ("safety line, shaded where forbidden", SAFETY, bool(map_.lines)),
        ("airspace", AIRSPACE, map_.airspace is not None),
    ]
    texts = [
        Text(f"{layer.plain} {name}" if plain else name, layer.style)
        for name, layer, is_visible in entries
        if is_visible
    ]
    return Text("  ").join(texts)
