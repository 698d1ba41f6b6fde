"""A start from another run: a flight that goes the wrong way round is overtaken, a good one is not."""

import dataclasses

import pytest
from explored_races import OFF, QUICK, WOUND, optimum
from races import blown, prepared
from ways_bench import workbench

from airrace.procedure.flight import stage_flight
from airrace.procedure.ladder import Ladder
from airrace.procedure.progress import Silent
from airrace.procedure.result import Outcome, Stage, StageResult
from airrace.procedure.run import optimize
from airrace.procedure.settings import Settings
from airrace.procedure.ways.around import faster_way

WINDY = blown(WOUND, 200.0, 2.0)


def found_around(optimum: StageResult) -> str:
    source = stage_flight(optimum.stage, WOUND, QUICK, optimum.trajectory)
    with workbench() as bench:
        return faster_way(prepared(WOUND), source, optimum, WOUND.course, bench)


def test_wrong_way_round_is_told() -> None:
    told = found_around(optimum(WOUND, OFF))
    assert told.endswith(" s")
    words, _, seconds = told.removesuffix(" s").partition(" saves about ")
    assert "->" in words
    assert float(seconds) > 5.0


def test_of_a_good_flight_nothing_is_told() -> None:
    assert found_around(optimum(WOUND)) == ""


def started(start: StageResult, chosen: Settings) -> StageResult:
    (result,) = optimize(
        WINDY, chosen, until=Stage.POINT_MASS, threads=1, start=[start], start_name="calm.h5", progress=Silent()
    )
    assert result.certified
    return result


def test_run_started_from_a_flight_the_wrong_way_round_is_flown_from_scratch_and_says_so() -> None:
    result = started(optimum(WOUND, OFF), QUICK)
    assert result.message.startswith("calm.h5: from its point-mass an optimum of ")
    assert result.message.endswith("so the start is from scratch")
    assert result.trajectory.race_time < optimum(WOUND, OFF).trajectory.race_time - 5.0


def test_run_started_from_a_good_flight_keeps_its_way() -> None:
    result = started(optimum(WOUND), QUICK)
    assert result.message == ""
    assert result.facts.source == "point-mass of calm.h5"


def test_without_exploring_a_start_is_taken_as_it_is() -> None:
    result = started(optimum(WOUND, OFF), OFF)
    assert result.message == ""
    assert result.trajectory.race_time > optimum(WOUND).trajectory.race_time + 5.0


def test_certified_start_is_not_given_up_for_a_promise_that_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another way seems faster when flown roughly; from scratch it leads to nothing faster, or to nothing at all."""
    good = started(optimum(WOUND), QUICK)
    monkeypatch.setattr(Ladder, "faster_way", lambda *_: "left -> right, flat, saves about 0.03 s")
    for scratch in (slower(good), dataclasses.replace(good, outcome=Outcome.NOT_CERTIFIED)):
        monkeypatch.setattr(Ladder, "climb", lambda *_, found=scratch: found)
        result = started(optimum(WOUND), QUICK)
        assert result.trajectory.race_time == good.trajectory.race_time
        assert result.message.endswith("so the start is from scratch, which led to nothing faster")


def slower(result: StageResult) -> StageResult:
    flown = dataclasses.replace(result.trajectory, durations=1.01 * result.trajectory.durations)
    return dataclasses.replace(result, trajectory=flown)
