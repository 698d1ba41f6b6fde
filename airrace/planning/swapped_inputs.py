"""Slips of the pen in a course: what is possible as it stands and was probably meant otherwise."""

import itertools
import math
from collections.abc import Iterator, Sequence

from airrace.frames import angle_between
from airrace.planning.legs import place
from airrace.track.course import Passage

FEWEST = 4
"""The smallest number of headings that tell whether positions fit them."""
BETTER = 0.25
"""The gain by which headings must fit better with north and east exchanged, as a mean cosine. Those of the shipped
courses fit worse by 0.31 at least."""
CLEAR = 20.0
"""The distance from a pylon at which the straight line between its neighbours passes on the side asked for, m. On the
shipped courses it is 17 m at most, and most lines pass on the other side."""


def exchanged_axes(passages: Sequence[Passage]) -> bool:
    """Return whether the gates' headings fit the course much better with north and east exchanged."""
    as_given: list[float] = []
    exchanged: list[float] = []
    for before, after in itertools.pairwise(passages):
        start, end = place(before), place(after)
        if start is None or end is None or math.dist(start[:2], end[:2]) < 1.0:
            continue
        north, east = end[0] - start[0], end[1] - start[1]
        for passage in (before, after):
            heading = passage.element.course(passage.direction) if passage.element.directed else None
            if heading is not None:
                as_given.append(math.cos(angle_between(heading, math.atan2(east, north))))
                exchanged.append(math.cos(angle_between(heading, math.atan2(north, east))))
    if len(as_given) < FEWEST:
        return False
    return (sum(exchanged) - sum(as_given)) / len(as_given) > BETTER


def idle_pylons(passages: Sequence[Passage]) -> Iterator[tuple[Passage, Passage, Passage, float]]:
    """Yield the elements to be passed on one side that nobody has to fly round, pylons for one, once each.

    Yields:
        The passages before, at and after such an element, and by how much the straight line between its neighbours
        passes it on the side that is asked for, m.
    """
    seen: set[str] = set()
    for before, passage, after in zip(passages, passages[1:], passages[2:], strict=False):
        element, start, end = passage.element, place(before), place(after)
        side, at = element.passing_side, element.place
        if side is None or at is None or start is None or end is None or element.name in seen:
            continue
        seen.add(element.name)
        north, east = end[0] - start[0], end[1] - start[1]
        length = math.hypot(north, east)
        if length < 1.0:
            continue
        along = ((at[0] - start[0]) * north + (at[1] - start[1]) * east) / length**2
        aside = (start[0] + along * north - at[0], start[1] + along * east - at[1])
        margin = aside[0] * math.cos(side) + aside[1] * math.sin(side)
        if 0.0 < along < 1.0 and margin > CLEAR:
            yield before, passage, after, margin
