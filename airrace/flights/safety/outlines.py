"""Outlines of ground that is covered: points within a width, on a raster, by marching squares.

The points are entered into a raster; the distance transform gives how far every cell is from the nearest of them, and
the outline is where that is the width. It is true to about a cell.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt  # pyright: ignore[reportUnknownVariableType] - it is untyped

from airrace.model.track.polygons import Point, area, inside
from airrace.optimal_control.trajectory import Array

_CROSSINGS: tuple[tuple[tuple[int, int], ...], ...] = (
    *((), ((0, 3),), ((1, 0),), ((1, 3),), ((2, 1),), ((0, 1), (2, 3)), ((2, 0),), ((2, 3),)),
    *(((3, 2),), ((0, 2),), ((1, 2), (3, 0)), ((1, 2),), ((3, 1),), ((0, 1),), ((3, 0),), ()),
)
"""The edges by which the outline enters and leaves a cell (south 0, east 1, north 2, west 3), covered ground to its
left, by the corners that are covered (south-west 1, south-east 2, north-east 4, north-west 8); in saddles these hang
together.
"""


@dataclass(frozen=True, eq=False)
class Outline:
    """A piece of ground.

    Attributes:
        border: north and east of its corners, counterclockwise from above, not closed, m, shape (n, 2).
        holes: likewise, clockwise.
    """

    border: Array
    holes: tuple[Array, ...] = ()


@dataclass(frozen=True, eq=False)
class Raster:
    """The ground within a width of some points.

    Attributes:
        corner: north and east of the centre of the first cell, m, shape (2,).
        cell: edge of the cells, m.
        inside: how far within the covered ground the centres are, m, negative outside, shape (north, east).
    """

    corner: Array
    cell: float
    inside: Array

    @classmethod
    def from_stretches(cls, stretches: Iterable[tuple[Array, Array]], width: float, cells: int) -> "Raster":
        """Return the ground within a width of what some stretches sweep over.

        Args:
            stretches: the begin and the end of each at instants in order, north and east, m, shape (n, 2).
            width: m; a cell where that is less, so that courses of any size take as many cells.
            cells: along the longer edge.
        """
        swept = list(stretches)
        ends = [end for pair in swept for end in pair]
        least = np.min([end.min(axis=0) for end in ends], axis=0)
        largest = np.max([end.max(axis=0) for end in ends], axis=0)
        cell = (float((largest - least).max()) + 2.0 * width) / cells
        width = max(width, cell)
        corner = least - width - 2.0 * cell
        shape = np.ceil((largest - least + 2.0 * width) / cell).astype(np.int64) + 5
        empty = np.ones(shape, bool)
        for begin, end in swept:
            rows, columns = np.rint((sweep(begin, end, cell) - corner) / cell).astype(np.int64).T
            empty[rows, columns] = False
        distance = np.asarray(distance_transform_edt(empty), np.float64)
        return cls(corner, cell, width - cell * distance)

    @property
    def centres(self) -> Array:
        """North and east of the centres of all cells, m, shape (north, east, 2)."""
        rows, columns = np.indices(self.inside.shape)
        return self.corner + self.cell * np.stack([rows, columns], axis=-1)

    def outlines(self) -> tuple[Outline, ...]:
        """Return the pieces of the covered ground, the largest first."""
        rings = sorted(self._rings(), key=lambda ring: abs(_area(ring)), reverse=True)
        borders = [ring for ring in rings if _area(ring) < 0.0]
        holes: dict[int, list[Array]] = {}
        for ring in rings:
            if _area(ring) > 0.0:
                around = [n for n, border in enumerate(borders) if inside(ring[0], _corners(border))]
                if around:
                    holes.setdefault(around[-1], []).append(ring)
        return tuple(Outline(border, tuple(holes.get(number, ()))) for number, border in enumerate(borders))

    def _rings(self) -> list[Array]:
        """Return the borders of the covered ground, each with that to its left as seen from above."""
        covered = self.inside > 0.0
        kind = covered[:-1, :-1] + 2 * covered[:-1, 1:] + 4 * covered[1:, 1:] + 8 * covered[1:, :-1]
        following: dict[tuple[int, int, bool], tuple[int, int, bool]] = {}
        for row, column in np.argwhere((kind > 0) & (kind < 15)).tolist():
            # An edge: the cell that it begins in, and whether it leads north.
            edges = ((row, column, False), (row, column + 1, True), (row + 1, column, False), (row, column, True))
            for enter, leave in _CROSSINGS[int(kind[row, column])]:
                following[edges[enter]] = edges[leave]
        rings: list[Array] = []
        while following:
            edge, after = following.popitem()
            ring = [edge]
            while after in following:
                ring.append(after)
                after = following.pop(after)
            rings.append(self._places(ring))
        return rings

    def _places(self, ring: list[tuple[int, int, bool]]) -> Array:
        """Return where the outline crosses some edges, m, shape (n, 2)."""
        begin = np.array([(row, column) for row, column, _ in ring])
        step = np.array([(1, 0) if north else (0, 1) for _, _, north in ring])
        a, b = (self.inside[tuple(index.T)] for index in (begin, begin + step))
        return self.corner + self.cell * (begin + (a / (a - b))[:, None] * step)


def sweep(begin: Array, end: Array, spacing: float) -> Array:
    """Return points of the ground over which a stretch moves, no farther apart than a spacing, shape (m, 2).

    Args:
        begin, end: of the stretch at instants in order, north and east, m, shape (n, 2).
        spacing: m.
    """
    across = 1 + math.ceil(float(np.linalg.norm(end - begin, axis=1).max()) / spacing)
    share = np.linspace(0.0, 1.0, across)[:, None]
    lines = begin[:, None] + share * (end - begin)[:, None]
    if len(lines) < 2:
        return lines.reshape(-1, 2)
    along = max(1, math.ceil(float(np.linalg.norm(np.diff(lines, axis=0), axis=-1).max()) / spacing))
    share = np.arange(along)[:, None, None] / along
    between = lines[:-1, None] + share * np.diff(lines, axis=0)[:, None]
    return np.concatenate([between.reshape(-1, 2), lines[-1]])


def _corners(ring: Array) -> list[Point]:
    return [Point(north, east) for north, east in ring.tolist()]


def _area(ring: Array) -> float:
    """Return the area of a ring, m2; positive if its corners run clockwise as seen from above."""
    return area(_corners(ring))
