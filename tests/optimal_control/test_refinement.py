"""A refined mesh carries the same flight."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from known_flights import exact, flight, node_times, problem

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import bisect
from airrace.optimal_control.replay import interval_durations, replay

STATED, FLOWN = problem(), flight(problem())
REPLAYED = replay(STATED, FLOWN)
choices = arrays(np.bool_, (STATED.intervals,))


def refined(coarse: np.ndarray) -> tuple[Problem, Iterate]:
    fractions, iterate = bisect(STATED, FLOWN, REPLAYED, coarse)
    first, second = fractions
    return problem(first, second), iterate


@given(choices)
def test_refined_flight_still_flies(coarse: np.ndarray) -> None:
    finer, iterate = refined(coarse)
    assert np.abs(replay(finer, iterate).defect).max() < 1e-8


@given(choices)
def test_every_marked_interval_becomes_two_halves_and_no_other(coarse: np.ndarray) -> None:
    finer, iterate = refined(coarse)
    before, after = interval_durations(STATED, FLOWN.durations), interval_durations(finer, iterate.durations)
    halves = [[step / 2, step / 2] if split else [step] for step, split in zip(before, coarse, strict=True)]
    assert after == pytest.approx(np.concatenate(halves), rel=1e-12)
    for phase in finer.phases:
        assert sum(phase.fractions) == pytest.approx(1.0)


@given(choices)
def test_old_nodes_durations_and_controls_are_kept(coarse: np.ndarray) -> None:
    finer, iterate = refined(coarse)
    times, kept = node_times(finer), node_times(STATED)
    place = [int(np.abs(times - time).argmin()) for time in kept]
    assert times[place] == pytest.approx(kept)
    assert (iterate.state[:, place] == FLOWN.state).all()
    assert (iterate.durations == FLOWN.durations).all()
    assert (iterate.control[:, place[:-1]] == FLOWN.control).all()


def test_new_node_lies_where_the_flight_is_half_way() -> None:
    coarse = np.zeros(STATED.intervals, dtype=bool)
    coarse[3] = True
    _, iterate = refined(coarse)
    half = 0.5 * float(interval_durations(STATED, FLOWN.durations)[3])
    assert iterate.state[:, 4] == pytest.approx(exact(FLOWN.state[:, 3], float(FLOWN.control[0, 3]), half), abs=1e-8)
    assert iterate.control[0, 3] == iterate.control[0, 4] == FLOWN.control[0, 3]


@given(st.just(np.zeros(STATED.intervals, dtype=bool)))
def test_without_marks_nothing_changes(coarse: np.ndarray) -> None:
    fractions, iterate = bisect(STATED, FLOWN, REPLAYED, coarse)
    assert fractions == [phase.fractions for phase in STATED.phases]
    assert (iterate.state == FLOWN.state).all()
