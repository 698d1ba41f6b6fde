"""Rough optima: solved well enough to be ranked, and honest about what their meshes gain."""

import dataclasses

import numpy as np
import pytest
from races import SHIPPED, SMALL, prepared
from search_races import OFF, SLALOM, open_session, optimum, planned_coarse_solution

from airrace.optimal_control.refinement import resample
from airrace.optimal_control.solvers.process.service import SolverService, SolverTimeout
from airrace.planning.plan import plan
from airrace.planning.race import Race
from airrace.procedure.multistart import coarse_solution
from airrace.procedure.multistart.budget import Radius, scaled
from airrace.procedure.multistart.coarse_solution import (
    INTERVAL,
    MOST,
    STEP,
    InitialGuess,
    intervals,
    planned_guess,
    solve_coarse,
    try_solve,
)
from airrace.procedure.start import InitialBarrier

HALF_CUBAN = SHIPPED["half_cuban_eight"]
each_small_race = pytest.mark.parametrize(
    "race",
    [
        pytest.param(SMALL, id="four gates"),
        pytest.param(SLALOM, id="slalom"),
        pytest.param(HALF_CUBAN, id="half cuban eight"),
    ],
)


@each_small_race
def test_sketch_is_near_the_certified_optimum_of_the_same_way(race: Race) -> None:
    assert planned_coarse_solution(race).race_time == pytest.approx(optimum(race, OFF).trajectory.race_time, abs=0.03)


@each_small_race
def test_sketch_is_never_deceived_by_its_own_errors(race: Race) -> None:
    found = planned_coarse_solution(race)
    counts = [len(phase) for phase in found.problem.mesh]
    for error, count in zip(found.errors.tolist(), counts, strict=True):
        assert abs(error) <= coarse_solution.ERROR_TOLERANCE or count == MOST


def test_errors_of_integration_on_a_coarse_mesh_are_told_in_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Corrected, a race time is nearer to that of the same mesh where intervals are integrated more finely."""
    monkeypatch.setattr(coarse_solution, "INTERVAL", 0.5)
    monkeypatch.setattr(coarse_solution, "FEWEST", 3)
    monkeypatch.setattr(coarse_solution, "STEP", 1)
    monkeypatch.setattr(coarse_solution, "COARSE_SOLVES_MAX", 1)
    flight = prepared(HALF_CUBAN)
    with open_session() as session:
        coarse = solve_coarse(session.service, planned_guess(flight, flight.plan, InitialBarrier.COLD))
        assert coarse is not None
        scheme = dataclasses.replace(coarse.problem.scheme, steps=4 * coarse.problem.scheme.steps)
        finer = dataclasses.replace(coarse.problem, scheme=scheme)
        solution = try_solve(session.service, finer, coarse.iterate, InitialBarrier.COARSE)
    assert solution is not None
    assert solution.success
    true, raw = float(solution.iterate.durations.sum()), float(coarse.iterate.durations.sum())
    assert true - raw > 0.01  # the coarse mesh gains by its errors
    assert abs(coarse.race_time - true) < 0.5 * abs(raw - true)


@pytest.mark.parametrize("error", [-0.5, 0.5])
def test_large_errors_count_against_a_flight_whatever_their_sign(error: float) -> None:
    own = planned_coarse_solution(SMALL)
    doubtful = dataclasses.replace(own, errors=own.errors + np.eye(len(own.errors))[0] * error)
    raw = float(own.iterate.durations.sum())
    assert doubtful.race_time == pytest.approx(raw + 0.5, abs=2 * coarse_solution.ERROR_TOLERANCE)


def test_mesh_that_deceives_is_made_finer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coarse_solution, "INTERVAL", 0.5)
    monkeypatch.setattr(coarse_solution, "FEWEST", 3)
    monkeypatch.setattr(coarse_solution, "STEP", 1)
    flight = prepared(HALF_CUBAN)
    first = planned_guess(flight, flight.plan, InitialBarrier.COLD)
    with open_session() as session:
        found = solve_coarse(session.service, first)
    assert found is not None
    assert found.problem.intervals > sum(len(phase) for phase in first.mesh)
    assert abs(found.race_time - optimum(HALF_CUBAN, OFF).trajectory.race_time) < 0.2


def test_intervals_grow_with_the_duration_in_steps_up_to_a_limit() -> None:
    seconds = np.linspace(0.1, 60.0, 200)
    counts = [intervals(float(one)) for one in seconds]
    assert counts == sorted(counts)
    assert all(count % STEP == 0 for count in counts)
    assert counts[-1] == MOST
    for one, count in zip(seconds, counts, strict=True):
        assert count == MOST or one / count <= INTERVAL + 1e-12


def test_slower_plan_has_no_more_intervals_for_being_slow() -> None:
    flight = prepared(SMALL)
    slow = scaled(flight.plan.cruise, Radius(0.5, slower=True))
    slower = planned_guess(flight, plan(SMALL.course, slow), InitialBarrier.COLD)
    own = planned_guess(flight, flight.plan, InitialBarrier.COLD)
    assert slower.flight.plan.cruise.V < flight.plan.cruise.V
    assert sum(map(len, slower.mesh)) <= sum(map(len, own.mesh))


@pytest.mark.parametrize("slower", [False, True])
@pytest.mark.parametrize("factor", [0.3, 0.7, 1.0])
def test_pace_is_scaled_to_the_radius_asked_for(factor: float, slower: bool) -> None:
    pace = prepared(SMALL).plan.cruise
    other = scaled(pace, Radius(factor, slower))
    assert other.radius == pytest.approx(factor * pace.radius)
    kept = ("n", "p") if slower else ("V", "p")
    assert [getattr(other, name) for name in kept] == [getattr(pace, name) for name in kept]


class Hanging(SolverService):
    """Never comes back."""

    def __init__(self) -> None: ...

    def solve(self, *arguments: object, **named: object) -> None:  # type: ignore[override]
        raise SolverTimeout("no iteration finished within 1 s")


def test_start_on_which_the_solver_hangs_is_lost_and_nothing_else() -> None:
    flight = prepared(SMALL)
    assert solve_coarse(Hanging(), planned_guess(flight, flight.plan, InitialBarrier.COLD)) is None


def test_sketch_of_an_optimum_stays_there() -> None:
    found = planned_coarse_solution(SMALL)
    with open_session() as session:
        again = solve_coarse(
            session.service,
            InitialGuess(found.flight, found.problem.mesh, found.iterate, InitialBarrier.COARSE),
        )
    assert again is not None
    assert again.race_time == pytest.approx(found.race_time, abs=1e-3)


def test_start_on_a_fine_mesh_is_sketched_like_all_others() -> None:
    """Other ways are proposed on the meshes of sketches, whatever mesh their flight was begun on."""
    rough = planned_coarse_solution(SMALL)
    counts = [2 * len(phase) for phase in rough.problem.mesh]
    mesh, guess = resample(rough.problem.mesh, rough.iterate, counts)
    begun = InitialGuess(rough.flight, mesh, guess, InitialBarrier.COARSE, is_baseline=True)
    with open_session() as session:
        found = solve_coarse(session.service, begun)
    assert found is not None
    wanted = [intervals(seconds) for seconds in found.iterate.durations.tolist()]
    assert [len(phase) for phase in found.problem.mesh] == wanted
    assert sum(wanted) < sum(counts)
    assert found.race_time == pytest.approx(rough.race_time, abs=1e-3)
