"""What comes with the package is found by name, in any folder, unless a file has that name."""

import shutil
from pathlib import Path

import pytest

from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.document import AIRCRAFT, TRACKS

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_names_are_those_of_the_files_in_the_repository() -> None:
    for collection, files in ((TRACKS, ROOT / "tracks"), (AIRCRAFT, ROOT / "configs")):
        assert list(collection.names) == sorted(file.stem for file in files.glob("*.yaml"))


@pytest.mark.parametrize("name", TRACKS.names)
def test_a_name_means_the_same_as_the_file(name: str) -> None:
    by_name, by_file = load_inputs(Path(name)), load_inputs(ROOT / "tracks" / f"{name}.yaml")
    assert by_name.race == by_file.race
    assert by_name.track.path == name
    assert by_name.aircraft.path == "edge540"


def test_an_aircraft_is_found_by_name_too() -> None:
    assert load_inputs(Path("rovinj_2014"), aircraft=Path("pc9")).race.aircraft.name == "PC-9 class"
    named = load_inputs(Path("rovinj_2014"), overrides=["aircraft=pc9"])
    assert named.race.aircraft.name == "PC-9 class"


@pytest.mark.parametrize("name", ["rovinj_2014", "rovinj_2014.yaml"])
def test_a_file_of_the_same_name_comes_first(name: str, folder: Path) -> None:
    text = (ROOT / "tracks" / "rovinj_2014.yaml").read_text(encoding="utf-8")
    (folder / name).write_text(text.replace("name: Rovinj 2014", "name: My Rovinj"))
    inputs = load_inputs(Path("rovinj_2014"))
    assert inputs.race.course.name == "My Rovinj"
    assert inputs.track.path == name


def test_an_aircraft_beside_the_track_comes_first(folder: Path) -> None:
    (folder / "mine").mkdir()
    shutil.copy(ROOT / "tracks" / "rovinj_2014.yaml", folder / "mine")
    (folder / "mine" / "edge540.yaml").write_text((ROOT / "configs" / "pc9.yaml").read_text(encoding="utf-8"))
    assert load_inputs(folder / "mine" / "rovinj_2014.yaml").race.aircraft.name == "PC-9 class"


def test_a_folder_of_the_same_name_is_no_course(folder: Path) -> None:
    (folder / "rovinj_2014").mkdir()
    assert load_inputs(Path("rovinj_2014")).race.course.name == "Rovinj 2014"


@pytest.mark.parametrize("misspelt", ["rovinj_2015", "rovinj_2014.yaml", "rovinj-2014"])
def test_a_misspelt_name_is_answered_with_the_right_one(misspelt: str) -> None:
    with pytest.raises(InputError, match=f"no such file: {misspelt}; did you mean `rovinj_2014`, which comes with"):
        load_inputs(Path(misspelt))


def test_a_path_is_never_taken_for_a_name(folder: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_inputs(folder / "rovinj_2014")


@pytest.mark.parametrize("strange", ["a" * 300, "nul\0nul", "."])
def test_what_is_no_name_at_all_is_refused_with_a_sentence(strange: str) -> None:
    with pytest.raises(InputError):
        load_inputs(Path(strange))
