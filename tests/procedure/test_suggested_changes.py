"""Suggested changes of an infeasible course: which are tried, tightened and told."""

import dataclasses
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import pytest
from races import (
    SMALL,
    planned,
    prepared,
)
from test_infeasible import level_turn
from test_solving import asked, session

from airrace.errors import InputError
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.quantities import Interval
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.infeasibility.conflicts import AIRCRAFT as AIRCRAFT_KIND
from airrace.procedure.infeasibility.conflicts import (
    MARGINS,
    PLAIN_STEPS,
    RULES_AND_GATES,
    Repair,
    conflict_location,
)
from airrace.procedure.infeasibility.diagnose import (
    CONFLICT_WORK_MAX,
    NOT_TRIED,
    RepairTrial,
    TrialFlight,
    Trials,
    describe_conflicts,
    tighten,
    validate,
)
from airrace.procedure.infeasibility.elastic import ElasticSolver, Relaxed
from airrace.procedure.planning.parameters import relaxable_parameters
from airrace.procedure.result import SuggestedChange
from airrace.procedure.solver_session import Budget
from airrace.procedure.stage import Stage
from airrace.race import Race

KNOWN = {one.key: one for one in relaxable_parameters(SMALL)}
NOBODY = cast(ElasticSolver, None)  # no trial of these tests asks what relaxed it
NOTHING = TrialFlight(None, certified=False, work=0.0)
CERTIFIED, FLOWN = TrialFlight(20.0, certified=True, work=0.1), TrialFlight(20.0, certified=False, work=0.1)
HARD = TrialFlight(20.0, certified=False, work=1.0)


def relaxed(steps: float) -> Relaxed:
    flight = Iterate(np.ones(1), np.zeros((1, 2)), np.zeros((1, 1)))
    return Relaxed(NOBODY, flight, steps, {}, {}, np.zeros((1, 1)), {"a -> b": 1.0})


def options(*keys: str) -> list[Repair]:
    return [Repair(KNOWN[key], relaxed(1.0)) for key in keys]


class Flights:
    """Trials that end as they are told to; `asked` counts them by key."""

    def __init__(self, tried: Sequence[Repair], ends: Mapping[str, Sequence[TrialFlight]]) -> None:
        self._keys = {id(one.relaxed): one.parameter.key for one in tried}
        self._ends = ends
        self.asked = Counter[str]()

    def __call__(self, race: Race, near: Relaxed, before: TrialFlight) -> TrialFlight:
        key = self._keys[id(near)]
        self.asked[key] += 1
        return self._ends.get(key, [CERTIFIED])[self.asked[key] - 1]


def told(tried: Sequence[Repair], **ends: Any) -> tuple[list[tuple[str, float]], Counter[str]]:  # Any: `Flown`s
    """The keys that are told with their values, and how often each was tried; ends by the last part of the key."""
    by_key = {key: ends[key.rpartition(".")[2]] for key in KNOWN if key.rpartition(".")[2] in ends}
    fly = Flights(tried, by_key)
    return [(one.repair.parameter.key, one.value) for one in validate(SMALL, fly, tried)], fly.asked


RULE_KEYS = [key for key in KNOWN if key.startswith(("rules.", "gates."))]
AIRCRAFT = ["aircraft.airframe.mass_kg", "aircraft.propulsion.power_max_kW", "aircraft.lift.C_L_max"]


def test_the_aircraft_is_reported_beside_however_many_rules_and_gates() -> None:
    assert len(RULE_KEYS) > RULES_AND_GATES.suggested_max
    keys = [key for key, _ in told(options(*RULE_KEYS, *AIRCRAFT))[0]]
    assert keys == [*RULE_KEYS[: RULES_AND_GATES.suggested_max], *AIRCRAFT[: AIRCRAFT_KIND.suggested_max]]


def test_what_was_certified_is_reported_before_what_only_flew_and_what_did_not_fly_never() -> None:
    tried = options(*RULE_KEYS[:2], *AIRCRAFT)
    first = RULE_KEYS[0].rpartition(".")[2]
    ends = {first: [FLOWN] * len(MARGINS), "mass_kg": [NOTHING] * len(MARGINS)}
    assert RULE_KEYS[1].rpartition(".")[2] != first
    assert [key for key, _ in told(tried, **ends)[0]] == [RULE_KEYS[1], *AIRCRAFT[1:], RULE_KEYS[0]]


@pytest.mark.parametrize("certified", range(len(MARGINS)))
def test_the_least_margin_with_a_certified_flight_is_reported(certified: int) -> None:
    (one,) = options("aircraft.propulsion.power_max_kW")
    ((_, value),), asked = told([one], power_max_kW=[FLOWN] * certified + [CERTIFIED])
    assert value == one.value(certified)
    assert asked[one.parameter.key] == certified + 1


def test_the_mildest_value_that_flew_is_reported_where_none_was_certified() -> None:
    (one,) = options("aircraft.propulsion.power_max_kW")
    ((_, value),), _ = told([one], power_max_kW=[FLOWN, FLOWN, NOTHING])
    assert value == one.value(1)


def test_hard_trials_are_not_repeated_without_end_but_the_first_is() -> None:
    tried = options(*AIRCRAFT[:2], *RULE_KEYS[:3])
    ends = {key.rpartition(".")[2]: [HARD] * len(MARGINS) for key in KNOWN}
    assert len(tried) > CONFLICT_WORK_MAX
    told_, asked = told(tried, **ends)
    assert [key for key, _ in told_] == [*RULE_KEYS[:3], *AIRCRAFT[:2]]
    assert asked == {RULE_KEYS[0]: len(MARGINS), **dict.fromkeys([*RULE_KEYS[1:3], *AIRCRAFT[:2]], 1)}


def test_limits_clearly_contradict_each_other_only_where_they_do_on_all_ways_round() -> None:
    much, little = (relaxed(factor * PLAIN_STEPS) for factor in (2.0, 0.5))
    assert conflict_location([much, much]) == "a -> b"
    assert [conflict_location(one) for one in ([much, little], [much, None], [None], [])] == ["", "", "", ""]


GIVEN = 235.0
LOW = level_turn(4.0)
LOW = dataclasses.replace(
    LOW,
    course=dataclasses.replace(LOW.course, rules=dataclasses.replace(LOW.course.rules, height=Interval(10.0, GIVEN))),
)
CEILING = next(one for one in relaxable_parameters(LOW) if one.key == "rules.ceiling_m")


def tightened(
    certified_from: float, found_from: float, begin: float, **known: Any
) -> tuple[SuggestedChange, list[float]]:
    """What is told of a ceiling that was certified at `begin`, and the heights that were tried of it."""
    tried: list[float] = []

    def fly(race: Race, near: Relaxed, before: TrialFlight) -> TrialFlight:
        tried.append(race.course.rules.height.upper)
        assert before.certified
        seconds = 40.0 if tried[-1] >= found_from else None
        return TrialFlight(seconds, certified=tried[-1] >= certified_from, work=0.1)

    trial = RepairTrial(Repair(CEILING, relaxed(3.35)), begin, CERTIFIED, **known)
    return tighten(LOW, fly, trial).suggested_change(1, "a -> b"), tried


@pytest.mark.parametrize("least", [260.0, 268.0, 275.0, 286.0])
def test_the_least_value_told_is_one_step_from_one_with_which_nothing_is_found(least: float) -> None:
    told, tried = tightened(least, least, 287.0)
    assert (told.needed, told.failed, told.failed_flies) == (least, least - 1.0, False)
    assert len(tried) < 16
    assert describe_conflicts([told]).endswith(
        f"it takes {least:g} m (rules.ceiling_m={least:g}), for with {least - 1.0:g} m none was found"
    )


def test_a_value_that_has_failed_before_is_not_tried_again() -> None:
    told, tried = tightened(275.0, 270.0, 287.0, failed=274.0, failed_flies=True)
    assert (told.needed, told.failed, told.failed_flies) == (275.0, 274.0, True)
    assert min(tried) == 275.0
    assert "it takes" not in describe_conflicts([told])


def test_where_less_was_not_tried_or_nothing_is_certified_nothing_is_said_to_be_the_least() -> None:
    told = SuggestedChange(1, "a -> b", "rules.ceiling_m", "the ceiling", "m", GIVEN, 287.0, 40.0)
    for one, ending in (
        (told, "with 287 m there is a flight (rules.ceiling_m=287); less was not tried"),
        (
            dataclasses.replace(told, certified=False),
            "with 287 m there is a flight that is not certified (rules.ceiling_m=287); less was not tried",
        ),
        (
            dataclasses.replace(told, failed=274.0, failed_flies=True),
            "with 287 m there is a flight (rules.ceiling_m=287); the one with 274 m was not certified",
        ),
        (
            dataclasses.replace(told, failed=274.0, failed_flies=True, certified=False),
            "with 287 m there is a flight that is not certified (rules.ceiling_m=287); "
            "the one with 274 m was not certified either",
        ),
        (
            dataclasses.replace(told, failed=274.0, certified=False),
            "with 287 m there is a flight that is not certified (rules.ceiling_m=287); with 274 m none was found",
        ),
    ):
        assert describe_conflicts([one]).endswith(ending)


@pytest.mark.parametrize("trials", [0, 1, 2])
@pytest.mark.parametrize("refused", [False, True])
def test_what_was_not_tried_is_not_told_to_have_failed(trials: int, refused: bool) -> None:
    """The budget is spent, or the inputs do not allow a value."""
    tried: list[float] = []

    def fly(race: Race, near: Relaxed, before: TrialFlight) -> TrialFlight:
        if len(tried) == trials:
            if refused:
                raise InputError([])
            return NOT_TRIED
        tried.append(race.course.rules.height.upper)
        return CERTIFIED if trials == 1 else NOTHING

    told = tighten(LOW, fly, RepairTrial(Repair(CEILING, relaxed(3.35)), 287.0, CERTIFIED))
    change = told.suggested_change(1, "a -> b")
    assert change.needed == (tried[-1] if trials == 1 else 287.0)
    assert change.failed == (tried[-1] if trials == 2 else math.inf)
    assert describe_conflicts([change]).endswith("less was not tried") is (trials < 2)


def test_a_margin_that_the_inputs_refuse_has_not_failed() -> None:
    (one,) = options("aircraft.propulsion.power_max_kW")
    for ends, failed in (
        ([NOT_TRIED, CERTIFIED], math.inf),
        ([FLOWN, NOT_TRIED, CERTIFIED], one.value(0)),
        ([NOTHING, CERTIFIED], one.value(0)),
    ):
        (trial,) = validate(SMALL, Flights([one], {one.parameter.key: ends}), [one])
        assert (trial.flight.certified, trial.failed) == (True, failed)


@pytest.mark.parametrize(("left", "solves", "was_tried"), [(0.0, 0, False), (1.0, 1, False), (math.inf, 2, True)])
def test_a_race_is_tried_as_far_as_there_is_a_budget_for_it(left: float, solves: int, was_tried: bool) -> None:
    used, near = session("stuck"), relaxed(1.0)
    used.budget = Budget(work=100.0 + left, spent=100, failed_only=False)
    mesh = first_mesh(planned(SMALL), used.settings.mesh)
    solver = ElasticSolver(SMALL, prepared(SMALL), mesh)
    near = dataclasses.replace(near, solver=solver, flight=guess(planned(SMALL), mesh))
    flown = Trials(used, SMALL, Stage.POINT_MASS).fly(SMALL, near, NOT_TRIED)
    assert (flown.race_time, flown.was_tried) == (None, was_tried)
    assert len(asked(used)) == solves
