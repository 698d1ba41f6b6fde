"""Errors of the integrators that are offered, and of optima found with them, on ever finer meshes."""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp
from statement import KnownAnswer, exactly

from airrace.optimal_control import runge_kutta
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import T, Vector, quantity, vector
from airrace.optimal_control.runge_kutta import VERNER_7, RungeKutta
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.system import system_of

SCHEMES = tuple(scheme for scheme in vars(runge_kutta).values() if isinstance(scheme, RungeKutta))
MESHES = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
ROUNDING = 2e-12  # below it, errors are those of the reference and of the solver


@vector
class State(Vector[T]):
    theta: T = quantity("rad")
    omega: T = quantity("rad/s")


@vector
class Torque(Vector[T]):
    M: T = quantity("1/s2", lower=-0.5, upper=0.5)


PENDULUM = system_of("pendulum", State, Torque, lambda x, u: State(theta=x.omega, omega=u.M - ca.sin(x.theta)))


@vector
class Population(Vector[T]):
    x: T = quantity("1")


@vector
class Growth(Vector[T]):
    u: T = quantity("1/s")


POPULATION = system_of("population", Population, Growth, lambda x, u: Population(x=u.u * x.x * (1 - x.x)))


def integration_errors(scheme: RungeKutta, meshes: Sequence[int]) -> list[float]:
    """Of a pendulum under a constant torque at the end of 4 s, by the kernels that the transcription uses."""
    step = casadi_kernels(PENDULUM, scheme).step.value
    start, M, duration = [1.0, 0.5], 0.3, 4.0
    exact = solve_ivp(
        lambda _, x: [x[1], M - np.sin(x[0])], (0.0, duration), start, method="DOP853", rtol=3e-14, atol=1e-15
    ).y[:, -1]
    errors: list[float] = []
    for intervals in meshes:
        x = np.array(start)
        for fraction in uniform(intervals):
            x = np.asarray(step([*x, M, duration], fraction, [])).ravel()
        errors.append(float(np.linalg.norm(x - exact)))
    return errors


def optimum_errors(scheme: RungeKutta, meshes: Sequence[int], reached: float = 0.99) -> list[float]:
    """Of the least effort that makes a population grow.

    A population `x' = u x (1 - x)` is to grow in a given time with the least integral of `u^2`. As
    `d/dt log(x / (1 - x)) = u`, the best u is constant and the integral is the square of the gain of that logarithm. So
    holding the control over an interval costs nothing, and all of the error is the integrator's.

    `reached` must not be 0.9: `x -> 1 - x` then maps the growth onto itself backwards, leading errors of odd order
    cancel, and the order looks one higher than it is.
    """
    begin = 0.1
    exact = np.log(reached / (1 - reached) * (1 - begin) / begin) ** 2
    errors: list[float] = []
    for intervals in meshes:
        problem = Problem(
            POPULATION,
            parameters=(),
            start=Boundary(bounds={"x": exactly(begin)}),
            phases=(Phase("growth", uniform(intervals), exactly(1.0), Boundary(bounds={"x": exactly(reached)})),),
            objective=Objective(time=0.0, regularisation={"u": 1.0}),
            scheme=scheme,
        )
        guess = interpolate(problem, [1.0], corners(Population(x=begin), Population(x=reached)), [4.0])
        answer = KnownAnswer("population", problem, guess, (), SolverOptions(tolerance=1e-10))
        solution = answer.solve("ipopt")  # whose last step is more exact than that
        if not solution.success:
            raise ArithmeticError(f"{scheme.name}, {intervals} intervals: {solution.status}")
        errors.append(abs(float(solution.objective - exact)))
    return errors


def order_of_optima(scheme: RungeKutta) -> int:
    """The order that errors of an optimum fall with; above rounding, that of order 7 shows the next one.

    Its leading error was made that small.
    """
    return 8 if scheme is VERNER_7 else scheme.order


def observed_order(errors_of: Callable[[RungeKutta, Sequence[int]], list[float]], scheme: RungeKutta) -> float:
    """Slope of the error over the length of an interval, both as logarithms; of the finest meshes above rounding."""
    errors = np.array(errors_of(scheme, MESHES))
    told = np.flatnonzero(errors > ROUNDING)[-5:]
    slope, _ = np.polyfit(-np.log(np.array(MESHES)[told]), np.log(errors[told]), 1)
    return float(slope)
