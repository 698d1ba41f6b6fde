"""Declared scalars, ranges and typed vectors."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.optimal_control.quantities import Interval, Quantity, T, Vector, quantity, vector

finite = st.floats(-1e6, 1e6)
intervals = st.builds(lambda a, b: Interval(min(a, b), max(a, b)), finite, finite)


@vector
class Position(Vector[T]):
    """Two declared components."""

    x: T = quantity("m", scale=100.0, text="north")
    y: T = quantity("m", scale=50.0, lower=-1.0, upper=1.0, text="east")


@vector
class Motion(Position[T]):
    """A position with one component more."""

    V: T = quantity("m/s", scale=10.0)


def test_declarations_stand_beside_the_names_and_an_extension_appends_its_own() -> None:
    assert Position.quantities() == (
        Quantity("x", "m", scale=100.0, text="north"),
        Quantity("y", "m", scale=50.0, lower=-1.0, upper=1.0, text="east"),
    )
    assert Motion.names() == ("x", "y", "V")
    assert Motion.size() == 3
    assert Motion.quantities()[:2] == Position.quantities()


def test_split_undoes_join_of_numbers_histories_and_symbols() -> None:
    history = np.arange(6.0).reshape(3, 2)
    assert list(Motion.split(history).V) == [4.0, 5.0]
    assert list(Motion.split(history[:, 0]).join()) == history[:, 0].tolist()
    column = ca.SX.sym("m", 3)
    assert ca.is_equal(ca.vertcat(*Motion.split(column).join()), column, 1)


def test_vectors_are_frozen_and_made_by_keyword_only() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Position(x=1.0, y=2.0).x = 3.0  # type: ignore[misc]  # the point of the test
    with pytest.raises(TypeError):
        Position(1.0, 2.0)  # type: ignore[misc]  # the point of the test


@given(intervals, intervals, finite)
def test_intersection_holds_what_both_hold(a: Interval, b: Interval, value: float) -> None:
    both = a.intersect(b)
    assert (both.lower <= value <= both.upper) == (a.lower <= value <= a.upper and b.lower <= value <= b.upper)
    assert a.intersect(Interval()) == a


def test_ranges_may_be_empty_or_unbounded() -> None:
    assert Interval(0.0, 1.0).intersect(Interval(2.0, 3.0)).empty
    assert not Interval.exactly(2.0).empty
    assert Interval(upper=1.0).constrained
    assert Interval(lower=0.0).constrained
    assert not Interval().constrained
    assert Interval().lower == -math.inf
