"""An exact flight replays onto itself; whatever was tampered with is found where it was."""

from dataclasses import replace

import known_flights
import numpy as np
import pytest
from known_flights import SYSTEM, exact, flight, problem

from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.replay import SAMPLES, interval_durations, replay, replay_phases

EXACT = 1e-8
SCALES = np.array([quantity.scale for quantity in SYSTEM.states])


def test_interval_durations_are_the_shares_of_each_phase() -> None:
    assert interval_durations(problem(), np.array([2.0, 5.0])) == pytest.approx([0.4, 1.0, 0.6, 3.0, 2.0])


def test_exact_flight_has_no_defect() -> None:
    assert np.abs(replay(problem(), flight(problem())).defect).max() < EXACT


def test_history_between_nodes_is_the_exact_one() -> None:
    stated, flown = problem(), flight(problem())
    steps = interval_durations(stated, flown.durations)
    state = replay(stated, flown).state
    assert state.shape == (2, stated.intervals, SAMPLES + 1)
    for interval, step in enumerate(steps):
        force = float(flown.control[0, interval])
        expected = exact(flown.state[:, interval], force, np.linspace(0.0, step, SAMPLES + 1))
        assert np.allclose(state[:, interval], expected, atol=EXACT)


def test_path_quantities_are_those_of_the_history() -> None:
    flown = flight(problem())
    seen = replay(problem(), flown)
    assert np.allclose(seen.path[0], seen.state[0])
    assert np.allclose(seen.path[1], seen.state[1] * flown.control[0][:, None])


@pytest.mark.parametrize("interval", range(problem().intervals))
def test_tampered_control_shows_as_the_defect_it_makes(interval: int) -> None:
    stated, flown = problem(), flight(problem())
    control = flown.control.copy()
    control[0, interval] += 0.05
    defect = replay(stated, replace(flown, control=control)).defect
    step = float(interval_durations(stated, flown.durations)[interval])
    after = exact(flown.state[:, interval], float(control[0, interval]), step)
    assert np.allclose(defect[:, interval], (after - flown.state[:, interval + 1]) / SCALES, atol=EXACT)
    assert np.abs(defect[:, interval]).max() > 1e-4
    assert np.abs(np.delete(defect, interval, axis=1)).max() < EXACT


@pytest.mark.parametrize("node", range(1, problem().intervals))
def test_tampered_state_shows_on_both_sides_of_its_node(node: int) -> None:
    stated, flown = problem(), flight(problem())
    state = flown.state.copy()
    state[0, node] += 0.02
    defect = replay(stated, replace(flown, state=state)).defect
    assert defect[0, node - 1] == pytest.approx(-0.02 / SCALES[0], abs=EXACT)
    assert np.abs(defect[:, node]).max() > 1e-4
    assert np.abs(np.delete(defect, [node - 1, node], axis=1)).max() < EXACT


def test_tampered_duration_shows_in_all_intervals_of_its_phase() -> None:
    stated, flown = problem(), flight(problem())
    defect = np.abs(replay(stated, replace(flown, durations=flown.durations * [1.0, 1.01])).defect).max(axis=0)
    assert (defect[3:] > 1e-4).all()
    assert (defect[:3] < EXACT).all()


def test_defect_of_one_interval_does_not_depend_on_the_others() -> None:
    """All intervals are integrated in one go; a single one must come out the same."""
    stated, flown = problem(), flight(problem())
    alone = known_flights.problem(first=(1.0,), second=(1.0,))
    steps = interval_durations(stated, flown.durations)
    for interval in (0, 3):
        nodes = [interval, interval + 1, interval + 1]
        piece = Iterate(np.array([steps[interval], 0.5]), flown.state[:, nodes], flown.control[:, [interval, interval]])
        assert np.allclose(
            replay(alone, piece).state[:, 0], replay(stated, flown).state[:, interval], atol=EXACT, rtol=0.0
        )


def test_system_without_path_quantities_has_no_path() -> None:
    bare = replace(problem(), system=replace(SYSTEM, path=(), path_values=None))
    assert replay(bare, flight(bare)).path.shape == (0, bare.intervals, SAMPLES + 1)


# whole phases

MILLIMETRE = 1e-3  # what hundreds of intervals at the looser tolerance may add up to


def test_exact_flight_ends_every_phase_where_it_should() -> None:
    assert np.abs(replay_phases(problem(), flight(problem()))).max() < 1e-6


@pytest.mark.parametrize("interval", range(problem().intervals))
def test_tampered_control_shows_at_the_end_of_its_phase_as_the_flight_goes_on_from_it(interval: int) -> None:
    stated, flown = problem(), flight(problem())
    control = flown.control.copy()
    control[0, interval] += 0.05
    missed = replay_phases(stated, replace(flown, control=control))
    first, last = (0, 3) if interval < 3 else (3, 5)
    x = flown.state[:, first]
    for number, step in enumerate(interval_durations(stated, flown.durations)[first:last], start=first):
        x = exact(x, float(control[0, number]), step)
    phase = 0 if interval < 3 else 1
    assert missed[:, phase] == pytest.approx(x - flown.state[:, last], abs=1e-6)
    assert np.abs(missed[:, 1 - phase]).max() < 1e-6


@pytest.mark.parametrize("node", [1, 2, 4])
def test_state_within_a_phase_does_not_matter(node: int) -> None:
    """The flight starts anew at the beginnings of the phases alone."""
    stated, flown = problem(), flight(problem())
    state = flown.state.copy()
    state[:, node] += 3.0
    assert np.abs(replay_phases(stated, replace(flown, state=state))).max() < 1e-6


def test_long_phase_of_many_intervals_is_flown_within_a_millimetre() -> None:
    many = problem((1 / 400,) * 400, (1 / 300,) * 300)
    assert np.abs(replay_phases(many, flight(many))).max() < MILLIMETRE
