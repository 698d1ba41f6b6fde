"""The safety of a course in many winds: what fails in one of them costs no other."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from safety_courses import inputs, optimum

from airrace.errors import OutOfTime, UsageError
from airrace.optimal_control.quantities import KNOT
from airrace.runs.run_state import RunState, new_run
from airrace.runs.safety_case import SafetyCase
from airrace.runs.safety_rose import NO_TIME, fly_rose, is_cut, is_own, own_case
from airrace.runs.stage_view import StageView


def flown() -> RunState:
    """A run with the six-dof optimum."""
    return new_run(inputs(), None).with_stage(optimum())


def test_a_wind_that_fails_is_a_remark_and_the_others_are_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    safety = StageView.safety

    def unsteady(view: StageView, **options: Any) -> SafetyCase:
        if options["label"] == "5 kt from 180":
            raise UsageError("a pilot cannot hold this optimum")
        return safety(view, **options)

    monkeypatch.setattr(StageView, "safety", unsteady)
    asked: list[Sequence[str]] = []

    def fly_again(_: RunState, values: Sequence[str]) -> RunState:
        asked.append(values)
        return flown()

    rows = fly_rose(flown(), "0,5kt@2", fly_again, {"flights": 2, "threads": 1}).table().objects()
    assert [row["wind"] for row in rows] == ["calm", "5 kt from 000", "5 kt from 180"]
    assert [row["contact_percent"] is None for row in rows] == [False, False, True]
    assert rows[2]["remark"] == "a pilot cannot hold this optimum"
    assert asked[0] == ["rules.reserve=null", "environment.wind=null"]


def test_the_wind_of_the_run_is_not_solved_again() -> None:
    asked: list[Sequence[str]] = []

    def fly_again(_: RunState, values: Sequence[str]) -> RunState:
        asked.append(values)
        raise UsageError("there is no flight")  # so that none is simulated but that of the run

    own = inputs().race.air.wind
    assert own is not None
    speed = own.speed / KNOT
    rose = fly_rose(flown(), f"{speed:.9f}kt@36", fly_again, {"flights": 1, "threads": 1})
    assert len(asked) == 35
    (same,) = (wind for wind in rose.cases if is_own(wind, flown()))
    assert same.from_deg == 250.0
    case = own_case(flown(), rose)
    assert case is rose.cases[same]
    assert own_case(flown(), "no flight") is None


def test_winds_before_which_the_time_is_over_are_told_and_those_that_are_flown_stay() -> None:
    def fly_again(_: RunState, values: Sequence[str]) -> RunState:
        if "environment.wind.from_deg=180" in values:
            raise OutOfTime("no time left")
        return flown()

    rose = fly_rose(flown(), "5kt@2", fly_again, {"flights": 2, "threads": 1})
    assert [isinstance(case, str) for case in rose.cases.values()] == [False, True]
    assert is_cut(rose)
    none = fly_rose(flown(), "5kt@2", fly_again, {"flights": 2, "threads": 1}, until=-math.inf)
    assert set(none.cases.values()) == {NO_TIME}
    assert not is_cut(fly_rose(flown(), "0kt", fly_again, {"flights": 2, "threads": 1}))
