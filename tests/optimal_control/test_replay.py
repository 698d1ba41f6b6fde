"""Replay and sampling by an independent integrator."""

import inspect
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import known_flights
import numpy as np
import pytest
from known_flights import SYSTEM, exact, flight, node_times, problem
from scipy.integrate import (
    DOP853,  # pyright: ignore[reportUnknownVariableType] - untyped in scipy
    solve_ivp,  # pyright: ignore[reportUnknownVariableType] - untyped in scipy
)

from airrace.optimal_control import replay as module
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.replay import (
    SAMPLES,
    function_at_points,
    integrate,
    interval_durations,
    replay,
    replay_phases,
    sample,
)
from airrace.optimal_control.trajectory import Array

EXACT = 1e-8
SCALES = np.array([quantity.scale for quantity in SYSTEM.states])


def test_interval_durations_are_the_shares_of_each_phase() -> None:
    assert interval_durations(problem(), np.array([2.0, 5.0])) == pytest.approx([0.4, 1.0, 0.6, 3.0, 2.0])


def test_exact_flight_has_no_defect_and_its_history_between_nodes_is_the_exact_one() -> None:
    stated, flown = problem(), flight(problem())
    found = replay(stated, flown)
    assert np.abs(found.defect).max() < EXACT
    assert found.state.shape == (2, stated.intervals, SAMPLES + 1)
    for interval, step in enumerate(interval_durations(stated, flown.durations)):
        force = float(flown.control[0, interval])
        expected = exact(flown.state[:, interval], force, np.linspace(0.0, step, SAMPLES + 1))
        assert np.allclose(found.state[:, interval], expected, atol=EXACT)
    assert np.abs(replay_phases(stated, flown)).max() < 1e-6


def test_path_quantities_are_those_of_the_history() -> None:
    flown = flight(problem())
    seen = replay(problem(), flown)
    assert np.allclose(seen.path[0], seen.state[0])
    assert np.allclose(seen.path[1], seen.state[1] * flown.control[0][:, None])


@pytest.mark.parametrize("interval", range(problem().intervals))
def test_tampered_control_shows_as_the_defect_it_makes_and_at_the_end_of_its_phase(interval: int) -> None:
    stated, flown = problem(), flight(problem())
    control = flown.control.copy()
    control[0, interval] += 0.05
    tampered, steps = replace(flown, control=control), interval_durations(stated, flown.durations)
    defect = replay(stated, tampered).defect
    after = exact(flown.state[:, interval], float(control[0, interval]), float(steps[interval]))
    assert np.allclose(defect[:, interval], (after - flown.state[:, interval + 1]) / SCALES, atol=EXACT)
    assert np.abs(defect[:, interval]).max() > 1e-4
    assert np.abs(np.delete(defect, interval, axis=1)).max() < EXACT
    missed = replay_phases(stated, tampered)
    phase, first, last = (0, 0, 3) if interval < 3 else (1, 3, 5)
    x = flown.state[:, first]
    for number in range(first, last):
        x = exact(x, float(control[0, number]), float(steps[number]))
    assert missed[:, phase] == pytest.approx(x - flown.state[:, last], abs=1e-6)
    assert np.abs(missed[:, 1 - phase]).max() < 1e-6


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


SAMPLE_TOLERANCE = 1e-7
STATED, FLOWN, TIME = problem(), flight(problem()), node_times(problem())


def sampled(times: Array) -> Array:
    """The flight at some times, shape (n_x, n)."""
    return sample(STATED.system, np.array(STATED.parameters), FLOWN, time=TIME, times=times)


def test_samples_are_the_nodes_and_on_the_grid_of_the_replay_the_replay() -> None:
    assert np.allclose(sampled(TIME), FLOWN.state, atol=SAMPLE_TOLERANCE)
    seen = replay(STATED, FLOWN).state
    for interval in range(STATED.intervals):
        times = np.linspace(TIME[interval], TIME[interval + 1], SAMPLES + 1)
        assert np.allclose(sampled(times), seen[:, interval], atol=SAMPLE_TOLERANCE)


def test_samples_are_the_exact_flight_in_whichever_order_they_are_asked_for() -> None:
    times = np.array([1.9, 0.3, 0.3, 1.2, 0.05, TIME[-1]])
    for time, state in zip(times, sampled(times).T, strict=True):
        interval = min(int(np.searchsorted(TIME, time, side="right")) - 1, STATED.intervals - 1)
        force = float(FLOWN.control[0, interval])
        assert state == pytest.approx(
            exact(FLOWN.state[:, interval], force, time - TIME[interval]), abs=SAMPLE_TOLERANCE
        )


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
        assert state == pytest.approx(exact(FLOWN.state[:, 0], 0.0, time), abs=SAMPLE_TOLERANCE)


def test_single_sample_is_that_of_many() -> None:
    many = sampled(np.linspace(0.0, TIME[-1], 17))
    alone = sampled(np.array([TIME[-1] * 5 / 16]))
    assert np.allclose(alone[:, 0], many[:, 5], atol=SAMPLE_TOLERANCE)


def growing(_time: float, x: np.ndarray) -> np.ndarray:
    """Rates of x' = x^2, whose solution 1 / (1 - t) from x(0) = 1 ends at t = 1."""
    return x**2


ROUNDING = 1e-12


@pytest.mark.parametrize("times", [np.array([0.0, 0.5]), np.linspace(0.0, 0.9, 7)])
def test_states_are_the_solution_at_the_times_that_were_asked(times: np.ndarray) -> None:
    states = integrate(growing, np.ones(1), times, relative=ROUNDING, absolute=ROUNDING)
    assert states.shape == (1, len(times))
    assert states[0] == pytest.approx(1 / (1 - times), rel=1e-9)


@pytest.mark.parametrize("first_step", [None, 0.5])
@pytest.mark.parametrize("count", [2, 3, 50])
def test_states_are_those_of_scipys_own_driver(count: int, first_step: float | None) -> None:
    def swinging(time: float, x: np.ndarray) -> np.ndarray:
        return np.array([x[1], -np.sin(x[0]) + 0.1 * np.cos(time)])

    start, times = np.array([2.0, 0.0]), np.linspace(0.0, 20.0, count)
    states = integrate(swinging, start, times, relative=ROUNDING, absolute=ROUNDING, first_step=first_step)
    asked = times if count > 2 else None
    theirs: Any = solve_ivp(  # Any: untyped in scipy
        swinging, (0.0, 20.0), start, "DOP853", asked, rtol=ROUNDING, atol=ROUNDING, first_step=first_step
    )
    assert np.array_equal(states[:, [0, -1]], theirs.y[:, [0, -1]])
    assert count == 2 or np.array_equal(states, theirs.y)


@pytest.mark.parametrize("times", [np.array([0.0, 2.0]), np.array([0.0, 0.5, 0.9, 1.5, 2.0])])
def test_states_after_the_end_of_the_solution_are_not_numbers(times: np.ndarray) -> None:
    states = integrate(growing, np.ones(1), times, relative=ROUNDING, absolute=ROUNDING)
    assert states.shape == (1, len(times))
    known = times < 1.0
    assert states[0, known] == pytest.approx(1 / (1 - times[known]), rel=1e-9)
    assert np.isnan(states[0, ~known]).all()
    assert np.isnan(integrate(growing, np.array([1.0, np.nan]), times, relative=ROUNDING, absolute=ROUNDING)).all()


def test_an_integration_ends_after_the_steps_that_it_may_take() -> None:
    evaluated: list[float] = []

    def rates(time: float, x: np.ndarray) -> np.ndarray:
        evaluated.append(time)
        return 1e9 * np.cos(1e9 * time) * np.ones_like(x)

    states = integrate(rates, np.zeros(2), np.array([0.0, 1.0]), relative=ROUNDING, absolute=ROUNDING, most_steps=50)
    assert np.isnan(states).all()
    assert 500 < len(evaluated) <= 600


def test_rates_that_are_no_numbers_are_reported_without_a_warning() -> None:
    def rates(time: float, x: np.ndarray) -> np.ndarray:
        return x * np.where(time > 0.5, np.inf, 1.0) * np.array([1.0, 0.0])

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        states = integrate(rates, np.array([1.0, 1.0]), np.array([0.0, 1.0]), relative=ROUNDING, absolute=ROUNDING)
    assert np.isnan(states[:, 1]).all()


@pytest.fixture
def loaded_anew() -> Iterator[None]:
    module.dop853.cache_clear()
    yield
    module.dop853.cache_clear()


def test_the_integrator_is_the_file_of_the_installed_scipy() -> None:
    own = module.dop853()
    assert inspect.getsourcefile(own) == inspect.getsourcefile(DOP853)  # pyright: ignore[reportUnknownArgumentType]


def test_the_package_around_it_is_not_loaded() -> None:
    program = "import sys; from airrace.optimal_control.replay import dop853; dop853()"
    look = f"{program}; print('scipy.integrate' in sys.modules)"
    told = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "False"


def test_all_of_it_is_loaded_where_scipy_keeps_the_file_elsewhere(
    monkeypatch: pytest.MonkeyPatch, loaded_anew: None
) -> None:
    monkeypatch.setattr(module, "FOLDER", Path("elsewhere"))
    monkeypatch.setattr(module, "ALIAS", "integrators_of_a_test")
    assert module.dop853() is DOP853
