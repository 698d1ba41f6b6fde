"""Near an optimum predictor-corrector steps lead to it in fewer iterations than fatrop, which is asked if they fail."""

from dataclasses import replace

import numpy as np
import pytest
from small_problems import PROBLEMS, random_iterate

from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.multiplier_transfer import transfer_multipliers
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import divide
from airrace.optimal_control.solvers import predictor_corrector, riccati
from airrace.optimal_control.solvers.solver import (
    NEAR_BARRIER,
    SOLVERS,
    Multipliers,
    PreparedProblem,
    Solution,
    SolverOptions,
)

STEPS = "predictor-corrector"
LIMITS_KEPT = 1e-5  # fatrop relaxes limits by 1e-8 after their factors of 1e-2 and more


def solved(
    problem: Problem, guess: Iterate, multipliers: Multipliers | None = None, barrier: float = NEAR_BARRIER
) -> Solution:
    kernels = casadi_kernels(problem.system, problem.scheme)
    options = SolverOptions(tolerance=1e-8, iterations_max=200, barrier=barrier)
    prepared = PreparedProblem(Layout(problem), kernels, SOLVERS["fatrop"], options, threads=1)
    found = prepared.solve(Layout(problem), guess, multipliers)
    assert found.success
    return found


def bisect_all(name: str) -> tuple[Problem, Iterate, Multipliers]:
    """A problem on a mesh twice as fine, with the optimum on its own mesh and its multipliers carried over."""
    problem = PROBLEMS[name]
    first = solved(problem, random_iterate(problem, 1), barrier=0.1)
    mesh, guess = divide(problem.mesh, first.iterate, None, np.full(problem.intervals, 2))
    phases = tuple(replace(phase, fractions=cut) for phase, cut in zip(problem.phases, mesh, strict=True))
    finer = replace(problem, phases=phases)
    return finer, guess, transfer_multipliers(first.multipliers, Layout(problem), Layout(finer))


@pytest.mark.parametrize("name", ["everything", "jumps", "final cost", "one phase"])
def test_steps_lead_to_the_optimum_that_fatrop_finds_in_fewer_iterations(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, guess, multipliers = bisect_all(name)
    found = solved(problem, guess, multipliers)
    monkeypatch.setattr(riccati, "library", lambda: None)
    expected = solved(problem, guess, multipliers)
    assert STEPS in found.status
    assert STEPS not in expected.status
    assert found.iterations < expected.iterations
    assert found.objective == pytest.approx(expected.objective, abs=LIMITS_KEPT)
    assert found.kkt.largest < 1e-7
    assert found.multipliers.constraints == pytest.approx(expected.multipliers.constraints, abs=1e-3)


def test_fatrop_is_asked_where_steps_give_up(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, guess, multipliers = bisect_all("everything")
    expected = solved(problem, guess, multipliers)
    monkeypatch.setattr(predictor_corrector, "ITERATIONS_MAX", 1)
    found = solved(problem, guess, multipliers)
    assert STEPS not in found.status
    assert found.iterations > 1
    assert found.objective == pytest.approx(expected.objective, abs=LIMITS_KEPT)


def test_multipliers_that_mislead_do_not_change_the_optimum() -> None:
    problem, guess, multipliers = bisect_all("everything")
    expected = solved(problem, guess, multipliers)
    wrong = Multipliers(-multipliers.constraints[::-1].copy(), 0.3 * np.ones_like(multipliers.bounds))
    assert solved(problem, guess, wrong).objective == pytest.approx(expected.objective, abs=LIMITS_KEPT)


@pytest.mark.parametrize(("known", "barrier"), [(False, NEAR_BARRIER), (True, 10 * NEAR_BARRIER)])
def test_far_from_the_optimum_fatrop_is_asked_at_once(known: bool, barrier: float) -> None:
    problem, guess, multipliers = bisect_all("everything")
    assert STEPS not in solved(problem, guess, multipliers if known else None, barrier).status
