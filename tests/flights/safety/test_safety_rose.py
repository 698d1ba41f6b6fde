"""The safety of a course in many winds: what fails in one of them costs no other."""

from collections.abc import Sequence
from typing import Any

import pytest
from safety_courses import inputs, optimum

from airrace.errors import UsageError
from airrace.runs.run_state import RunState, new_run
from airrace.runs.safety_case import SafetyCase
from airrace.runs.safety_rose import fly_rose
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
