"""Lines and areas cut in two where they cross the antimeridian, as RFC 7946 (section 3.1.9) wants it.

Two corners that are more than half a turn apart are joined the shorter way.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

Corner = list[float]
"""Longitude and latitude, degrees, and further numbers that are interpolated like these."""


def cut_line(corners: Sequence[Corner]) -> list[list[Corner]]:
    """Return the pieces of a line, each on one side of the antimeridian; a line that stays on its side is one piece."""
    pieces = [[corners[0]]]
    for one, other in pairwise(corners):
        if abs(other[0] - one[0]) > 180.0:
            side = math.copysign(180.0, one[0])
            between = _at(one, [other[0] + 2.0 * side, *other[1:]], side)
            pieces[-1].append(between)
            pieces.append([[-side, *between[1:]]])
        pieces[-1].append(other)
    return pieces


def cut_area(ring: Sequence[Corner]) -> list[list[Corner]]:
    """Return the pieces of an area, none of them closed, in the sense of rotation of the given one."""
    turned = unwrapped(ring)
    far = max(turned, key=lambda one: abs(one[0]))[0]
    side = math.copysign(180.0, far)
    if abs(far) <= 180.0:
        return [list(ring)]
    pieces: list[list[Corner]] = []
    for inner in (True, False):
        piece: list[Corner] = []
        for one, other in pairwise([*turned, turned[0]]):
            here, there = ((abs(corner[0]) <= 180.0) == inner for corner in (one, other))
            piece += [one] if here else []
            piece += [_at(one, other, side)] if here != there else []
        pieces.append(piece if inner else [[lon - 2.0 * side, *rest] for lon, *rest in piece])
    return [one for one in pieces if len(one) > 2]


def unwrapped(ring: Sequence[Corner]) -> list[Corner]:
    """Return corners whose longitudes go on beyond half a turn, without a jump."""
    found = [list(ring[0])]
    for lon, *rest in ring[1:]:
        found.append([found[-1][0] + math.remainder(lon - found[-1][0], 360.0), *rest])
    return found


def _at(one: Corner, other: Corner, longitude: float) -> Corner:
    share = (longitude - one[0]) / (other[0] - one[0])
    return [longitude, *(a + share * (b - a) for a, b in zip(one[1:], other[1:], strict=True))]
