"""Dubins paths arrive where they should, and no shorter path exists among simple alternatives."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from airrace.model.track.dubins import WORDS, DubinsPath, lengths, on_side, shortest

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


side = st.sampled_from([1, -1])


def to_side(north: float, east: float, a: float, b: float, chosen: int = 0) -> DubinsPath:
    return shortest(np.zeros(2), a, np.array([north, east]), b, 100.0, chosen)


@given(coordinate, coordinate, angle, angle, side)
def test_path_to_one_side_turns_to_it_on_the_whole_and_arrives(
    north: float, east: float, a: float, b: float, chosen: int
) -> None:
    assume(abs(to_side(north, east, a, b).turn) > 1e-6)  # a straight is to no side
    path = to_side(north, east, a, b, chosen)
    assert chosen * path.turn > 0.0
    n, e, heading = (float(values[0]) for values in path.points(np.array([path.length])))
    assert math.hypot(n - north, e - east) < 1e-3
    assert abs(math.remainder(heading - b, 2 * math.pi)) < 1e-5


@given(coordinate, coordinate, angle, angle)
def test_better_of_both_sides_is_the_shortest_path_and_neither_is_shorter(
    north: float, east: float, a: float, b: float
) -> None:
    free = to_side(north, east, a, b)
    assume(abs(free.turn) > 1e-6)  # a straight is to no side
    left, right = to_side(north, east, a, b, -1), to_side(north, east, a, b, 1)
    assert min(left.length, right.length) == pytest.approx(free.length, rel=1e-12)


@given(coordinate, coordinate, angle, angle, side)
def test_mirrored_path_to_the_other_side_has_the_same_length(
    north: float, east: float, a: float, b: float, chosen: int
) -> None:
    assume(math.hypot(north, east) > 1.0)  # closer, whether a turn is none or a full circle is a matter of rounding
    path = to_side(north, east, a, b, chosen)
    assume(abs(path.turn) > 1e-6)
    assert to_side(north, -east, -a, -b, -chosen).length == pytest.approx(path.length, rel=1e-6, abs=1e-3)


@given(coordinate, coordinate, st.lists(angle, min_size=1, max_size=4), st.lists(angle, min_size=1, max_size=3), side)
def test_lengths_of_many_paths_at_once_are_those_of_each(
    north: float, east: float, first: list[float], last: list[float], chosen: int
) -> None:
    start, end = np.zeros(2), np.array([north, east])
    pieces = lengths(start, np.array(first)[:, None], end, np.array(last)[None, :], 100.0)
    for either in (chosen, 0):
        found = on_side(pieces, either)
        assume(np.isfinite(found.min(axis=0)).all())  # where the only path is straight there is none to a side
        assert found.shape == (6, len(first), len(last))
        for row, a in enumerate(first):
            for column, b in enumerate(last):
                one = 100.0 * found[:, row, column].min()
                assert one == pytest.approx(to_side(north, east, a, b, either).length, rel=1e-9)


@given(coordinate, coordinate, angle, angle)
def test_what_a_path_turns_is_the_sum_of_what_its_parts_turn(north: float, east: float, a: float, b: float) -> None:
    path = to_side(north, east, a, b)
    assert path.turning >= abs(path.turn) - 1e-9
    assert math.isclose(math.remainder(path.turn - (b - a), 2 * math.pi), 0.0, abs_tol=1e-5)
    middle = 0.4 * path.length
    parts = path.part(0.0, middle).turning + path.part(middle, path.length).turning
    assert parts == pytest.approx(path.turning, abs=1e-9)


def test_turning_counts_turns_to_both_sides_and_no_straights() -> None:
    path = DubinsPath(0.0, 0.0, 0.0, (100.0, 50.0, 30.0), (0.01, 0.0, -0.01))
    assert path.turning == pytest.approx(1.3)
    assert path.turn == pytest.approx(0.7)


@pytest.mark.parametrize("side", [-1, 0, 1])
def test_a_path_of_a_least_length_is_the_shortest_that_is_as_long(side: int) -> None:
    end, heading = np.array([300.0, 20.0]), 0.2
    pieces = lengths(np.zeros(2), np.asarray(0.0), end, np.asarray(heading), 100.0)
    known = sorted(float(one) for one in on_side(pieces, side) * 100.0 if np.isfinite(one))
    assert len(known) > 1
    found = shortest(np.zeros(2), 0.0, end, heading, 100.0, side, length_min=0.5 * (known[0] + known[1]))
    assert found.length == pytest.approx(known[1])
    north, east, chi = (float(values[0]) for values in found.points(np.array([found.length])))
    assert (north, east, math.cos(chi - heading)) == pytest.approx((*end.tolist(), 1.0), abs=1e-6)
    farther = shortest(np.zeros(2), 0.0, end, heading, 100.0, side, length_min=1e6)  # there is none
    assert farther.length == pytest.approx(known[0])
