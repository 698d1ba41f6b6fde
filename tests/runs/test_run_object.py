"""The object of a run, and the code its stages deserve."""

import json
import math
from dataclasses import replace

import pytest
from fake_optimizer import solve_single_mesh, stage_result

from airrace.procedure.infeasibility.analysis import told
from airrace.procedure.result import Outcome, Stage, State, SuggestedChange
from airrace.runs.command_result import CommandResult
from airrace.runs.execute import summarise
from airrace.runs.json_objects import lap_times, run_object, stage_object
from airrace.runs.stage_view import is_certified, verdict


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
            "state",
            "message",
            "race_time_s",
            "lap_times_s",
            "regularisation_s",
            "started_from",
            "tracking_error_m",
            "iterations",
            "solve_s",
            "derivatives_s",
            "wall_s",
            "certified",
            "alternatives",
            "mesh",
            "routes",
            "search",
            "conflicts",
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


def test_conflicts_are_told_one_by_one_with_what_resolves_each() -> None:
    suggested_changes = (
        SuggestedChange(1, "a -> b", "rules.n_z_max", "n_z", "g", 2.0, 2.8, 9.5),
        SuggestedChange(1, "a -> b", "", "the margin of safety line shore", "m", 0.0, -12.0, 9.0),
        SuggestedChange(2, "c", "", "", "", 0.0, 0.0, 0.0),
    )
    failed = replace(stage_result(Stage.POINT_MASS), outcome=Outcome.INFEASIBLE, suggested_changes=suggested_changes)
    (stage,) = json.loads(json.dumps(run_object("t", [failed], 1.0, certified=False), allow_nan=False))["stages"]
    first, second = stage["conflicts"]
    assert (first["where"], second) == ("a -> b", {"where": "c", "suggested_changes": []})
    assert first["suggested_changes"][0] == {
        "key": "rules.n_z_max",
        "text": "n_z",
        "unit": "g",
        "given": 2.0,
        "needed": 2.8,
        "race_time_s": 9.5,
    }
    assert first["suggested_changes"][1]["key"] is None  # no key moves a line
    sentence = told(suggested_changes)
    assert "a -> b cannot be flown with n_z of 2 g: it takes 2.8 g (rules.n_z_max=2.8), or the margin" in sentence
    assert sentence.endswith(
        "; and the limits contradict each other at c, and no single number was found that resolves it"
    )


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


def test_a_stage_solved_on_one_mesh_is_no_failure_but_never_a_certified_end() -> None:
    solved, certified = solve_single_mesh(stage_result(Stage.POINT_MASS)), stage_result(Stage.TRANSFER_FUNCTION)
    assert is_certified([solved, certified])
    assert not is_certified([certified, solved])
    code, sentence = verdict([solved])
    assert code == 5
    assert sentence == "point-mass: it is solved, but its race time was not confirmed on a second mesh"


def test_the_object_tells_what_was_proved_of_a_stage() -> None:
    solved = stage_object(solve_single_mesh(stage_result(Stage.POINT_MASS)))
    assert (solved["status"], solved["state"], solved["certified"]) == ("solved", "solved", False)
    certified = stage_object(stage_result(Stage.POINT_MASS))
    assert (certified["status"], certified["state"], certified["certified"]) == ("solved", "certified", True)


def test_nothing_but_all_items_makes_a_stage_certified() -> None:
    """Whatever else is left out or does not hold, the state never claims more."""
    result = stage_result(Stage.POINT_MASS)
    assert result.state is State.CERTIFIED
    assert solve_single_mesh(result).state is State.SOLVED
    assert stage_result(Stage.POINT_MASS, kkt_error=1.0).state is State.NOT_CERTIFIED
    assert solve_single_mesh(stage_result(Stage.POINT_MASS, kkt_error=1.0)).state is State.NOT_CERTIFIED
    assert stage_result(Stage.HOMOTOPY).state is State.GUESS
    for outcome in set(Outcome) - {Outcome.SOLVED}:
        assert stage_result(Stage.POINT_MASS, outcome).state.value == outcome.value
        assert not stage_result(Stage.POINT_MASS, outcome).holds


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
    answer = CommandResult()
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
