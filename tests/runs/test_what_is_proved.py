"""What a run does with stages that were solved on one mesh, decided before anything is computed."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import fake_optimizer
import pytest
from fake_optimizer import solve_single_mesh, stage_result

from airrace.errors import InputError
from airrace.inputs import load_inputs
from airrace.procedure import results_api
from airrace.procedure import run as procedure
from airrace.procedure.progress import Silent
from airrace.procedure.result import Stage, StageResult, State
from airrace.procedure.settings import MeshCheck
from airrace.runs.command_result import CommandResult
from airrace.runs.execute import execute_for_command
from airrace.runs.plan import plan_resumed_run, step_lines
from airrace.runs.run import Run, new_run

PASSINGS = [passage.name for passage in load_inputs("rovinj_2014").race.course.passages]
SOLVED = solve_single_mesh(stage_result(Stage.POINT_MASS, passings=PASSINGS))
CERTIFIED = stage_result(Stage.TRANSFER_FUNCTION, passings=PASSINGS)


@pytest.fixture
def run() -> Run:
    """Two stages, the lower one solved on one mesh."""
    begun = new_run(load_inputs("rovinj_2014", overrides=("settings.guess=plan",)))
    return begun.with_stage(SOLVED).with_stage(CERTIFIED)


def actions(run: Run, until: str, mesh_check: MeshCheck | str | None = None) -> list[str]:
    return [step.action for step in plan_resumed_run(run, until=until, mesh_check=mesh_check).steps]


def test_solved_stage_below_the_last_is_kept(run: Run) -> None:
    assert actions(run, "transfer-function") == ["keep", "keep"]


def test_solved_stage_is_proved_where_all_are(run: Run) -> None:
    assert actions(run, "transfer-function", MeshCheck.ALL) == ["prove", "keep"]
    assert actions(run, "state-space-inversion", "all") == ["prove", "keep", "run"]


def test_solved_stage_that_the_run_now_ends_with_is_proved(run: Run) -> None:
    assert actions(run, "point-mass") == ["prove"]
    assert list(step_lines(plan_resumed_run(run, until="point-mass").steps)) == [
        "point-mass: prove (it was solved on one mesh)"
    ]


def test_stages_stand_whatever_is_to_be_proved(run: Run) -> None:
    """Also those of a run that was asked for otherwise: its next call remembers."""
    asked = plan_resumed_run(run, until="transfer-function", mesh_check="all").run
    assert asked.stale == {}
    assert asked.inputs.settings.mesh_check is MeshCheck.ALL
    assert asked.checkpoint.inputs.resolved == run.checkpoint.inputs.resolved
    again = plan_resumed_run(asked, until="transfer-function", mesh_check="last").run
    assert again.inputs.settings.mesh_check is MeshCheck.LAST
    assert again.inputs.overrides == (*run.inputs.overrides, "settings.mesh_check=last")


def test_what_may_be_proved_has_a_name(run: Run) -> None:
    with pytest.raises(InputError, match="mesh_check"):
        plan_resumed_run(run, until="transfer-function", mesh_check="some")


def flown_by(
    monkeypatch: pytest.MonkeyPatch, run: Run, *results: StageResult
) -> tuple[CommandResult, Sequence[StageResult]]:
    """A run all of whose stages are to be proved, by a procedure that comes to these results."""

    def optimize(*_: object, **__: object) -> Iterator[StageResult]:
        yield from results

    monkeypatch.setattr(procedure, "optimize", optimize)
    monkeypatch.setattr(results_api, "continuous", fake_optimizer.continuous)
    answer = CommandResult()
    task = plan_resumed_run(run, until="transfer-function", mesh_check="all")
    return answer, execute_for_command(answer, task, threads=1, progress=Silent())


def test_completed_proof_is_told_in_the_place_of_its_stage(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    proved = stage_result(Stage.POINT_MASS, passings=PASSINGS)
    answer, results = flown_by(monkeypatch, run, proved)
    assert list(results) == [proved, CERTIFIED]
    assert answer.code == 0


def test_proof_that_fails_where_it_was_asked_for_fails_the_command(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    answer, results = flown_by(monkeypatch, run, replace(SOLVED, message="its race time could not be confirmed"))
    assert [result.state for result in results] == [State.SOLVED, State.CERTIFIED]
    assert answer.code == 5
    assert answer.error == "point-mass: its race time could not be confirmed"
    assert answer.fields["certified"] is True  # the last stage is


def test_verification_says_what_was_verified_and_asks_all_of_the_last_stage(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def remeasured(_: object, __: object, results: Sequence[StageResult]) -> Iterator[tuple[StageResult, StageResult]]:
        yield from ((result, result) for result in results)

    monkeypatch.setattr(procedure, "remeasured", remeasured)
    below, last = run.verify()
    assert (below.verified, last.verified) == (True, True)
    assert below.finding == "verified as solved on one mesh, its race time not confirmed on a second one"
    assert last.finding == "verified"
    (alone,) = replace(run, checkpoint=run.checkpoint.with_stage(SOLVED)).verify()
    assert not alone.verified
    assert alone.objection.startswith("the run ends with it, and it is only solved on one mesh")
