"""The budget of a stage: what is solved in vain is counted, and ends with an honest answer; nothing else is."""

import dataclasses

import pytest
from races import SIXTEEN, SMALL, planned, prepared, settings
from test_solving import asked, session, small

from airrace.procedure import budget
from airrace.procedure.budget import BUDGET_EXHAUSTED, FEWEST_INTERVALS, PER_INTERVAL, Budget
from airrace.procedure.guess import first_mesh
from airrace.procedure.progress import Silent
from airrace.procedure.result import Outcome, Stage, StageResult
from airrace.procedure.run import optimize
from airrace.procedure.settings import GuessKind, MeshSettings
from airrace.procedure.solve_and_refine import solve_with_refinement
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.start import InitialBarrier, Start


def limited(work: float, *verdicts: str) -> SolverSession:
    """Solvers that answer as told, after three iterations each."""
    used = session(*verdicts)
    used.budget = Budget(work)
    return used


def test_a_race_may_take_more_the_longer_it_is_and_the_finer_its_mesh() -> None:
    plan, mesh = planned(SIXTEEN), MeshSettings()
    intervals = sum(len(phase) for phase in first_mesh(plan, mesh))
    assert intervals > FEWEST_INTERVALS
    assert Budget.of(plan, mesh).work == PER_INTERVAL * intervals
    assert Budget.of(planned(SMALL), dataclasses.replace(mesh, interval=9.0)).work == PER_INTERVAL * FEWEST_INTERVALS
    assert Budget.of(plan, dataclasses.replace(mesh, interval=0.05)).work > 2.5 * Budget.of(plan, mesh).work


def test_only_what_is_solved_in_vain_is_counted_by_what_it_costs() -> None:
    problem, made = small()
    used = limited(1e9, "solved", "stuck", "infeasible")
    used.solve(problem, made, "all phases", barrier=0.1)
    assert used.budget.spent == 0
    used.solve(problem, made, "all phases", barrier=0.1)  # by fatrop, then by IPOPT, whose iterations count twice
    assert used.budget.spent == 3 * problem.intervals + 2 * 3 * problem.intervals
    used.begin()
    assert used.budget.spent == 0


def test_a_solver_may_take_what_is_left_and_none_is_asked_after_that() -> None:
    problem, made = small()
    used = limited(4.5 * problem.intervals, "stuck")
    solution = used.solve(problem, made, "all phases", barrier=0.1)
    assert [(name, options.iterations_max) for name, options, _ in asked(used)] == [("fatrop", 5), ("ipopt", 1)]
    again = used.solve(problem, made, "all phases", barrier=0.1)
    assert solution is not None
    assert again is not None
    assert (solution.status, again.status, again.success) == ("stuck", BUDGET_EXHAUSTED, False)
    assert len(asked(used)) == len(used.attempts) == 2
    used.attempt(problem, made, "why", "fatrop", asked(used)[0][1], beyond_budget=True)
    assert len(asked(used)) == 3


def test_a_stage_whose_budget_is_spent_has_not_converged_and_says_what_it_came_to() -> None:
    problem, made = small()
    starts = [lambda: Start(prepared(SMALL), problem, made, InitialBarrier.COLD)] * 2
    used = limited(2.0 * problem.intervals, "stuck")
    result = solve_with_refinement(used, starts)
    assert result.outcome is Outcome.NOT_CONVERGED
    assert result.message.startswith("not converged: fatrop gave up (stuck), most violated: nothing; ")
    assert BUDGET_EXHAUSTED in result.message
    assert len(result.attempts) == 1


def flown(threads: int) -> StageResult:
    run = optimize(SMALL, settings(GuessKind.PLAN), until=Stage.POINT_MASS, threads=threads, progress=Silent())
    *_, result = run
    return result


def test_a_budget_ends_a_run_after_the_same_work_with_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "PER_INTERVAL", 5)
    one, two = flown(1), flown(2)
    assert one.outcome is Outcome.NOT_CONVERGED
    assert BUDGET_EXHAUSTED in one.message
    assert [(a.purpose, a.solver, a.status, a.iterations) for a in one.attempts] == [
        (a.purpose, a.solver, a.status, a.iterations) for a in two.attempts
    ]


def test_a_sound_run_is_the_same_with_a_hundredth_of_its_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = flown(1)
    monkeypatch.setattr(budget, "PER_INTERVAL", PER_INTERVAL // 100)
    assert (flown(1).trajectory.state == whole.trajectory.state).all()
    assert whole.certified
