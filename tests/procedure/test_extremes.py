"""Courses that nobody would build but that can be flown: they are flown, and certified."""

import dataclasses

import pytest
from races import EDGE_540, RULES, course, level, optimum, settings

from airrace.dynamics.limits import LEAST_ROOM
from airrace.environment.air import Air
from airrace.planning.plan import ONE_PLACE
from airrace.planning.race import Race
from airrace.procedure.result import StageResult
from airrace.procedure.settings import GuessKind
from airrace.quantities import Interval
from airrace.track.course import Rules

HEIGHT = 20.0  # m, of all gates


def flown(*distances: float, rules: Rules = RULES) -> StageResult:
    """The optimum through gates one behind the other, at these distances from the first (m)."""
    gates = [level(f"g{number}", north, 0.0, 0.0) for number, north in enumerate([0.0, *distances])]
    race = Race(course("in a row", *gates, rules=rules), EDGE_540, Air())
    return optimum(race, settings(GuessKind.PLAN))


@pytest.mark.parametrize("apart", [2.0 * ONE_PLACE, 0.05, 1.0, 5.0])
def test_a_gate_right_behind_another_one_costs_no_time(apart: float) -> None:
    close, alone = flown(300.0, 300.0 + apart, 600.0), flown(300.0, 600.0)
    assert close.certified
    assert close.trajectory.race_time == pytest.approx(alone.trajectory.race_time, abs=2e-3)


def test_a_gate_that_is_passed_again_at_once_is_come_back_to() -> None:
    again = flown(300.0, 300.0, 600.0)
    assert again.certified
    assert again.trajectory.race_time > flown(300.0, 600.0).trajectory.race_time + 2.0


@pytest.mark.parametrize("turned", [0.0, 60.0])
def test_one_height_alone_can_be_kept(turned: float) -> None:
    """Straight on and in a turn."""
    kept = dataclasses.replace(RULES, height=Interval.exactly(HEIGHT))
    gates = level("a", 0.0, 0.0, 0.0), level("b", 500.0, 100.0, turned), level("c", 800.0, 900.0, 90.0)
    result = optimum(Race(course("level", *gates, rules=kept), EDGE_540, Air()), settings(GuessKind.PLAN))
    assert result.certified
    assert result.trajectory.of("z") == pytest.approx(-HEIGHT, abs=0.51 * LEAST_ROOM)
