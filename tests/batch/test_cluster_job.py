"""What travels to a cluster and back: it is what was sent, or it is refused."""

import hashlib
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from batch_examples import job

from airrace.batch.cluster import landed
from airrace.batch.cluster_job import DamagedParcel, Flown, Parcel
from airrace.batch.executor import Ending, Fault, Order, StageFinished


def test_a_parcel_knows_whether_it_was_damaged(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"flown")
    parcel = Parcel.of(tmp_path / "a")
    assert parcel is not None
    assert parcel.unpacked() == b"flown"
    assert parcel.sha256 == hashlib.sha256(b"flown").hexdigest()
    with pytest.raises(DamagedParcel):
        Parcel(b"flawn", parcel.sha256).unpacked()
    assert Parcel.of(tmp_path / "b") is None


def test_a_checkpoint_that_was_damaged_on_its_way_is_a_failed_attempt_and_not_written(tmp_path: Path) -> None:
    path = tmp_path / "oval.h5"
    path.write_bytes(b"before")
    done = Ending(0, "", 1.0, run={"race_time_s": 10.0, "stages": []})
    stage = StageFinished("oval", "point-mass", "solved", 10.0, True)
    stages, ending = landed(Order(job(), 1, path, None), Flown(done, (stage,), Parcel(b"flawn", "0" * 64)))
    assert (stages, ending.code, ending.fault, ending.run) == ((), 8, Fault.LOST, None)
    assert ending.message.startswith("its checkpoint came back damaged on its way (sha256 ")
    assert path.read_bytes() == b"before"
