"""A run that is begun on a checkpoint takes along what still stands of it, and nothing else."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from fake_optimizer import stage_result

from airrace.checkpoint import Checkpoint, write_checkpoint
from airrace.inputs import load_inputs
from airrace.procedure.result import Stage
from airrace.runs.run import Run, adopt_checkpoint, new_run

TRACK = Path(__file__).parents[2] / "tracks" / "half_cuban_eight.yaml"


def run_of(path: Path, *overrides: str) -> Run:
    return new_run(load_inputs(TRACK, overrides=overrides), path)


def stages(run: Run) -> list[Stage]:
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
