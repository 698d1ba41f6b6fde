"""A finer or coarser mesh carries the same flight."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from known_flights import exact, flight, node_times, problem

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import divide, inherited_nodes, restrict, widen
from airrace.optimal_control.replay import interval_durations, replay

STATED, FLOWN = problem(), flight(problem())
REPLAYED = replay(STATED, FLOWN)
counts = arrays(np.int64, (STATED.intervals,), elements=st.integers(1, 6))


def divided(parts: np.ndarray) -> tuple[Problem, Iterate]:
    (first, second), iterate = divide(STATED.mesh, FLOWN, REPLAYED, parts)
    return problem(first, second), iterate


def restricted(stated: Problem, iterate: Iterate, kept: np.ndarray) -> tuple[Problem, Iterate]:
    (first, second), coarser = restrict(stated.mesh, iterate, kept)
    return problem(first, second), coarser


@given(arrays(np.bool_, (STATED.intervals,)))
def test_halved_flight_still_flies(split: np.ndarray) -> None:
    finer, iterate = divided(np.where(split, 2, 1))
    assert np.abs(replay(finer, iterate).defect).max() < 1e-8


@given(counts)
def test_every_interval_becomes_so_many_equal_parts(parts: np.ndarray) -> None:
    finer, iterate = divided(parts)
    before, after = interval_durations(STATED, FLOWN.durations), interval_durations(finer, iterate.durations)
    expected = [[step / count] * count for step, count in zip(before, parts, strict=True)]
    assert after == pytest.approx(np.concatenate(expected), rel=1e-12)
    for phase in finer.phases:
        assert sum(phase.fractions) == pytest.approx(1.0)


@given(counts)
def test_old_nodes_durations_and_controls_are_kept(parts: np.ndarray) -> None:
    finer, iterate = divided(parts)
    kept = inherited_nodes(parts)
    assert node_times(finer)[kept] == pytest.approx(node_times(STATED))
    assert (iterate.state[:, kept] == FLOWN.state).all()
    assert (iterate.durations == FLOWN.durations).all()
    assert (iterate.control == np.repeat(FLOWN.control, parts, axis=1)).all()


@pytest.mark.parametrize("count", [2, 5])
def test_new_nodes_lie_on_the_flight(count: int) -> None:
    """Where they are samples of the replay; between samples they lie on its chords."""
    parts = np.ones(STATED.intervals, dtype=np.int64)
    parts[3] = count
    _, iterate = divided(parts)
    step = float(interval_durations(STATED, FLOWN.durations)[3])
    times = step * np.arange(1, count) / count
    assert iterate.state[:, 4 : 3 + count] == pytest.approx(
        exact(FLOWN.state[:, 3], float(FLOWN.control[0, 3]), times), abs=1e-8
    )


def test_nodes_between_samples_are_near_the_flight() -> None:
    parts = np.ones(STATED.intervals, dtype=np.int64)
    parts[3] = 3
    _, iterate = divided(parts)
    step = float(interval_durations(STATED, FLOWN.durations)[3])
    expected = exact(FLOWN.state[:, 3], float(FLOWN.control[0, 3]), step * np.array([1 / 3, 2 / 3]))
    assert iterate.state[:, 4:6] == pytest.approx(expected, abs=5e-3)


@given(counts)
def test_dropping_the_new_nodes_leads_back(parts: np.ndarray) -> None:
    again, iterate = restricted(*divided(parts), inherited_nodes(parts))
    for phase, before in zip(again.phases, STATED.phases, strict=True):
        assert phase.fractions == pytest.approx(before.fractions, rel=1e-12)
    assert (iterate.state == FLOWN.state).all()
    assert iterate.control == pytest.approx(FLOWN.control, rel=1e-12)


@given(arrays(np.bool_, (STATED.intervals + 1,)))
def test_dropped_nodes_leave_what_the_controls_add_up_to(kept: np.ndarray) -> None:
    kept[STATED.first_node] = True
    coarser, iterate = restricted(STATED, FLOWN, kept)
    added = [
        (interval_durations(of, flown.durations) * flown.control).sum()
        for of, flown in ((STATED, FLOWN), (coarser, iterate))
    ]
    assert added[0] == pytest.approx(added[1])
    assert coarser.intervals == kept.sum() - 1
    assert node_times(coarser) == pytest.approx(node_times(STATED)[kept])


def test_node_between_phases_cannot_be_dropped() -> None:
    kept = np.ones(STATED.intervals + 1, dtype=np.bool_)
    kept[STATED.first_node[1]] = False
    with pytest.raises(ValueError, match="between phases"):
        restrict(STATED.mesh, FLOWN, kept)


def test_neighbours_are_those_beside() -> None:
    marked = np.array([False, False, True, False, False, False, True])
    assert widen(marked).tolist() == [False, True, True, True, False, True, True]
