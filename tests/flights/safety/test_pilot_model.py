"""The regulator, its delay and the covariance of a closed loop, by a double integrator whose answers are known."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from airrace.flights.safety.covariance import closed_loop_matrix, propagate
from airrace.flights.safety.pilot import delayed_gains, predictors, regulator

STEP, MANY = 0.1, 600
F = np.array([[1.0, STEP], [0.0, 1.0]])
G = np.array([[0.5 * STEP**2], [STEP]])
Q, R = np.diag([1.0, 0.2]), np.array([[0.1]])
NOISE = np.diag([1e-4, 4e-3])
GAIN = np.linalg.solve(R + G.T @ solve_discrete_are(F, G, Q, R) @ G, G.T @ solve_discrete_are(F, G, Q, R) @ F)
"""The gain of the infinite horizon, by scipy."""


def repeated(matrix: np.ndarray) -> np.ndarray:
    return np.tile(matrix, (MANY, 1, 1))


def feedback(waiting: int) -> np.ndarray:
    """The gains by the code of the pilot, far from the end."""
    K = regulator(repeated(F), repeated(G), Q, R, Q)
    return delayed_gains(K, predictors(repeated(F), repeated(G), waiting), waiting)[0]


def stationary(waiting: int) -> np.ndarray:
    """The covariance after a long time, by the code of the covariance."""
    A = closed_loop_matrix(F, G, feedback(waiting), waiting)
    W = np.zeros_like(A)
    W[:2, :2] = NOISE
    *_, last = propagate(np.zeros_like(A), iter([(A, W)] * 3000))
    return last[:2, :2]


def test_far_from_the_end_the_gain_is_that_of_the_infinite_horizon() -> None:
    np.testing.assert_allclose(-feedback(0)[:, :2], GAIN, rtol=1e-9)


def test_the_covariance_without_delay_solves_the_lyapunov_equation() -> None:
    expected = solve_discrete_lyapunov(F - G @ GAIN, NOISE)
    np.testing.assert_allclose(stationary(0), expected, rtol=1e-8)


@pytest.mark.parametrize("waiting", [1, 3, 6])
def test_with_delay_it_is_that_of_the_prediction_and_of_what_comes_meanwhile(waiting: int) -> None:
    """The prediction is a loop without delay, driven by the noise carried through the delay; what comes is added."""
    powers = [np.linalg.matrix_power(F, j) for j in range(waiting + 1)]
    predicted = solve_discrete_lyapunov(F - G @ GAIN, powers[-1] @ NOISE @ powers[-1].T)
    meanwhile = sum(one @ NOISE @ one.T for one in powers[:-1])
    np.testing.assert_allclose(stationary(waiting), predicted + meanwhile, rtol=1e-7)


def test_a_longer_delay_scatters_more() -> None:
    traces = [np.trace(stationary(waiting)) for waiting in (0, 2, 5)]
    assert traces[0] < traces[1] < traces[2]


def test_a_simulation_of_the_delayed_loop_has_this_covariance() -> None:
    rng, waiting, n = np.random.default_rng(3), 3, 4000
    L, e, queue = feedback(waiting), np.zeros((2, n)), [np.zeros((1, n))] * waiting
    for _ in range(400):
        decision = L @ np.vstack([e, *queue])
        e = F @ e + G @ queue[0] + np.sqrt(np.diag(NOISE))[:, None] * rng.standard_normal((2, n))
        queue = [*queue[1:], decision]
    np.testing.assert_allclose(np.diag(np.cov(e)), np.diag(stationary(waiting)), rtol=0.1)
