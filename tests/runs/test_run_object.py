"""The object of a run, and the code its stages deserve."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import fake_optimizer
import pytest
from fake_optimizer import solve_roughly, solve_single_mesh, stage_result

from airrace.errors import InputError, SolverCrash, UsageError
from airrace.files.checkpoint import Checkpoint, write_checkpoint
from airrace.files.inputs import load_inputs
from airrace.procedure import procedure, stored_stages
from airrace.procedure.infeasibility.diagnose import describe_conflicts
from airrace.procedure.result import OUTCOMES, Silent, StageResult, Status, SuggestedChange
from airrace.procedure.settings import MeshCheck
from airrace.procedure.stage import Stage
from airrace.runs.command_result import CommandResult
from airrace.runs.execute import execute_for_command
from airrace.runs.execution_plan import plan_resumed_run
from airrace.runs.json_objects import lap_times, run_object, stage_object
from airrace.runs.output import FlightName
from airrace.runs.run_state import RunState, adopt_checkpoint, new_run
from airrace.runs.verdict import is_certified, verdict
from airrace.runs.verification import inconsistencies, verify_run


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


def test_conflicts_are_reported_one_by_one_with_what_resolves_each() -> None:
    suggested_changes = (
        SuggestedChange(1, "a -> b", "rules.n_z_max", "n_z", "g", 2.0, 2.8, 9.5, failed=2.7),
        SuggestedChange(1, "a -> b", "", "the margin of safety line shore", "m", 0.0, -12.0, 9.0),
        SuggestedChange(2, "c", "", "", "", 0.0, 0.0, 0.0),
    )
    failed = replace(stage_result(Stage.POINT_MASS), outcome=Status.INFEASIBLE, suggested_changes=suggested_changes)
    (stage,) = json.loads(json.dumps(run_object("t", [failed], 1.0, certified=False), allow_nan=False))["stages"]
    first, second = stage["conflicts"]
    assert (first["where"], second) == ("a -> b", {"where": "c", "suggested_changes": []})
    assert first["suggested_changes"][0] == {
        "key": "rules.n_z_max",
        "text": "n_z",
        "unit": "g",
        "given": 2.0,
        "needed": 2.8,
        "certified": True,
        "failed": 2.7,
        "failed_flies": False,
        "race_time_s": 9.5,
    }
    assert first["suggested_changes"][1]["key"] is None  # no key moves a line
    assert first["suggested_changes"][1]["failed"] is None  # less was not tried
    sentence = describe_conflicts(suggested_changes)
    assert "a -> b cannot be flown with n_z of 2 g: it takes 2.8 g (rules.n_z_max=2.8)" in sentence
    assert "for with 2.7 g none was found; or the margin of safety line shore of" in sentence
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
    assert (solved["status"], solved["certified"]) == ("solved", False)
    certified = stage_object(stage_result(Stage.POINT_MASS))
    assert (certified["status"], certified["certified"]) == ("certified", True)


def test_nothing_but_all_items_makes_a_stage_certified() -> None:
    """Whatever else is left out or does not hold, the state never claims more."""
    result = stage_result(Stage.POINT_MASS)
    assert result.status is Status.CERTIFIED
    assert solve_single_mesh(result).status is Status.SOLVED
    assert stage_result(Stage.POINT_MASS, kkt_error=1.0).status is Status.NOT_CERTIFIED
    assert solve_single_mesh(stage_result(Stage.POINT_MASS, kkt_error=1.0)).status is Status.NOT_CERTIFIED
    assert stage_result(Stage.HOMOTOPY).status is Status.GUESS
    for outcome in set(OUTCOMES) - {Status.SOLVED}:
        assert stage_result(Stage.POINT_MASS, outcome).status.value == outcome.value
        assert not stage_result(Stage.POINT_MASS, outcome).holds


def test_laps_add_up_to_the_race_and_one_lap_is_none() -> None:
    """The names of passings begin with the number of the lap."""
    own = stage_result(Stage.POINT_MASS, passings=("0:g0", "1:g1", "1:g0", "2:g1", "2:g0"))
    assert lap_times(own.splits) == [5.0, 5.0]
    assert sum(lap_times(own.splits)) == own.trajectory.race_time
    assert lap_times(stage_result(Stage.POINT_MASS, passings=("0:g0", "1:g1", "1:g0")).splits) == []


def test_stage_stands_behind_the_colon() -> None:
    assert FlightName.of("folder/run.h5:six-dof") == FlightName(Path("folder/run.h5"), "six-dof")
    assert FlightName.of("folder/run.h5") == FlightName(Path("folder/run.h5"), None)


def test_file_with_a_colon_in_its_name_comes_first(tmp_path: Path) -> None:
    file = tmp_path / "run.h5:six-dof"
    file.touch()
    assert FlightName.of(str(file)) == FlightName(file, None)


def test_nothing_behind_the_colon_is_no_stage(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"run\.h5: names no stage"):
        FlightName.of(f"{tmp_path}/run.h5:")


TRACK = Path(__file__).parents[2] / "tracks" / "half_cuban_eight.yaml"


def run_of(path: Path, *overrides: str) -> RunState:
    return new_run(load_inputs(TRACK, overrides=overrides), path)


def stages(run: RunState) -> list[Stage]:
    return [stored.result.stage for stored in run.checkpoint.stages]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A checkpoint with two stages."""
    run = run_of(tmp_path / "run.h5")
    checkpoint = run.checkpoint.with_stage(stage_result(Stage.HOMOTOPY)).with_stage(stage_result(Stage.POINT_MASS))
    write_checkpoint(run.path, checkpoint)
    return run.path


def test_stages_of_the_same_inputs_are_taken_along(path: Path) -> None:
    assert stages(adopt_checkpoint(run_of(path))) == [Stage.HOMOTOPY, Stage.POINT_MASS]


def test_stages_of_other_inputs_are_left_behind(path: Path) -> None:
    assert stages(adopt_checkpoint(run_of(path, "rules.n_z_max=9"))) == []


def with_other_casadi(path: Path) -> None:
    run = adopt_checkpoint(run_of(path))
    versions = {**run.checkpoint.versions, "casadi": "0.0"}
    write_checkpoint(path, replace(run.checkpoint, versions=versions))


@pytest.mark.parametrize(
    "spoil",
    [
        pytest.param(lambda path: path.unlink(), id="missing"),
        pytest.param(lambda path: path.write_bytes(path.read_bytes()[:-1]), id="truncated"),
        pytest.param(lambda path: path.write_bytes(b""), id="empty"),
        pytest.param(with_other_casadi, id="other versions"),
    ],
)
def test_what_cannot_be_trusted_is_left_behind(spoil: Callable[[Path], object], path: Path) -> None:
    spoil(path)
    run = adopt_checkpoint(run_of(path))
    assert stages(run) == []
    assert isinstance(run.checkpoint, Checkpoint)


PASSINGS = [passage.name for passage in load_inputs("rovinj_2014").race.course.passages]
SOLVED = solve_single_mesh(stage_result(Stage.POINT_MASS, passings=PASSINGS))
CERTIFIED = stage_result(Stage.TRANSFER_FUNCTION, passings=PASSINGS)


@pytest.fixture
def run() -> RunState:
    """Two stages, the lower one solved on one mesh."""
    begun = new_run(load_inputs("rovinj_2014", overrides=("settings.guess=plan",)))
    return begun.with_stage(SOLVED).with_stage(CERTIFIED)


def actions(run: RunState, until: str, mesh_check: MeshCheck | str | None = None) -> list[str]:
    return [step.action for step in plan_resumed_run(run, until=until, mesh_check=mesh_check).steps]


def test_solved_stage_below_the_last_is_kept(run: RunState) -> None:
    assert actions(run, "transfer-function") == ["keep", "keep"]


def test_solved_stage_is_proved_where_all_are(run: RunState) -> None:
    assert actions(run, "transfer-function", MeshCheck.ALL) == ["check", "keep"]
    assert actions(run, "state-space-inversion", "all") == ["check", "keep", "run"]


def test_solved_stage_that_the_run_now_ends_with_is_proved(run: RunState) -> None:
    assert actions(run, "point-mass") == ["check"]
    assert list(map(str, plan_resumed_run(run, until="point-mass").steps)) == [
        "point-mass: check (it was solved on one mesh)"
    ]


def test_stages_stand_whatever_is_to_be_proved(run: RunState) -> None:
    """Also those of a run that was asked for otherwise: its next call remembers."""
    asked = plan_resumed_run(run, until="transfer-function", mesh_check="all").run
    assert asked.stale == {}
    assert asked.inputs.settings.mesh_check is MeshCheck.ALL
    assert asked.checkpoint.inputs.resolved == run.checkpoint.inputs.resolved
    again = plan_resumed_run(asked, until="transfer-function", mesh_check="last").run
    assert again.inputs.settings.mesh_check is MeshCheck.LAST
    assert again.inputs.overrides == (*run.inputs.overrides, "settings.mesh_check=last")


def test_what_may_be_proved_has_a_name(run: RunState) -> None:
    with pytest.raises(InputError, match="mesh_check"):
        plan_resumed_run(run, until="transfer-function", mesh_check="some")


def flown_by(
    monkeypatch: pytest.MonkeyPatch, run: RunState, *results: StageResult
) -> tuple[CommandResult, Sequence[StageResult]]:
    """A run all of whose stages are to be proved, by a procedure that comes to these results."""

    def optimize(*_: object, **__: object) -> Iterator[StageResult]:
        yield from results

    monkeypatch.setattr(procedure, "optimize", optimize)
    monkeypatch.setattr(stored_stages, "continuous", fake_optimizer.continuous)
    answer = CommandResult()
    task = plan_resumed_run(run, until="transfer-function", mesh_check="all")
    return answer, execute_for_command(answer, task, threads=1, progress=Silent()).results


def test_completed_proof_is_reported_in_the_place_of_its_stage(run: RunState, monkeypatch: pytest.MonkeyPatch) -> None:
    proved = stage_result(Stage.POINT_MASS, passings=PASSINGS)
    answer, results = flown_by(monkeypatch, run, proved)
    assert list(results) == [proved, CERTIFIED]
    assert answer.code == 0


def test_proof_that_fails_where_it_was_asked_for_fails_the_command(
    run: RunState, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer, results = flown_by(monkeypatch, run, replace(SOLVED, message="its race time could not be confirmed"))
    assert [result.status for result in results] == [Status.SOLVED, Status.CERTIFIED]
    assert answer.code == 5
    assert answer.error == "point-mass: its race time could not be confirmed"
    assert answer.fields["certified"] is True  # the last stage is


def test_a_simpler_flight_may_have_an_alternative_that_is_hardly_faster_but_no_faster_one() -> None:
    def faster_by(seconds: float) -> StageResult:
        """The stage beside a flight that is so much faster, s."""
        trajectory = SOLVED.trajectory
        share = 1.0 - seconds / trajectory.race_time
        flown = replace(trajectory, durations=share * trajectory.durations)
        return replace(SOLVED, alternatives=(replace(SOLVED, trajectory=flown),))

    said = "an alternative does not hold, or is faster by more than 10 ms"
    assert said not in inconsistencies(faster_by(0.009))
    assert said in inconsistencies(faster_by(0.011))


def test_verification_says_what_was_verified_and_asks_all_of_the_last_stage(
    run: RunState, monkeypatch: pytest.MonkeyPatch
) -> None:
    def recompute(_: object, __: object, results: Sequence[StageResult]) -> Iterator[tuple[StageResult, StageResult]]:
        yield from ((result, result) for result in results)

    monkeypatch.setattr(procedure, "recompute", recompute)
    below, last = verify_run(run)
    assert (below.verified, last.verified) == (True, True)
    assert below.finding == "verified as solved on one mesh, its race time not confirmed on a second one"
    assert last.finding == "verified"
    rough, _ = verify_run(replace(run, checkpoint=run.checkpoint.with_mesh_check(solve_roughly(SOLVED))))
    assert rough.finding == "verified as solved on one mesh, as closely as the next stage needs"
    (alone,) = verify_run(replace(run, checkpoint=run.checkpoint.with_stage(SOLVED)))
    assert not alone.verified
    assert alone.objection.startswith("the run ends with it, and it is only solved on one mesh")


def test_what_cannot_be_told_of_a_crashed_run_does_not_hide_the_crash(
    run: RunState, monkeypatch: pytest.MonkeyPatch
) -> None:
    def crash(*_: object, **__: object) -> Iterator[StageResult]:
        raise SolverCrash("the solver process died")
        yield

    def no_object(*_: object, **__: object) -> dict[str, object]:
        raise ValueError("a table of nothing")

    monkeypatch.setattr(procedure, "optimize", crash)
    monkeypatch.setattr("airrace.runs.execute.run_object", no_object)
    with pytest.raises(SolverCrash, match="the solver process died"):
        execute_for_command(CommandResult(), plan_resumed_run(run, mesh_check="all"), threads=1, progress=Silent())
