"""Creeping: it is told from what fatrop prints, and another method goes on from its iterate and multipliers."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from small_problems import PROBLEMS, random_iterate

from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers import predictor_corrector
from airrace.optimal_control.solvers.fatrop import solver as fatrop_solver
from airrace.optimal_control.solvers.fatrop.solver import CreepingDetector, CreepingLimits, FatropResult, FatropSolver
from airrace.optimal_control.solvers.interface import Ending, Multipliers, SolverOptions, SolverResult
from airrace.optimal_control.solvers.predictor_corrector import PredictorCorrector
from airrace.optimal_control.solvers.solver import Ipopt, PreparedProblem, Solution

# What fatrop printed of a six-dof race of 18 phases; it went on like this for 500 iterations.
CREEPING = """\
iter    objective   inf_pr   inf_du lg(mu)    ||d||   lg(rg)   alpha_du   alpha_pr ls
  11  6.78700000e+01 3.10e-03 1.30e+00   -5.0 6.00e-01      -  1.00e+00   6.43e-01h  1
  12  6.78636791e+01 2.29e-03 1.60e+00   -5.0 7.56e-01    0.0  1.00e+00   6.43e-01h  1
  13  6.78606388e+01 6.05e-07 4.35e-03   -5.0 4.34e-03    0.4  1.00e+00   1.00e+00f  1
  14  6.78596776e+01 1.12e-07 1.04e-03   -5.0 1.59e-03   -0.1  1.00e+00   1.00e+00h  1
  15  6.78595717e+01 3.15e-09 9.72e-04   -5.0 1.17e-03    0.4  1.00e+00   1.00e+00h  1
  16  6.78593989e+01 1.24e-08 7.41e-04   -5.0 4.10e-04   -0.1  1.00e+00   1.00e+00h  1
  17  6.78593493e+01 1.02e-09 6.53e-04   -5.0 9.37e-04    0.3  1.00e+00   1.00e+00h  1
""".splitlines(keepends=True)
FOUND_OUT = len(CREEPING)
"""The number of lines after which it is known."""


def lines_read(lines: Sequence[str]) -> CreepingDetector:
    detector = CreepingDetector()
    for line in lines:
        detector.read(line)
    return detector


def test_regularised_again_and_again_at_feasible_points_is_creeping() -> None:
    assert not lines_read(CREEPING[: FOUND_OUT - 1]).creeping
    detector = lines_read(CREEPING)
    assert detector.creeping
    assert detector.barrier == pytest.approx(1e-5)


@pytest.mark.parametrize("length", [1, 7, 1000])
def test_output_may_come_in_any_pieces(length: int) -> None:
    text = "".join(CREEPING)
    assert lines_read([text[at : at + length] for at in range(0, len(text), length)]).creeping


OTHERWISE: dict[str, Callable[[str], str]] = {
    "not regularised": lambda line: line.replace("    0.4  1.00", "      -  1.00"),
    "hardly regularised": lambda line: line.replace("    0.4  1.00", "   -2.4  1.00"),
    "infeasible": lambda line: line.replace("6.05e-07", "6.05e-02").replace("3.15e-09", "3.15e-02"),
    "leads on": lambda line: line.replace("6.78636791e+01", "6.98636791e+01"),
    "restoration": lambda line: line.replace("  15  ", "  15r "),
    "no number": lambda line: line.replace("3.15e-09", "nan"),
}


@pytest.mark.parametrize("name", OTHERWISE)
def test_otherwise_it_is_none(name: str) -> None:
    changed = [OTHERWISE[name](line) for line in CREEPING]
    assert changed != CREEPING
    assert not lines_read(changed).creeping


PROBLEM = PROBLEMS["everything"]
LAYOUT = Layout(PROBLEM)
KERNELS = casadi_kernels(PROBLEM.system, PROBLEM.scheme)
OPTIONS = SolverOptions(tolerance=1e-8, iterations_max=100)


def optimum() -> Solution:
    return PreparedProblem(LAYOUT, KERNELS, "fatrop", OPTIONS).solve(LAYOUT, random_iterate(PROBLEM, 1))


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take any few iterations that are nearly feasible for creeping."""
    anything = CreepingLimits(iterations=3, regularisation=0.0, infeasibility=1e-2, change=1.0)
    monkeypatch.setattr(fatrop_solver, "CREEPING", anything)


def recorded(
    monkeypatch: pytest.MonkeyPatch,
    kind: type[FatropSolver | PredictorCorrector | Ipopt],
    calls: list[Any],
    results: list[Any],
) -> None:
    """Record the arguments and results of a solver's calls."""
    solve: Callable[..., SolverResult] = kind.solve

    def recording(self: Any, *arguments: Any, **named: Any) -> SolverResult:
        calls.append(arguments)
        results.append(solve(self, *arguments, **named))
        return results[-1]

    monkeypatch.setattr(kind, "solve", recording)


@pytest.mark.usefixtures("hasty")
def test_steps_go_on_from_the_iterate_and_its_multipliers_to_the_same_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(fatrop_solver, "CREEPING", CreepingLimits())
        expected = optimum()
    reached: list[FatropResult] = []
    handed: list[Any] = []
    found: list[SolverResult] = []
    recorded(monkeypatch, FatropSolver, [], reached)
    recorded(monkeypatch, PredictorCorrector, handed, found)
    solution = optimum()
    assert reached[0].ending is Ending.CREEPING
    assert not reached[0].success
    assert len(handed) == 1
    w, _, _, known, options = handed[0]
    assert (w == reached[0].w).all()
    assert (known == np.concatenate([reached[0].lam_g, reached[0].lam_w])).all()
    assert options.barrier == pytest.approx(reached[0].barrier)
    assert solution.success
    assert solution.ending is Ending.OPTIMAL
    assert solution.iterations == reached[0].iterations + found[0].iterations < expected.iterations + 10
    assert "handed over by fatrop" in solution.status
    assert solution.objective == pytest.approx(expected.objective, abs=1e-6)
    assert solution.kkt.largest < 1e-7


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("missing", ["steps", "library"])
def test_ipopt_goes_on_where_steps_lead_nowhere(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(fatrop_solver, "CREEPING", CreepingLimits())
        expected = optimum()
    if missing == "steps":
        few = replace(predictor_corrector.PARAMETERS, iterations_max=0)
        monkeypatch.setattr(predictor_corrector, "PARAMETERS", few)
    else:
        monkeypatch.setattr(predictor_corrector, "library", lambda: None)
    reached: list[FatropResult] = []
    handed: list[Any] = []
    recorded(monkeypatch, FatropSolver, [], reached)
    recorded(monkeypatch, Ipopt, handed, [])
    solution = optimum()
    assert [one.ending for one in reached] == [Ending.CREEPING]  # it is not asked again
    ((w, _, _, known),) = handed
    assert isinstance(known, Multipliers)
    assert (w == reached[0].w).all()
    assert (known.constraints == reached[0].lam_g).all()
    assert (known.bounds == reached[0].lam_w).all()
    assert solution.success
    assert solution.status.startswith("Solve_Succeeded")
    assert solution.objective == pytest.approx(expected.objective, abs=1e-6)


NOTHING = Multipliers(np.zeros(LAYOUT.constraints), np.zeros(LAYOUT.unknowns))


def optimum_with_known_multipliers() -> Solution:
    prepared = PreparedProblem(LAYOUT, KERNELS, "fatrop", replace(OPTIONS, barrier=1e-2))
    return prepared.solve(LAYOUT, random_iterate(PROBLEM, 1), NOTHING)


def test_a_solve_with_known_multipliers_is_handed_over_early(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = optimum()
    reached: list[FatropResult] = []
    found: list[SolverResult] = []
    recorded(monkeypatch, FatropSolver, [], reached)
    recorded(monkeypatch, PredictorCorrector, [], found)
    solution = optimum_with_known_multipliers()
    assert [one.ending for one in reached] == [Ending.ITERATION_LIMIT]
    assert solution.success
    assert solution.iterations == reached[0].iterations + found[0].iterations
    assert f"handed over by fatrop after {reached[0].iterations} iterations" in solution.status
    assert solution.objective == pytest.approx(expected.objective, abs=1e-6)


def test_fatrop_goes_on_from_its_own_iterate_where_steps_lead_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = optimum()
    monkeypatch.setattr(
        predictor_corrector, "PARAMETERS", replace(predictor_corrector.PARAMETERS, iterations_max=0, nearly_optimal=0.0)
    )
    asked: list[Any] = []
    reached: list[FatropResult] = []
    recorded(monkeypatch, FatropSolver, asked, reached)
    solution = optimum_with_known_multipliers()
    first, second = reached
    assert first.ending is Ending.ITERATION_LIMIT
    assert (asked[1][0] == first.w).all()
    assert (asked[1][3] == np.concatenate([first.lam_g, first.lam_w])).all()
    assert solution.success
    assert solution.iterations == first.iterations + second.iterations < expected.iterations + 40
    assert solution.objective == pytest.approx(expected.objective, abs=1e-6)


@pytest.mark.parametrize("most", [10, 25, 40])
def test_all_who_are_asked_share_the_iterations_of_the_options(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        predictor_corrector, "PARAMETERS", replace(predictor_corrector.PARAMETERS, iterations_max=8, nearly_optimal=0.0)
    )
    options = replace(OPTIONS, barrier=1e-2, iterations_max=most, tolerance=1e-17)
    solution = PreparedProblem(LAYOUT, KERNELS, "fatrop", options).solve(LAYOUT, random_iterate(PROBLEM, 1), NOTHING)
    assert not solution.success
    assert solution.iterations <= most + 2  # fatrop counts the iteration at which it ends, each time


def test_without_known_multipliers_the_last_iteration_is_the_end() -> None:
    prepared = PreparedProblem(LAYOUT, KERNELS, "fatrop", replace(OPTIONS, iterations_max=14, barrier=1e-2))
    assert prepared.solve(LAYOUT, random_iterate(PROBLEM, 1)).ending is Ending.ITERATION_LIMIT


def unread(_: CreepingDetector, text: str) -> None:
    """Let a line pass."""


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_solve_that_does_not_creep_is_left_alone(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With and without anybody who looks for creeping it has the same iterations and the same bits."""
    problem = PROBLEMS[name]
    layout, kernels = Layout(problem), casadi_kernels(problem.system, problem.scheme)
    found: list[Solution] = []
    for _ in range(2):
        prepared = PreparedProblem(layout, kernels, "fatrop", OPTIONS)
        found.append(prepared.solve(layout, random_iterate(problem, 1)))
        monkeypatch.setattr(CreepingDetector, "read", unread)
    watched, unwatched = found
    assert watched.success
    assert watched.iterations == unwatched.iterations
    assert (watched.iterate.state == unwatched.iterate.state).all()
    assert (watched.multipliers.constraints == unwatched.multipliers.constraints).all()
