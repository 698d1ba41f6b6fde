"""Limits that contradict each other are found out while the first flight is pieced together, by all that is asked."""

import dataclasses
from collections.abc import Sequence

import pytest
from races import SIXTEEN, SMALL, planned, prepared, settings
from test_solving import STALLED, Canned, asked, session

from airrace.optimal_control.problem import Iterate, Problem
from airrace.procedure.fidelity_continuation import FidelityContinuation
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.homotopy import INFEASIBILITY_TESTS_MAX, fly_homotopy
from airrace.procedure.infeasibility.local_infeasibility import contradiction
from airrace.procedure.progress import Silent
from airrace.procedure.result import Outcome, Stage
from airrace.procedure.settings import GuessKind, SearchEffort, Settings
from airrace.procedure.solver_session import SolverSession

TORN = 4


def sixteen() -> tuple[Problem, Iterate]:
    mesh = first_mesh(planned(SIXTEEN), Settings().mesh)
    return prepared(SIXTEEN).problem(mesh), guess(planned(SIXTEEN), mesh)


@pytest.mark.parametrize(
    ("verdicts", "found", "solvers"),
    [
        (["stuck", "stuck", "infeasible", "infeasible"], True, ["fatrop", "fatrop", "ipopt", "ipopt"]),
        (["stuck", "solved"], False, ["fatrop", "fatrop"]),
        (["stuck", "stuck", "stuck"], False, ["fatrop", "fatrop", "ipopt"]),
        (["stuck", "stuck", "infeasible", "solved"], False, ["fatrop", "fatrop", "ipopt", "ipopt"]),
        ([STALLED], False, ["fatrop"]),
    ],
)
def test_all_have_to_agree_that_there_is_no_flight(verdicts: list[str], found: bool, solvers: list[str]) -> None:
    used = session(*verdicts)
    problem, made = sixteen()
    result = contradiction(used, problem, TORN, [made, made])
    assert (result is not None) is found
    assert [solver for solver, _, _ in asked(used)] == solvers
    assert all([phase.name for phase in one.phases] == list(names(problem, TORN)) for _, _, one in asked(used))


def names(problem: Problem, torn: int) -> Sequence[str]:
    return [phase.name for phase in problem.phases[torn - 2 : torn + 3]]


def test_a_single_solver_contradicts_nothing() -> None:
    used = session("infeasible")
    used.settings = dataclasses.replace(
        used.settings, solver=dataclasses.replace(used.settings.solver, fallback="fatrop")
    )
    problem, made = sixteen()
    assert contradiction(used, problem, TORN, [made]) is None
    assert asked(used) == []


@pytest.mark.parametrize("answer", [True, False])
def test_a_homotopy_asks_of_the_first_phases_that_fail_and_ends_where_they_are_hopeless(answer: bool) -> None:
    used, tested_phases = session("stuck"), list[int]()

    def window_is_infeasible(race: Problem, index: int, guesses: Sequence[Iterate]) -> bool:
        tested_phases.append(index)
        assert all(one.state.shape == (len(race.system.states), race.intervals + 1) for one in guesses)
        return answer

    result = fly_homotopy(prepared(SIXTEEN), used, window_is_infeasible)
    assert tested_phases == ([0] if answer else list(range(INFEASIBILITY_TESTS_MAX)))
    assert result.outcome is Outcome.SOLVED  # it is a guess, whatever it is worth
    assert result.remarks == f"left as planned: {', '.join(result.trajectory.phases)}"
    assert (len(asked(used)) == 1) is answer


FOUND_OUT = ("stuck", "stuck", "stuck", "infeasible", "infeasible")  # the first piece, then its legs


@pytest.mark.parametrize(
    ("kind", "before", "search"),
    [
        (GuessKind.HOMOTOPY, [], SearchEffort.QUICK),
        (GuessKind.HOMOTOPY, [], SearchEffort.OFF),
        (GuessKind.PLAN, ["stuck", "stuck"], SearchEffort.OFF),  # the plan, then all its limits relaxed
    ],
)
def test_a_race_that_contradicts_itself_is_infeasible_and_solved_no_more(
    kind: GuessKind, before: list[str], search: SearchEffort
) -> None:
    chosen = settings(kind, search=search)
    used = SolverSession(Canned(*before, *FOUND_OUT, "stuck", "solved"), chosen, Silent())
    ladder = FidelityContinuation(SMALL, chosen, ())
    if kind is GuessKind.HOMOTOPY:
        assert ladder.climb(Stage.HOMOTOPY, used).outcome is Outcome.SOLVED
        used.begin()
    result = ladder.climb(Stage.POINT_MASS, used)
    assert result.outcome is Outcome.INFEASIBLE
    assert result.stage is Stage.POINT_MASS
    first = result.trajectory.phases[0]
    assert result.remarks.startswith(f"the limits contradict each other at {first}; without the limit of ")
    assert [one.purpose for one in result.attempts if one.purpose.startswith("all ")] == [
        f"all {len(result.trajectory.phases)} phases" for _ in before[1:]
    ]
    purposes = [one.purpose for one in result.attempts]
    explaining = next(place for place, one in enumerate(reversed(purposes), start=1) if "without" in one) - 1
    assert len(asked(used)) - explaining == len(before) + len(FOUND_OUT) + 2  # two limits are taken away
