"""What is suggested where a race has no flight: how many of which kind, with which margin, and in which order."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import pytest
from races import SMALL

from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.infeasibility.elastic_solver import ElasticSolver, Relaxed
from airrace.procedure.infeasibility.parameters import relaxables
from airrace.procedure.infeasibility.relaxed_routes import CLEAR, Relaxation, torn
from airrace.procedure.infeasibility.suggestions import (
    EFFORT_MAX,
    MARGINS,
    NOTHING,
    OF_AIRCRAFT,
    OF_RULES,
    Flown,
    Option,
    Trials,
)

KNOWN = {one.key: one for one in relaxables(SMALL)}
NOBODY = cast(ElasticSolver, None)  # no trial of these tests asks what relaxed it
CERTIFIED, FLOWN = Flown(20.0, certified=True, effort=0.1), Flown(20.0, certified=False, effort=0.1)
HARD = Flown(20.0, certified=False, effort=1.0)


def relaxed(steps: float) -> Relaxed:
    flight = Iterate(np.ones(1), np.zeros((1, 2)), np.zeros((1, 1)))
    return Relaxed(flight, steps, {}, {}, np.zeros((1, 1)), {"a -> b": 1.0})


def options(*keys: str) -> list[Option]:
    return [Option(KNOWN[key], NOBODY, relaxed(1.0)) for key in keys]


class Flights:
    """Trials that end as they are told to; `asked` counts them by key."""

    def __init__(self, tried: Sequence[Option], ends: Mapping[str, Sequence[Flown]]) -> None:
        self._keys = {id(one.relaxed): one.relaxable.key for one in tried}
        self._ends = ends
        self.asked = Counter[str]()

    def __call__(self, race: Race, relaxer: ElasticSolver, near: Relaxed) -> Flown:
        key = self._keys[id(near)]
        self.asked[key] += 1
        return self._ends.get(key, [CERTIFIED])[self.asked[key] - 1]


def told(tried: Sequence[Option], **ends: Any) -> tuple[list[tuple[str, float]], Counter[str]]:  # Any: `Flown`s
    """The keys that are told with their values, and how often each was tried; ends by the last part of the key."""
    by_key = {key: ends[key.rpartition(".")[2]] for key in KNOWN if key.rpartition(".")[2] in ends}
    fly = Flights(tried, by_key)
    return [(one.option.relaxable.key, one.value) for one in Trials(SMALL, fly).flown(tried)], fly.asked


RULES = [key for key in KNOWN if key.startswith(("rules.", "gates."))]
AIRCRAFT = ["aircraft.airframe.mass_kg", "aircraft.propulsion.power_max_kW", "aircraft.lift.C_L_max"]


def test_the_aircraft_is_told_beside_however_many_rules_and_gates() -> None:
    assert len(RULES) > OF_RULES.suggested_max
    keys = [key for key, _ in told(options(*RULES, *AIRCRAFT))[0]]
    assert keys == [*RULES[: OF_RULES.suggested_max], *AIRCRAFT[: OF_AIRCRAFT.suggested_max]]


def test_what_was_certified_is_told_before_what_only_flew_and_what_did_not_fly_never() -> None:
    tried = options(*RULES[:2], *AIRCRAFT)
    first = RULES[0].rpartition(".")[2]
    ends = {first: [FLOWN] * len(MARGINS), "mass_kg": [NOTHING] * len(MARGINS)}
    assert RULES[1].rpartition(".")[2] != first
    assert [key for key, _ in told(tried, **ends)[0]] == [RULES[1], *AIRCRAFT[1:], RULES[0]]


@pytest.mark.parametrize("certified", range(len(MARGINS)))
def test_the_least_margin_with_a_certified_flight_is_told(certified: int) -> None:
    (one,) = options("aircraft.propulsion.power_max_kW")
    ((_, value),), asked = told([one], power_max_kW=[FLOWN] * certified + [CERTIFIED])
    assert value == one.value(MARGINS[certified])
    assert asked[one.relaxable.key] == certified + 1


def test_the_mildest_value_that_flew_is_told_where_none_was_certified() -> None:
    (one,) = options("aircraft.propulsion.power_max_kW")
    ((_, value),), _ = told([one], power_max_kW=[FLOWN, FLOWN, NOTHING])
    assert value == one.value(MARGINS[1])


def test_hard_trials_are_not_repeated_without_end_but_the_first_is() -> None:
    tried = options(*AIRCRAFT[:2], *RULES[:3])
    ends = {key.rpartition(".")[2]: [HARD] * len(MARGINS) for key in KNOWN}
    assert len(tried) > EFFORT_MAX
    told_, asked = told(tried, **ends)
    assert [key for key, _ in told_] == [*RULES[:3], *AIRCRAFT[:2]]
    assert asked == {RULES[0]: len(MARGINS), **dict.fromkeys([*RULES[1:3], *AIRCRAFT[:2]], 1)}


def test_limits_clearly_contradict_each_other_only_where_they_do_on_all_ways_round() -> None:
    much, little = Relaxation(NOBODY, relaxed(2.0 * CLEAR)), Relaxation(NOBODY, relaxed(0.5 * CLEAR))
    assert torn([much, much]) == "a -> b"
    assert [torn(one) for one in ([much, little], [much, None], [None], [])] == ["", "", "", ""]
