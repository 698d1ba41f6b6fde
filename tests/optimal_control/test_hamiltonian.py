"""Costates and Hamiltonians against problems whose optima are known in closed form."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import costates, errors_in_objective, hamiltonian
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.solve import solve
from airrace.optimal_control.solvers.solver import Solution, SolverOptions
from airrace.quantities import Interval, Quantity
from airrace.system import System

FASTEST = 20.0  # m/s2
LEAST_TIME = 2.0 / np.sqrt(FASTEST)  # from rest to rest over 1 m


def sliding_mass() -> System:
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    return System(
        name="sliding-mass",
        states=(Quantity("x", "m", 0.7), Quantity("v", "m/s", 3.0)),
        controls=(Quantity("f", "m/s2", 11.0, -FASTEST, FASTEST),),
        parameters=(),
        rates=ca.Function("rates", [x, u, p], [ca.vertcat(x[1], u)]),
        path=(),
        path_values=None,
    )


SYSTEM = sliding_mass()


def least_time(intervals: int = 10, **objective: object) -> Problem:
    """Rest to rest in two phases that meet wherever is best."""
    at_rest = {"v": Interval.exactly(0.0)}
    start = Boundary("start", {"x": Interval.exactly(0.0), **at_rest})
    end = Boundary("end", {"x": Interval.exactly(1.0), **at_rest})
    half = Boundary("half")
    phases = (
        Phase("out", uniform(intervals // 2), Interval(0.01, 5.0), half),
        Phase("back", uniform(intervals - intervals // 2), Interval(0.01, 5.0), end),
    )
    return Problem(SYSTEM, (), start, phases, objective=Objective(**objective))


def solved(problem: Problem) -> Solution:
    guess = interpolate(problem, (0.5, 0.5), [[0.0, 0.5, 1.0], [0.0, 1.0, 0.0]], (0.0,))
    options = SolverOptions(tolerance=1e-9)
    solution = solve(problem, guess, options=options)
    assert solution.success
    return solution


def found(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Costates and Hamiltonian of the optimum."""
    solution = solved(problem)
    multipliers = solution.multipliers.constraints
    return costates(Layout(problem), multipliers), hamiltonian(problem, solution.iterate, multipliers)


def test_hamiltonian_of_least_time_is_minus_one_all_along() -> None:
    assert found(least_time())[1] == pytest.approx(-np.ones(10), abs=1e-6)


def test_weight_of_time_scales_hamiltonian_and_costates() -> None:
    (p, H), (p_3, H_3) = found(least_time()), found(least_time(time=3.0))
    assert pytest.approx(3.0 * H, abs=1e-5) == H_3
    assert p_3 == pytest.approx(3.0 * p, abs=1e-5)


def test_costates_are_those_of_bang_and_bang() -> None:
    """The velocity's falls from -1 / FASTEST v to plus as much and is zero at the switch; its slope is the place's."""
    problem = replace(
        least_time(), phases=(replace(least_time().phases[0], end=Boundary("half")), least_time().phases[1])
    )
    p_x, p_v = found(problem)[0]
    times = np.linspace(0.0, LEAST_TIME, 11)[1:]
    slope = 2.0 / (FASTEST * LEAST_TIME)
    assert p_v == pytest.approx(slope * (times - 0.5 * LEAST_TIME), abs=1e-5)
    assert p_x == pytest.approx(-slope * np.ones(10), abs=1e-5)


def test_costates_are_what_a_shift_costs() -> None:
    """A start that is 1 mm ahead saves as much time as the costate of the place there says."""
    free = least_time()
    ahead = replace(free, start=Boundary("start", {"x": Interval.exactly(1e-3), "v": Interval.exactly(0.0)}))
    saved = solved(ahead).objective - solved(free).objective
    assert found(free)[0][0, 0] * 1e-3 == pytest.approx(saved, rel=2e-3)


def test_hamiltonian_counts_the_regularisation() -> None:
    """With a price on the force the optimum is smooth; time's and force's shares still add up to -1."""
    smooth = least_time(40, regularisation={"f": 0.5})
    _, H = found(smooth)
    solution = solved(smooth)
    assert np.abs(H + 1.0).max() < 5e-3
    assert np.abs(solution.iterate.control).max() < FASTEST  # nothing is at a limit
    priced = replace(smooth, objective=Objective())
    without = hamiltonian(priced, solution.iterate, solution.multipliers.constraints)
    assert np.abs(without + 1.0).max() > 0.05


def test_hamiltonian_strays_where_a_mesh_hides_the_switch() -> None:
    """One free phase on an odd number of intervals: the force cannot change sign in the middle of one."""
    whole = replace(least_time(), phases=(replace(least_time().phases[1], fractions=uniform(5)),))
    guess = interpolate(whole, (1.0,), [[0.0, 1.0], [0.0, 0.0]], (0.0,))
    solution = solve(whole, guess, options=SolverOptions(tolerance=1e-9))
    drift = np.abs(hamiltonian(whole, solution.iterate, solution.multipliers.constraints) + 1.0)
    assert drift.argmax() == 2
    assert drift.max() > 0.02


def test_error_of_integration_costs_what_the_costates_say() -> None:
    """An interval that ended a millimetre further, and 1 mm/s faster, would save what a start shifted there saves."""
    problem = least_time()
    solution = solved(problem)
    defect = np.zeros((2, 10))
    defect[:, 0] = 1e-3 / np.array([one.scale for one in SYSTEM.states])
    error = errors_in_objective(problem, defect, solution.multipliers.constraints)
    p_x, p_v = costates(Layout(problem), solution.multipliers.constraints)
    assert error[0] == pytest.approx(1e-3 * (p_x[0] + p_v[0]))
    assert (error[1:] == 0.0).all()
    assert error[0] < 0.0
