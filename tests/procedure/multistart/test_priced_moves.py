"""Moves to other routes that prices of the state at gates promise to be faster."""

from collections.abc import Callable, Set
from dataclasses import replace

import numpy as np
import pytest
from races import course, level, prepared
from search_races import OFF, SLALOM, open_session, planned_coarse_solution

from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure.multistart import priced_moves as pricing
from airrace.procedure.multistart.coarse_solution import CoarseSolution
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.priced_window import PricedWindow, RaceGuess, WindowFlight, WindowGuess
from airrace.procedure.multistart.search import QUICK, planned_starts
from airrace.procedure.multistart.window import Move, evaluate
from airrace.race import Race

GATES = (level("first", 0.0, 0.0, 0.0), level("middle", 600.0, 40.0, 10.0), level("last", 1200.0, 160.0, 20.0))
TWO_LEGS = replace(SLALOM, course=course("legs", *GATES))

Solve = Callable[[SolverService, tuple[PricedWindow, WindowGuess]], WindowFlight | None]


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """The windows that are solved, of one leg each."""
    windows: list[tuple[int, int]] = []
    solve: Solve = pricing._solve_window

    def record(service: SolverService, job: tuple[PricedWindow, WindowGuess]) -> WindowFlight | None:
        windows.append(job[0].window)
        return solve(service, job)

    monkeypatch.setattr(pricing, "LEGS_MAX", 1)
    monkeypatch.setattr(pricing, "_solve_window", record)
    return windows


def moves_of(base: CoarseSolution, race: Race, changed: Set[int] | None = None) -> list[Move]:
    """The moves around a flight to what the tightest plan leads to."""
    pace = QUICK.planning_radius.scale(base.stage_problem.plan.cruise)
    generator = MoveGenerator(base, race.course, pace)
    tightest = RaceGuess.of(planned_starts(prepared(race), race.course, QUICK)[-1])
    changed = set(range(len(base.problem.phases))) if changed is None else changed
    with open_session(OFF) as session, session.pool() as pool:
        return pricing.priced_moves(generator, changed, [tightest], race.course, pool)


def test_route_of_a_tight_plan_is_found_in_windows_between_gates(monkeypatch: pytest.MonkeyPatch) -> None:
    """The race's own plan is wide: its flight winds itself around the pylons."""
    monkeypatch.setattr(pricing, "LEGS_MAX", 2)
    base = planned_coarse_solution(SLALOM)
    saved: list[float] = []
    with open_session(OFF) as session:
        for move in moves_of(base, SLALOM):
            evaluated = evaluate(session.service, move)
            saved.append(0.0 if evaluated is None else evaluated.saved)
    assert max(saved) > 5.0


def test_move_crosses_the_gate_at_the_end_of_its_window_as_the_flight_through_it_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pricing, "LEGS_MAX", 2)
    flights: list[WindowFlight] = []
    solve: Solve = pricing._solve_window

    def record(service: SolverService, job: tuple[PricedWindow, WindowGuess]) -> WindowFlight | None:
        flight = solve(service, job)
        if flight is not None and job[0].window == (0, 2):
            flights.append(flight)
        return flight

    monkeypatch.setattr(pricing, "_solve_window", record)
    move = next(move for move in moves_of(planned_coarse_solution(SLALOM), SLALOM) if move.segment.number == 0)
    end, expected = move.pieces[1].state[:, -1], flights[0].iterate.state[:, -1]
    rows = [quantity.name in ("x", "y", "z", "V_K") for quantity in move.base.problem.system.states]
    assert end[rows] == pytest.approx(expected[rows], abs=1e-9)


def test_windows_in_which_another_plan_leads_to_the_same_flight_propose_no_move(solved: list[tuple[int, int]]) -> None:
    """Prices promise more than a race saves; they promise it to the flight's own pieces, too."""
    base = planned_coarse_solution(TWO_LEGS)
    promising = replace(base, errors=np.full_like(base.errors, 0.1))  # its pieces seem to take longer than they do
    assert moves_of(promising, TWO_LEGS) == []
    assert solved == [(0, 1), (1, 2)] * 2  # from the plan, and its own pieces


def test_windows_in_which_nothing_has_changed_are_not_solved(solved: list[tuple[int, int]]) -> None:
    moves_of(planned_coarse_solution(SLALOM), SLALOM, {1})
    assert set(solved) == {(1, 2)}
    solved.clear()
    moves_of(planned_coarse_solution(SLALOM), SLALOM, set())
    assert solved == []


def test_race_that_is_one_window_has_none(solved: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pricing, "LEGS_MAX", 3)
    assert moves_of(planned_coarse_solution(SLALOM), SLALOM) == []
    assert solved == []
