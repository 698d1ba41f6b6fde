"""The placement of labels: beside what they name, off one another and off what should be seen."""

import math
from collections.abc import Sequence

from airrace.records import record
from airrace.trajectory import Array


@record
class Placement:
    """What places are tried for a label, and what they cost.

    Attributes:
        directions: around a place in which its label may go.
        gaps: distances between a place and its label, as multiples of the gap asked for.
        overlap: the price of lying on another label, in points of the drawing that a label covers.
        outside: the price of lying outside the frame; at that of an overlap, of four places in a corner the last label
            lay half outside.
    """

    directions: int = 12
    gaps: tuple[float, ...] = (1.0, 2.0, 3.5, 5.5)
    overlap: float = 50.0
    outside: float = 1000.0


PLACEMENT = Placement()


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

    def count_inside(self, points: Array) -> int:
        """Return the number of the points, shape (n, 2), that lie inside."""
        across = (points[:, 0] > self.left) & (points[:, 0] < self.left + self.width)
        return int((across & (points[:, 1] > self.bottom) & (points[:, 1] < self.bottom + self.height)).sum())


def place_labels(
    anchors: Sequence[tuple[float, float]], sizes: Sequence[tuple[float, float]], points: Array, frame: Box, gap: float
) -> list[Box]:
    """Return a box for every label, placed one after the other where it costs least.

    Args:
        anchors: the places that the labels name.
        sizes: the width and height of each label.
        points: of what should stay visible, shape (n, 2).
        frame: the rectangle to stay within.
        gap: the least distance from the anchor.
    """
    boxes: list[Box] = []
    for (x, y), (width, height) in zip(anchors, sizes, strict=True):
        choices: list[tuple[float, Box]] = []
        for distance in PLACEMENT.gaps:
            for number in range(PLACEMENT.directions):
                angle = 2.0 * math.pi * number / PLACEMENT.directions
                across = x + math.cos(angle) * (distance * gap + 0.5 * width)
                up = y + math.sin(angle) * (distance * gap + 0.5 * height)
                box = Box(across - 0.5 * width, up - 0.5 * height, width, height)
                area = width * height
                overlap = sum(box.overlap(other) for other in boxes) / area
                outside = 1.0 - box.overlap(frame) / area
                cost = (
                    PLACEMENT.overlap * overlap
                    + PLACEMENT.outside * outside
                    + box.count_inside(points)
                    + 0.02 * len(choices)
                )
                choices.append((cost, box))
        boxes.append(min(choices, key=lambda choice: choice[0])[1])
    return boxes
