"""States between the nodes are those of the replay."""

from dataclasses import replace

import numpy as np
import pytest
from known_flights import exact, flight, node_times, problem

from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.replay import SAMPLES, function_at_points, replay, sample
from airrace.trajectory import Array

EXACT = 1e-7
STATED, FLOWN, TIME = problem(), flight(problem()), node_times(problem())


def sampled(times: Array) -> Array:
    """The flight at some times, shape (n_x, n)."""
    return sample(STATED.system, np.array(STATED.parameters), FLOWN, time=TIME, times=times)


def test_samples_at_the_nodes_are_the_nodes() -> None:
    assert np.allclose(sampled(TIME), FLOWN.state, atol=EXACT)


def test_samples_on_the_grid_of_the_replay_are_the_replay() -> None:
    seen = replay(STATED, FLOWN).state
    for interval in range(STATED.intervals):
        times = np.linspace(TIME[interval], TIME[interval + 1], SAMPLES + 1)
        assert np.allclose(sampled(times), seen[:, interval], atol=EXACT)


def test_samples_are_the_exact_flight_in_whichever_order_they_are_asked_for() -> None:
    times = np.array([1.9, 0.3, 0.3, 1.2, 0.05, TIME[-1]])
    for time, state in zip(times, sampled(times).T, strict=True):
        interval = min(int(np.searchsorted(TIME, time, side="right")) - 1, STATED.intervals - 1)
        force = float(FLOWN.control[0, interval])
        assert state == pytest.approx(exact(FLOWN.state[:, interval], force, time - TIME[interval]), abs=EXACT)


def test_rates_at_a_single_point_stay_as_they_are_when_others_are_asked_for() -> None:
    at = function_at_points(STATED.system.rates, FLOWN.control[:, :1], np.array(STATED.parameters))
    first = at(FLOWN.state[:, :1])
    kept = first.copy()
    assert not np.array_equal(at(FLOWN.state[:, 1:2]), kept)
    assert np.array_equal(first, kept)


def test_a_flight_that_cannot_be_integrated_has_no_states_there_alone() -> None:
    state = FLOWN.state.copy()
    state[:, 1] = np.nan
    within: Array = (TIME[:-1] + TIME[1:]) / 2.0
    lost = sample(STATED.system, np.array(STATED.parameters), replace(FLOWN, state=state), time=TIME, times=within)
    assert np.isnan(lost[:, 1]).all()
    others = [number for number in range(len(within)) if number != 1]
    assert np.array_equal(lost[:, others], sampled(within)[:, others])


def test_steps_become_shorter_until_samples_agree() -> None:
    """The whole flight in one interval, without a force: one step of it is far off."""
    single = Iterate(FLOWN.durations, FLOWN.state[:, [0, -1]], np.zeros((1, 1)))
    ends = np.array([0.0, 20.0])
    found = sample(STATED.system, np.array(STATED.parameters), single, time=ends, times=np.array([5.0, 20.0]))
    for time, state in zip((5.0, 20.0), found.T, strict=True):
        assert state == pytest.approx(exact(FLOWN.state[:, 0], 0.0, time), abs=EXACT)


def test_single_sample_is_that_of_many() -> None:
    many = sampled(np.linspace(0.0, TIME[-1], 17))
    alone = sampled(np.array([TIME[-1] * 5 / 16]))
    assert np.allclose(alone[:, 0], many[:, 5], atol=EXACT)
