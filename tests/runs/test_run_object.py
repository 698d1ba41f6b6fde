"""The object of a run, and the code its stages deserve."""

import json
import math

import pytest
from canned_procedure import stage_result

from airrace.procedure.result import Outcome, Stage
from airrace.runs.answer import Answer
from airrace.runs.run_object import is_certified, lap_times, run_object, summarise


def test_the_object_has_the_documented_keys() -> None:
    results = [stage_result(Stage.HOMOTOPY), stage_result(Stage.POINT_MASS)]
    answered = run_object("t", results, 2.0, certified=True)
    assert list(answered) == ["track", "certified", "race_time_s", "wall_s", "stages"]
    assert answered["race_time_s"] == pytest.approx(10.0)
    stages = json.loads(json.dumps(answered, allow_nan=False))["stages"]
    assert [stage["stage"] for stage in stages] == ["homotopy", "point-mass"]
    for stage in stages:
        assert list(stage) == [
            "stage",
            "status",
            "message",
            "race_time_s",
            "lap_times_s",
            "regularisation_s",
            "started_from",
            "strayed_m",
            "iterations",
            "solve_s",
            "derivatives_s",
            "wall_s",
            "certified",
            "rivals",
            "mesh",
            "ways",
            "explored",
            "certificate",
        ]
    assert stages[0]["certificate"] is None
    assert stages[1]["certificate"]["solver_status"] == "Solve_Succeeded"
    assert stages[1]["certificate"]["items"][0] == {
        "name": "kkt_error",
        "value": 1e-9,
        "limit": 1e-6,
        "unit": "",
        "holds": True,
        "where": "",
    }


def test_what_could_not_be_measured_is_null_and_does_not_hold() -> None:
    results = [stage_result(Stage.POINT_MASS, kkt_error=math.nan)]
    answered = json.loads(json.dumps(run_object("t", results, 1.0, certified=False), allow_nan=False))
    item = answered["stages"][0]["certificate"]["items"][0]
    assert item["value"] is None
    assert item["holds"] is False
    assert not is_certified(results)


def test_a_guess_on_the_way_is_no_failure_but_never_a_certified_end() -> None:
    homotopy, point_mass = stage_result(Stage.HOMOTOPY), stage_result(Stage.POINT_MASS)
    assert is_certified([homotopy, point_mass])
    assert not is_certified([homotopy])
    assert not is_certified([])


@pytest.mark.parametrize(
    ("outcome", "code"),
    [
        (Outcome.SOLVED, 0),
        (Outcome.NOT_CERTIFIED, 5),
        (Outcome.NOT_CONVERGED, 5),
        (Outcome.INFEASIBLE, 4),
        (Outcome.TIMEOUT, 6),
    ],
)
def test_each_outcome_has_its_code(outcome: Outcome, code: int) -> None:
    answer = Answer()
    summarise(answer, "t", [stage_result(Stage.HOMOTOPY), stage_result(Stage.POINT_MASS, outcome)], 1.0)
    assert answer.code == code
    assert bool(answer.error) == bool(code)
    assert answer.fields["certified"] == (code == 0)


def test_laps_add_up_to_the_race_and_one_lap_is_none() -> None:
    """The names of passings begin with the number of the lap."""
    own = stage_result(Stage.POINT_MASS, passings=("0:g0", "1:g1", "1:g0", "2:g1", "2:g0"))
    assert lap_times(own.splits) == [5.0, 5.0]
    assert sum(lap_times(own.splits)) == own.trajectory.race_time
    assert lap_times(stage_result(Stage.POINT_MASS, passings=("0:g0", "1:g1", "1:g0")).splits) == []
