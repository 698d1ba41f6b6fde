"""States between the nodes are those of the replay."""

import numpy as np
import pytest
from known_flights import exact, flight, node_times, problem

from airrace.optimal_control.replay import SAMPLES, replay
from airrace.optimal_control.sampling import sample
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


def test_single_sample_is_that_of_many() -> None:
    many = sampled(np.linspace(0.0, TIME[-1], 17))
    alone = sampled(np.array([TIME[-1] * 5 / 16]))
    assert np.allclose(alone[:, 0], many[:, 5], atol=EXACT)
