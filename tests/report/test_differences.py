"""How far a flight is behind: not behind itself, in proportion when slowed, and by the passings' times at passings."""

from dataclasses import replace

import numpy as np
import pytest
from flown import circling, half_cuban, windy
from pages_told import circle

from airrace.documents import load_inputs
from airrace.errors import UsageError
from airrace.report.differences import behind, differences_of


def test_a_flight_is_not_behind_itself() -> None:
    _, later = behind(circle(), circle())
    np.testing.assert_allclose(later, 0.0, atol=1e-12)


def test_a_slowed_flight_is_behind_in_proportion() -> None:
    fast = circle()
    slow = replace(
        fast, time=1.25 * fast.time, crossings=tuple(replace(one, time=1.25 * one.time) for one in fast.crossings)
    )
    time, later = behind(fast, slow)
    np.testing.assert_allclose(later, 0.25 * time, atol=1e-9)


def test_at_the_passings_it_is_the_difference_of_their_times() -> None:
    first, other = half_cuban().flight(), windy().flight()
    time, later = behind(first, other)
    expected = [two.time - one.time for one, two in zip(first.crossings, other.crossings, strict=True)]
    at_passings = np.interp([one.time for one in first.crossings], time, later)
    np.testing.assert_allclose(at_passings, expected, atol=1e-9)
    legs = half_cuban().compare(windy()).legs
    np.testing.assert_allclose(at_passings[1:], [leg.cumulative for leg in legs], atol=1e-6)


def test_seen_from_the_other_flight_the_difference_at_the_finish_changes_its_sign() -> None:
    first, other = half_cuban().flight(), windy().flight()
    assert behind(first, other)[1][-1] == pytest.approx(-behind(other, first)[1][-1], abs=1e-9)


def test_between_passings_it_has_no_jumps() -> None:
    time, later = behind(half_cuban().flight(), windy().flight())
    assert np.abs(np.diff(later) / np.diff(time)).max() < 1.0


def test_a_passing_that_one_flight_missed_is_passed_over() -> None:
    whole = circle()
    missed = replace(
        whole, crossings=tuple(replace(one, time=np.nan) if i == 4 else one for i, one in enumerate(whole.crossings))
    )
    _, later = behind(whole, missed)
    np.testing.assert_allclose(later, 0.0, atol=1e-12)


def test_flights_of_other_passings_are_refused() -> None:
    other = circling(load_inputs("half_cuban_eight").race, label="elsewhere")
    with pytest.raises(UsageError, match="elsewhere has other passings than circle"):
        differences_of([circle(), other])


def test_flights_without_a_stretch_in_common_are_refused() -> None:
    whole = circle()
    lost = replace(whole, crossings=tuple(replace(one, time=np.nan) for one in whole.crossings)).labelled("lost")
    with pytest.raises(UsageError, match="fewer than two passings in common"):
        differences_of([whole, lost])
