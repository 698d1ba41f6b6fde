"""The error of the transcription falls with the order of its integrator."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from statement import corners, exactly, optimum, textbook_system

from airrace.optimal_control.integrators import DORMAND_PRINCE_5, RK4, RK4_TWICE, RungeKutta
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, interpolated, uniform
from airrace.quantities import T, Vector, quantity, vector

SCHEMES = [pytest.param(scheme, id=scheme.name) for scheme in (RK4, RK4_TWICE, DORMAND_PRINCE_5)]


@vector
class State(Vector[T]):
    theta: T = quantity("rad")
    omega: T = quantity("rad/s")


@vector
class Torque(Vector[T]):
    M: T = quantity("1/s2", lower=-0.5, upper=0.5)


PENDULUM = textbook_system("pendulum", State, Torque, lambda x, u: State(theta=x.omega, omega=u.M - ca.sin(x.theta)))


@vector
class Population(Vector[T]):
    x: T = quantity("1")


@vector
class Growth(Vector[T]):
    u: T = quantity("1/s")


POPULATION = textbook_system("population", Population, Growth, lambda x, u: Population(x=u.u * x.x * (1 - x.x)))


def observed_order(errors: list[float]) -> float:
    """Mean number of halvings of the error per halving of the mesh."""
    return float(np.mean(np.log2(np.array(errors[:-1]) / np.array(errors[1:]))))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_integration_error_falls_with_the_order_of_the_scheme(scheme: RungeKutta) -> None:
    step = build_kernels(PENDULUM, scheme, compiled=False).step.value
    start, M, duration = [1.0, 0.5], 0.3, 4.0
    exact = solve_ivp(
        lambda _, x: [x[1], M - np.sin(x[0])], (0.0, duration), start, method="DOP853", rtol=1e-13, atol=1e-14
    ).y[:, -1]
    errors = []
    for intervals in (16, 32, 64, 128):
        x = np.array(start)
        for fraction in uniform(intervals):
            x = np.asarray(step([*x, M, duration], fraction, [])).ravel()
        errors.append(float(np.linalg.norm(x - exact)))
    assert observed_order(errors) == pytest.approx(scheme.order, abs=0.3)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_error_of_an_optimum_falls_with_the_order_of_the_scheme(scheme: RungeKutta) -> None:
    """A population `x' = u x (1 - x)` is grown in a given time with the least integral of `u^2`.

    `d/dt log(x / (1 - x)) = u`, so the best u is constant and the integral is the square of the gain of that logarithm.
    """
    begin, reached = 0.1, 0.3
    exact = np.log(reached / (1 - reached) * (1 - begin) / begin) ** 2
    errors = []
    for intervals in (4, 8, 16):
        end = Boundary(bounds={"x": exactly(reached)})
        problem = Problem(
            POPULATION,
            parameters=(),
            start=Boundary(bounds={"x": exactly(begin)}),
            phases=(Phase("growth", uniform(intervals), exactly(1.0), end),),
            objective=Objective(time=0.0, regularisation={"u": 1.0}),
            scheme=scheme,
        )
        guess = interpolated(problem, [1.0], corners(Population(x=begin), Population(x=reached)), [1.0])
        solution = optimum(problem, guess, tolerance=1e-10)
        assert solution.success, solution.status
        errors.append(abs(float(solution.objective - exact)))
    assert observed_order(errors) == pytest.approx(scheme.order, abs=0.3)
