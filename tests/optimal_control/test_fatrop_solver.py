"""fatrop called directly does what casadi's interface to it does, faster to set up and with better manners."""

import signal
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from casadi_program import solver_named
from known_flights import rest_to_rest
from small_problems import PROBLEMS, random_iterate

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.solvers.fatrop import solver as fatrop_solver
from airrace.optimal_control.solvers.fatrop.solver import FatropResult, FatropSolver
from airrace.optimal_control.solvers.fatrop.stages import RELAXATION, undo_relaxation
from airrace.optimal_control.solvers.interface import Bounds, Ending, SolverOptions
from airrace.optimal_control.solvers.solver import PreparedProblem, Solution
from airrace.quantities import Interval, Quantity
from airrace.system import System

exactly = Interval.exactly
OPTIONS = SolverOptions(tolerance=1e-9, iterations_max=100)
EVERYTHING = PROBLEMS["everything"]
GUESS = random_iterate(EVERYTHING, 1)


def prepared(problem: Problem, solver: str, options: SolverOptions = OPTIONS) -> PreparedProblem:
    kernels = casadi_kernels(problem.system, problem.scheme)
    return PreparedProblem(Layout(problem), kernels, solver_named(solver), options, threads=1)


def optimum(problem: Problem, guess: Iterate, solver: str = "fatrop", options: SolverOptions = OPTIONS) -> Solution:
    return prepared(problem, solver, options).solve(Layout(problem), guess)


def bounded(start: Interval, load: Interval) -> Problem:
    """The problem with everything, other kinds of bounds."""
    first, *others = EVERYTHING.phases
    first = replace(first, bounds={"load": load})
    fixed = replace(others[-1], duration=exactly(0.4), end=replace(others[-1].end, bounds={"clearance": exactly(0.1)}))
    begin = replace(EVERYTHING.start, bounds={"a": start, "lean": Interval(-6.0, 6.0)})
    return replace(EVERYTHING, start=begin, phases=(first, *others[:-1], fixed))


VARIANTS: Mapping[str, Problem] = {
    "fixed start": bounded(exactly(0.4), Interval(-2.0, 7.0)),
    "free start": bounded(Interval(), Interval(-2.0, 7.0)),
    "one-sided": bounded(Interval(upper=1.0), Interval(lower=-2.0)),
}


@pytest.mark.parametrize("name", [*PROBLEMS, *VARIANTS])
def test_iterations_and_optimum_are_those_of_casadis_interface(name: str) -> None:
    problem = {**PROBLEMS, **VARIANTS}[name]
    guess = random_iterate(problem, 1)
    one, other = (optimum(problem, guess, solver) for solver in ("fatrop", "fatrop-casadi"))
    assert one.success
    assert other.success
    assert one.iterations == other.iterations
    assert one.objective == pytest.approx(other.objective, rel=1e-9)
    assert one.multipliers.constraints == pytest.approx(other.multipliers.constraints, abs=1e-7)


def test_iterates_are_those_of_casadis_interface(capsys: pytest.CaptureFixture[str]) -> None:
    printed: list[list[str]] = []
    for solver in ("fatrop", "fatrop-casadi"):
        solution = optimum(EVERYTHING, GUESS, solver)
        lines = capsys.readouterr().out.splitlines()
        begin = next(number for number, line in enumerate(lines) if line.startswith("iter"))
        printed.append(lines[begin + 1 : begin + 2 + solution.iterations])
        assert printed[-1][-1].split()[0] == str(solution.iterations)
    assert printed[0] == printed[1]


def test_path_quantities_of_states_and_controls_leave_newtons_method_quadratic() -> None:
    """They are evaluated at the last node with the control before it: of that, nothing may get into the wrong place."""
    swing, guess = rest_to_rest()
    u, x = ca.SX.sym("u", 1), ca.SX.sym("x", 2)
    values = ca.Function("path", [x, u, ca.SX.sym("p", 1)], [ca.vertcat(x[0], u * x[0])])
    smooth = Objective(regularisation={"f": 1.0})
    problem = replace(swing, system=replace(swing.system, path_values=values), objective=smooth)
    one, other = (optimum(problem, guess, solver) for solver in ("fatrop", "ipopt"))
    assert one.success
    assert one.objective == pytest.approx(other.objective, rel=1e-9)
    assert one.iterations <= other.iterations + 3


def direct(problem: Problem, guess: Iterate) -> tuple[FatropResult, Evaluation]:
    """The binding's own result, at its own risk."""
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    solver = FatropSolver(functions, {"tol": 1e-9, "max_iter": 100})
    bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
    return solver.solve(layout.pack(guess), bounds, layout.parameter_values()), functions


@pytest.mark.parametrize("name", VARIANTS)
def test_multipliers_of_bounds_balance_the_gradient(name: str) -> None:
    problem = VARIANTS[name]
    result, functions = direct(problem, random_iterate(problem, 1))
    functions.at(result.w, Layout(problem).parameter_values())
    functions.lam_g[:] = result.lam_g
    functions.slope()
    assert result.success
    assert np.abs(result.lam_w).max() > 0.01
    assert result.lam_w == pytest.approx(-functions.gradient, abs=1e-6)


def test_a_problem_without_inequalities_is_solved() -> None:
    """fatrop leaves its multipliers where they are; one bound that is far away makes it find them."""
    swing, guess = rest_to_rest()
    (f,) = swing.system.controls
    unlimited = replace(swing.system, controls=(replace(f, lower=-np.inf, upper=np.inf),))
    (phase,) = swing.phases
    objective = Objective(regularisation={"f": 1.0})
    problem = replace(swing, system=unlimited, phases=(replace(phase, duration=exactly(2.0)),), objective=objective)
    lower, upper = Layout(problem).unknown_bounds()
    assert not ((lower < upper) & (np.isfinite(lower) | np.isfinite(upper))).any()
    one, other = (optimum(problem, guess, solver) for solver in ("fatrop", "ipopt"))
    assert one.success
    assert one.kkt.largest < 1e-8
    assert one.objective == pytest.approx(other.objective, rel=1e-9)
    assert not optimum(problem, guess, "fatrop-casadi").success


def test_one_solver_serves_bounds_of_changing_kinds() -> None:
    ready = prepared(VARIANTS["fixed start"], "fatrop")
    for name in ("fixed start", "free start", "fixed start"):
        guess = random_iterate(VARIANTS[name], 1)
        again, fresh = ready.solve(Layout(VARIANTS[name]), guess), optimum(VARIANTS[name], guess)
        assert again.objective == fresh.objective
        assert (again.iterate.state == fresh.iterate.state).all()


def coasting(
    rate: Callable[[ca.SX, ca.SX], ca.SX], path: Callable[[ca.SX], ca.SX], start: float, lowest: float
) -> Problem:
    """Come as low as possible within a second, with little control."""
    x, u, p = ca.SX.sym("x", 1), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    system = System(
        name="coasting",
        states=(Quantity("x", "m"),),
        controls=(Quantity("u", "m/s", 1.0, -3.0, 3.0),),
        parameters=(),
        rates=ca.Function("rates", [x, u, p], [rate(x, u)]),
        path=(Quantity("c", "1", 1.0, lowest),),
        path_values=ca.Function("path", [x, u, p], [path(x)]),
    )
    phase = Phase("all", uniform(4), exactly(1.0))
    objective = Objective(time=0.0, terminal={"x": 1.0}, regularisation={"u": 1e-3})
    return Problem(system, (), Boundary("start", {"x": exactly(start)}), (phase,), objective)


def level(problem: Problem, height: float) -> Iterate:
    return interpolate(problem, [1.0], np.array([[height, height]]), [0.0])


def test_steps_to_where_a_constraint_has_no_value_are_taken_back() -> None:
    """ln x >= -2: the first steps lead to negative x."""
    problem = coasting(lambda _, u: u, ca.log, start=1.0, lowest=-2.0)
    solution = optimum(problem, level(problem, 1.0))
    assert solution.success, solution.status
    assert solution.iterate.state[0, -1] == pytest.approx(np.exp(-2.0), rel=1e-6)


def test_derivatives_that_are_not_finite_end_the_solve() -> None:
    """sqrt(x) has a value at x = 0 but no slope."""
    problem = coasting(lambda x, u: u - ca.sqrt(x), lambda x: x, start=0.0, lowest=-1.0)
    solution = optimum(problem, level(problem, 0.0))
    assert not solution.success
    assert solution.ending is Ending.NOT_FINITE


def test_huge_derivatives_end_the_solve_before_matrices_overflow() -> None:
    problem = coasting(lambda x, u: u - 1e12 * x, lambda x: x, start=0.0, lowest=-1.0)
    solution = optimum(problem, level(problem, 0.0))
    assert not solution.success
    assert solution.ending is Ending.NOT_FINITE
    assert np.isfinite(solution.iterate.state).all()


def test_a_guess_without_numbers_ends_the_solve() -> None:
    problem = coasting(lambda _, u: u, ca.log, start=1.0, lowest=-2.0)
    result, _ = direct(problem, level(problem, -1.0))
    assert not result.success
    assert result.iterations < 100


def test_a_limit_of_iterations_is_told() -> None:
    solution = optimum(EVERYTHING, GUESS, options=SolverOptions(iterations_max=2))
    assert not solution.success
    assert solution.ending is Ending.ITERATION_LIMIT
    assert solution.status == "1: more iterations than allowed"


def test_ctrl_c_ends_the_solve_and_is_raised_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    ready = prepared(EVERYTHING, "fatrop")
    calls, working, handler = [0], Evaluation.values, signal.getsignal(signal.SIGINT)

    def pressing(functions: Evaluation) -> None:
        calls[0] += 1
        if calls[0] == 5:
            signal.raise_signal(signal.SIGINT)
        working(functions)

    with monkeypatch.context() as patched:
        patched.setattr(Evaluation, "values", pressing)
        with pytest.raises(KeyboardInterrupt):
            ready.solve(Layout(EVERYTHING), GUESS)
    assert calls[0] < 25  # an iteration was finished, hardly more
    assert signal.getsignal(signal.SIGINT) is handler
    assert ready.solve(Layout(EVERYTHING), GUESS).success


def test_ctrl_c_at_any_moment_is_not_lost() -> None:
    ready = prepared(EVERYTHING, "fatrop")
    for milliseconds in range(1, 9):
        timer = threading.Timer(1e-3 * milliseconds, signal.raise_signal, (signal.SIGINT,))
        with pytest.raises(KeyboardInterrupt):  # noqa: PT012 (it comes at any time)
            timer.start()
            for _ in range(100):
                ready.solve(Layout(EVERYTHING), GUESS)


class Failing:
    """A standard output that cannot be written to after some lines."""

    def __init__(self, lines: int) -> None:
        self.lines = lines

    def write(self, text: str) -> int:
        self.lines -= text.count("\n")
        if self.lines < 0:
            raise BrokenPipeError
        return len(text)


def test_an_error_while_printing_ends_the_solve_and_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    ready = prepared(EVERYTHING, "fatrop")
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stdout", Failing(5))
        with pytest.raises(BrokenPipeError):
            ready.solve(Layout(EVERYTHING), GUESS)
    assert ready.solve(Layout(EVERYTHING), GUESS).objective == optimum(EVERYTHING, GUESS).objective


@pytest.mark.parametrize("calls", [0, 1, 7])
def test_an_error_in_a_function_ends_the_solve_and_is_raised(monkeypatch: pytest.MonkeyPatch, calls: int) -> None:
    ready = prepared(EVERYTHING, "fatrop")
    remaining, working = [calls], Evaluation.values

    def failing(functions: Evaluation) -> None:
        remaining[0] -= 1
        if remaining[0] < 0:
            raise ZeroDivisionError("as planned")
        working(functions)

    with monkeypatch.context() as patched:
        patched.setattr(Evaluation, "values", failing)
        with pytest.raises(ZeroDivisionError, match="as planned"):
            ready.solve(Layout(EVERYTHING), GUESS)
    assert ready.solve(Layout(EVERYTHING), GUESS).success


def test_time_in_functions_is_part_of_the_time() -> None:
    solution = optimum(EVERYTHING, GUESS)
    assert 0.0 < solution.derivative_seconds < solution.seconds


def out_of_reach() -> tuple[Problem, Iterate]:
    """A problem whose last condition cannot be met, and a guess."""
    problem = VARIANTS["free start"]
    *others, last = problem.phases
    far = replace(last, end=replace(last.end, bounds={**last.end.bounds, "clearance": exactly(50.0)}))
    objective = replace(problem.objective, regularisation={"s": 0.05, "t": 0.4})
    return replace(problem, phases=(*others, far), objective=objective), random_iterate(problem, 1)


def printed(text: str) -> list[str]:
    """The numbers of fatrop's iterations as it prints them; one within a restoration of feasibility ends with an r."""
    first = (line.split()[0] for line in text.splitlines() if line.strip() and "objective" not in line)
    return [word for word in first if word.rstrip("r").isdigit()]


def test_iterations_of_a_restoration_that_fails_are_counted_and_limited(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    problem, guess = out_of_reach()
    solution, numbers = optimum(problem, guess), printed(capsys.readouterr().out)
    assert not solution.success
    assert len([one for one in numbers if one.endswith("r")]) > 20
    assert solution.iterations == pytest.approx(len(numbers), abs=2)
    monkeypatch.setattr(fatrop_solver, "LIMITS", fatrop_solver.SolveLimits(restoration=12))
    solution, numbers = optimum(problem, guess), printed(capsys.readouterr().out)
    assert not solution.success
    assert solution.ending is Ending.RESTORATION_LIMIT
    assert len([one for one in numbers if one.endswith("r")]) <= 12 + 2
    # which is none of other iterations
    monkeypatch.setattr(fatrop_solver, "LIMITS", fatrop_solver.SolveLimits(restoration=1))
    assert optimum(EVERYTHING, GUESS).success


@pytest.mark.parametrize("name", PROBLEMS)
def test_bounds_are_kept_exactly_where_that_is_asked_for(name: str) -> None:
    """By itself fatrop misses the bounds that it presses on by 1e-8 of them, or of 1."""
    problem = PROBLEMS[name]
    relaxed, kept = (
        optimum(problem, random_iterate(problem, 1), options=replace(OPTIONS, exact=exact)) for exact in (False, True)
    )
    assert kept.success
    assert kept.kkt.primal < 3e-9
    assert kept.objective == pytest.approx(relaxed.objective, rel=1e-6)


def test_fatrop_relaxes_bounds_by_as_much_as_is_undone() -> None:
    found = optimum(EVERYTHING, GUESS)
    assert 0.5 * RELAXATION < found.kkt.primal < 20.0 * RELAXATION


def test_bounds_that_fatrop_relaxes_become_what_they_were() -> None:
    lower, upper = np.array([-np.inf, -300.0, 0.0, 1.0]), np.array([2.0, np.inf, 1e-9, np.inf])
    low, high = undo_relaxation(lower, upper)
    assert low == pytest.approx([-np.inf, -300.0 + 300.0 * RELAXATION, 0.25e-9, 1.0 + RELAXATION], abs=1e-15)
    assert high == pytest.approx([2.0 - 2.0 * RELAXATION, np.inf, 0.75e-9, np.inf], abs=1e-15)
