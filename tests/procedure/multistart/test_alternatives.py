"""Several routes go through all stages side by side; the fastest is the result, and none gets lost on the way."""

import dataclasses
import functools
import logging
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from fake_optimizer import solve_roughly, solve_single_mesh
from races import SHIPPED, SMALL, models_of
from search_races import OFF, QUICK, open_session, planned_coarse_solution
from search_races import optimum as search_optimum

from airrace.files.checkpoint import Checkpoint, StoredDocument, StoredInputs, read_checkpoint, write_checkpoint
from airrace.optimal_control.certificate import RACE_TIME_CHANGE
from airrace.procedure import first_solutions, mesh_check, procedure, pylon_sides
from airrace.procedure.choice import mesh_resolution
from airrace.procedure.homotopy import HomotopyOutcome
from airrace.procedure.mesh_loop import Failure, solve_certified
from airrace.procedure.multistart.multistart import FoundRoutes, PricedRound
from airrace.procedure.procedure import CARRIED_LAG, check_stage_mesh, optimize, solve_point_mass, solve_stage_above
from airrace.procedure.pylon_sides import with_other_sides
from airrace.procedure.result import NOT_SEARCHED, PylonSide, Route, SearchReport, Silent, StageResult, Status
from airrace.procedure.settings import Settings
from airrace.procedure.single_mesh import solve_single_mesh as real_single_mesh
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_models import StageModels
from airrace.procedure.warm_start import InitialBarrier, Start

HALF_CUBAN = SHIPPED["half_cuban_eight"]
BOTH = dataclasses.replace(QUICK, alternatives=2)


@functools.cache
def solve_stages() -> tuple[StageResult, ...]:
    """The point mass and the stage above it, on two routes."""
    return tuple(optimize(HALF_CUBAN, BOTH, until=Stage.TRANSFER_FUNCTION, threads=1, progress=Silent()))


def seconds(result: StageResult) -> float:
    return result.trajectory.race_time


def test_alternatives_are_certified_and_slower() -> None:
    point_mass = search_optimum(HALF_CUBAN, BOTH)
    (alternative,) = point_mass.alternatives
    assert alternative.certified
    assert seconds(alternative) > seconds(point_mass)
    assert alternative.stage is Stage.POINT_MASS
    assert (alternative.search, alternative.alternatives) == (NOT_SEARCHED, ())


def test_best_route_is_the_same_whether_it_climbs_alone_or_not() -> None:
    alone = search_optimum(HALF_CUBAN, dataclasses.replace(QUICK, alternatives=1))
    assert alone.alternatives == ()
    assert seconds(search_optimum(HALF_CUBAN, BOTH)) == pytest.approx(seconds(alone), abs=1e-6)


@pytest.mark.slow
def test_all_routes_are_climbed_and_the_fastest_is_the_result() -> None:
    higher = solve_stages()[1]
    assert higher.stage is Stage.TRANSFER_FUNCTION
    assert higher.certified
    (alternative,) = higher.alternatives
    assert alternative.certified
    assert seconds(alternative) >= seconds(higher)
    assert higher.search == NOT_SEARCHED


@pytest.mark.slow
def test_stored_run_goes_on_with_all_routes(tmp_path: Path) -> None:
    document = StoredDocument("x.yaml", "x")
    checkpoint = Checkpoint(StoredInputs(document, document, None, (), "{}"), {}).with_stage(solve_stages()[0])
    write_checkpoint(tmp_path / "run.h5", checkpoint)
    (stored,) = read_checkpoint(tmp_path / "run.h5").stages
    going_on = optimize(
        HALF_CUBAN, BOTH, until=Stage.TRANSFER_FUNCTION, threads=1, finished=[stored.result], progress=Silent()
    )
    (higher,) = going_on
    before = solve_stages()[1]
    for own, other in zip((higher, *higher.alternatives), (before, *before.alternatives), strict=True):
        np.testing.assert_array_equal(own.trajectory.state, other.trajectory.state)


def stage_above(
    monkeypatch: pytest.MonkeyPatch,
    *of_alternative: StageResult | Failure,
    main: StageResult | None = None,
    settings: Settings = BOTH,
) -> tuple[StageResult, int]:
    """The stage above the point mass, whose best route takes 9 s, and how often its alternative was solved."""
    left = list(of_alternative)
    monkeypatch.setattr(procedure, "solve_from_starts", Answers(main or taking(9.0), making=False))
    for name in ("start_along", "start_trimmed"):
        monkeypatch.setattr(procedure, name, lambda *_: None)
    models = models_of(HALF_CUBAN, settings, Stage.TRANSFER_FUNCTION)
    done = {Stage.POINT_MASS: search_optimum(HALF_CUBAN, BOTH)}
    with open_session(settings) as session:
        result = solve_stage_above(models, session, lambda *_: left.pop(0), Stage.TRANSFER_FUNCTION, done)
    return result, len(of_alternative) - len(left)


def test_what_rough_race_times_may_be_off_by_leaves_no_route_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor are two routes one because they happen to take equally long."""
    close, far = 9.0 + CARRIED_LAG + 0.01, 9.0 + CARRIED_LAG + 0.03  # s; both are left out where meshes are good
    for seconds_beside, good, rough in ((close, 0, 1), (far, 0, 0), (9.0001, 0, 1)):
        result, _ = stage_above(monkeypatch, taking(seconds_beside), settings=QUICK)
        assert len(result.alternatives) == good
        beside, main = solve_roughly(taking(seconds_beside, north=20.0)), solve_roughly(taking(9.0))
        result, _ = stage_above(monkeypatch, beside, main=main, settings=QUICK)
        assert len(result.alternatives) == rough
        assert result.notes == ()


def test_of_rough_routes_that_a_run_now_ends_with_the_faster_one_is_chosen_once_both_are_certified(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    times = {9.0: taking(8.99), 9.02: taking(8.96)}
    monkeypatch.setattr(mesh_check, "solve_on_second_mesh", lambda _, optimum, __: times[round(seconds(optimum), 3)])
    rough = dataclasses.replace(solve_roughly(taking(9.0)), alternatives=(solve_roughly(taking(9.02)),))
    with open_session(BOTH) as session:
        result = check_stage_mesh(models_of(SMALL, BOTH), rough, session)
    assert result.certified
    assert seconds(result) == pytest.approx(8.96)
    assert [seconds(one) for one in result.alternatives] == [pytest.approx(8.99)]


def test_every_alternative_is_a_start_of_the_next_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where they were read from a file: the next stage starts from all that is finished."""
    result, _ = stage_above(monkeypatch, taking(8.9))
    assert seconds(result) == pytest.approx(8.9)
    assert [seconds(alternative) for alternative in result.alternatives] == [pytest.approx(9.0)]


def test_alternative_that_does_not_hold_gets_no_second_start_and_one_without_an_optimum_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result, solved = stage_above(monkeypatch, taking(8.9, certified=False), taking(8.9))
    assert solved == 1
    assert seconds(result) == pytest.approx(9.0)
    assert result.alternatives == ()
    coarse = planned_coarse_solution(SMALL)
    nothing = Failure(Start(coarse.stage_problem, coarse.problem, coarse.iterate, InitialBarrier.COLD), None)
    result, solved = stage_above(monkeypatch, nothing, taking(8.9))
    assert solved == 2
    assert seconds(result) == pytest.approx(8.9)


# the order in which starts are tried, with canned answers


class Answers:
    """Stands for the joint optimisation: certified or not, as told, in the order of the calls."""

    def __init__(self, *verdicts: StageResult, making: bool = True) -> None:
        self.verdicts = list(verdicts)
        self.making = making
        self.asked: list[list[Start]] = []

    def __call__(
        self, _: SolverSession, starts: Sequence[Callable[[], Start]], refine: object, *, diagnose: object = None
    ) -> StageResult:
        self.asked.append([make() for make in starts] if self.making else [])
        return self.verdicts.pop(0)


def taking(seconds: float, *, certified: bool = True, north: float = 0.0) -> StageResult:
    """A result of a race time, so many metres farther north."""
    own = search_optimum(SMALL, OFF)
    durations, state = own.trajectory.durations * seconds / own.trajectory.race_time, own.trajectory.state.copy()
    state[0] += north
    flown = dataclasses.replace(own.trajectory, durations=durations, state=state)
    outcome = Status.SOLVED if certified else Status.NOT_CERTIFIED
    return dataclasses.replace(own, trajectory=flown, outcome=outcome)


def first_stage(
    monkeypatch: pytest.MonkeyPatch,
    chosen: Settings,
    found: int,
    *verdicts: StageResult,
    search: SearchReport = NOT_SEARCHED,
    near: int = 1,
) -> tuple[StageResult, list[list[Start]], list[Start]]:
    """The point mass where the search has found so many starts: the result, what was asked, and those starts."""
    coarse = planned_coarse_solution(SMALL)
    starts = tuple(
        Start(coarse.stage_problem, coarse.problem, coarse.iterate, 10.0**-number) for number in range(found)
    )
    answers = Answers(*verdicts)
    monkeypatch.setattr(procedure, "solve_from_starts", answers)
    routes = FoundRoutes(starts, lambda _: search, near)
    monkeypatch.setattr(procedure, "search_routes", lambda *_, **__: routes)
    monkeypatch.setattr(first_solutions, "solve_homotopy", lambda *_: HomotopyOutcome(search_optimum(SMALL, OFF)))
    with open_session(chosen) as session:
        *_, result = solve_point_mass(models_of(SMALL, chosen, Stage.HOMOTOPY), session, solve_certified, None)
    assert answers.verdicts == []
    return result, answers.asked, list(starts)


def test_every_solver_is_asked_of_the_best_route_before_another_start(monkeypatch: pytest.MonkeyPatch) -> None:
    result, asked, found = first_stage(monkeypatch, QUICK, 2, taking(9.0))
    assert asked == [[found[0]]]
    assert seconds(result) == pytest.approx(9.0)


def test_routes_that_rough_times_do_not_rank_are_all_certified_and_one_that_is_hardly_slower_is_carried_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    verdicts = taking(9.06), taking(9.03), taking(9.0)
    result, asked, found = first_stage(monkeypatch, QUICK, 4, *verdicts, near=3)
    assert asked == [[one] for one in found[:3]]
    assert seconds(result) == pytest.approx(9.0)
    assert [seconds(one) for one in result.alternatives] == [pytest.approx(9.03)]
    alone, *_ = first_stage(monkeypatch, QUICK, 2, taking(9.06), taking(9.0), near=2)
    assert alone.alternatives == ()
    same, *_ = first_stage(monkeypatch, QUICK, 2, taking(9.0), taking(9.0001), near=2)
    assert same.alternatives == ()


def test_next_route_and_at_last_the_plan_are_tried_where_the_best_is_not_certified(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    failed = taking(9.0, certified=False)
    result, asked, found = first_stage(monkeypatch, QUICK, 2, failed, failed, taking(11.0))
    assert asked[:2] == [[found[0]], [found[1]]]
    assert len(asked[2]) == 2  # the plan and the homotopy
    assert result.certified
    assert seconds(result) == pytest.approx(11.0)


def test_routes_are_compared_with_the_certified_one(monkeypatch: pytest.MonkeyPatch) -> None:
    coarse = planned_coarse_solution(SMALL)
    starts = (Start(coarse.stage_problem, coarse.problem, coarse.iterate, 1.0),) * 2
    told = [SearchReport(routes=(Route(text, 9.0, 0.0, "joint"),)) for text in ("first", "second")]
    monkeypatch.setattr(procedure, "solve_from_starts", Answers(taking(9.0, certified=False), taking(9.05)))
    monkeypatch.setattr(procedure, "search_routes", lambda *_, **__: FoundRoutes(starts, told.__getitem__))
    with open_session(QUICK) as session:
        *_, result = solve_point_mass(models_of(SMALL, QUICK), session, solve_certified, None)
    assert result.search.routes[0].text == "second"


BEST_ROUTE = SearchReport(routes=(Route("flat", 9.0, 0.0, "joint"),))


def test_next_route_is_tried_where_the_best_has_become_a_slower_one_on_its_way_to_the_certificate(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    verdicts = (taking(9.5), taking(9.05))
    with caplog.at_level(logging.WARNING):
        result, asked, found = first_stage(monkeypatch, QUICK, 3, *verdicts, search=BEST_ROUTE)
    assert asked == [[one] for one in found[:2]]
    assert seconds(result) == pytest.approx(9.05)
    assert not caplog.records


def test_flight_that_is_far_slower_than_the_best_route_when_rough_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        result, *_ = first_stage(monkeypatch, QUICK, 2, taking(9.6), taking(9.5), search=BEST_ROUTE)
    assert seconds(result) == pytest.approx(9.5)
    (record,) = caplog.records
    assert "9.00 s when solved coarsely" in record.getMessage()
    assert "takes 9.50 s" in record.getMessage()


def priced_stages(
    monkeypatch: pytest.MonkeyPatch, first: StageResult, *joined: StageResult
) -> tuple[list[StageResult], int]:
    """The point mass of a search whose prices join one flight in each round, after the first and after every round;
    and how many of the joined flights were solved."""
    coarse = planned_coarse_solution(SMALL)
    start = Start(coarse.stage_problem, coarse.problem, coarse.iterate, 1.0)

    def search_report(number: int) -> SearchReport:
        return SearchReport(routes=(Route(f"route {number}", 9.0, 0.0, "joint"),))

    answers = Answers(first, *joined)
    monkeypatch.setattr(procedure, "solve_from_starts", answers)
    routes = FoundRoutes((start,), search_report, by_prices=[PricedRound(start, search_report)] * len(joined))
    monkeypatch.setattr(procedure, "search_routes", lambda *_, **__: routes)
    with open_session(QUICK) as session:
        results = list(solve_point_mass(models_of(SMALL, QUICK), session, solve_certified, None))
    return results, len(joined) - len(answers.verdicts)


def test_flight_that_prices_lead_to_takes_the_place_of_a_slower_one(monkeypatch: pytest.MonkeyPatch) -> None:
    failed = taking(8.0, certified=False)
    results, solved = priced_stages(monkeypatch, taking(9.0), failed, taking(8.9), taking(9.2))
    assert solved == 3
    assert [round(seconds(result), 3) for result in results] == [9.0, 9.0, 8.9, 8.9]
    assert [result.search.routes[0].text for result in results] == ["route 0", "route 0", "route 2", "route 2"]


def test_flight_that_prices_leave_behind_goes_on_beside_the_faster_one(monkeypatch: pytest.MonkeyPatch) -> None:
    (_, last), _ = priced_stages(monkeypatch, taking(9.0), taking(8.97))
    assert [round(seconds(result), 3) for result in (last, *last.alternatives)] == [8.97, 9.0]


def test_without_a_flight_there_are_no_prices(monkeypatch: pytest.MonkeyPatch) -> None:
    lost = dataclasses.replace(taking(9.0), outcome=Status.TIMEOUT)
    results, solved = priced_stages(monkeypatch, lost, lost)
    assert [(result.outcome, result.search.bound) for result in results] == [(Status.TIMEOUT, None)]
    assert solved == 1  # the plan, in place of a joined flight


def close_together(
    monkeypatch: pytest.MonkeyPatch, *verdicts: StageResult, checks: dict[float, StageResult | str], carried: int = 1
) -> tuple[StageResult, list[float]]:
    """The result where two routes below the last stage were solved on one mesh each, by what their checks lead to."""
    two = dataclasses.replace(QUICK, alternatives=carried)
    coarse = planned_coarse_solution(SMALL)
    starts = (Start(coarse.stage_problem, coarse.problem, coarse.iterate, 1.0),) * 2
    asked: list[float] = []

    def answered(_: object, optimum: StageResult, __: object) -> StageResult | str:
        asked.append(round(seconds(optimum), 3))
        return checks[asked[-1]]

    left, routes = list(verdicts), FoundRoutes(starts, lambda _: NOT_SEARCHED, near_count=2)
    monkeypatch.setattr(procedure, "solve_from_starts", lambda *_, **__: left.pop(0))
    monkeypatch.setattr(procedure, "search_routes", lambda *_, **__: routes)
    monkeypatch.setattr(first_solutions, "solve_homotopy", lambda *_: HomotopyOutcome(search_optimum(SMALL, OFF)))
    monkeypatch.setattr(mesh_check, "solve_on_second_mesh", answered)
    with open_session(two) as session:
        *_, result = solve_point_mass(models_of(SMALL, two, Stage.HOMOTOPY), session, real_single_mesh, None)
    return result, asked


def test_routes_whose_meshes_may_hide_which_is_faster_are_checked_first(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = solve_single_mesh(taking(9.000)), solve_single_mesh(taking(9.008))
    checks: dict[float, StageResult | str] = {9.000: taking(8.999), 9.008: taking(8.998)}
    result, asked = close_together(monkeypatch, first, second, checks=checks)
    assert asked == [9.000, 9.008]
    assert (seconds(result), result.status) == (pytest.approx(8.998), Status.CERTIFIED)
    assert result.alternatives == ()


@pytest.mark.parametrize("time", [9.008, 9.05])
def test_routes_that_are_both_carried_on_need_no_certificate(time: float, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = solve_single_mesh(taking(time)), solve_single_mesh(taking(9.0))
    result, asked = close_together(monkeypatch, first, second, checks={}, carried=2)
    assert asked == []
    assert (seconds(result), result.status) == (pytest.approx(9.0), Status.SOLVED)
    assert [alternative.status for alternative in result.alternatives] == [Status.SOLVED]


def test_of_close_routes_one_that_could_be_confirmed_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = solve_single_mesh(taking(9.000)), solve_single_mesh(taking(9.008))
    result, _ = close_together(monkeypatch, first, second, checks={9.000: "it failed", 9.008: taking(9.008)})
    assert (seconds(result), result.status) == (pytest.approx(9.008), Status.CERTIFIED)
    assert result.alternatives == ()
    neither, _ = close_together(monkeypatch, first, second, checks={9.000: "it failed", 9.008: "it failed"})
    assert (seconds(neither), neither.status) == (pytest.approx(9.0), Status.SOLVED)
    assert neither.remarks == "its race time could not be confirmed on a second mesh: it failed"


def test_where_nothing_was_found_the_plan_and_the_homotopy_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    result, asked, _ = first_stage(monkeypatch, QUICK, 0, taking(10.0))
    assert [len(one) for one in asked] == [2]
    assert seconds(result) == pytest.approx(10.0)


def test_fastest_certified_route_is_the_result_whichever_was_the_best_when_rough(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    three = dataclasses.replace(QUICK, alternatives=3)
    verdicts = (taking(9.2), taking(9.0), taking(8.0, certified=False))
    result, asked, found = first_stage(monkeypatch, three, 4, *verdicts)
    assert asked == [[one] for one in found[:3]]
    assert seconds(result) == pytest.approx(9.0)
    assert [seconds(alternative) for alternative in result.alternatives] == [pytest.approx(9.2)]


def flights_at(seconds_of: Sequence[float], certified: bool = True) -> list[StageResult]:
    """Optima of one race with these race times, s."""
    known = search_optimum(SMALL, OFF)
    outcome = known.outcome if certified else Status.NOT_CERTIFIED
    times = [dataclasses.replace(known.trajectory, durations=np.array([0.5 * one] * 2)) for one in seconds_of]
    return [dataclasses.replace(known, trajectory=one, outcome=outcome) for one in times]


def test_other_sides_are_tried_around_the_fastest_while_that_gains_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither those that have gained nothing are tried again, nor the side that a faster flight has left."""
    beaten, uncertified = flights_at([9.0, 8.0, 7.9999]), flights_at([6.0], certified=False)
    left, *others = beaten[1].pylon_conditions
    sides = (dataclasses.replace(left, side=PylonSide.BELOW), *others)
    beaten[1] = dataclasses.replace(beaten[1], pylon_conditions=sides)
    rounds = [[beaten[0], beaten[1], *uncertified], [beaten[2]]]
    around: list[float] = []
    not_tried: list[set[pylon_sides.Side]] = []

    def on_other_sides(
        _: StageModels, fastest: StageResult, useless: set[pylon_sides.Side], __: SolverSession
    ) -> Sequence[tuple[frozenset[pylon_sides.Side], object]]:
        around.append(seconds(fastest))
        not_tried.append(set(useless))
        flights = enumerate(rounds.pop(0))
        return [
            (frozenset({("pylon", 0, leg, PylonSide.LEFT)}), lambda session, flight=flight: spend(session, flight))
            for leg, flight in flights
        ]

    def spend(session: SolverSession, one: StageResult) -> StageResult:
        session.budget.spent += 1000
        return one

    monkeypatch.setattr(pylon_sides, "on_other_sides", on_other_sides)
    with open_session(OFF) as session:
        given = flights_at([8.5, 8.6])
        found = with_other_sides(models_of(SMALL, OFF), given, session)
        assert session.budget.spent == 0
    assert around == pytest.approx([8.5, 8.0])
    slower = {("pylon", 0, leg, PylonSide.LEFT) for leg in (0, 2)}
    assert not_tried == [set(), slower | pylon_sides.sides_of([left])]
    assert [seconds(one) for one in found] == pytest.approx(
        [8.5, 8.6, 8.0]
    )  # neither slower, uncertified, nor the same


def test_another_side_has_to_be_faster_on_the_coarser_mesh_of_a_certified_optimum() -> None:
    """A certified optimum tells what it takes on the coarser mesh, from which another side starts."""
    (optimum,) = flights_at([9.0])
    assert optimum.certificate is not None
    items = tuple(
        dataclasses.replace(item, value=0.02) if item.name == RACE_TIME_CHANGE else item
        for item in optimum.certificate.items
    )
    compared = dataclasses.replace(optimum, certificate=dataclasses.replace(optimum.certificate, items=items))
    with open_session(OFF) as session:
        longest = pylon_sides.longest_race_time(compared, session.settings)
        alone = pylon_sides.longest_race_time(dataclasses.replace(optimum, certificate=None), session.settings)
        assert longest == pytest.approx(9.02 - pylon_sides.GAIN_MIN, abs=1e-9)
        assert alone == pytest.approx(9.0 + mesh_resolution(session.settings, 9.0), abs=1e-9)
