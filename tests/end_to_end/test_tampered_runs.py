"""A forger who knows how to seal a checkpoint still cannot make `verify` believe it."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from airrace_command import AIRCRAFT, airrace, inside

from airrace.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from airrace.procedure.result import StageResult

STAGES = ("point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof")
COURSE = f"""
schema: airrace/track/1
name: forged
aircraft: {AIRCRAFT}
rules: rbar-2014
gates:
  a: {{type: level, north_m: 0, east_m: 0, heading_deg: 0}}
  b: {{type: level, north_m: 350, east_m: 120, heading_deg: 60}}
  c: {{type: level, north_m: 420, east_m: 480, heading_deg: 120}}
course: {{start: a, lap: [b], finish: c}}
"""


def flown(folder: Path, name: str, text: str, *options: str) -> Checkpoint:
    """The checkpoint of a course, flown from the plan."""
    (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    ran = airrace("optimize", f"{name}.yaml", "--guess", "plan", "--search", "off", "--quiet", *options, cwd=folder)
    assert ran.code == 0, ran.err
    return read_checkpoint(folder / f"{name}.h5")


@pytest.fixture(scope="module")
def genuine(tmp_path_factory: pytest.TempPathFactory) -> Checkpoint:
    """All stages of a small course, each of them proved."""
    return flown(tmp_path_factory.mktemp("genuine"), "course", COURSE, "--mesh-check", "all")


def resealed(checkpoint: Checkpoint, results: list[StageResult], path: Path) -> Path:
    """The results under the inputs of a checkpoint, with hashes and checksums as they should be."""
    forged = dataclasses.replace(checkpoint, stages=())
    for result in results:
        forged = forged.with_stage(result)
    write_checkpoint(path, forged)
    return path


def failed_items(path: Path) -> dict[str, set[str]]:
    """Names of what does not hold, by stage, according to `verify`, which must not verify the run."""
    ran = inside("verify", path, "--json", cwd=path.parent)
    assert (ran.code, ran.answer["verified"]) == (5, False)
    stages = ran.answer["stages"]
    return {
        stage["stage"]: {item["name"] for item in stage["certificate"]["items"] if not item["holds"]}
        for stage in stages
        if not stage["verified"]
    }


def results(checkpoint: Checkpoint) -> list[StageResult]:
    return [stored.result for stored in checkpoint.stages]


def forged(genuine: Checkpoint, path: Path, change: Callable[[StageResult], StageResult]) -> dict[str, set[str]]:
    """What `verify` finds where every stage is changed."""
    return failed_items(resealed(genuine, [change(result) for result in results(genuine)], path / "run.h5"))


def test_what_is_sealed_again_without_a_change_is_verified(genuine: Checkpoint, tmp_path: Path) -> None:
    ran = airrace("verify", resealed(genuine, results(genuine), tmp_path / "run.h5"), "--json", cwd=tmp_path)
    assert (ran.code, ran.answer["verified"]) == (0, True)


def fastest(result: StageResult) -> tuple[int, int]:
    """Row and interval of the control that is moved most, as a share of its scale."""
    scale = np.array([one.scale for one in result.trajectory.controls])[:, None]
    moved = np.abs(result.trajectory.control / scale)
    row, interval = np.unravel_index(int(moved.argmax()), moved.shape)
    return int(row), int(interval)


def test_control_that_is_one_percent_off_is_found_at_every_stage(genuine: Checkpoint, tmp_path: Path) -> None:
    def change(result: StageResult) -> StageResult:
        control = result.trajectory.control.copy()
        control[fastest(result)] *= 1.01
        return dataclasses.replace(result, trajectory=dataclasses.replace(result.trajectory, control=control))

    found = forged(genuine, tmp_path, change)
    assert tuple(found) == STAGES
    assert all({"replay_defect", "kkt_error"} <= items for items in found.values()), found


@pytest.mark.parametrize("absurd", [1e29, -1e12])
def test_control_that_nothing_can_fly_ends_no_verifying(genuine: Checkpoint, tmp_path: Path, absurd: float) -> None:
    """An integrator would follow it in steps as small as they are many."""

    def change(result: StageResult) -> StageResult:
        control = result.trajectory.control.copy()
        control[:, 1] = absurd
        return dataclasses.replace(result, trajectory=dataclasses.replace(result.trajectory, control=control))

    found = forged(genuine, tmp_path, change)
    assert tuple(found) == STAGES
    assert all({"replay_defect", "replay_gate"} <= items for items in found.values()), found


def test_multiplier_that_is_one_percent_off_is_found_at_every_stage(genuine: Checkpoint, tmp_path: Path) -> None:
    def change(result: StageResult) -> StageResult:
        multipliers = result.constraint_multipliers.copy()
        multipliers[int(np.abs(multipliers).argmax())] *= 1.01
        return dataclasses.replace(result, constraint_multipliers=multipliers)

    found = forged(genuine, tmp_path, change)
    assert tuple(found) == STAGES
    assert all("kkt_error" in items for items in found.values()), found


def test_race_time_that_was_compared_with_itself_is_found(genuine: Checkpoint, tmp_path: Path) -> None:
    def change(result: StageResult) -> StageResult:
        all_nodes = np.ones_like(result.mesh.coarser)
        return dataclasses.replace(result, mesh=dataclasses.replace(result.mesh, coarser=all_nodes))

    found = forged(genuine, tmp_path, change)
    assert tuple(found) == STAGES
    assert all(items == {"race_time_change"} for items in found.values()), found


def test_run_that_claims_less_of_its_last_stage_is_not_verified(genuine: Checkpoint, tmp_path: Path) -> None:
    """Without the comparison of race times all stages hold, but nobody has proved the one that the run ends with."""

    def change(result: StageResult) -> StageResult:
        assert result.certificate is not None
        items = tuple(item for item in result.certificate.items if item.name != "race_time_change")
        return dataclasses.replace(result, certificate=dataclasses.replace(result.certificate, items=items))

    assert forged(genuine, tmp_path, change) == {STAGES[-1]: set()}


def test_gate_that_stands_elsewhere_is_found(genuine: Checkpoint, tmp_path: Path) -> None:
    """A metre to the side; the flight of the one course under the inputs of the other."""
    elsewhere = flown(tmp_path, "moved", COURSE.replace("east_m: 120", "east_m: 121"), "--until", "point-mass")
    gate_position = failed_items(resealed(elsewhere, results(genuine), tmp_path / "run.h5"))
    assert tuple(gate_position) == STAGES
    assert all("gate_length" in items or "kkt_error" in items for items in gate_position.values()), gate_position
