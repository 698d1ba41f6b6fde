"""Slips that are easily made in a file or on the command line: the sentence says what was meant."""

import pytest
from language_texts import AIRCRAFT, ROOT, TRACK, edited, findings_of

from airrace.inputs import Document, load_inputs
from airrace.inputs.unused import unused_gates

ROVINJ = ROOT / "tracks" / "rovinj_2014.yaml"


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("    north_m: 0,5\n", "not the text `0,5`; write it with a decimal point, 0.5"),
        ("    north_m: -12,75\n", "write it with a decimal point, -12.75"),
    ],
)
def test_decimal_comma_is_called_one(written: str, words: str) -> None:
    (finding,) = findings_of(edited(TRACK, "    north_m: 0\n", written))
    assert words in str(finding)


def test_decimal_comma_between_braces_is_called_one() -> None:
    text = ROVINJ.read_text().replace("north_m: 272.8,", "north_m: 272,8,")
    (finding,) = findings_of(text)
    assert "gates.g1.8: has no value" in str(finding)
    assert "a number has a decimal point, not a comma" in str(finding)


def test_other_texts_are_no_numbers_with_a_comma() -> None:
    (finding,) = findings_of(edited(TRACK, "    north_m: 0\n", "    north_m: '0,5,6'\n"))
    assert "decimal" not in str(finding)


def test_key_that_stands_one_level_too_high_is_told_where_it_belongs() -> None:
    (finding,) = findings_of(TRACK + "wind: {from_deg: 250, speed_m_s: 6}\n")
    assert "wind: unknown key `wind`; it belongs in `environment`" in str(finding)


def test_metres_set_on_a_place_of_degrees_are_told_so_and_not_the_file() -> None:
    text = edited(TRACK, "    north_m: 0\n    east_m: 0\n", "    latitude_deg: 45\n    longitude_deg: 13\n")
    text += "origin: {latitude_deg: 45, longitude_deg: 13}\n"
    (finding,) = findings_of(text, overrides=("gates.g0.north_m=3",))
    assert (finding.file, finding.key) == ("--set", "gates.g0.north_m")
    assert finding.message.startswith("the file gives this position by latitude and longitude; set `latitude_deg`")


def test_degrees_set_on_a_place_of_metres_are_told_so_and_not_the_file() -> None:
    text = TRACK + "origin: {latitude_deg: 45, longitude_deg: 13}\n"
    (finding,) = findings_of(text, overrides=("gates.g0.latitude_deg=45.1",))
    assert (finding.file, finding.key) == ("--set", "gates.g0.latitude_deg")
    assert finding.message == "the file gives this position by north and east; set `north_m` and `east_m`"


def test_mass_that_no_body_of_that_size_has_is_refused() -> None:
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, "mass_kg: 698 ", "mass_kg: 0.001 "))
    assert "airframe.mass_kg: is too little: nothing within a wing span of 7.43 m has I_x_kg_m2 = 520" in str(finding)


def test_wing_span_whose_square_is_no_number_is_refused() -> None:
    findings = findings_of(aircraft=edited(AIRCRAFT, "wing_span_m: 7.43", "wing_span_m: 1e-308"))
    assert any("nothing within a wing span of 1e-308 m" in str(finding) for finding in findings)


def test_gate_that_no_lap_passes_is_named() -> None:
    assert unused_gates(load_inputs(ROVINJ)) == []
    text = ROVINJ.read_text().replace(
        "gates:\n", "gates:\n  spare: {type: level, north_m: 9, east_m: 9, heading_deg: 0}\n"
    )
    assert unused_gates(load_inputs(Document(str(ROVINJ), text))) == ["spare"]


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_courses_pass_all_their_gates(path) -> None:
    assert unused_gates(load_inputs(path)) == []
