"""From which start a stage is solved, and by which solver: the order, with solvers that fail on purpose."""

import dataclasses
from collections.abc import Callable

import pytest
from races import OPTIMA, PLAN, SMALL, models_of, prepared, solve_stages
from test_solving import STALLED, Canned, asked

from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Certificate, Item
from airrace.optimal_control.evidence import Evidence
from airrace.optimal_control.problem import Iterate, Problem
from airrace.procedure import mesh_loop
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.mesh_loop import solve_certified, solve_from_starts
from airrace.procedure.procedure import solve_stage_above
from airrace.procedure.result import Silent, StageResult, Status
from airrace.procedure.settings import MeshSettings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start


@pytest.fixture(autouse=True)
def flights_that_fly_are_certified(monkeypatch: pytest.MonkeyPatch) -> None:
    """Canned answers have no multipliers and know of no other mesh."""

    def certify(problem: Problem, iterate: Iterate, evidence: Evidence, *_: object, **__: object) -> Certificate:
        return Certificate("canned", (*evidence.check.items, Item(RACE_TIME_CHANGE, 0.0, 5e-3, "s")))

    monkeypatch.setattr(mesh_loop, "certify", certify)


def canned(*verdicts: str) -> SolverSession:
    """Solvers that answer as told; no other mesh is tried."""
    unrefined = dataclasses.replace(PLAN, mesh=MeshSettings(refinements_max=0))
    return SolverSession(Canned(*verdicts), unrefined, Silent())


@pytest.mark.parametrize("kept", range(1, len(OPTIMA)))
def test_stage_that_fails_says_so(kept: int) -> None:
    finished, used = solve_stages(SMALL)[:kept], canned("stuck")
    stage, done = OPTIMA[kept], {result.stage: result for result in finished}
    models = models_of(SMALL, PLAN, stage, *done)
    result = solve_stage_above(models, used, solve_certified, stage, done)
    assert (result.stage, result.outcome) == (OPTIMA[kept], Status.NOT_CONVERGED)
    assert not result.certified
    assert "gave up (stuck)" in result.message


def solved_start(*, torn: float = 0.0) -> Start:
    """The point mass's optimum; or a flight that is none, for its last state is so far (m) from where it leads."""
    stage_problem, flown = prepared(SMALL), solve_stages(SMALL)[0].trajectory
    iterate = iterate_of(flown)
    state = iterate.state.copy()
    state[0, -1] += torn
    begun = Iterate(iterate.durations, state, iterate.control)
    return Start(stage_problem, stage_problem.problem(mesh_of(flown)), begun, InitialBarrier.OTHER_PROBLEM)


def tried(used: SolverSession, *starts: Start) -> tuple[StageResult, list[int], list[str]]:
    """The result; which starts were made, in order; which solvers were asked."""
    made: list[int] = []

    def maker(number: int) -> Callable[[], Start]:
        def make() -> Start:
            made.append(number)
            return starts[number]

        return make

    result = solve_from_starts(used, [maker(number) for number in range(len(starts))], solve_certified)
    return result, made, [solver for solver, _, _ in asked(used)]


@pytest.mark.parametrize(
    ("verdicts", "made", "solvers"),
    [
        (["solved"], [0], ["interior-point"]),
        (["stuck", "solved"], [0, 1], ["interior-point", "interior-point"]),
        (["stuck", "stuck", "solved"], [0, 1], ["interior-point", "interior-point", "ipopt"]),
        (["stuck", "stuck", "stuck", "solved"], [0, 1], ["interior-point", "interior-point", "ipopt", "ipopt"]),
    ],
)
def test_primary_solver_is_asked_from_all_starts_before_the_fallback(
    verdicts: list[str], made: list[int], solvers: list[str]
) -> None:
    other = solved_start()
    nudged = dataclasses.replace(other.guess, durations=(1.0 + 1e-9) * other.guess.durations)
    other = dataclasses.replace(other, guess=nudged)
    result, made_then, asked_then = tried(canned(*verdicts), solved_start(), other)
    assert result.certified
    assert (made_then, asked_then) == (made, solvers)


def test_a_start_with_the_guess_of_an_earlier_one_is_not_solved_again() -> None:
    result, made, solvers = tried(canned("stuck", "stuck", "stuck"), solved_start(), solved_start())
    assert result.outcome is Status.NOT_CONVERGED
    assert (made, solvers) == ([0, 1], ["interior-point", "ipopt"])


def test_certified_optimum_of_a_later_start_is_preferred_to_a_flight_that_is_torn() -> None:
    result, made, _ = tried(canned("solved"), solved_start(torn=10.0), solved_start())
    assert result.certified
    assert made == [0, 1]


def test_first_optimum_counts_where_none_is_certified() -> None:
    starts = solved_start(torn=10.0), solved_start(torn=20.0)
    result, _, solvers = tried(canned("solved"), *starts)
    assert result.outcome is Status.NOT_CERTIFIED
    assert (result.trajectory.state == starts[0].guess.state).all()
    assert solvers == ["interior-point", "interior-point"]


def test_no_further_start_is_made_once_a_solver_hangs() -> None:
    result, made, solvers = tried(canned(STALLED), solved_start(), solved_start())
    assert result.outcome is Status.TIMEOUT
    assert (made, solvers) == ([0], ["interior-point", "ipopt"])
