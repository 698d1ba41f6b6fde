"""A shell completes what the commands take: names that come along, files, stages."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from airrace.cli.completion import complete_aircraft as aircraft
from airrace.cli.completion import complete_stage as stages
from airrace.cli.completion import complete_track as tracks
from airrace.files.inputs.document import AIRCRAFT, TRACKS
from airrace.procedure.stage import STAGES


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_all_names_that_come_along_and_all_stages_are_offered() -> None:
    assert tracks("") == list(TRACKS.names)
    assert aircraft("") == list(AIRCRAFT.names)
    assert stages("") == [stage.value for stage in STAGES]


def test_what_is_begun_is_completed() -> None:
    assert tracks("rov") == ["rovinj_2014"]
    assert aircraft("p") == ["pc9"]
    assert stages("state") == ["state-space-inversion", "state-space"]


def test_files_and_folders_are_offered_beside_names(folder: Path) -> None:
    (folder / "rough.yaml").touch()
    (folder / "notes.txt").touch()
    (folder / "races").mkdir()
    (folder / "races" / "mine.yaml").touch()
    assert tracks("r") == ["rovinj_2014", "races/", "rough.yaml"]
    assert tracks("races/") == ["races/mine.yaml"]
    assert tracks("nowhere/") == []


@pytest.mark.parametrize(
    ("words", "offered"), [("airrace optimize rov", "rovinj_2014"), ("airrace init --like pc", "")]
)
def test_the_command_answers_bash(words: str, offered: str) -> None:
    environment = {
        **os.environ,
        "_AIRRACE_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split()) - 1),
    }
    program = "import sys; from airrace.cli.main import app; app(prog_name='airrace')"
    ran = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert ran.stdout.split() == offered.split(), ran.stderr
