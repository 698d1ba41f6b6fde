"""The check of sustained loads: durations between samples, both signs, gaps."""

import numpy as np
import pytest

from airrace.flights.results.flight_facts import TOLERATED_LOADS, longest_stretch, sustained

TIME = np.linspace(0.0, 100.0, 1001)


@pytest.mark.parametrize(("level", "tolerated"), TOLERATED_LOADS)
def test_a_load_counts_only_when_it_lasts_longer_than_is_tolerated(level: float, tolerated: float) -> None:
    for spare, expected in ((-0.5, ()), (0.5, (level,))):
        n_z = np.where(tolerated + spare >= TIME, level, 1.0)
        assert tuple(one.n_z for one in sustained(TIME, n_z)) == expected


def test_more_load_counts_for_less_as_well_and_the_sentence_says_all() -> None:
    n_z = np.where((TIME > 10.0) & (TIME < 85.0), 8.5, 1.0)
    found = sustained(TIME, n_z)
    assert [one.n_z for one in found] == [8.0, 6.0, 5.0, 4.0]
    assert found[0].text == (
        "8 g or more for 74.8 s from 10.09 s on; experienced pilots tolerate that for 15 s (FAA-AM-72-28)"
    )
    assert "-3 g or less" in sustained(TIME, -n_z)[0].text


def test_the_level_is_crossed_between_samples_and_a_gap_ends_a_stretch() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    assert longest_stretch(time, np.array([0.0, 4.0, 4.0, 0.0, 0.0]), 1.0) == pytest.approx((0.25, 2.5))
    assert longest_stretch(time, np.array([4.0, 4.0, np.nan, 4.0, 4.0]), 1.0) == pytest.approx((0.0, 1.0))
    assert longest_stretch(time, np.zeros(5), 1.0)[1] == 0.0


@pytest.mark.parametrize("shift", [0.0, 3.7])
def test_the_clock_does_not_matter(shift: float) -> None:
    n_z = 4.0 + 3.0 * np.sin(TIME / 30.0)
    before, after = sustained(TIME, n_z), sustained(TIME + shift, n_z)
    assert [one.n_z for one in before] == [one.n_z for one in after] == [6.0, 5.0, 4.0]
    assert [one.duration for one in before] == pytest.approx([one.duration for one in after])
