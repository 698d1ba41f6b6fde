"""The solver cascade and the homotopy, with solvers that fail on purpose."""

import dataclasses
import signal
from collections.abc import Callable, Sequence
from threading import Event
from typing import Any

import numpy as np
import pytest
from races import RACES, SIXTEEN, SMALL, planned, prepared, settings

from airrace.errors import SolverCrash
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import KktError
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.interface import Ending, Multipliers, SolverOptions
from airrace.optimal_control.solvers.messages import IterationReport
from airrace.optimal_control.solvers.service import SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.procedure import solver_session
from airrace.procedure.guess import first_mesh, guess, phase_piece
from airrace.procedure.homotopy import SMALLEST_STEP, fixed_state, solve_homotopy
from airrace.procedure.mesh_loop import solve_certified, solve_from_starts
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult, Status
from airrace.procedure.settings import GuessKind, MeshSettings, Settings
from airrace.procedure.solver_session import (
    CONTINUATIONS_MAX,
    INTERVALS_MIN,
    MEASURED,
    NEARLY_FEASIBLE,
    TIME_GAIN_MIN,
    WARM_ITERATIONS_MAX,
    WORK_PER_INTERVAL,
    Budget,
    SolverPool,
    SolverSession,
)
from airrace.procedure.stage import Stage
from airrace.procedure.warm_start import InitialBarrier, Start

STALLED, FAULTY, KILLED = "stalled", "faulty", "killed"


class Canned(SolverService):
    """Answers without solving: each solve returns its guess with the next verdict, the last one from then on."""

    def __init__(self, *verdicts: str) -> None:
        self.verdicts = list(verdicts)
        self.asked: list[tuple[str, SolverOptions, Problem]] = []
        self.known: list[Multipliers | None] = []
        self.threads: list[int | None] = []
        self._process = None

    def stop_unless_started_here(self) -> None:
        """There is no process."""

    def solve(
        self,
        problem: Problem,
        guess: Iterate,
        *,
        solver: str,
        options: SolverOptions,
        multipliers: Multipliers | None = None,
        on_iteration: Callable[[IterationReport], None] | None = None,
        threads: int | None = None,
        stall_seconds: float | None = None,
    ) -> ProgramSolution:
        self.asked.append((solver, options, problem))
        self.known.append(multipliers)
        self.threads.append(threads)
        verdict = self.verdicts.pop(0) if len(self.verdicts) > 1 else self.verdicts[0]
        if verdict == STALLED:
            raise SolverTimeout("no iteration finished within 1 s")
        if verdict in (FAULTY, KILLED):
            raise SolverCrash("the solver process died", -(signal.SIGSEGV if verdict == FAULTY else 9))
        layout = Layout(problem)
        return ProgramSolution(
            solver=solver,
            status=verdict,
            success=verdict in ("solved", "inexact"),
            ending=Ending.INFEASIBLE if verdict == "infeasible" else Ending.UNKNOWN,
            iterate=guess,
            multipliers=Multipliers(np.zeros(layout.constraints), np.zeros(layout.unknowns)),
            objective=0.0,
            kkt=KktError(0.0, {"solved": 0.0, "nearly": 5e-7, "inexact": 2e-6}.get(verdict, 1.0), 0.0),
            worst="nothing",
            iterations=3,
            seconds=0.5,
            derivative_seconds=0.25,
        )


def session(*verdicts: str) -> SolverSession:
    return SolverSession(Canned(*verdicts), Settings(), Silent())


def asked(of: SolverSession) -> Sequence[tuple[str, SolverOptions, Problem]]:
    assert isinstance(of.service, Canned)
    return of.service.asked


def small() -> tuple[Problem, Iterate]:
    mesh = first_mesh(planned(SMALL), Settings().mesh)
    return prepared(SMALL).problem(mesh), guess(planned(SMALL), mesh)


def test_killed_solver_process_ends_the_run() -> None:
    with pytest.raises(SolverCrash):
        session(KILLED).solve(*small(), "all phases", barrier=InitialBarrier.COLD)


@pytest.mark.parametrize(
    ("verdicts", "solvers"),
    [
        (["solved"], ["interior-point"]),
        (["stuck", "solved"], ["interior-point", "ipopt"]),
        ([STALLED, "solved"], ["interior-point", "ipopt"]),
        ([FAULTY, "solved"], ["interior-point", "ipopt"]),
    ],
)
def test_fallback_is_asked_only_where_the_primary_solver_fails(verdicts: list[str], solvers: list[str]) -> None:
    used = session(*verdicts)
    problem, made = small()
    solution = used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    assert solution is not None
    assert solution.success
    assert [one.solver for one in used.attempts] == solvers
    assert used.attempts[-1].success
    assert not any(one.success for one in used.attempts[:-1])


def test_optimum_by_its_measured_errors_counts_and_says_so() -> None:
    used = session("nearly", "solved")
    problem, made = small()
    solution = used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    assert solution is not None
    assert solution.success
    (attempt,) = used.attempts
    assert attempt.success
    assert attempt.status == solution.status == f"nearly; {MEASURED}"


class Exhausted(Canned):
    """A service whose solves run out of iterations after a gain of time, s, at points of some violation."""

    gained, violation = 1.0, 1e-3

    def solve(self, problem: Problem, guess: Iterate, **rest: Any) -> ProgramSolution:
        found = super().solve(problem, guess, **rest)
        faster = dataclasses.replace(guess, durations=guess.durations - self.gained / len(guess.durations))
        kkt = KktError(self.violation, 1.0, 0.0)
        return dataclasses.replace(found, ending=Ending.ITERATION_LIMIT, iterate=faster, kkt=kkt)


@pytest.mark.parametrize(
    ("gained", "violation", "descents"),
    [
        (1.0, 1e-3, CONTINUATIONS_MAX),  # on its way down
        (0.5 * TIME_GAIN_MIN, 1e-3, 0),  # at a standstill
        (1.0, NEARLY_FEASIBLE, 0),  # far from feasible
    ],
)
def test_a_solve_that_ran_out_of_iterations_on_its_way_down_is_continued(
    gained: float, violation: float, descents: int
) -> None:
    service = Exhausted("stuck")
    service.gained, service.violation = gained, violation
    used = SolverSession(service, Settings(), Silent())
    problem, made = small()
    used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    own = ["all phases", *["all phases, farther down"] * descents]
    assert [one.purpose for one in used.attempts] == own * 2  # by both solvers
    barriers = [one.barrier for _, one, _ in asked(used)]
    assert barriers == [InitialBarrier.COLD.value, *[InitialBarrier.COARSE.value] * descents] * 2


@pytest.mark.parametrize("barrier", [InitialBarrier.OTHER_MESH, InitialBarrier.OTHER_PROBLEM])
def test_known_multipliers_lead_on_once_before_a_solve_without_them(barrier: InitialBarrier) -> None:
    service = Exhausted("stuck")
    service.gained = -1.0  # a guess of another plant may be too fast
    used = SolverSession(service, Settings(), Silent())
    problem, made = small()
    layout = Layout(problem)
    known = Multipliers(np.zeros(layout.constraints), np.zeros(layout.unknowns))
    used.solve(problem, made, "all phases", barrier=barrier, multipliers=known)
    assert [one.purpose for one in used.attempts[:3]] == ["all phases", "all phases, farther down", "all phases"]
    most = [options.iterations_max for _, options, _ in asked(used)[:3]]
    assert most == [WARM_ITERATIONS_MAX, *[Settings().solver.iterations_max] * 2]
    assert [one is None for one in service.known[:3]] == [False, False, True]
    assert asked(used)[1][1].barrier == InitialBarrier.OTHER_PROBLEM.value
    fewer = SolverSession(Exhausted("stuck"), Settings(), Silent())
    fewer.solve(problem, made, "all phases", barrier=barrier, multipliers=known, iterations_max=50)
    assert [one.purpose for one in fewer.attempts] == ["all phases"] * 3


@pytest.mark.parametrize("reference_only", [False, True])
def test_inexact_optimum_is_solved_closer_unless_it_is_only_compared_with(reference_only: bool) -> None:
    used = session("inexact")
    problem, made = small()
    solution = used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD, reference_only=reference_only)
    assert solution is not None
    assert solution.success
    assert [one.purpose for one in used.attempts] == ["all phases", "all phases, closer"][: 1 if reference_only else 2]


def test_last_answer_is_returned_where_nobody_succeeds_and_none_where_no_solver_comes_back() -> None:
    problem, made = small()
    solution = session("stuck", "infeasible").solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    assert solution is not None
    assert (solution.solver, solution.status) == ("ipopt", "infeasible")
    alone = session("stuck", STALLED).solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    assert alone is not None
    assert alone.solver == "interior-point"
    used = session(STALLED)
    assert used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD) is None
    assert [one.status for one in used.attempts] == ["no iteration finished within 1 s"] * 2


def test_known_multipliers_are_tried_first_and_for_fewer_iterations() -> None:
    problem, start = small()
    layout = Layout(problem)
    known = Multipliers(np.zeros(layout.constraints), np.zeros(layout.unknowns))
    used = session("infeasible", "solved")
    solution = used.solve(problem, start, "joint", barrier=InitialBarrier.OTHER_MESH, multipliers=known)
    assert solution is not None
    assert solution.success
    assert isinstance(used.service, Canned)
    assert used.service.known == [known, None]
    assert [options.iterations_max for _, options, _ in asked(used)] == [WARM_ITERATIONS_MAX, 500]
    assert [solver for solver, _, _ in asked(used)] == ["interior-point", "interior-point"]
    failing = session("infeasible")
    failing.solve(problem, start, "joint", barrier=InitialBarrier.OTHER_MESH, multipliers=known)
    assert isinstance(failing.service, Canned)
    assert [solver for solver, _, _ in asked(failing)] == ["interior-point", "interior-point", "ipopt"]
    assert failing.service.known == [known, None, None]  # a solver that begins without multipliers is asked once


def test_search_beside_has_a_thread_to_itself_until_it_has_found() -> None:
    problem, start = small()
    told, searching, going_on = SolverSession(Canned("solved"), Settings(), Silent(), threads=2), Event(), Event()

    def search(_: SolverPool) -> str:
        searching.set()
        assert going_on.wait(10.0)
        return "found"

    with told.search_in_background(search) as beside:
        assert searching.wait(10.0)
        told.solve(problem, start, "joint", barrier=InitialBarrier.COLD)
        going_on.set()
        assert beside.result() == "found"
        told.solve(problem, start, "joint", barrier=InitialBarrier.COLD)
    assert isinstance(told.service, Canned)
    assert told.service.threads == [1, 2]


def test_settings_reach_the_solver() -> None:
    used = session("stuck")
    chosen = dataclasses.replace(Settings().solver, tolerance=1e-5, iterations_max=7, primary="ipopt")
    used.settings = dataclasses.replace(Settings(), solver=chosen)
    problem, made = small()
    used.solve(problem, made, "all phases", barrier=InitialBarrier.COARSE)
    # The fallback is the primary solver here: it is asked once.
    used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    near = SolverOptions(1e-5, 7, InitialBarrier.COARSE.value, curvature=True)
    cold = SolverOptions(1e-5, 7, InitialBarrier.COLD.value, curvature=True)
    assert [(name, options) for name, options, _ in asked(used)] == [("ipopt", near), ("ipopt", cold)]


def test_timings_add_up_and_begin_anew_with_every_stage() -> None:
    used = session("stuck", "solved")
    problem, made = small()
    used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    timings = used.timings()
    assert (timings.solve, timings.derivatives) == (1.0, 0.5)
    used.reset_log()
    assert used.attempts == []
    assert used.timings().solve == used.timings().derivatives == 0.0


# the homotopy


@pytest.mark.parametrize("name", RACES)
def test_homotopy_that_nobody_can_fly_leaves_the_race_as_planned_and_says_so(name: str) -> None:
    stage_problem, used = prepared(RACES[name]), session("stuck")
    result = solve_homotopy(stage_problem, used).result
    made = guess(stage_problem.plan, first_mesh(stage_problem.plan, Settings().mesh))
    assert result.outcome is Status.SOLVED  # it is a guess, whatever it is worth
    assert np.allclose(result.trajectory.state, made.state, atol=1e-12)
    phases = result.trajectory.phases
    assert result.remarks == f"left as planned: {', '.join(phases)}"
    assert not any(attempt.success for attempt in result.attempts)


def test_homotopy_tries_the_whole_way_first() -> None:
    stage_problem, used = prepared(SMALL), session("solved")
    result = solve_homotopy(stage_problem, used).result
    parts = [attempt.purpose.rpartition("part ")[2] for attempt in result.attempts]
    assert parts == ["0", "1"] * 3
    assert result.remarks == ""


@pytest.mark.parametrize(
    ("verdicts", "parts", "remarks"),
    [
        (["solved", "stuck", "stuck", "solved"], [0.0, 1.0, 0.5, 0.25, 0.75, 1.0], True),
        (["solved", *["stuck"] * 5, "solved"], [0.0, 1.0, 0.5, 0.25, 0.125, 0.0625], False),
    ],
    ids=["grows again", "too small"],
)
def test_step_that_fails_is_halved_until_it_leads_to_the_real_gate_or_is_too_small(
    verdicts: list[str], parts: list[float], remarks: bool
) -> None:
    result = solve_homotopy(prepared(SMALL), session(*verdicts)).result
    first = [attempt for attempt in result.attempts if attempt.purpose.startswith("first -> pylon")]
    made = [float(attempt.purpose.rpartition("part ")[2]) for attempt in first]
    assert made[:6] == parts
    assert min(part for part in made if part) >= SMALLEST_STEP
    assert not remarks or (len(made) == 6 and result.remarks == "")


def test_a_phase_that_failed_is_not_tried_again_on_another_lap() -> None:
    stage_problem = prepared(SIXTEEN)

    class Failing(Canned):
        def solve(self, problem: Problem, guess: Iterate, **rest: Any) -> ProgramSolution:
            found = super().solve(problem, guess, **rest)
            return dataclasses.replace(found, success=not problem.phases[-1].name.endswith(f":{name}"))

    name = stage_problem.plan.waypoints[3].passage.name.partition(":")[2]
    used = SolverSession(Failing("stuck"), Settings(), Silent())
    result = solve_homotopy(stage_problem, used).result
    first, second = (one for one in result.trajectory.phases if one.endswith(f":{name}"))
    assert result.remarks == f"left as planned: {first}, {second}"
    tried = {attempt.purpose.partition(",")[0] for attempt in result.attempts}
    assert tried == set(result.trajectory.phases) - {second}


def test_short_horizon_of_phases_is_solved_together() -> None:
    stage_problem, used = prepared(RACES["rovinj_2014"]), session("solved")
    solve_homotopy(stage_problem, used)
    counts = [len(problem.phases) for _, _, problem in asked(used)]
    assert counts == [1, 1, *[2] * (len(counts) - 2)]


def test_piece_begins_exactly_where_the_one_before_ended() -> None:
    problem, made = small()
    state = phase_piece(made, problem, 1).state[:, 0]
    start = fixed_state(prepared(SMALL), state)
    assert [bounds.lower for bounds in start.bounds.values()] == state.tolist()
    assert all(bounds.lower == bounds.upper for bounds in start.bounds.values())
    assert list(start.bounds) == [quantity.name for quantity in problem.system.states]


def limited(work: float, *verdicts: str) -> SolverSession:
    """Solvers that answer as told, after three iterations each."""
    used = session(*verdicts)
    used.budget = Budget(work)
    return used


def test_a_race_may_take_more_the_longer_it_is_and_the_finer_its_mesh() -> None:
    plan, mesh = planned(SIXTEEN), MeshSettings()
    intervals = sum(len(phase) for phase in first_mesh(plan, mesh))
    assert intervals > INTERVALS_MIN
    assert Budget.from_plan(plan, mesh).work == WORK_PER_INTERVAL * intervals
    assert (
        Budget.from_plan(planned(SMALL), dataclasses.replace(mesh, interval=9.0)).work
        == WORK_PER_INTERVAL * INTERVALS_MIN
    )
    assert (
        Budget.from_plan(plan, dataclasses.replace(mesh, interval=0.05)).work > 2.5 * Budget.from_plan(plan, mesh).work
    )


def test_only_what_is_solved_in_vain_is_counted_by_what_it_costs() -> None:
    problem, made = small()
    used = limited(1e9, "solved", "stuck", "infeasible")
    used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    assert used.budget.spent == 0
    used.solve(
        problem, made, "all phases", barrier=InitialBarrier.COLD
    )  # by the interior point method, then by IPOPT, whose iterations count twice
    assert used.budget.spent == 3 * problem.intervals + 2 * 3 * problem.intervals
    used.reset_log()
    assert used.budget.spent == 0


def test_a_solver_may_take_what_is_left_and_none_is_asked_after_that() -> None:
    problem, made = small()
    used = limited(4.5 * problem.intervals, "stuck")
    solution = used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    assert [(name, options.iterations_max) for name, options, _ in asked(used)] == [("interior-point", 5), ("ipopt", 1)]
    again = used.solve(problem, made, "all phases", barrier=InitialBarrier.COLD)
    assert solution is not None
    assert again is not None
    assert (solution.status, again.status, again.success) == ("stuck", Ending.BUDGET_EXHAUSTED.value, False)
    assert len(asked(used)) == len(used.attempts) == 2
    used.attempt(problem, made, "why", "interior-point", asked(used)[0][1], beyond_budget=True)
    assert len(asked(used)) == 3


def test_a_stage_whose_budget_is_spent_has_not_converged_and_says_what_it_came_to() -> None:
    problem, made = small()
    starts = [lambda: Start(prepared(SMALL), problem, made, InitialBarrier.COLD)] * 2
    used = limited(2.0 * problem.intervals, "stuck")
    result = solve_from_starts(used, starts, solve_certified)
    assert result.outcome is Status.NOT_CONVERGED
    assert result.message.startswith("not converged: interior-point gave up (stuck), most violated: nothing; ")
    assert Ending.BUDGET_EXHAUSTED.value in result.message
    assert len(result.attempts) == 1


@pytest.mark.parametrize(
    ("verdict", "conflict", "outcome", "message"),
    [
        (
            "infeasible",
            "the limits contradict each other at a",
            Status.INFEASIBLE,
            "the limits contradict each other at a",
        ),
        (
            "stuck",
            "the limits contradict each other at a",
            Status.NOT_CONVERGED,
            "; perhaps the limits contradict each",
        ),
        ("stuck", None, Status.NOT_CONVERGED, "; the legs around it are feasible by themselves"),
    ],
)
def test_where_no_solver_claims_it_a_conflict_is_only_a_conjecture(
    verdict: str, conflict: str | None, outcome: Status, message: str
) -> None:
    problem, made = small()
    starts = [lambda: Start(prepared(SMALL), problem, made, InitialBarrier.COLD)]
    result = solve_from_starts(session(verdict), starts, solve_certified, diagnose=lambda *_: conflict)
    assert result.outcome is outcome
    assert message in result.message
    assert ("not converged" in result.message) is (outcome is Status.NOT_CONVERGED)


def flown(threads: int) -> StageResult:
    run = optimize(SMALL, settings(GuessKind.PLAN), until=Stage.POINT_MASS, threads=threads, progress=Silent())
    *_, result = run
    return result


def test_a_budget_ends_a_run_after_the_same_work_with_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver_session, "WORK_PER_INTERVAL", 5)
    one, two = flown(1), flown(2)
    assert one.outcome is Status.NOT_CONVERGED
    assert Ending.BUDGET_EXHAUSTED.value in one.message
    assert [(a.purpose, a.solver, a.status, a.iterations) for a in one.attempts] == [
        (a.purpose, a.solver, a.status, a.iterations) for a in two.attempts
    ]


def test_a_sound_run_is_the_same_with_a_hundredth_of_its_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = flown(1)
    monkeypatch.setattr(solver_session, "WORK_PER_INTERVAL", WORK_PER_INTERVAL // 100)
    assert (flown(1).trajectory.state == whole.trajectory.state).all()
    assert whole.certified
