"""A warm stage finds the optimum that a race has from scratch, whatever was solved before."""

import dataclasses
from contextlib import closing

import pytest
from races import PLAN, SMALL, blown, optimum

from airrace.errors import UsageError
from airrace.optimal_control.quantities import Interval
from airrace.procedure.result import Status
from airrace.procedure.stage_problem import OtherStructureError, PerturbedProblem
from airrace.procedure.warm_stage import WarmStage
from airrace.race import Race


def with_limit(race: Race, n_z: float) -> Race:
    rules = dataclasses.replace(race.course.rules, n_z=Interval(-2.0, n_z))
    return dataclasses.replace(race, course=dataclasses.replace(race.course, rules=rules))


def test_every_answer_is_the_optimum_from_scratch_and_its_mesh_can_be_checked() -> None:
    windy, tight = blown(SMALL, 200.0, 3.0), with_limit(SMALL, 9.0)
    with closing(WarmStage(SMALL, PLAN, optimum(SMALL, PLAN))) as warm:
        for race in (tight, windy, tight):  # the wind has equations of its own
            found = warm.solve(race)
            assert found.status is Status.SOLVED
            scratch = optimum(race, PLAN).trajectory.race_time
            assert found.trajectory.race_time == pytest.approx(scratch, abs=5e-3)
            assert found.certificate is not None
            assert found.certificate.holds
        checked = warm.mesh_check(race, found)()
        assert checked.certified
        assert checked.trajectory.race_time == pytest.approx(scratch, abs=5e-3)
        from_there = warm.solve(tight, found)
        assert from_there.trajectory.race_time == pytest.approx(optimum(tight, PLAN).trajectory.race_time, abs=5e-3)


def test_a_race_without_a_flight_is_an_answer_and_the_next_one_is_solved() -> None:
    with closing(WarmStage(SMALL, PLAN, optimum(SMALL, PLAN))) as warm:
        assert not warm.solve(with_limit(SMALL, 0.5)).holds
        assert warm.solve(SMALL).trajectory.race_time == pytest.approx(warm.optimum.trajectory.race_time, abs=1e-4)


def test_other_passings_are_refused_and_other_kinds_of_conditions_are_no_numbers() -> None:
    course = SMALL.course
    shorter = dataclasses.replace(SMALL, course=dataclasses.replace(course, passages=course.passages[:-1]))
    perturbed = PerturbedProblem.of_result(SMALL, PLAN, optimum(SMALL, PLAN))
    for race in (shorter, blown(SMALL, 200.0, 3.0)):
        with pytest.raises(OtherStructureError):
            perturbed.formulation(race)
    with (
        closing(WarmStage(SMALL, PLAN, optimum(SMALL, PLAN))) as warm,
        pytest.raises(UsageError, match="other passings"),
    ):
        warm.solve(shorter)
