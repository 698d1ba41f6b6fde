"""A course to begin with is valid, whatever it is called, and never overwrites anything unasked."""

from pathlib import Path

import pytest

from airrace.errors import InputError, UsageError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.document import TRACKS
from airrace.files.inputs.json_schema import schema_text
from airrace.runs.courses import EDITORS_LINE, catalogue, init


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "title"),
    [("sprint", "Sprint"), ("harbour_run", "Harbour run"), ("2019", "2019"), ("off", "Off"), ("o'k", "O'k")],
)
def test_a_new_course_is_valid_and_bears_its_name(name: str, title: str) -> None:
    assert init(name) == Path(f"{name}.yaml")
    assert load_inputs(Path(name)).race.course.name == title


def test_a_course_can_be_copied(folder: Path) -> None:
    copied = init(folder / "mine.yaml", like="san_diego_2017")
    assert copied == folder / "mine.yaml"
    assert load_inputs(copied).race == load_inputs(Path("san_diego_2017")).race


def test_an_existing_file_is_only_overwritten_when_asked() -> None:
    path = init("sprint")
    with pytest.raises(UsageError, match="exists"):
        init("sprint", like="rovinj_2014")
    assert init("sprint", like="rovinj_2014", force=True) == path
    assert "Rovinj" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("like", [None, "rovinj_2014"])
def test_editors_find_the_schema_beside_the_course(like: str | None, folder: Path) -> None:
    path = init("sprint", like=like)
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith(EDITORS_LINE)
    schema = folder / first.removeprefix(EDITORS_LINE)
    assert schema.read_text(encoding="utf-8") == schema_text("track")


def test_a_copy_keeps_the_schema_that_it_names(folder: Path) -> None:
    init("first")
    own = (folder / "first.yaml").read_text(encoding="utf-8")
    assert init("second", like="first").read_text(encoding="utf-8") == own


def test_another_schema_is_only_overwritten_when_asked(folder: Path) -> None:
    schema = folder / "track.schema.json"
    schema.write_text("{}", encoding="utf-8")
    with pytest.raises(UsageError, match=r"track\.schema\.json exists; it is not the schema of this version"):
        init("sprint")
    assert [one.name for one in folder.iterdir()] == ["track.schema.json"]
    assert schema.read_text(encoding="utf-8") == "{}"
    init("sprint", force=True)
    assert schema.read_text(encoding="utf-8") == schema_text("track")


def test_what_does_not_exist_cannot_be_copied(folder: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        init("sprint", like="nowhere")
    assert list(folder.iterdir()) == []


def test_all_that_comes_along_is_listed() -> None:
    listed = catalogue()
    assert [one.name for one in listed.tracks] == list(TRACKS.names)
    rovinj = next(one for one in listed.tracks if one.name == "rovinj_2014")
    assert (rovinj.title, rovinj.passages, rovinj.laps, rovinj.aircraft) == ("Rovinj 2014", 17, 1, "edge540")
    assert {one.name: one.mass for one in listed.aircraft}["edge540"] == 698.0
    assert "rbar-2014" in listed.rules
