"""What travels to a cluster and back: it is what was sent, or it is refused."""

import hashlib
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from batch_examples import job

from airrace.batch.cluster import landed
from airrace.batch.cluster_job import AttemptReply, DamagedPayload, Payload
from airrace.batch.executor import Attempt, AttemptResult, FailureKind, StageFinished


def test_a_parcel_knows_whether_it_was_damaged(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"flown")
    parcel = Payload.of(tmp_path / "a")
    assert parcel is not None
    assert parcel.unpacked() == b"flown"
    assert parcel.sha256 == hashlib.sha256(b"flown").hexdigest()
    with pytest.raises(DamagedPayload):
        Payload(b"flawn", parcel.sha256).unpacked()
    assert Payload.of(tmp_path / "b") is None


def test_a_checkpoint_that_was_damaged_on_its_way_is_a_failed_attempt_and_not_written(tmp_path: Path) -> None:
    path = tmp_path / "oval.h5"
    path.write_bytes(b"before")
    done = AttemptResult(0, "", 1.0, run={"race_time_s": 10.0, "stages": []})
    stage = StageFinished("oval", "point-mass", "solved", 10.0, True)
    stages, ending = landed(Attempt(job(), 1, path, None), AttemptReply(done, (stage,), Payload(b"flawn", "0" * 64)))
    assert (stages, ending.code, ending.fault, ending.run) == ((), 8, FailureKind.LOST, None)
    assert ending.message.startswith("its checkpoint came back damaged on its way (sha256 ")
    assert path.read_bytes() == b"before"
