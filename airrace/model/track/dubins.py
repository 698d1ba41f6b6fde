"""Shortest planar paths of bounded curvature between two directed points (Dubins, 1957).

Positions are (north, east) in metres, headings in radians clockwise from north; a right turn has positive curvature. A
path is three arcs or straights, written as the signs of their curvatures. The lengths follow Shkel & Lumelsky (2001).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WORDS: tuple[tuple[int, int, int], ...] = ((1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1), (-1, 1, -1), (1, -1, 1))
"""The signs of the curvature along the three pieces of every kind of path."""

_TURN = 2.0 * np.pi
NO_TURN = 1e-9
"""The angle of a turn that counts as none, rad."""
ROUNDED = 9
"""The number of decimals to which two lengths (in radii) or times (s) must agree to be the same."""


@dataclass(frozen=True)
class DubinsPath:
    """A path from (north, east) with `heading`: `lengths` of its three pieces (m) and their `curvatures` (1/m)."""

    north: float
    east: float
    heading: float
    lengths: tuple[float, float, float]
    curvatures: tuple[float, float, float]

    @property
    def length(self) -> float:
        return sum(self.lengths)

    @property
    def turning(self) -> float:
        """The sum of all turns along the path, to whichever side, rad."""
        return sum(abs(length * bend) for length, bend in zip(self.lengths, self.curvatures, strict=True))

    @property
    def turn(self) -> float:
        """The angle by which the heading changes along the path, rad, positive to the right."""
        return sum(length * bend for length, bend in zip(self.lengths, self.curvatures, strict=True))

    def curvature(self, s: Array) -> Array:
        """Return the curvature at arc lengths `s`, shape (n,), 1/m."""
        edges = np.cumsum(self.lengths)[:-1]
        return np.asarray(self.curvatures)[np.searchsorted(edges, s, side="right")]

    def bend(self, factor: float) -> "DubinsPath":
        """Return the path of the same piece lengths with all curvatures multiplied by `factor` (0: straight)."""
        first, second, third = (factor * curvature for curvature in self.curvatures)
        return DubinsPath(self.north, self.east, self.heading, self.lengths, (first, second, third))

    def part(self, begin: float, end: float) -> "DubinsPath":
        """Return the stretch between two arc lengths, m."""
        north, east, heading = (float(values[0]) for values in self.points(np.array([begin])))
        edges = np.concatenate([[0.0], np.cumsum(self.lengths)])
        first, second, third = (float(length) for length in np.diff(np.clip(edges, begin, end)))
        return DubinsPath(north, east, heading, (first, second, third), self.curvatures)

    def points(self, s: Array) -> tuple[Array, Array, Array]:
        """Return north, east (m) and heading (rad) at arc lengths `s` in [0, length], each of shape (n,)."""
        north, east, heading = (np.empty_like(s) for _ in range(3))
        n, e, chi, begin = self.north, self.east, self.heading, 0.0
        for length, curvature in zip(self.lengths, self.curvatures, strict=True):
            piece = s >= begin - 1e-9
            north[piece], east[piece], heading[piece] = _arc(n, e, chi, curvature, s[piece] - begin)
            ends = _arc(n, e, chi, curvature, np.array([length]))
            n, e, chi = (float(end[0]) for end in ends)
            begin += length
        return north, east, heading


def _arc(north: float, east: float, heading: float, curvature: float, s: Array) -> tuple[Array, Array, Array]:
    """Return points on a circular arc, or on a straight line if the curvature is nil."""
    turned = heading + curvature * s
    half = 0.5 * curvature * s
    chord = s * np.sinc(half / np.pi)
    return north + chord * np.cos(heading + half), east + chord * np.sin(heading + half), turned


def _turn(angle: Array) -> Array:
    """Return an angle as a turn in [0, 2 pi); what rounding has put just below a full circle becomes zero."""
    wrapped = np.mod(angle, _TURN)
    return np.where(wrapped > _TURN - NO_TURN, 0.0, wrapped)


def lengths(start: Array, heading: Array, end: Array, end_heading: Array, radius: float) -> Array:
    """Return the lengths of the pieces of all six kinds of path, in radii; infinite where a kind does not exist.

    Args:
        start, end: positions, shapes broadcastable to (..., 2).
        heading, end_heading: shapes broadcastable to (...).
        radius: the radius of the turns, m.

    Returns:
        Shape (6, 3, ...), in the order of `WORDS`.
    """
    offset = (np.asarray(end) - np.asarray(start)) / radius
    d = np.hypot(offset[..., 0], offset[..., 1])
    bearing = np.arctan2(offset[..., 1], offset[..., 0])
    d, a, b = np.broadcast_arrays(d, _turn(heading - bearing), _turn(end_heading - bearing))
    pieces = np.stack([
        _same_side(d, a, b),
        _same_side(d, -a, -b),
        _crossing(d, a, b),
        _crossing(d, -a, -b),
        _three_turns(d, -a, -b),
        _three_turns(d, a, b),
    ])  # fmt: skip
    return np.where(np.isnan(pieces).any(axis=1, keepdims=True), np.inf, pieces)


def _same_side(d: Array, a: Array, b: Array) -> Array:
    """Return the pieces of a turn, a straight and a turn to the same side (written for positive turns)."""
    straight = np.sqrt(np.maximum(2 + d * d - 2 * np.cos(a - b) + 2 * d * (np.sin(a) - np.sin(b)), 0.0))
    towards = np.arctan2(np.cos(b) - np.cos(a), d + np.sin(a) - np.sin(b))
    return np.stack([_turn(towards - a), straight, _turn(b - towards)])


def _crossing(d: Array, a: Array, b: Array) -> Array:
    """Return the pieces of a turn, a straight and a turn to the other side (written for a positive first turn)."""
    with np.errstate(invalid="ignore"):
        straight = np.sqrt(-2 + d * d + 2 * np.cos(a - b) + 2 * d * (np.sin(a) + np.sin(b)))
    towards = np.arctan2(-np.cos(a) - np.cos(b), d + np.sin(a) + np.sin(b)) - np.arctan2(-2.0, straight)
    return np.stack([_turn(towards - a), straight, _turn(towards - b)])


def _three_turns(d: Array, a: Array, b: Array) -> Array:
    """Return the pieces of three turns to alternating sides (written for a positive first turn)."""
    with np.errstate(invalid="ignore"):
        middle = _turn(-np.arccos((6 - d * d + 2 * np.cos(a - b) + 2 * d * (np.sin(b) - np.sin(a))) / 8))
    towards = np.arctan2(np.cos(a) - np.cos(b), d + np.sin(a) - np.sin(b))
    first = _turn(-a - towards + middle / 2)
    return np.stack([first, middle, _turn(b - a - first + middle)])


def on_side(pieces: Array, side: int, length_min: float = 0.0) -> Array:
    """Return the lengths of all six kinds of path, infinite where a path turns to the other side on the whole.

    Args:
        pieces: lengths of their pieces in radii, shape (6, 3, ...).
        side: 1 for right turns, -1 for left turns, 0 for both.
        length_min: the length in radii below which a path counts as infinite, too, where there is a longer one.

    Returns:
        Shape (6, ...), in radii.
    """
    total = pieces.sum(axis=1)
    if side != 0:
        signs = np.asarray(WORDS, dtype=float)
        with np.errstate(invalid="ignore"):  # a path that does not exist has infinite pieces
            turned = (np.moveaxis(pieces, (0, 1), (-2, -1)) * signs).sum(axis=-1)
        total = np.where(side * np.moveaxis(turned, -1, 0) > NO_TURN, total, np.inf)
    longer = np.where(total >= length_min, total, np.inf)
    return np.where(np.isfinite(longer).any(axis=0), longer, total)


def least(values: Array, *, last: bool = False) -> Array:
    """Return where each column is least; of values that are equal but for rounding, the first, or the last."""
    rounded = np.round(values, ROUNDED)
    return len(rounded) - 1 - rounded[::-1].argmin(axis=0) if last else rounded.argmin(axis=0)


def circle(start: Array, heading: float, radius: float, *, left: bool = False) -> DubinsPath:
    """Return the full circle from a place back to it, to the right or to the left; shape (2,) and scalars."""
    curvature = (-1.0 if left else 1.0) / radius
    return DubinsPath(
        float(start[0]), float(start[1]), heading, (_TURN * radius, 0.0, 0.0), (curvature, curvature, curvature)
    )


def shortest(
    start: Array,
    heading: float,
    end: Array,
    end_heading: float,
    radius: float,
    side: int = 0,
    *,
    length_min: float = 0.0,
    last: bool = False,
) -> DubinsPath:
    """Return the shortest path; of those to one side if `side` is 1 (right) or -1 (left). Shapes (2,) and scalars.

    Of those that are at least `length_min` long (m), if there are any. Of equally short ones the first in the order of
    `WORDS` is taken, or the last.
    """
    pieces = lengths(start, np.asarray(heading), end, np.asarray(end_heading), radius)
    word = int(least(on_side(pieces, side, length_min / radius), last=last))
    first, second, third = (float(piece) * radius for piece in pieces[word])
    signs = WORDS[word]
    curvatures = (signs[0] / radius, signs[1] / radius, signs[2] / radius)
    return DubinsPath(float(start[0]), float(start[1]), heading, (first, second, third), curvatures)
