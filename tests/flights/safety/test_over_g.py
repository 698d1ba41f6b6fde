"""Over-g: the pulls that count by the ladder of a season."""

import math
from dataclasses import replace

import numpy as np
import pytest
from safety_courses import inputs

from airrace.files.inputs import load_inputs
from airrace.flights.results.penalties import ENDS_RACE, Penalties
from airrace.flights.safety.over_g import LOAD_ALLOWED, LoadRule
from airrace.optimal_control.quantities import Interval
from airrace.race import Race

SAMPLE = 0.02
LADDER = LoadRule(lower=-2.0, upper=10.0, lasting=0.6, at_once=12.0, penalty=ENDS_RACE)


def pulls(rule: LoadRule, *stretches: tuple[float, float], **joined: tuple[float, float]) -> int:
    """The pulls that count of a load factor that is 5 g but for some stretches of a level (g) and a time (s).

    Those that are `joined` follow the last of the others without a break.
    """
    parts = [np.full(50, 5.0)]
    for level, time in stretches:
        parts += [np.full(round(time / SAMPLE), level), np.full(50, 5.0)]
    if joined:
        parts[-1:] = [np.full(round(time / SAMPLE), level) for level, time in joined.values()]
    parts.append(np.full(50, 5.0))
    load = np.concatenate(parts)[:, None]
    return int(rule.pulls(load, SAMPLE, np.ones(load.shape, bool)).sum())


@pytest.mark.parametrize(
    ("level", "time", "count"),
    [(10.5, 0.5, 0), (10.5, 0.7, 1), (11.9, 0.1, 0), (12.2, 0.02, 1), (10.05, 5.0, 0), (-2.5, 0.02, 1), (-1.5, 5.0, 0)],
)
def test_a_pull_counts_where_it_lasts_or_is_beyond_what_ends_a_race(level: float, time: float, count: int) -> None:
    assert pulls(LADDER, (level, time)) == count


def test_without_a_ladder_every_pull_counts_and_each_once() -> None:
    plain = replace(LADDER, lasting=0.0, at_once=math.inf, penalty=None)
    assert pulls(plain, (10.5, 0.02), (10.2, 3.0), (10.0 + 0.5 * LOAD_ALLOWED, 1.0)) == 2
    assert pulls(LADDER, (10.5, 0.7), (10.5, 0.5), (10.5, 0.7)) == 2


@pytest.mark.parametrize("lasting", [0.3, 0.7, 1.5])
def test_a_pull_with_a_peak_is_one_pull_and_a_break_makes_two(lasting: float) -> None:
    """Whether or not it has counted, and has ceased to, by what it lasts before its peak ends the race."""
    assert pulls(LADDER, (10.5, lasting), peak=(12.5, 0.1), after=(10.5, 0.1)) == 1
    assert pulls(LADDER, (10.5, lasting), peak=(9.0, 0.1), after=(12.5, 0.1)) == (1 if lasting < 0.6 else 2)
    assert pulls(LADDER, (10.5, 0.7), peak=(-2.5, 0.1), after=(5.0, 0.1)) == 2


def test_what_lies_outside_of_the_race_does_not_count() -> None:
    load = np.full((200, 1), 11.0)
    assert not LADDER.pulls(load, SAMPLE, np.zeros(load.shape, bool)).any()


def test_more_load_is_never_judged_more_mildly() -> None:
    generator = np.random.default_rng(0)
    load = 10.0 + np.cumsum(generator.normal(0.0, 0.15, (600, 40)), axis=0)
    counted = LADDER.counted(load, SAMPLE)
    assert (LADDER.counted(np.maximum(load, 5.0) + 0.2, SAMPLE) >= counted * (load > 0.0)).all()
    assert counted.any()


def of_aircraft(upper: float) -> Race:
    race = inputs().race
    envelope = replace(race.aircraft.envelope, n_z=Interval(-upper, upper))
    return replace(race, aircraft=replace(race.aircraft, envelope=envelope))


def test_the_rule_is_that_of_the_season_and_of_the_aircraft() -> None:
    season = load_inputs("chiba_2015")
    rule = LoadRule.from_penalties(season.race, season.penalties)
    assert (rule.upper, rule.lasting, rule.at_once, rule.penalty) == (10.0, 0.6, 12.0, ENDS_RACE)
    at_once = "more than 12 g at once, which ends the race; less than -2 g"
    assert rule.text == f"more than 10 g for 0.6 s, which ends the race; {at_once}"
    for preset, pull in (("rbar-2018", "more than 10 g for 0.6 s"), ("rbar-2019", "more than 11 g")):
        season = load_inputs("chiba_2015", overrides=[f"rules.preset={preset}"])
        rule = LoadRule.from_penalties(season.race, season.penalties)
        assert rule.text == f"{pull}, which costs 1 s; {at_once}"
    none = load_inputs("rovinj_2014")
    assert LoadRule.from_penalties(none.race, none.penalties).text == "more than 10 g; less than -2 g"
    ladder = Penalties(load_factor=1.0, load_factor_time=0.6, load_factor_end=12.0)
    of_weak = LoadRule.from_penalties(of_aircraft(7.0), ladder)
    assert of_weak.at_once == 7.0
    assert "more than 7 g at once, which is the aircraft's limit; more than 12 g at once, which ends" in of_weak.text
    assert LoadRule.from_penalties(of_aircraft(7.0)).upper == 7.0
