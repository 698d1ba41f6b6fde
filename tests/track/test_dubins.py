"""Dubins paths arrive where they should, and no shorter path exists among simple alternatives."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from airrace.track.dubins import WORDS, DubinsPath, lengths, shortest

coordinate = st.floats(-1000, 1000)
angle = st.floats(-math.pi, math.pi)


@given(coordinate, coordinate, angle, angle, st.floats(50, 200))
def test_every_kind_of_path_arrives_at_its_end(north: float, east: float, a: float, b: float, radius: float) -> None:
    end = np.array([north, east])
    pieces = lengths(np.zeros(2), np.asarray(a), end, np.asarray(b), radius)
    found = 0
    for signs, piece in zip(WORDS, pieces, strict=True):
        if not np.isfinite(piece).all():
            continue
        found += 1
        path = DubinsPath(0.0, 0.0, a, tuple(piece * radius), tuple(sign / radius for sign in signs))
        n, e, heading = (values[0] for values in path.points(np.array([path.length])))
        assert math.hypot(n - north, e - east) < 1e-3
        assert abs(math.remainder(heading - b, 2 * math.pi)) < 1e-5
    assert found >= 2  # turns to the same side always exist


def test_a_straight_is_a_straight() -> None:
    path = shortest(np.zeros(2), 0.3, 500 * np.array([math.cos(0.3), math.sin(0.3)]), 0.3, 100.0)
    assert path.length == pytest.approx(500.0)


def test_turning_back_on_the_spot_takes_the_three_turn_path() -> None:
    path = shortest(np.zeros(2), 0.0, np.zeros(2), math.pi, 100.0)
    assert path.length == pytest.approx(100.0 * (math.pi + 4 * math.pi / 3 - 0.0), rel=0.2)
    assert path.curvatures[0] == -path.curvatures[1] == path.curvatures[2]


@given(coordinate, coordinate, angle, angle)
def test_the_mirrored_path_has_the_same_length(north: float, east: float, a: float, b: float) -> None:
    assume(math.hypot(north, east) > 1.0)  # closer, whether a turn is none or a full circle is a matter of rounding
    path = shortest(np.zeros(2), a, np.array([north, east]), b, 100.0)
    mirrored = shortest(np.zeros(2), -a, np.array([north, -east]), -b, 100.0)
    assert mirrored.length == pytest.approx(path.length, rel=1e-6, abs=1e-3)


@given(coordinate, coordinate, angle, angle)
def test_the_reversed_path_has_the_same_length(north: float, east: float, a: float, b: float) -> None:
    assume(math.hypot(north, east) > 1.0)  # closer, whether a turn is none or a full circle is a matter of rounding
    path = shortest(np.zeros(2), a, np.array([north, east]), b, 100.0)
    back = shortest(np.array([north, east]), b + math.pi, np.zeros(2), a + math.pi, 100.0)
    assert back.length == pytest.approx(path.length, rel=1e-6, abs=1e-3)
