"""The placement of labels: beside what they name, off one another and off what should be seen."""

import math
from collections.abc import Sequence

import numpy as np

from airrace.records import record
from airrace.trajectory import Array

DIRECTIONS = 12
"""The number of directions around a place in which a label may go."""
OUTSIDE = 1000.0
"""The price of a label that lies outside the frame, in points of the drawing that a label covers.

Twenty times that of one that lies on another label: of four places in a corner the last label else lay half outside.
"""
GAPS = (1.0, 2.0, 3.5, 5.5)
"""The distances between a place and its label that are tried, as multiples of the gap asked for."""


@record
class Box:
    """A rectangle with edges along the axes, in any unit."""

    left: float
    bottom: float
    width: float
    height: float

    def overlap(self, other: "Box") -> float:
        """Return the area in common with another rectangle."""
        across = min(self.left + self.width, other.left + other.width) - max(self.left, other.left)
        up = min(self.bottom + self.height, other.bottom + other.height) - max(self.bottom, other.bottom)
        return max(across, 0.0) * max(up, 0.0)

    def holds(self, points: Array) -> int:
        """Return the number of the points, shape (n, 2), that lie inside."""
        across = (points[:, 0] > self.left) & (points[:, 0] < self.left + self.width)
        return int((across & (points[:, 1] > self.bottom) & (points[:, 1] < self.bottom + self.height)).sum())


def placed(
    anchors: Sequence[tuple[float, float]], sizes: Sequence[tuple[float, float]], drawn: Array, frame: Box, gap: float
) -> list[Box]:
    """Return a box for every label, placed one after the other where it costs least.

    Args:
        anchors: the places that the labels name.
        sizes: the width and height of each label.
        drawn: points that should stay visible, shape (n, 2).
        frame: the rectangle to stay within.
        gap: the least distance from the anchor.
    """
    boxes: list[Box] = []
    for anchor, size in zip(anchors, sizes, strict=True):
        choices = _choices(anchor, size, gap)
        costs = [_cost(box, boxes, drawn, frame) + 0.02 * number for number, box in enumerate(choices)]
        boxes.append(choices[int(np.argmin(costs))])
    return boxes


def _choices(anchor: tuple[float, float], size: tuple[float, float], gap: float) -> list[Box]:
    """Return boxes around a place, near ones first."""
    width, height = size
    boxes: list[Box] = []
    for distance in GAPS:
        for number in range(DIRECTIONS):
            angle = 2.0 * math.pi * number / DIRECTIONS
            across, up = math.cos(angle), math.sin(angle)
            middle = (
                anchor[0] + across * (distance * gap + 0.5 * width),
                anchor[1] + up * (distance * gap + 0.5 * height),
            )
            boxes.append(Box(middle[0] - 0.5 * width, middle[1] - 0.5 * height, width, height))
    return boxes


def _cost(box: Box, others: Sequence[Box], drawn: Array, frame: Box) -> float:
    area = box.width * box.height
    covered = sum(box.overlap(other) for other in others) / area
    outside = 1.0 - box.overlap(frame) / area
    return 50.0 * covered + OUTSIDE * outside + box.holds(drawn)
