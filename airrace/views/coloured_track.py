"""A track on a map in colours: of its speed, or of the time that is lost along it."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from airrace.quantities import KNOT
from airrace.records import record
from airrace.results.comparison import Comparison
from airrace.results.time_loss import loss_along
from airrace.trajectory import Array

SPEED_COLOURS = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#d8c00f")
"""From slow to fast."""
LOSS_COLOURS = ("#08519c", "#4292c6", "#9ecae1", "#bdbdbd", "#fdae6b", "#f16913", "#a63603")
"""From winning to losing: blue and orange differ for all eyes, and are the darker, the more it is."""
LARGEST = 95.0
"""The percentile of the rates of loss that has the last colour."""
STILL = 2e-4
"""The rate of loss that has the last colour at least, s/m: 0.02 s in 100 m are within the noise of a log."""


@record
class ColouredTrack:
    """A track with a value at each of its places.

    Attributes:
        line: north and east, m, shape (n, 2).
        values: shape (n,); NaN where nothing is known.
        least, greatest: the values that have the first and the last colour.
        colours: from the least value to the greatest.
        ends: both values in words.
        label: what the values are.
    """

    line: Array
    values: Array
    least: float
    greatest: float
    colours: tuple[str, ...]
    ends: tuple[str, str]
    label: str

    def pieces(self) -> Iterator[tuple[Array, str]]:
        """Yield the pieces of one colour each."""
        middle = 0.5 * (self.values[1:] + self.values[:-1])
        share = (np.nan_to_num(middle) - self.least) / max(self.greatest - self.least, 1e-9)
        number = np.clip((share * len(self.colours)).astype(np.int64), 0, len(self.colours) - 1)
        number[np.isnan(middle)] = -1
        begins = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(number)]
        for begin, end in pairwise(begins):
            if number[begin] >= 0:
                yield self.line[begin : end + 1], self.colours[int(number[begin])]


def by_speed(line: Array, speed: Array) -> ColouredTrack:
    """Return a track, shape (n, 2), in the colours of its speed, m/s, shape (n,)."""
    least, greatest = float(speed.min()), float(speed.max())
    ends = f"{least / KNOT:.0f} kt", f"{greatest / KNOT:.0f} kt"
    return ColouredTrack(line, speed, least, greatest, SPEED_COLOURS, ends, "speed over ground")


def by_loss(comparison: Comparison) -> ColouredTrack:
    """Return the track of the other flight in the colours of the time that it loses at a place."""
    line, rate = loss_along(comparison)
    known = np.abs(rate[np.isfinite(rate)])
    most = max(float(np.percentile(known, LARGEST)), STILL) if len(known) else STILL
    ends = f"wins {100.0 * most:.2f} s in 100 m", f"loses {100.0 * most:.2f} s"
    label = f"time lost against {comparison.reference.label}"
    return ColouredTrack(line, rate, -most, most, LOSS_COLOURS, ends, label)
