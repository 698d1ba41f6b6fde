"""The search over routes, from scratch and around a start, on one thread or several."""

import dataclasses
import itertools
import logging
import math
import threading
from collections.abc import Sequence

import numpy as np
import pytest
from races import EDGE_540, RULES, SHIPPED, SMALL, blown, course, level, models_of, prepared, pylon
from search_races import (
    OFF,
    PLAN,
    QUICK,
    SLALOM,
    open_session,
    optimum,
    planned_coarse_solution,
    search_point_mass,
    slalom,
)
from test_moves import own_window
from transformations import mirrored

from airrace.model.environment import Air
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.service import SolverPool, SolverService
from airrace.optimal_control.trajectory import Trajectory
from airrace.pages.views.stage_tables import claim, search_table
from airrace.procedure import procedure, restart
from airrace.procedure.mesh_loop import solve_certified
from airrace.procedure.multistart import multistart, priced_moves, search
from airrace.procedure.multistart.coarse_solution import (
    CoarseSolution,
    coarse_options,
    planned_guess,
    solve_coarse,
    try_solve,
)
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.multistart import FoundRoutes, RoutesAround, search_around, search_routes
from airrace.procedure.multistart.rolls import rerolls
from airrace.procedure.multistart.search import QUICK as BUDGET
from airrace.procedure.multistart.search import SAVED_MIN, Radius, Search, SearchBudget, planned_starts
from airrace.procedure.multistart.window import EvaluatedMove
from airrace.procedure.procedure import optimize, solve_point_mass
from airrace.procedure.result import Route, SearchReport, Silent, StageResult, Status
from airrace.procedure.settings import MeshSettings, SearchEffort, Settings
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import formulate
from airrace.procedure.warm_start import InitialBarrier
from airrace.race import Race

SAME = 5e-3  # s
RADII_ALONE = dataclasses.replace(BUDGET, tightest_radius=Radius(1.0))
"""The budget without a tighter plan: one of the race's own radius turns no other way than the race's own plan."""
HALF_CUBAN = SHIPPED["half_cuban_eight"]
each_small_race = pytest.mark.parametrize(
    "race",
    [
        pytest.param(SMALL, id="four gates", marks=pytest.mark.slow),
        pytest.param(SLALOM, id="slalom"),
        pytest.param(HALF_CUBAN, id="half cuban eight"),
    ],
)


def seconds(result: StageResult) -> float:
    return result.trajectory.race_time


@each_small_race
def test_explored_race_is_certified_and_no_slower(race: Race) -> None:
    assert optimum(race).certified
    assert seconds(optimum(race)) <= seconds(optimum(race, OFF)) + SAME


def test_flight_that_rounds_its_pylon_backwards_is_corrected() -> None:
    assert optimum(SLALOM, OFF).certified  # a certificate says nothing of other routes
    assert seconds(optimum(SLALOM)) < seconds(optimum(SLALOM, OFF)) - 5.0


@pytest.mark.parametrize("limits", [(7.0, 6.0), pytest.param((8.0, 7.0, 6.0), marks=pytest.mark.slow)])
def test_tighter_limit_makes_no_race_faster(limits: tuple[float, ...]) -> None:
    times = [seconds(optimum(slalom(n_z))) for n_z in limits]
    for looser, tighter in itertools.pairwise(times):
        assert looser <= tighter + SAME


def test_mirrored_race_takes_the_same_time_in_the_mirrored_ways() -> None:
    own, image = optimum(SLALOM), optimum(mirrored(SLALOM))
    assert seconds(image) == pytest.approx(seconds(own), abs=SAME)
    other = {"right": "left", "left": "right"}
    # Names of passages stay as they are: only what follows the colon is seen in the mirror.
    for way, seen in zip(own.search.routes, image.search.routes, strict=True):
        legs = [leg.split(": ") for leg in way.text.split("; ")]
        expected = "; ".join(
            ": ".join([*leg[:-1], " ".join(_mirrored_word(word, other) for word in leg[-1].split(" "))]) for leg in legs
        )
        assert seen.text == expected
        assert seen.difference == pytest.approx(way.difference, abs=2e-2)


def _mirrored_word(word: str, other: dict[str, str]) -> str:
    bare = word.rstrip(",")
    return other.get(bare, bare) + word[len(bare) :]


def assert_same_flight(one: StageResult, other: StageResult) -> None:
    assert one.search.routes == other.search.routes
    assert (one.search.converged_to_best, one.search.converged_elsewhere, one.search.failed) == (
        other.search.converged_to_best,
        other.search.converged_elsewhere,
        other.search.failed,
    )
    for name in ("durations", "state", "control"):
        np.testing.assert_array_equal(getattr(one.trajectory, name), getattr(other.trajectory, name))


@pytest.mark.parametrize("threads", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_result_is_the_same_in_every_bit_whoever_does_the_work(threads: int) -> None:
    again = search_point_mass.__wrapped__(SLALOM, QUICK, threads)
    assert_same_flight(optimum(SLALOM), again)


def search_with(budget: SearchBudget, race: Race) -> FoundRoutes:
    with open_session() as session:
        return search_routes(prepared(race), race.course, session, budget)


def test_a_tighter_plan_is_a_start_where_it_alone_turns_another_way() -> None:
    """Between two pylons that stand near each other: wide plans make most of a circle, a tight one goes straight on."""
    circuit = course(
        "circuit",
        level("start", 0.0, 0.0, 319.0),
        pylon("first", 387.2, 53.6, 122.0),
        pylon("second", 495.2, -51.8, 134.0),
        pylon("third", 32.9, -205.0, 240.0),
        level("finish", 0.0, 0.0, 319.0),
        rules=dataclasses.replace(RULES, n_z=Interval(-2.0, 4.0)),
    )
    race = Race(circuit, EDGE_540, Air())
    budget = dataclasses.replace(BUDGET, radii=(Radius(0.7),))
    *wide, tightest = (start.stage_problem.plan for start in planned_starts(prepared(race), circuit, budget))
    assert len(wide) == 1
    between = [leg.path.turn for leg in (wide[0].legs[1], tightest.legs[1]) if leg.path]
    assert abs(between[0]) > math.radians(180.0) > math.radians(90.0) > abs(between[1])
    # a tight plan among those of the budget takes the way that the tightest one takes
    budget = dataclasses.replace(BUDGET, radii=(Radius(0.7), Radius(0.3)))
    assert len(planned_starts(prepared(race), circuit, budget)) == 2


@pytest.mark.slow
def test_improving_a_wide_start_finds_the_way_of_the_tight_start() -> None:
    wide = dataclasses.replace(RADII_ALONE, radii=(Radius(1.0),))
    unimproved = search_with(dataclasses.replace(wide, iterations=0), SLALOM).search_report(0)
    improved = search_with(wide, SLALOM).search_report(0)
    tight = search_with(dataclasses.replace(RADII_ALONE, radii=(Radius(0.4),)), SLALOM).search_report(0)
    assert unimproved.routes[0].race_time > tight.routes[0].race_time + 5.0
    assert improved.routes[0].race_time == pytest.approx(tight.routes[0].race_time, abs=2e-2)
    assert improved.routes[0].text == tight.routes[0].text


def improved_without_windows(best: CoarseSolution) -> tuple[CoarseSolution, int]:
    """What a search makes of a flight while all windows fail, and how many flights it solves jointly."""
    with open_session() as session, session.pool() as pool, pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "evaluate", lambda *_: None)
        searching = Search(prepared(SLALOM), SLALOM.course, BUDGET, pool, lambda _: None)
        found = searching.improve(best)
        result = searching.result()
    return found, len(result.flights) + result.failed


def test_moves_with_much_faster_plans_are_solved_jointly_where_their_windows_fail() -> None:
    wrong = planned_coarse_solution(SLALOM)
    right, tried = improved_without_windows(wrong)
    assert right.race_time < wrong.race_time - 5.0
    assert 0 < tried <= search.RETRIED_MAX * (1 + len(BUDGET.radii))
    again, tried = improved_without_windows(right)
    assert again is right
    assert tried == 0  # no plan is much faster than that of a good flight


def test_rolls_are_tried_of_all_flights_that_may_be_the_fastest(monkeypatch: pytest.MonkeyPatch) -> None:
    """A flight of large errors may be, though a slower one than another whose time is known better."""
    base = planned_coarse_solution(SLALOM)
    share = [1.0, 1.02, 0.999]
    flights = [
        dataclasses.replace(base, iterate=dataclasses.replace(base.iterate, durations=factor * base.iterate.durations))
        for factor in share
    ]
    flights[2] = dataclasses.replace(flights[2], errors=np.full_like(base.errors, 1.0))  # so it comes last
    budget = dataclasses.replace(BUDGET, iterations=0)
    rolled: list[CoarseSolution] = []

    def record(_: Search, flight: CoarseSolution, unlike: CoarseSolution | None = None) -> CoarseSolution:
        rolled.append(flight)
        return flight

    monkeypatch.setattr(Search, "improve_rolls", record)
    monkeypatch.setattr(multistart, "_distinct", lambda flights, *_: flights)
    monkeypatch.setattr(multistart, "_refine", lambda *_: flights)
    with open_session() as session:
        routes = search_routes(prepared(SLALOM), SLALOM.course, session, budget, starts=[], solved=flights)
    assert rolled == [flights[0], flights[2]]
    assert len(routes.starts) == 3
    assert routes.near_count == 3


@pytest.mark.parametrize("before", [True, False], ids=["before", "in the search"])
@pytest.mark.parametrize("fails", [True, False])
def test_plan_that_fails_as_a_whole_is_tried_in_windows_between_gates(
    fails: bool, before: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No other move is made: without the windows the flight stays wound around its pylons."""
    base = planned_coarse_solution(SLALOM)
    tightest = planned_starts(prepared(SLALOM), SLALOM.course, BUDGET)[-1]
    monkeypatch.setattr(priced_moves, "LEGS_MAX", 2)
    monkeypatch.setattr(search, "solve_coarse", lambda *_: None if fails else base)
    monkeypatch.setattr(Search, "improve", lambda _, flight: flight)
    monkeypatch.setattr(Search, "_other_routes", lambda *_: [])
    with open_session() as session:
        starts, failed = ([], [tightest] if fails else []) if before else ([tightest], [])
        routes = search_routes(
            prepared(SLALOM), SLALOM.course, session, BUDGET, starts=starts, solved=[base], failed=failed
        )
    fastest = float(routes.starts[0].guess.durations.sum())
    assert (fastest < base.race_time - 5.0) is fails


def test_routes_that_become_one_on_the_finer_mesh_are_refined_once(monkeypatch: pytest.MonkeyPatch) -> None:
    base = planned_coarse_solution(SLALOM)
    other = next(one for one in rerolls(base.problem, base.iterate) if one.kind.startswith("roll"))
    solved = [base, dataclasses.replace(base, iterate=other.flight)]
    budget = dataclasses.replace(BUDGET, iterations=0)
    finer: list[CoarseSolution] = []

    def lead_to_the_first(service: SolverService, coarse: CoarseSolution, mesh: MeshSettings) -> CoarseSolution:
        finer.append(coarse)
        return finer[0]

    monkeypatch.setattr("airrace.procedure.multistart.multistart.solve_finer", lead_to_the_first)
    with open_session() as session:
        found = search_routes(prepared(SLALOM), SLALOM.course, session, budget, starts=[], solved=solved)
    assert len(finer) == 2
    assert len(found.starts) == 1


def test_moves_are_tried_again_where_one_that_saves_time_was_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    base, tried = planned_coarse_solution(SLALOM), list[set[int]]()
    left = EvaluatedMove(own_window(base, 1, 2), base.iterate, base.problem, 0.1)
    answers = iter([(base, [left]), (None, [])])
    monkeypatch.setattr(MoveGenerator, "rolls", lambda _, changed: tried.append(set(changed)) or [])
    monkeypatch.setattr(Search, "_improve", lambda *_: next(answers))
    with open_session() as session, session.pool() as pool:
        Search(prepared(SLALOM), SLALOM.course, BUDGET, pool, lambda _: None).improve_rolls(base)
    assert tried == [{0, 1, 2}, {1}]


def test_loop_that_is_left_is_reported() -> None:
    """Without other starts and without improving, the wound flight is the best of those tried."""
    budget = dataclasses.replace(RADII_ALONE, radii=(Radius(1.0),), iterations=0)
    told = " ".join(search_with(budget, SLALOM).search_report(0).loops)
    assert "left -> right" in told
    assert "where the gates ask for" in told


def test_loops_are_warned_of(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    loop = "left -> right: turns 340 degrees on 900 m, where the gates ask for 20 degrees on 160 m"

    def looped(*arguments: object, **named: object) -> FoundRoutes:
        found = search_routes(*arguments, **named)  # type: ignore[arg-type]
        return dataclasses.replace(
            found, search_report=lambda one: dataclasses.replace(found.search_report(one), loops=(loop,))
        )

    monkeypatch.setattr(procedure, "search_routes", looped)
    with open_session(QUICK) as session, caplog.at_level(logging.WARNING):
        *_, result = solve_point_mass(models_of(SMALL, QUICK), session, solve_certified, None)
    assert result.search.loops == (loop,)
    assert [record.getMessage() for record in caplog.records] == [f"the flight may hold a needless loop: {loop}"]


@each_small_race
def test_race_that_is_flown_well_has_no_needless_loop(race: Race) -> None:
    assert optimum(race).search.loops == ()


def ranked(ways: Sequence[Route]) -> list[float]:
    return [way.race_time for way in ways]


@each_small_race
def test_best_way_comes_first_and_the_others_follow_by_race_time(race: Race) -> None:
    explored = optimum(race).search
    best, *others = explored.routes
    assert (best.difference, best.evaluated_by) == (0.0, "joint")
    assert ranked(others) == sorted(ranked(others))
    for way in explored.routes:
        assert way.difference == pytest.approx(way.race_time - best.race_time, abs=1e-12)
        assert way.evaluated_by in ("joint", "window")
        assert way.difference > -SAVED_MIN, "a price that was not tried jointly"
    for way in others:
        assert way.rolls is all("rolling" in leg for leg in way.text.split("; "))
    assert not best.rolls
    texts = [way.text for way in others]
    assert len(set(texts)) == len(texts)
    assert explored.converged_to_best >= 1
    assert explored.seconds > 0.0


@each_small_race
def test_rough_time_of_the_best_way_is_near_the_certified_one(race: Race) -> None:
    assert optimum(race).search.routes[0].race_time == pytest.approx(seconds(optimum(race)), abs=0.03)


def test_without_exploring_nothing_is_reported() -> None:
    assert optimum(SLALOM, OFF).search.routes == ()
    assert optimum(SLALOM, OFF).search.seconds == 0.0


def test_start_without_exploring_is_never_lost_by_it() -> None:
    """Were all other plans of no use, exploring would still end where the race ends without it."""
    others_lead_nowhere = dataclasses.replace(RADII_ALONE, radii=(), iterations=0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(procedure, "QUICK", others_lead_nowhere)
        (result,) = optimize(SLALOM, QUICK, until=Stage.POINT_MASS, threads=1, progress=Silent())
    assert result.certified
    assert (result.search.converged_to_best, result.search.converged_elsewhere, result.search.failed) == (1, 0, 0)
    assert seconds(result) == pytest.approx(seconds(optimum(SLALOM, OFF)), abs=SAME)


def test_no_race_without_a_flight_has_starts() -> None:
    """Where every start is lost the homotopy and the plan are what is left."""
    budget = dataclasses.replace(RADII_ALONE, radii=())
    found = search_with(budget, SMALL)
    assert found.starts == ()
    assert found.search_report(0).routes == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "race",
    [
        pytest.param(SMALL, id="four gates"),
        pytest.param(SLALOM, id="slalom"),
        pytest.param(HALF_CUBAN, id="half cuban eight"),
    ],
)
def test_thorough_search_is_no_slower_than_a_quick_one(race: Race) -> None:
    thorough = dataclasses.replace(PLAN, search=SearchEffort.THOROUGH)
    result = optimum(race, thorough)
    assert seconds(result) <= seconds(optimum(race)) + SAME
    assert result.search.bound is not None
    priced = [route for route in result.search.routes if route.evaluated_by == "priced"]
    assert all(route.difference > 0.0 for route in priced)
    assert priced or race is not SLALOM
    assert result.search.bound.gap < thorough.gap
    assert optimum(race).search.bound is None


WINDY = blown(SLALOM, 200.0, 2.0)


def found_around(optimum: StageResult) -> RoutesAround:
    source = formulate(optimum.stage, SLALOM, QUICK, optimum.trajectory)
    with open_session() as session, session.pool() as pool:
        found = search_around(prepared(SLALOM), source, optimum, SLALOM.course, QUICK.mesh, pool)
    assert found is not None
    return found


@pytest.mark.slow
def test_around_a_flight_the_wrong_way_round_the_right_way_is_found_and_reported() -> None:
    wrong = optimum(SLALOM, OFF)
    found = found_around(wrong)
    words, _, saved = found.text.removesuffix(" s").partition(", saves about ")
    assert "->" in words
    assert float(saved) > 5.0
    assert found.best.race_time < wrong.trajectory.race_time - 5.0
    assert found.phases
    first, kept = found.report.routes[0], found.report_on_stored.routes[0]
    assert first.race_time == found.best.race_time
    assert kept.race_time == pytest.approx(wrong.trajectory.race_time, abs=0.1)
    assert min(one.difference for one in found.report_on_stored.routes) < -5.0


def test_around_a_good_flight_no_other_route_is_found() -> None:
    found = found_around(optimum(SLALOM))
    assert (found.phases, found.text) == (frozenset(), "")
    assert found.best.race_time == pytest.approx(optimum(SLALOM).trajectory.race_time, abs=0.03)


ALONE = dataclasses.replace(OFF, alternatives=1)
ALONE_QUICK = dataclasses.replace(QUICK, alternatives=1)


def started(start: StageResult, chosen: Settings, threads: int = 1) -> StageResult:
    (result,) = optimize(
        WINDY, chosen, until=Stage.POINT_MASS, threads=threads, start=[start], start_name="calm.h5", progress=Silent()
    )
    assert result.certified
    return result


def test_run_started_from_a_flight_the_wrong_way_round_has_the_optimum_that_it_has_from_scratch() -> None:
    result = started(optimum(SLALOM, OFF), QUICK)
    assert result.remarks.startswith("calm.h5: another route has become faster: ")
    assert "no other route was evaluated" not in claim([result])
    assert max(one.difference for one in result.search.routes) > 5.0
    assert result.trajectory.race_time == pytest.approx(optimum(WINDY).trajectory.race_time, abs=SAME)


def test_faster_route_is_gone_on_from_where_more_stages_are_wanted_than_are_stored() -> None:
    wrong = optimum(SLALOM, OFF)
    first, last = optimize(
        WINDY,
        ALONE_QUICK,
        until=Stage.TRANSFER_FUNCTION,
        threads=1,
        start=[wrong],
        start_name="calm.h5",
        progress=Silent(),
    )
    assert first.trajectory.race_time == pytest.approx(optimum(WINDY).trajectory.race_time, abs=SAME)
    assert first.remarks.startswith("calm.h5: another route has become faster: ")
    assert last.certified


def test_faster_route_is_put_into_a_flight_of_higher_fidelity() -> None:
    def flown(race: Race, chosen: Settings, *start: StageResult) -> list[StageResult]:
        until = Stage.TRANSFER_FUNCTION
        return list(optimize(race, chosen, until=until, threads=1, start=start, progress=Silent()))

    (result,) = flown(WINDY, QUICK, *flown(SLALOM, OFF))
    assert (result.stage, result.certified) == (Stage.TRANSFER_FUNCTION, True)
    assert result.provenance.source == "transfer-function of another run"
    assert result.trajectory.race_time == pytest.approx(flown(WINDY, QUICK)[-1].trajectory.race_time, abs=SAME)


def test_flight_that_leads_nowhere_is_followed_by_what_the_point_mass_makes_of_it_and_not_by_another_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stored, scratch = optimum(SLALOM), optimum(WINDY)
    monkeypatch.setattr(restart, "ITERATIONS_MAX", 1)  # not enough to lead anywhere
    monkeypatch.delattr(procedure, "search_routes")
    result = started(stored, QUICK)
    assert result.remarks.endswith("so the start is what the point mass makes of it")
    assert result.trajectory.race_time == pytest.approx(scratch.trajectory.race_time, abs=SAME)


@pytest.mark.parametrize("threads", [1, 2])
def test_run_started_from_a_good_flight_keeps_its_way(threads: int) -> None:
    result = started(optimum(SLALOM), QUICK, threads)
    assert result.remarks == ""
    assert result.provenance.source == "point-mass of calm.h5"


def test_wrong_way_round_is_reported_the_same_while_the_race_is_solved() -> None:
    one, two = (started(optimum(SLALOM, OFF), QUICK, threads) for threads in (1, 2))
    assert one.remarks == two.remarks
    assert np.array_equal(one.trajectory.state, two.trajectory.state)


def test_search_beside_is_given_up_with_what_it_stands_beside() -> None:
    with open_session(threads=2) as session:
        begun = threading.Event()

        def endless(pool: SolverPool) -> str:
            begun.set()
            while True:
                pool.work([planned_guess(prepared(SLALOM), prepared(SLALOM).plan, InitialBarrier.COLD)], solve_coarse)

        def interrupted() -> None:
            with session.search_in_background(endless):
                assert begun.wait(60.0)
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            interrupted()


def test_error_of_a_search_beside_is_raised_where_it_is_asked_for() -> None:
    with (
        open_session(threads=2) as session,
        session.search_in_background(lambda _: 1 / 0) as search,
        pytest.raises(ZeroDivisionError),
    ):
        search.result()


def test_alternative_that_has_become_the_fastest_changes_places_with_the_stored_flight() -> None:
    """As one that is slower from the beginning has."""
    result = started(dataclasses.replace(optimum(SLALOM, OFF), alternatives=(optimum(SLALOM),)), OFF)
    assert result.remarks.endswith("another route has become faster: an alternative of the stored one")
    assert "the best of 2 routes" in claim([result])
    assert result.trajectory.race_time == pytest.approx(optimum(WINDY).trajectory.race_time, abs=SAME)
    (slower,) = result.alternatives
    assert slower.trajectory.race_time > result.trajectory.race_time + 5.0
    alone = started(dataclasses.replace(optimum(SLALOM, OFF), alternatives=(optimum(SLALOM),)), ALONE)
    assert alone.alternatives == ()
    assert alone.trajectory.race_time == pytest.approx(slower.trajectory.race_time, abs=1e-5)


def test_without_exploring_a_start_is_taken_as_it_is() -> None:
    result = started(optimum(SLALOM, OFF), OFF)
    assert result.remarks == ""
    assert result.trajectory.race_time > optimum(SLALOM).trajectory.race_time + 5.0


def test_certified_start_is_not_given_up_for_a_promise_that_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another way seems faster when solved coarsely, and turns out to be slower, or to be no flight at all."""
    good = started(optimum(SLALOM), QUICK)
    for other in (slower(good), dataclasses.replace(good, outcome=Status.NOT_CERTIFIED)):
        monkeypatch.setattr(restart, "_refine_route", lambda *_, found=other: found)
        promise = RoutesAround(planned_coarse_solution(SLALOM), frozenset({1}), "left -> right, flat")
        monkeypatch.setattr(restart, "search_around", lambda *_, found=promise: found)
        result = started(optimum(SLALOM), QUICK)
        assert result.trajectory.race_time == good.trajectory.race_time
        assert result.remarks == ""


def reported(text: str) -> SearchReport:
    return SearchReport((Route(text, 9.0, 0.0, "joint"), Route("another", 9.5, 0.5, "window")))


def test_the_report_of_a_search_around_a_flight_begins_with_the_route_of_the_flight_that_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    good = started(optimum(SLALOM), QUICK)
    quicker = dataclasses.replace(good, trajectory=scaled(good, 0.99))
    found = planned_coarse_solution(SLALOM)
    promise = RoutesAround(found, frozenset({1}), "the promise", reported("of the search"), reported("of the stored"))
    monkeypatch.setattr(restart, "search_around", lambda *_: promise)
    for other, first in ((slower(good), "of the stored"), (quicker, "of the search")):
        monkeypatch.setattr(restart, "_refine_route", lambda *_, found=other: found)
        assert started(optimum(SLALOM), QUICK).search.routes[0].text == first


@pytest.mark.parametrize("chosen", [OFF, QUICK])
def test_where_an_alternative_has_become_the_fastest_the_optima_of_the_stage_are_reported(
    chosen: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The search was around another flight, and its rough race times are not comparable with theirs."""
    found = RoutesAround(planned_coarse_solution(SLALOM), report_on_stored=reported("of the stored"))
    monkeypatch.setattr(restart, "search_around", lambda *_: found)
    result = started(dataclasses.replace(optimum(SLALOM, OFF), alternatives=(optimum(SLALOM),)), chosen)
    texts = [route.text for route in result.search.routes]
    assert texts == ["an alternative of the stored one", "the stored one"]
    times = [result.trajectory.race_time, *(one.trajectory.race_time for one in result.alternatives)]
    assert [route.race_time for route in result.search.routes] == times
    words = " ".join(search_table(result.search).text().split())
    assert "race time" in words
    assert "rough" not in words
    assert "multistarts" not in words


def slower(result: StageResult) -> StageResult:
    return dataclasses.replace(result, trajectory=scaled(result, 1.01))


def scaled(result: StageResult, factor: float) -> Trajectory:
    return dataclasses.replace(result.trajectory, durations=factor * result.trajectory.durations)


def test_flight_that_kills_its_solver_is_left_out_and_the_next_one_is_flown(caplog: pytest.LogCaptureFixture) -> None:
    coarse = planned_coarse_solution(SMALL)
    broken = dataclasses.replace(coarse.iterate, state=coarse.iterate.state[:-1])
    with open_session() as session, caplog.at_level(logging.WARNING):
        assert try_solve(session.service, coarse.problem, broken, coarse_options(InitialBarrier.COARSE)) is None
        assert (
            try_solve(session.service, coarse.problem, coarse.iterate, coarse_options(InitialBarrier.COARSE))
            is not None
        )
    (record,) = caplog.records
    assert "left out" in record.getMessage()
