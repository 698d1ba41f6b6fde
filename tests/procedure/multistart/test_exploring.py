"""Exploring leaves loops out, makes no race slower, and finds the same however it is asked."""

import dataclasses
import itertools
import logging
from collections.abc import Sequence

import numpy as np
import pytest
from races import SHIPPED, SMALL, prepared
from search_races import OFF, PLAN, QUICK, SLALOM, open_session, optimum, search_point_mass, slalom
from transformations import mirrored

from airrace.planning.race import Race
from airrace.procedure import fidelity_continuation
from airrace.procedure.fidelity_continuation import FidelityContinuation
from airrace.procedure.multistart.budget import QUICK as QUICK_EFFORT
from airrace.procedure.multistart.budget import THOROUGH, Radius, SearchBudget
from airrace.procedure.multistart.multistart import Exploration, explore
from airrace.procedure.multistart.search import WORTH
from airrace.procedure.progress import Silent
from airrace.procedure.result import Route, Stage, StageResult
from airrace.procedure.run import optimize
from airrace.procedure.settings import SearchEffort

SAME = 5e-3  # s
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


def search_with(effort: SearchBudget, race: Race) -> Exploration:
    with open_session() as session:
        return explore(prepared(race), race.course, session, effort)


def test_improving_a_wide_start_finds_the_way_of_the_tight_start() -> None:
    wide = dataclasses.replace(QUICK_EFFORT, radii=(Radius(1.0),))
    unimproved = search_with(dataclasses.replace(wide, rounds=0), SLALOM).search(0)
    improved = search_with(wide, SLALOM).search(0)
    tight = search_with(dataclasses.replace(QUICK_EFFORT, radii=(Radius(0.4),)), SLALOM).search(0)
    assert unimproved.routes[0].race_time > tight.routes[0].race_time + 5.0
    assert improved.routes[0].race_time == pytest.approx(tight.routes[0].race_time, abs=2e-2)
    assert improved.routes[0].text == tight.routes[0].text


def test_loop_that_is_left_is_told() -> None:
    """Without other starts and without improving, the wound flight is the best of those tried."""
    effort = dataclasses.replace(QUICK_EFFORT, radii=(Radius(1.0),), rounds=0)
    told = " ".join(search_with(effort, SLALOM).search(0).loops)
    assert "left -> right" in told
    assert "where the gates ask for" in told


def test_loops_are_warned_of(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    loop = "left -> right: turns 340 degrees on 900 m, where the gates ask for 20 degrees on 160 m"

    def looped(*arguments: object) -> Exploration:
        found = explore(*arguments)  # type: ignore[arg-type]
        return dataclasses.replace(found, search=lambda one: dataclasses.replace(found.search(one), loops=(loop,)))

    monkeypatch.setattr(fidelity_continuation, "explore", looped)
    with open_session(QUICK) as session, caplog.at_level(logging.WARNING):
        result = FidelityContinuation(SMALL, QUICK, ()).climb(Stage.POINT_MASS, session)
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
        assert way.difference > -WORTH, "a price that was not tried jointly"
    texts = [way.text for way in others]
    assert len(set(texts)) == len(texts)
    assert explored.led >= 1
    assert explored.seconds > 0.0


@each_small_race
def test_rough_time_of_the_best_way_is_near_the_certified_one(race: Race) -> None:
    assert optimum(race).search.routes[0].race_time == pytest.approx(seconds(optimum(race)), abs=0.03)


def test_without_exploring_nothing_is_told() -> None:
    assert optimum(SLALOM, OFF).search.routes == ()
    assert optimum(SLALOM, OFF).search.seconds == 0.0


def test_start_without_exploring_is_never_lost_by_it() -> None:
    """Were all other plans of no use, exploring would still end where the race ends without it."""
    others_lead_nowhere = dataclasses.replace(QUICK_EFFORT, radii=(), rounds=0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fidelity_continuation, "EFFORTS", {SearchEffort.QUICK: others_lead_nowhere})
        (result,) = optimize(SLALOM, QUICK, until=Stage.POINT_MASS, threads=1, progress=Silent())
    assert result.certified
    assert (result.search.converged_to_best, result.search.converged_elsewhere, result.search.failed) == (1, 0, 0)
    assert seconds(result) == pytest.approx(seconds(optimum(SLALOM, OFF)), abs=SAME)


def test_thorough_search_tries_all_that_a_quick_one_tries() -> None:
    assert {radius.factor for radius in QUICK_EFFORT.radii if not radius.slower} <= {
        radius.factor for radius in THOROUGH.radii if not radius.slower
    }
    for name in ("max_plan_penalty", "rounds", "alternatives", "finalists"):
        assert getattr(THOROUGH, name) >= getattr(QUICK_EFFORT, name)


def test_no_race_without_a_flight_has_starts() -> None:
    """Where every start is lost the homotopy and the plan are what is left."""
    effort = dataclasses.replace(QUICK_EFFORT, radii=())
    found = search_with(effort, SMALL)
    assert found.starts == ()
    assert found.search(0).routes == ()


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
    assert seconds(optimum(race, thorough)) <= seconds(optimum(race)) + SAME
