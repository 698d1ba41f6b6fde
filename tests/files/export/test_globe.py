"""Lines and areas that cross the antimeridian are cut there, and lose nothing."""

import math

import numpy as np
import pytest

from airrace.files.export.globe import cut_area, cut_line


def area(ring: list[list[float]]) -> float:
    x, y = np.array(ring).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize("side", [180.0, -180.0])
def test_a_line_is_cut_where_it_crosses_and_further_numbers_are_interpolated(side: float) -> None:
    inner = math.copysign(1.0, side)
    line = [[side - 2.0 * inner, 10.0, 0.0], [side - inner, 11.0, 1.0], [-side + 3.0 * inner, 15.0, 5.0]]
    assert cut_line(line) == [[*line[:2], [side, 12.0, 2.0]], [[-side, 12.0, 2.0], line[2]]]
    assert cut_line(line[:2]) == [line[:2]]


@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("begin", [0, 1, 2, 3])
def test_an_area_is_cut_into_two_of_the_same_sum_and_sense(turn: int, begin: int) -> None:
    corners = [[179.0, 0.0], [-179.5, 0.0], [-179.5, 2.0], [179.0, 2.0]][::turn]
    pieces = cut_area(corners[begin:] + corners[:begin])
    assert sorted(area(one) for one in pieces) == pytest.approx(sorted([2.0 * turn, 1.0 * turn]))
    assert all(np.ptp([lon for lon, _ in one]) <= 1.0 for one in pieces)
    plain = [[lon / 10.0, lat] for lon, lat in corners]
    assert cut_area(plain) == [plain]
