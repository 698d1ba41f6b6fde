"""A race is planned once, however many stages fly it and however often what was flown is looked at."""

import dataclasses

import numpy as np
import pytest
from races import SMALL, settings

from airrace.planning import plan as planning
from airrace.planning.race import Race
from airrace.procedure.fidelity_continuation import FidelityContinuation
from airrace.procedure.progress import Silent
from airrace.procedure.results_api import derived_quantities, sampler
from airrace.procedure.run import optimize
from airrace.procedure.settings import GuessKind
from airrace.procedure.stage import STAGES, Stage

PLAN = settings(GuessKind.PLAN)


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many ways each search for a plan had to choose from at its stops, search by search."""
    found: list[int] = []
    search = planning._shortest

    def counted(stops, pace, *, last):  # as the function that it stands in for
        found.append(max(len(stop.ways) for stop in stops))
        return search(stops, pace, last=last)

    monkeypatch.setattr(planning, "_shortest", counted)
    return found


def fresh() -> Race:
    """A race of which nothing is known yet."""
    return dataclasses.replace(SMALL)


def test_all_stages_fly_one_plan(searches: list[int]) -> None:
    race = fresh()
    ladder = FidelityContinuation(race, PLAN, ())
    plans = {id(ladder.flight(stage).plan) for stage in STAGES}
    assert plans == {id(race.plan)}
    assert len(searches) == 1


def test_looking_at_a_flight_plans_nothing(searches: list[int]) -> None:
    race = fresh()
    (result,) = optimize(race, PLAN, until=Stage.POINT_MASS, threads=1, progress=Silent())
    searches.clear()
    sampler(race, result)(np.array([0.0, 1.0]))
    derived_quantities(race, result)
    assert searches == []


def test_a_race_that_differs_has_a_plan_of_its_own() -> None:
    race = fresh()
    slower = dataclasses.replace(race, course=dataclasses.replace(race.course, passages=race.course.passages[:3]))
    assert len(race.plan.waypoints) == 4
    assert len(slower.plan.waypoints) == 3
