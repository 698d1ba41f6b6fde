"""Files of inputs: how one names another, and how one that cannot be read is told."""

from pathlib import Path

import pytest
from language_texts import AIRCRAFT, TRACK

from airrace.errors import Finding, InputError
from airrace.inputs import Document, load_inputs


def loaded_findings(path: Path, **more: Path) -> list[Finding]:
    with pytest.raises(InputError) as raised:
        load_inputs(path, **more)
    return raised.value.findings


def test_an_aircraft_file_is_found_relative_to_the_track(tmp_path: Path) -> None:
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs/edge.yaml").write_text(AIRCRAFT)
    (tmp_path / "tracks").mkdir()
    track = tmp_path / "tracks/t.yaml"
    track.write_text(TRACK + "aircraft: ../configs/edge.yaml\n")
    assert load_inputs(track).race.aircraft.name == "Edge 540 class"


def test_an_unknown_aircraft_file_is_reported_where_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "edge540.yaml").write_text(AIRCRAFT)
    track = tmp_path / "t.yaml"
    track.write_text("aircraft: edge504.yaml\n" + TRACK)
    (finding,) = loaded_findings(track)
    assert (finding.file, finding.line, finding.column, finding.key) == (str(track), 1, 11, "aircraft")
    assert finding.message == f"no such file: {tmp_path / 'edge504.yaml'}; did you mean `edge540.yaml`?"


def test_an_aircraft_option_replaces_the_tracks_own(tmp_path: Path) -> None:
    track, aircraft = tmp_path / "t.yaml", tmp_path / "a.yaml"
    track.write_text("aircraft: missing.yaml\n" + TRACK)
    aircraft.write_text(AIRCRAFT)
    assert load_inputs(track, aircraft=aircraft).aircraft == Document(str(aircraft), AIRCRAFT)
    (finding,) = loaded_findings(track, aircraft=tmp_path / "none.yaml")
    assert (finding.file, finding.line) == (str(tmp_path / "none.yaml"), 0)


def test_a_track_without_an_aircraft_says_how_to_name_one(tmp_path: Path) -> None:
    track = tmp_path / "t.yaml"
    track.write_text(TRACK)
    (finding,) = loaded_findings(track)
    assert (finding.key, finding.message) == (
        "aircraft",
        "missing; name the aircraft file here, or give --aircraft FILE",
    )


@pytest.mark.parametrize(
    ("content", "words"),
    [(None, "no such file"), (b"", "is empty"), (b"name: \xff\n", "not UTF-8"), (b"#" * 2_100_000, "too large")],
)
def test_an_unreadable_track_is_one_clear_finding(tmp_path: Path, content: bytes | None, words: str) -> None:
    track = tmp_path / "t.yaml"
    if content is not None:
        track.write_bytes(content)
    (finding,) = loaded_findings(track)
    assert (finding.file, finding.line) == (str(track), 0)
    assert words in finding.message


def test_a_folder_is_no_track(tmp_path: Path) -> None:
    (finding,) = loaded_findings(tmp_path)
    assert finding.message == "is not a file"
