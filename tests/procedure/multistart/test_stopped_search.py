"""A thorough search that is stopped by its prices: what was found before is kept, and says how far it is bounded."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import pytest
from search_races import PLAN, SLALOM, optimum

from airrace.errors import OutOfTime
from airrace.procedure.choice import SAME_FLIGHT
from airrace.procedure.multistart import lower_bound
from airrace.procedure.multistart.lower_bound import PriceSearch
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.settings import SearchEffort
from airrace.procedure.stage import Stage

THOROUGH = dataclasses.replace(PLAN, search=SearchEffort.THOROUGH, gap=0.0)


def stored_before(error: BaseException, rounds: int, solves: int) -> list[StageResult]:
    """The point masses of a search that is stopped in the round after so many, by an error after so many solves of
    windows from all starts there."""
    begun: list[int] = []
    solve_from_all, solve = PriceSearch._solve_from_all, lower_bound._solve_window

    def count_rounds(search: PriceSearch, *arguments: Any) -> dict[tuple[int, int], int]:
        begun.append(0)
        return solve_from_all(search, *arguments)

    def solve_until_stopped(*arguments: Any) -> Any:
        if len(begun) > rounds:
            if begun[-1] == solves:
                raise error
            begun[-1] += 1
        return solve(*arguments)

    stored: list[StageResult] = []
    with pytest.MonkeyPatch.context() as patch:  # other searches solve windows, too
        patch.setattr(PriceSearch, "_solve_from_all", count_rounds)
        patch.setattr(lower_bound, "_solve_window", solve_until_stopped)
        with pytest.raises(type(error)):
            stored.extend(optimize(SLALOM, THOROUGH, until=Stage.POINT_MASS, threads=1, progress=Silent()))
    return stored


def assert_stored_as_it_is(stored: Sequence[StageResult]) -> None:
    """What is on the disk is a certified flight as good as that of a quick search, and nothing is left to be done."""
    last = stored[-1]
    assert last.certified
    assert last.trajectory.race_time <= optimum(SLALOM).trajectory.race_time + SAME_FLIGHT
    bound = last.search.bound
    assert bound is not None
    assert bound.stopped
    assert 0.0 <= bound.seconds <= bound.race_time
    resumed = optimize(SLALOM, THOROUGH, until=Stage.POINT_MASS, threads=1, finished=[last], progress=Silent())
    assert list(resumed) == []


def test_search_that_is_stopped_before_any_window_was_solved_from_all_starts_keeps_its_flight() -> None:
    stored = stored_before(OutOfTime(), rounds=0, solves=5)
    assert_stored_as_it_is(stored)
    (only,) = stored
    assert only.search.bound is not None
    assert (only.search.bound.seconds, only.search.bound.windows) == (0.0, ())
    assert not [route for route in only.search.routes if route.evaluated_by == "priced"]


def test_search_that_is_stopped_in_its_second_round_keeps_the_bound_of_the_first() -> None:
    first, second = stored_before(KeyboardInterrupt(), rounds=1, solves=5)
    assert_stored_as_it_is([first, second])
    bound = second.search.bound
    assert bound is not None
    assert bound.seconds > 0.0
    assert bound.starts > 5
    assert sum(window.slack for window in bound.windows) == pytest.approx(bound.race_time - bound.seconds, abs=1e-6)
    assert second.trajectory.race_time <= first.trajectory.race_time
