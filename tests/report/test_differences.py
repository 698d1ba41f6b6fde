"""How far a flight is behind on the first one's clock: the comparison's differences, at the times of the first."""

from dataclasses import replace

import numpy as np
import pytest
from example_flights import circling, half_cuban, windy
from report_pages import circle

from airrace.errors import UsageError
from airrace.inputs import load_inputs
from airrace.report.contents import TimeDifference
from airrace.report.flight_contents import difference_of
from airrace.report.flight_page import flight_page
from airrace.results import Flight
from airrace.results.comparison import compare_flights


def behind(first: Flight, other: Flight) -> TimeDifference:
    return difference_of(compare_flights(first, other), 1)


def test_a_flight_is_not_behind_itself() -> None:
    np.testing.assert_allclose(behind(circle(), circle()).difference, 0.0, atol=1e-12)


def test_a_slowed_flight_is_behind_in_proportion_to_the_time() -> None:
    fast = circle()
    slow = replace(
        fast, time=1.25 * fast.time, crossings=tuple(replace(one, time=1.25 * one.time) for one in fast.crossings)
    )
    told = behind(fast, slow)
    np.testing.assert_allclose(told.difference, 0.25 * told.time, atol=1e-9)


def test_at_the_passings_it_is_the_difference_of_their_times() -> None:
    first, other = half_cuban().flight(), windy().flight()
    told = behind(first, other)
    expected = [two.time - one.time for one, two in zip(first.crossings, other.crossings, strict=True)]
    at_passings = np.interp([one.time for one in first.crossings], told.time, told.difference)
    np.testing.assert_allclose(at_passings, expected, atol=1e-9)


def test_its_times_are_those_of_the_first_flight_and_rise() -> None:
    first = half_cuban().flight()
    told = behind(first, windy().flight())
    assert (told.time[0], told.time[-1]) == pytest.approx((0.0, first.race_time))
    assert np.all(np.diff(told.time) > 0.0)


def test_legs_that_one_flight_lacks_are_unknown_and_the_others_are_not() -> None:
    whole = circle()
    crossings = [replace(one, time=np.nan) if i == 4 else one for i, one in enumerate(whole.crossings)]
    missed = replace(whole, crossings=tuple(crossings))
    seen, lacking = behind(whole, missed), behind(missed, whole)
    before, after = whole.crossings[3].time, whole.crossings[5].time
    inside = (seen.time > before + 1e-9) & (seen.time <= after + 1e-9)
    assert np.array_equal(np.isnan(seen.difference), inside)
    assert np.isfinite(lacking.difference).all()


def test_flights_of_other_passings_are_refused() -> None:
    other = circling(load_inputs("half_cuban_eight").race, label="elsewhere")
    with pytest.raises(UsageError, match="elsewhere and circle cannot be compared"):
        flight_page([circle(), other])
