"""What is finished is kept; every change of what a job depends on is noticed, and named."""

import json
import os
from dataclasses import fields, replace
from pathlib import Path

import pytest
from batch_examples import finished, job

from airrace.batch.job import Fingerprint, Job
from airrace.batch.record import (
    Choice,
    JobRecord,
    checkpoint_path,
    read_record,
    reason_to_fly,
    record_path,
    write_record,
)
from airrace.errors import Finding
from airrace.inputs import Document


def reason(one: Job, folder: Path, choice: Choice = Choice.NONE) -> str:
    return reason_to_fly(one, folder, choice)[0]


def test_a_job_survives_its_own_plain_form() -> None:
    one = job(settings=Document("s.yaml", "ä\n"), overrides=("a=1",), swept=(("k", "v"),))
    assert Job.from_object(json.loads(json.dumps(one.as_object()))) == one


def test_a_job_that_was_never_flown_is_new(tmp_path: Path) -> None:
    assert reason(job(), tmp_path) == "new"


@pytest.mark.parametrize("code", [0, 4, 5])
def test_a_finished_job_is_kept_also_if_it_found_no_certified_flight(code: int, tmp_path: Path) -> None:
    finished(tmp_path, job(), code, "infeasible")
    assert reason(job(), tmp_path) == ""


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"track": Document("oval.yaml", "another track")}, "the track changed"),
        ({"aircraft": Document("aircraft.yaml", "another one")}, "the aircraft changed"),
        ({"settings": Document("settings.yaml", "some")}, "the settings changed"),
        ({"overrides": ("rules.n_z_max=9",)}, "--set or --sweep changed"),
        ({"until": "six-dof"}, "the last stage was point-mass and is six-dof"),
        ({"versions": "airrace 9.9"}, "it was flown with other versions (airrace 0.1.0; now airrace 9.9)"),
    ],
)
def test_whatever_affects_the_result_is_noticed_and_named(
    changed: dict[str, object], told: str, tmp_path: Path
) -> None:
    finished(tmp_path, job())
    assert reason(job(**changed), tmp_path) == told


def test_every_part_of_the_fingerprint_has_its_words() -> None:
    one = Fingerprint(*("x" for _ in fields(Fingerprint)))
    for part in fields(Fingerprint):
        assert len(replace(one, **{part.name: "y"}).changes(one)) == 1


def test_the_path_of_an_input_is_of_no_matter(tmp_path: Path) -> None:
    finished(tmp_path, job())
    assert reason(job(track=Document("elsewhere/oval.yaml", "a track")), tmp_path) == ""


@pytest.mark.parametrize(
    ("code", "message", "told"),
    [
        (8, "its process crashed (SIGSEGV)", "it failed: its process crashed (SIGSEGV)"),
        (6, "stopped after 5 s (--timeout)", "it failed: stopped after 5 s (--timeout)"),
        (130, "interrupted", "it was interrupted"),
        (3, "", "its input was not valid"),
    ],
)
def test_accidents_are_flown_again(code: int, message: str, told: str, tmp_path: Path) -> None:
    finished(tmp_path, job(), code, message)
    assert reason(job(), tmp_path) == told


def test_a_job_under_way_when_all_ended_is_flown_again(tmp_path: Path) -> None:
    write_record(tmp_path, "oval", JobRecord(job().fingerprint, ended=False))
    assert reason(job(), tmp_path) == "it was not finished"


def test_the_user_may_ask_for_more(tmp_path: Path) -> None:
    finished(tmp_path, job())
    finished(tmp_path, job("bad"), 4, "infeasible")
    assert reason(job(), tmp_path, Choice.FAILED) == ""
    assert "asked for" in reason(job("bad"), tmp_path, Choice.FAILED)
    assert reason(job(), tmp_path, Choice.ALL) == "asked for"


def test_a_missing_checkpoint_is_noticed(tmp_path: Path) -> None:
    finished(tmp_path, job())
    checkpoint_path(tmp_path, "oval").unlink()
    assert reason(job(), tmp_path) == "its checkpoint is missing"


def test_a_checkpoint_of_another_size_is_noticed(tmp_path: Path) -> None:
    finished(tmp_path, job())
    with checkpoint_path(tmp_path, "oval").open("ab") as file:
        file.write(b"x")
    assert reason(job(), tmp_path).startswith("its checkpoint has changed")


def test_another_content_of_the_same_size_is_noticed_but_a_copy_is_as_good(tmp_path: Path) -> None:
    finished(tmp_path, job())
    path = checkpoint_path(tmp_path, "oval")
    content = path.read_bytes()
    path.write_bytes(content)
    os.utime(path, ns=(1, 1))
    assert reason(job(), tmp_path) == ""
    path.write_bytes(content[::-1])
    os.utime(path, ns=(1, 1))
    assert reason(job(), tmp_path) == "its checkpoint has changed (in its content)"


def test_a_checkpoint_without_a_record_is_flown_again(tmp_path: Path) -> None:
    finished(tmp_path, job())
    record_path(tmp_path, "oval").unlink()
    assert reason(job(), tmp_path) == "its record is missing"


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"null", b'{"schema": "airrace/job/1"}', b"\xff\xfe", b"[" * 9999]
)
def test_a_damaged_record_is_told_and_never_a_crash(content: bytes, tmp_path: Path) -> None:
    finished(tmp_path, job())
    record_path(tmp_path, "oval").write_bytes(content)
    assert reason(job(), tmp_path) == "its record is damaged"


def test_any_truncation_of_a_record_is_noticed(tmp_path: Path) -> None:
    finished(tmp_path, job())
    content = record_path(tmp_path, "oval").read_bytes()
    for length in range(len(content)):
        record_path(tmp_path, "oval").write_bytes(content[:length])
        assert reason(job(), tmp_path) == "its record is damaged"


def test_a_record_says_after_a_round_trip_what_it_said(tmp_path: Path) -> None:
    findings = (Finding("a.yaml", 3, 4, "rules.n_z_max", "must be a number, not the text `ä`"),)
    run = {"race_time_s": 55.25, "stages": []}
    record = JobRecord(job().fingerprint, True, 3, "bad", 1.5, ("crashed",), run, findings, None)
    write_record(tmp_path, "oval", record)
    assert read_record(tmp_path, "oval") == record
