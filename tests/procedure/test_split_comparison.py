"""Two flights leg by leg: what is lost on the legs adds up to what is lost in all."""

import dataclasses

import pytest
from races import PLAN, SHIPPED, SMALL, blown, optimum

from airrace.procedure.result import Outcome, Stage
from airrace.procedure.split_comparison import compared, last_common


def test_losses_of_the_legs_add_up_to_that_of_the_race() -> None:
    found = compared(optimum(SMALL, PLAN), optimum(blown(SMALL, 200.0, 3.0), PLAN))
    assert found.difference != 0.0
    assert sum(leg.difference for leg in found.legs) == pytest.approx(found.difference, abs=1e-9)
    assert found.legs[-1].cumulative == pytest.approx(found.difference, abs=1e-9)
    assert sum(leg.before for leg in found.legs) == pytest.approx(found.before, abs=1e-9)
    assert [leg.name for leg in found.legs] == ["pylon", "edge", "last"]


def test_comparison_the_other_way_round_changes_all_signs() -> None:
    calm, windy = optimum(SMALL, PLAN), optimum(blown(SMALL, 200.0, 3.0), PLAN)
    there, back = compared(calm, windy), compared(windy, calm)
    assert [leg.difference for leg in there.legs] == [-leg.difference for leg in back.legs]
    assert there.difference == -back.difference


def test_flights_of_other_passings_are_not_compared() -> None:
    with pytest.raises(ValueError, match="same passings"):
        compared(optimum(SMALL, PLAN), optimum(SHIPPED["half_cuban_eight"], PLAN))


def test_only_stages_certified_in_both_runs_are_compared() -> None:
    flown = optimum(SMALL, PLAN)
    higher = dataclasses.replace(flown, stage=Stage.TRANSFER_FUNCTION)
    failed = dataclasses.replace(higher, outcome=Outcome.NOT_CERTIFIED)
    assert last_common([flown, higher], [flown]) == (flown, flown)
    assert last_common([flown, failed], [flown, higher]) == (flown, flown)
    assert last_common([failed], [higher]) is None
