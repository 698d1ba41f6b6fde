"""Arguments that can be no file, where one is meant."""

import os
from pathlib import Path

import pytest
from command import run

from airrace.pages.report import film


@pytest.mark.parametrize("name", ["", ".", "/", "./"])
@pytest.mark.parametrize("words", ["plot", "report", "export kml", "export csv x.h5 -o", "film", "card", "init"])
def test_what_can_be_no_file_is_wrong_usage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(film, "browser_path", lambda *_: "chromium")  # which is not needed to refuse a file
    monkeypatch.setattr(film, "ffmpeg_path", lambda: "ffmpeg")
    refused = run(*words.split(), name)
    assert refused.code == 2, refused.err
    assert refused.err == f"airrace: {Path(name)} is a folder; name a file\n"
    assert os.listdir(tmp_path) == []


def test_a_log_that_can_be_no_file_is_wrong_usage() -> None:
    refused = run("import", "/", "--course", "rovinj_2014")
    assert (refused.code, refused.err) == (2, "airrace: / is a folder; name a file\n")
