"""The reference integration: as exact as it was asked to be, and honest about where it had to stop."""

import warnings
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp  # pyright: ignore[reportUnknownVariableType] - untyped in scipy

from airrace.optimal_control.reference_integration import integrate


def growing(_time: float, x: np.ndarray) -> np.ndarray:
    """Rates of x' = x^2, whose solution 1 / (1 - t) from x(0) = 1 ends at t = 1."""
    return x**2


EXACT = 1e-12


@pytest.mark.parametrize("times", [np.array([0.0, 0.5]), np.linspace(0.0, 0.9, 7)])
def test_states_are_the_solution_at_the_times_that_were_asked(times: np.ndarray) -> None:
    states = integrate(growing, np.ones(1), times, relative=EXACT, absolute=EXACT)
    assert states.shape == (1, len(times))
    assert states[0] == pytest.approx(1 / (1 - times), rel=1e-9)


@pytest.mark.parametrize("first_step", [None, 0.5])
@pytest.mark.parametrize("count", [2, 3, 50])
def test_states_are_those_of_scipys_own_driver(count: int, first_step: float | None) -> None:
    def swinging(time: float, x: np.ndarray) -> np.ndarray:
        return np.array([x[1], -np.sin(x[0]) + 0.1 * np.cos(time)])

    start, times = np.array([2.0, 0.0]), np.linspace(0.0, 20.0, count)
    states = integrate(swinging, start, times, relative=EXACT, absolute=EXACT, first_step=first_step)
    asked = times if count > 2 else None
    theirs: Any = solve_ivp(  # Any: untyped in scipy
        swinging, (0.0, 20.0), start, "DOP853", asked, rtol=EXACT, atol=EXACT, first_step=first_step
    )
    assert np.array_equal(states[:, [0, -1]], theirs.y[:, [0, -1]])
    assert count == 2 or np.array_equal(states, theirs.y)


def test_both_ends_are_told_apart_from_an_end_that_was_not_reached() -> None:
    states = integrate(growing, np.ones(1), np.array([0.0, 2.0]), relative=EXACT, absolute=EXACT)
    assert states[0, 0] == 1.0
    assert np.isnan(states[0, 1])


def test_nothing_is_told_of_times_after_the_end_of_the_solution() -> None:
    times = np.array([0.0, 0.5, 0.9, 1.5, 2.0])
    states = integrate(growing, np.ones(1), times, relative=EXACT, absolute=EXACT)
    assert states.shape == (1, len(times))
    assert states[0, :3] == pytest.approx(1 / (1 - times[:3]), rel=1e-9)
    assert np.isnan(states[0, 3:]).all()


def test_nothing_is_told_where_the_start_is_not_finite() -> None:
    states = integrate(growing, np.array([1.0, np.nan]), np.array([0.0, 0.5]), relative=EXACT, absolute=EXACT)
    assert np.isnan(states).all()


def test_an_integration_ends_after_the_steps_that_it_may_take() -> None:
    evaluated: list[float] = []

    def rates(time: float, x: np.ndarray) -> np.ndarray:
        evaluated.append(time)
        return 1e9 * np.cos(1e9 * time) * np.ones_like(x)

    states = integrate(rates, np.zeros(2), np.array([0.0, 1.0]), relative=EXACT, absolute=EXACT, most_steps=50)
    assert np.isnan(states).all()
    assert 500 < len(evaluated) <= 600


def test_rates_that_are_no_numbers_are_told_without_a_warning() -> None:
    def rates(time: float, x: np.ndarray) -> np.ndarray:
        return x * np.where(time > 0.5, np.inf, 1.0) * np.array([1.0, 0.0])

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        states = integrate(rates, np.array([1.0, 1.0]), np.array([0.0, 1.0]), relative=EXACT, absolute=EXACT)
    assert np.isnan(states[:, 1]).all()
