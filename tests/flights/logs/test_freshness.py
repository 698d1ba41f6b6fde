"""Numbers that are held or written in steps, and times that run back, are told from those that are not."""

import numpy as np
import pytest

from airrace.flights.logs.clocks import spread_repeated, true_times, unwrap_days
from airrace.flights.logs.recording import repeats, resolution, rounding

RANDOM = np.random.default_rng(5)
WAY = np.cumsum(RANDOM.normal(3.0, 1.0, 2000))
TIME = 0.05 * np.arange(2000)


@pytest.mark.parametrize("step", [1.0, 0.1, 0.3048, 0.25])
@pytest.mark.parametrize("offset", [0.0, 12.345])
def test_the_step_of_numbers_is_found_whatever_they_count_from(step: float, offset: float) -> None:
    values = step * np.round(WAY / step) + offset
    assert resolution(values) == pytest.approx(step, rel=1e-6)
    assert rounding(values) == pytest.approx(step / np.sqrt(12.0), rel=1e-6)
    assert float(np.std(values - offset - WAY)) == pytest.approx(rounding(values), rel=0.1)


def test_numbers_that_are_written_in_full_have_no_step() -> None:
    assert resolution(WAY) == 0.0
    assert resolution(np.array([1.0, np.nan])) == 0.0


@pytest.mark.parametrize("every", [2, 3, 7])
def test_what_repeats_a_measurement_is_held(every: int) -> None:
    fresh = np.arange(2000) % every == 0
    assert repeats(WAY[None, np.arange(2000) // every * every], TIME).tolist() == (~fresh).tolist()


def test_what_is_written_coarsely_is_not_held() -> None:
    assert not repeats(np.round(0.1 * WAY)[None], TIME).any()
    assert not repeats(WAY[None], TIME).any()


@pytest.mark.parametrize(("rows", "shift"), [((700,), -3.0), ((700,), 9e4), ((0,), 50.0), ((300, 301, 900), 4e3)])
def test_single_times_that_cannot_be_true_are_found(rows: tuple[int, ...], shift: float) -> None:
    time = TIME.copy()
    time[list(rows)] += shift
    kept, remarks = true_times("a.csv", time, np.arange(2000) + 2)
    assert np.flatnonzero(~kept).tolist() == list(rows)
    assert len(remarks) == 1
    assert true_times("a.csv", TIME, np.arange(2000)) == (pytest.approx(np.ones(2000, bool)), ())


def test_a_clock_that_is_set_back_leaves_the_longer_part() -> None:
    kept, _ = true_times("a.csv", np.where(TIME < 70.0, TIME, TIME - 5.0), np.arange(2000))
    assert kept.tolist() == (TIME < 70.0).tolist()


def test_midnight_is_where_the_clock_goes_on_behind_it() -> None:
    time = 86_390.0 + TIME
    clock = np.remainder(time, 86_400.0)
    assert np.diff(unwrap_days(clock)) == pytest.approx(0.05)
    clock[500] -= 43_300.0
    assert np.diff(np.delete(unwrap_days(clock), 500)) == pytest.approx(np.diff(np.delete(time, 500)))


@pytest.mark.parametrize("first", [1, 3, 5])
def test_samples_of_a_second_are_spread_over_it(first: int) -> None:
    time = np.arange(5 - first, 400) / 5.0
    spread, remarks = spread_repeated(np.floor(time))
    assert spread == pytest.approx(time)
    assert remarks == ("5 samples share each time: they are spread evenly over it",)
    assert spread_repeated(TIME) == (pytest.approx(TIME), ())
