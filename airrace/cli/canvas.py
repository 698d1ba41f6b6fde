"""A drawing of dots in a terminal, in layers and with texts over them. Eight square dots make a character cell."""

import math

import numpy as np
from rich.text import Text

from airrace.records import record
from airrace.trajectory import Array

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
