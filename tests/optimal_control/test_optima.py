"""Laws of an optimum: it depends neither on the solver nor on how the problem is written down."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import SOLVERS, PreparedProblem, ProgramSolution
from airrace.optimal_control.system import System

exactly = Interval.exactly
REST = {"theta": exactly(0.0), "omega": exactly(0.0)}
UP = {"theta": exactly(1.0), "omega": exactly(0.5)}
TIGHT = SolverOptions(tolerance=1e-9)


def pendulum(scales: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)) -> System:
    """A hanging pendulum of given stiffness with a limited torque and a limited power."""
    theta, omega, torque, power = scales
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 1)
    return System(
        name="pendulum",
        states=(Quantity("theta", "rad", theta), Quantity("omega", "rad/s", omega)),
        controls=(Quantity("torque", "1/s2", torque, -1.0, 1.0),),
        parameters=(Quantity("stiffness", "1/s2"),),
        rates=ca.Function("rates", [x, u, p], [ca.vertcat(x[1], u - p * ca.sin(x[0]))]),
        path=(Quantity("power", "1/s3", power, upper=0.45),),
        path_values=ca.Function("path", [x, u, p], [u * x[1]]),
    )


def swing(*phases: Phase, system: System | None = None, torque_scale: float = 1.0) -> Problem:
    """Swing up in little time with little torque."""
    objective = Objective(time=0.2, regularisation={"torque": torque_scale**2})
    return Problem(system or pendulum(), (0.8,), Boundary("start", REST), phases, objective)


def guess(problem: Problem) -> Iterate:
    count = len(problem.phases)
    states = np.stack([np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 0.5, count + 1)])
    return interpolate(problem, [2.0 / count] * count, states, [0.3])


def optimum(problem: Problem, solver: str = "interior-point") -> ProgramSolution:
    solution = solve(problem, guess(problem), solver=solver, options=TIGHT)
    assert solution.success, solution.status
    return solution


WHOLE = Phase("swing", uniform(12), Interval(0.5, 6.0), Boundary("top", UP))


def test_both_solvers_find_the_same_optimum_and_multipliers() -> None:
    one, other = optimum(swing(WHOLE), "interior-point"), optimum(swing(WHOLE), "ipopt")
    assert one.objective == pytest.approx(other.objective, rel=1e-8)
    assert one.iterate.durations == pytest.approx(other.iterate.durations, rel=1e-5)
    assert one.iterate.state == pytest.approx(other.iterate.state, abs=1e-5)
    assert one.iterate.control == pytest.approx(other.iterate.control, abs=1e-5)
    assert one.multipliers.constraints == pytest.approx(other.multipliers.constraints, abs=1e-5)
    assert one.multipliers.bounds == pytest.approx(other.multipliers.bounds, abs=1e-5)


@pytest.mark.parametrize("solver", SOLVERS)
def test_optimality_conditions_hold_at_an_optimum_and_nowhere_near(solver: str) -> None:
    solution = optimum(swing(WHOLE), solver)
    assert solution.kkt.largest < 1e-6
    stopped = solve(swing(WHOLE), guess(swing(WHOLE)), solver=solver, options=SolverOptions(iterations_max=2))
    assert not stopped.success
    assert stopped.kkt.largest > 1e-3


@pytest.mark.parametrize("solver", SOLVERS)
def test_splitting_a_phase_does_not_change_the_optimum(solver: str) -> None:
    whole = optimum(swing(replace(WHOLE, duration=exactly(2.0))), solver)
    parts = swing(
        Phase("first third", uniform(4), exactly(2.0 / 3)),
        Phase("the rest", uniform(8), exactly(4.0 / 3), Boundary("top", UP)),
    )
    split = optimum(parts, solver)
    assert split.objective == pytest.approx(whole.objective, rel=1e-8)
    assert split.iterate.state == pytest.approx(whole.iterate.state, abs=1e-6)
    assert split.iterate.control == pytest.approx(whole.iterate.control, abs=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("scales", [(10.0, 0.2, 3.0, 0.5), (0.3, 4.0, 0.1, 20.0)])
def test_scales_do_not_change_the_optimum(scales: tuple[float, float, float, float], solver: str) -> None:
    plain = optimum(swing(WHOLE), solver)
    problem = replace(swing(WHOLE, system=pendulum(scales), torque_scale=scales[2]), time_scale=5.0)
    scaled = optimum(problem, solver)
    assert scaled.objective == pytest.approx(plain.objective, rel=1e-6)
    assert scaled.iterate.durations == pytest.approx(plain.iterate.durations, rel=1e-4)
    assert scaled.iterate.state == pytest.approx(plain.iterate.state, abs=1e-4)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_prepared_problem_solves_its_structure_with_other_numbers(solver: str) -> None:
    first = swing(WHOLE)
    fractions = tuple(np.linspace(0.5, 1.5, 12) / 12)
    far = Boundary("top", {"theta": exactly(1.2), "omega": Interval(0.3, 0.4)})
    other = replace(first, parameters=(0.5,), phases=(replace(WHOLE, fractions=fractions, end=far),))
    kernels = build_kernels(first.system, first.scheme)
    prepared = PreparedProblem(Layout(first), kernels, solver, TIGHT, threads=1)
    prepared.solve(Layout(first), guess(first))
    again, fresh = prepared.solve(Layout(other), guess(other)), optimum(other, solver)
    assert again.success
    assert again.objective == fresh.objective
    assert (again.iterate.state == fresh.iterate.state).all()


@pytest.mark.parametrize("solver", SOLVERS)
def test_options_hold_whatever_was_solved_before(solver: str) -> None:
    """Also where an equality became a range, or the range was left away."""
    layouts = [
        Layout(swing(replace(WHOLE, end=Boundary("top", {"theta": exactly(1.0), "omega": omega}))))
        for omega in (exactly(0.5), Interval(-5.0, 5.0), Interval(), exactly(0.2))
    ]
    kernels = build_kernels(pendulum(), swing(WHOLE).scheme)
    few = SolverOptions(iterations_max=3)
    prepared = PreparedProblem(layouts[0], kernels, solver, few, threads=1)
    for layout in layouts:
        solution = prepared.solve(layout, guess(layout.problem))
        assert not solution.success
        assert solution.iterations <= 4


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_problem_without_controls_is_solved_for_its_durations(solver: str) -> None:
    """A free fall of 1 m, then 3 m: both take sqrt(2 / g)."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 0), ca.SX.sym("p", 0)
    states = (Quantity("depth", "m"), Quantity("speed", "m/s"))
    system = System("fall", states, (), (), ca.Function("rates", [x, u, p], [ca.vertcat(x[1], 9.81)]))
    problem = Problem(
        system,
        (),
        Boundary("top", {"depth": exactly(0.0), "speed": exactly(0.0)}),
        (
            Phase("one", uniform(1), Interval(0.01, 9.0), Boundary("ledge", {"depth": exactly(1.0)})),
            Phase("two", uniform(2), Interval(0.01, 9.0), Boundary("ground", {"depth": exactly(4.0)})),
        ),
    )
    start = interpolate(problem, [1.0, 1.0], np.array([[0.0, 1.0, 4.0], [0.0, 4.0, 8.0]]), [])
    solution = solve(problem, start, solver=solver)
    assert solution.success, solution.status
    assert solution.iterate.durations == pytest.approx(np.sqrt(2 / 9.81), rel=1e-7)


@pytest.mark.parametrize("solver", SOLVERS)
def test_what_cannot_be_solved_is_answered_not_raised(solver: str) -> None:
    def attempt(problem: Problem, start: Iterate) -> ProgramSolution:
        solution = solve(problem, start, solver=solver, options=SolverOptions(iterations_max=100))
        assert not solution.success
        assert solution.status
        return solution

    short = swing(replace(WHOLE, duration=Interval(0.1, 0.5)))
    solution = attempt(short, guess(short))
    assert solution.kkt.primal > 1e-3
    assert solution.worst.startswith("swing: ")
    for limits in ({"theta": Interval(upper=0.9)}, {"power": Interval(lower=0.5)}):  # which contradict others
        problem = swing(replace(WHOLE, bounds=limits))
        solution = attempt(problem, guess(problem))
        assert solution.infeasible
        assert "bounds contradict" in solution.status
    start = guess(swing(WHOLE))
    start.state[:, 5] = np.nan
    solution = attempt(swing(WHOLE), start)
    assert not solution.infeasible
    assert np.isnan(solution.kkt.largest)
