"""Flights on finer, coarser and other meshes."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from known_flights import FREQUENCY, exact, flight, node_times, problem
from scipy.linalg import expm

from airrace.optimal_control.mesh_refinement import divide, inherited_nodes, move_nodes, resample, restrict, widen
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import estimate_defect, estimate_error, interval_durations, replay
from airrace.optimal_control.runge_kutta import RK4

STATED, FLOWN = problem(), flight(problem())
OWN = [len(phase.fractions) for phase in STATED.phases]
counts = st.tuples(st.integers(1, 12), st.integers(1, 12))


def edges(mesh: list[tuple[float, ...]]) -> list[int]:
    return [0, *itertools.accumulate(len(phase) for phase in mesh)]


def test_phases_that_have_their_counts_already_are_left_alone() -> None:
    mesh, iterate = resample(STATED.mesh, FLOWN, OWN)
    assert mesh == STATED.mesh
    for name in ("durations", "state", "control"):
        np.testing.assert_array_equal(getattr(iterate, name), getattr(FLOWN, name))


@given(counts)
def test_phases_have_their_counts_and_keep_their_ends_and_what_the_controls_add_up_to(chosen: tuple[int, int]) -> None:
    mesh, iterate = resample(STATED.mesh, FLOWN, chosen)
    for phase, own, count in zip(mesh, STATED.mesh, chosen, strict=True):
        assert phase == own if len(own) == count else phase == pytest.approx((1.0 / count,) * count)
        assert sum(phase) == pytest.approx(1.0)
    assert iterate.state.shape[1] == iterate.control.shape[1] + 1 == sum(chosen) + 1
    assert iterate.state[:, edges(mesh)] == pytest.approx(FLOWN.state[:, edges(STATED.mesh)], abs=1e-12)
    np.testing.assert_array_equal(iterate.durations, FLOWN.durations)
    for after, before, new, old in zip(
        itertools.pairwise(edges(mesh)), itertools.pairwise(edges(STATED.mesh)), mesh, STATED.mesh, strict=True
    ):
        added = iterate.control[:, slice(*after)] @ np.array(new)
        assert added == pytest.approx(FLOWN.control[:, slice(*before)] @ np.array(old), abs=1e-12)
    assert iterate.control.min() >= FLOWN.control.min() - 1e-12
    assert iterate.control.max() <= FLOWN.control.max() + 1e-12


def test_finer_meshes_of_a_smooth_flight_come_near_to_it_and_coarser_ones_lead_back() -> None:
    """A force held all the way: the states between the nodes are on its chords."""
    stated = problem((0.05,) * 20, (0.05,) * 20)
    before, times = np.array([0.4, 1.1]), node_times(stated)
    whole = flight(stated)
    smooth = type(whole)(whole.durations, exact(before, 2.0, times), np.full((1, 40), 2.0))
    mesh, finer = resample(stated.mesh, smooth, (60, 60))
    again, back = resample(mesh, finer, (20, 20))
    assert back.control == pytest.approx(smooth.control)
    assert back.state == pytest.approx(smooth.state, abs=1e-9)
    fine = problem(*mesh)
    assert finer.state == pytest.approx(exact(before, 2.0, node_times(fine)), abs=5e-3)
    assert [len(phase) for phase in again] == [20, 20]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_estimated_defect_is_nearly_that_of_the_independent_integrator(count: int) -> None:
    mesh, iterate = resample(STATED.mesh, FLOWN, (count, count))
    stated = problem(*mesh)
    measured, estimated = replay(stated, iterate).defect, estimate_defect(stated, iterate)
    assert estimated.shape == measured.shape == (2, len(interval_durations(stated, iterate.durations)))
    assert np.abs(measured).max() > 0.01  # there is something to be estimated
    assert np.abs(estimated - measured).max() < 0.01 * np.abs(measured).max()


def test_exact_flight_has_no_estimated_defect() -> None:
    assert np.abs(estimate_defect(STATED, FLOWN)).max() < 1e-3 * np.abs(FLOWN.state).max()


def test_nodes_that_do_not_join_are_no_error_of_the_integrator() -> None:
    """Held at rest by its force in every interval, at another place in each: nothing moves, and nothing joins."""
    places = np.random.default_rng(1).uniform(-1.0, 1.0, 41)
    force = FREQUENCY**2 * places[None, :-1]
    at_rest = type(FLOWN)(FLOWN.durations, np.stack([places, 0.0 * places]), force)
    stated = problem((0.05,) * 20, (0.05,) * 20)
    assert np.abs(estimate_error(stated, at_rest)).max() < 1e-12
    assert np.abs(estimate_defect(stated, at_rest)).max() > 0.1


@pytest.mark.parametrize("count", [2, 3, 5])
def test_error_of_the_integrator_is_what_its_series_leaves_out(count: int) -> None:
    """About rest under its force an oscillator turns by the duration of an interval; RK4 has four terms of that."""
    mesh, iterate = resample(STATED.mesh, FLOWN, (count, count))
    stated = dataclasses.replace(problem(*mesh), scheme=RK4)
    k, ends = FREQUENCY**2, []
    steps = interval_durations(stated, iterate.durations)
    for x, u, step in zip(iterate.state.T, iterate.control[0], steps, strict=False):
        turned = step * np.array([[0.0, 1.0], [-k, 0.0]])
        series = sum(np.linalg.matrix_power(turned, n) / math.factorial(n) for n in range(5))
        ends.append((expm(turned) - series) @ (x - [u / k, 0.0]))
    missed = np.stack(ends, axis=1) / np.array([[one.scale] for one in stated.system.states])
    assert np.abs(missed).max() > 1e-5
    assert np.abs(estimate_error(stated, iterate) - missed).max() < 0.01 * np.abs(missed).max()


shares = st.lists(st.floats(0.0, 1.0), max_size=3)


@given(
    shares, shares, st.lists(st.booleans(), min_size=STATED.intervals - 1, max_size=STATED.intervals - 1), st.booleans()
)
def test_moved_nodes_are_as_many_in_the_same_order_and_phases_keep_their_ends(
    first: list[float], second: list[float], marks: list[bool], beside_ends: bool
) -> None:
    nodes = np.array([True, *marks, True])
    nodes[edges(STATED.mesh)] = True
    mesh, iterate = move_nodes(STATED.mesh, FLOWN, nodes, (first, second), beside_ends=beside_ends)
    assert edges(mesh) == edges(STATED.mesh)
    for phase in mesh:
        assert sum(phase) == pytest.approx(1.0)
        assert min(phase) > 0.0
    np.testing.assert_array_equal(iterate.state[:, edges(mesh)], FLOWN.state[:, edges(mesh)])
    np.testing.assert_array_equal(iterate.control, FLOWN.control)


def test_the_nearest_node_is_moved_to_where_it_is_wanted_and_what_lies_between_moves_along() -> None:
    stated = problem((0.25,) * 4, (0.5, 0.5))
    nodes = np.array([True, False, True, False, True, True, True])
    mesh, iterate = move_nodes(stated.mesh, flight(stated), nodes, ([0.45], []))
    assert np.cumsum(mesh[0]) == pytest.approx([0.225, 0.45, 0.725, 1.0])
    assert mesh[1] == stated.mesh[1]
    places = np.concatenate([[0.0], np.cumsum(mesh[0])])
    known = np.linspace(0.0, 1.0, 5)
    for row, before in zip(iterate.state, flight(stated).state, strict=True):
        assert row[:5] == pytest.approx(np.interp(places, known, before[:5]))


def test_a_place_beside_an_end_takes_the_end_or_the_node_beside_it() -> None:
    stated = problem((0.25,) * 4, (0.5, 0.5))
    nodes = np.ones(stated.intervals + 1, dtype=np.bool_)
    stays, _ = move_nodes(stated.mesh, flight(stated), nodes, ([0.1], []))
    moves, _ = move_nodes(stated.mesh, flight(stated), nodes, ([0.1], []), beside_ends=True)
    assert np.cumsum(stays[0]) == pytest.approx([0.25, 0.5, 0.75, 1.0])
    assert np.cumsum(moves[0]) == pytest.approx([0.1, 0.5, 0.75, 1.0])


REPLAYED = replay(STATED, FLOWN)
part_counts = arrays(np.int64, (STATED.intervals,), elements=st.integers(1, 6))


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


@given(part_counts)
def test_every_interval_becomes_so_many_equal_parts_and_dropping_the_new_nodes_leads_back(parts: np.ndarray) -> None:
    finer, iterate = divided(parts)
    before, after = interval_durations(STATED, FLOWN.durations), interval_durations(finer, iterate.durations)
    expected = [[step / count] * count for step, count in zip(before, parts, strict=True)]
    assert after == pytest.approx(np.concatenate(expected), rel=1e-12)
    for phase in finer.phases:
        assert sum(phase.fractions) == pytest.approx(1.0)
    old = inherited_nodes(parts)
    assert node_times(finer)[old] == pytest.approx(node_times(STATED))
    assert (iterate.state[:, old] == FLOWN.state).all()
    assert (iterate.durations == FLOWN.durations).all()
    assert (iterate.control == np.repeat(FLOWN.control, parts, axis=1)).all()
    again, back = restricted(finer, iterate, old)
    for phase, own in zip(again.phases, STATED.phases, strict=True):
        assert phase.fractions == pytest.approx(own.fractions, rel=1e-12)
    assert (back.state == FLOWN.state).all()
    assert back.control == pytest.approx(FLOWN.control, rel=1e-12)


@pytest.mark.parametrize(("count", "tolerance"), [(2, 1e-8), (5, 1e-8), (3, 5e-3)])
def test_new_nodes_lie_on_the_flight(count: int, tolerance: float) -> None:
    """Where they are samples of the replay; between samples they lie on its chords."""
    parts = np.ones(STATED.intervals, dtype=np.int64)
    parts[3] = count
    _, iterate = divided(parts)
    times = float(interval_durations(STATED, FLOWN.durations)[3]) * np.arange(1, count) / count
    expected = exact(FLOWN.state[:, 3], float(FLOWN.control[0, 3]), times)
    assert iterate.state[:, 4 : 3 + count] == pytest.approx(expected, abs=tolerance)


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
