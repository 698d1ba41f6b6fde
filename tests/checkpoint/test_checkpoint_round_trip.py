"""What is written is what is read, and any HDF5 program can read it, too."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from checkpoint_examples import (
    INPUTS,
    VERSIONS,
    assert_same,
    checkpoints,
    example_checkpoint,
    example_result,
)
from hypothesis import HealthCheck, given, settings

from airrace.checkpoint import Checkpoint, inputs_hash, read_checkpoint, stale_stages, write_checkpoint
from airrace.checkpoint.hdf5 import Group, image_of, tree_of
from airrace.checkpoint.run_layout import encode
from airrace.checkpoint.store import BLOCK_SIZE
from airrace.errors import CheckpointError
from airrace.procedure.stage import Stage
from airrace.quantities import Quantity
from airrace.trajectory import Trajectory


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(checkpoint=checkpoints())
def test_reading_gives_back_every_bit_that_was_written(checkpoint: Checkpoint, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.h5"
    write_checkpoint(path, checkpoint)
    read = read_checkpoint(path)
    assert_same(checkpoint.inputs, read.inputs)
    assert dict(checkpoint.versions) == dict(read.versions)
    assert_same(checkpoint.stages, read.stages)
    assert stale_stages(read, inputs_hash(read.inputs.resolved)) == []


def test_equal_checkpoints_make_equal_files(tmp_path: Path) -> None:
    for name in ("one.h5", "other.h5"):
        write_checkpoint(tmp_path / name, example_checkpoint())
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "other.h5").read_bytes()


def test_a_long_race_with_long_texts_survives(tmp_path: Path) -> None:
    inputs = replace(INPUTS, overrides=("a=1",) * 50, resolved="{" + " " * 300_000 + "}")
    checkpoint = Checkpoint(inputs, VERSIONS).with_stage(example_result(intervals=20_000))
    write_checkpoint(tmp_path / "long.h5", checkpoint)
    read = read_checkpoint(tmp_path / "long.h5")
    assert_same(checkpoint.inputs, read.inputs)
    assert_same(checkpoint.stages, read.stages)


def test_plain_hdf5_opens_the_file_behind_its_user_block(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write_checkpoint(path, example_checkpoint())
    with h5py.File(path, "r") as file:
        assert file.userblock_size == BLOCK_SIZE
        stage = file["stages/point-mass"]
        speed = stage["states/V_K"]
        np.testing.assert_array_equal(speed, example_result().trajectory.of("V_K"))
        assert (speed.attrs["units"], speed.attrs["long_name"]) == (b"m/s", b"speed")
        assert np.isposinf(speed.attrs["upper"])
        np.testing.assert_array_equal(speed.dims[0][0], stage["time"])
        np.testing.assert_array_equal(stage["controls/sink"].dims[0]["interval_time"], stage["interval_time"])
        assert stage["controls/sink"].attrs["rate_of"] == b"z"
        assert file["inputs/track/text"][()].decode() == INPUTS.track.text
        assert stage["certificate/items"]["name"].tolist() == [b"kkt_error", b"replay"]


@pytest.mark.parametrize("name", ["a/b", "..", "", "2nd", "n\0z", "x" * 65, "V_K"])
def test_a_quantity_whose_name_cannot_name_a_dataset_is_refused(tmp_path: Path, name: str) -> None:
    flight = example_result().trajectory
    flight = replace(flight, states=(Quantity(name, "m"), flight.states[1]))
    with pytest.raises(CheckpointError, match="cannot be stored"):
        write_checkpoint(tmp_path / "run.h5", checkpoint_of(flight))
    assert list(tmp_path.iterdir()) == []


def test_what_could_not_be_read_again_never_replaces_a_good_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write_checkpoint(path, example_checkpoint())
    before = path.read_bytes()
    contradictory = replace(example_result().trajectory, first_node=np.array([0, 2, 99], np.int64))
    with pytest.raises(CheckpointError, match="first_node"):
        write_checkpoint(path, checkpoint_of(contradictory))
    nul = Checkpoint(replace(INPUTS, resolved="a\0b"), VERSIONS)
    with pytest.raises(CheckpointError, match="NUL"):
        write_checkpoint(path, nul)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_stage_that_could_not_be_read_is_refused_although_the_others_are_unchanged(tmp_path: Path) -> None:
    path, kept = tmp_path / "run.h5", example_checkpoint()
    write_checkpoint(path, kept)
    before = path.read_bytes()
    unchanged = {one.result.stage for one in kept.stages}
    contradictory = replace(example_result().trajectory, first_node=np.array([0, 2, 99], np.int64))
    longer = kept.with_stage(replace(example_result(Stage.STATE_SPACE), trajectory=contradictory))
    with pytest.raises(CheckpointError, match="first_node"):
        write_checkpoint(path, longer, unchanged=unchanged)
    assert path.read_bytes() == before
    sound = kept.with_stage(example_result(Stage.STATE_SPACE))
    write_checkpoint(path, sound, unchanged=unchanged)
    write_checkpoint(tmp_path / "read_back.h5", sound)
    assert path.read_bytes() == (tmp_path / "read_back.h5").read_bytes()
    assert_same(read_checkpoint(path).stages, sound.stages)


def test_members_that_are_not_asked_for_are_not_read() -> None:
    image = image_of(encode(example_checkpoint()))
    assert set(child(tree_of(image), "stages").members) == {"homotopy", "point-mass"}
    assert set(child(tree_of(image, ["/stages/homotopy"]), "stages").members) == {"point-mass"}


def child(group: Group, name: str) -> Group:
    member = group.members[name]
    assert isinstance(member, Group)
    return member


def checkpoint_of(trajectory: Trajectory) -> Checkpoint:
    return Checkpoint(INPUTS, VERSIONS).with_stage(replace(example_result(), trajectory=trajectory))
