"""The inputs of a run: files, references, overrides and objects."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from language_texts import AIRCRAFT, RICH, ROOT, TRACK, edited, findings_of, understood

from airrace.errors import Finding, InputError, UsageError
from airrace.files.inputs import Document, Inputs, inputs_from_documents, load_inputs
from airrace.files.inputs.document import TRACKS
from airrace.files.inputs.inputs import shorten
from airrace.files.inputs.nodes import FINDINGS_MAX
from airrace.files.inputs.objects import (
    CourseAndAir,
    aircraft_of,
    course_and_air_of,
    document_of_objects,
    is_of_objects,
)
from airrace.files.inputs.overrides import parse_overrides, value_text
from airrace.files.inputs.variation import Variation
from airrace.model.aircraft import Aircraft
from airrace.model.environment import Air, Profile
from airrace.model.track.course import Course, Direction, Passage
from airrace.model.track.gates import INVERTED, KNIFE_EDGE_LEFT, Gate, Manoeuvre, Passing, Pylon
from airrace.optimal_control.quantities import Interval
from airrace.procedure.settings import GuessKind, MeshCheck, Settings

KNOT = 1852.0 / 3600.0


def test_passages_follow_the_order_flown_over_all_laps() -> None:
    passages = understood().race.course.passages
    assert [passage.name for passage in passages] == [
        "0:g0",
        *("1:g1", "1:g2", "1:top", "1:g0"),
        *("2:g1", "2:g2", "2:top", "2:g0"),
    ]
    assert [passage.lap for passage in passages] == [1, 1, 1, 1, 1, 2, 2, 2, 2]
    assert passages[2].direction is Direction.PLANNED
    start, *others = passages
    assert start.speed == Interval(upper=200 * KNOT)
    assert all(passage.speed == Interval() for passage in others)


def test_elements_come_with_the_defaults_of_the_language() -> None:
    gate, pylon, knife, top = (passage.element for passage in understood().race.course.passages[:4])
    assert isinstance(gate, Gate)
    assert (gate.height, gate.width, gate.passing, gate.bank) == (20.0, 13.0, Passing.WINDOW, 0.0)
    assert gate.heading == math.radians(90)
    assert gate.tolerances.height == Interval(15.0, 25.0)
    assert gate.tolerances.clearance == 0.5
    assert gate.tolerances.bank == math.radians(10.0)
    assert gate.tolerances.crossing == math.radians(60.0)
    assert isinstance(pylon, Pylon)
    assert (pylon.side, pylon.reach, pylon.tolerances.clearance) == (math.pi, 100.0, 3.5)
    assert isinstance(knife, Gate)
    assert (knife.bank, knife.either_bank) == (KNIFE_EDGE_LEFT, False)
    assert top == Manoeuvre("top", bank=INVERTED, height=Interval(lower=100.0))


def test_a_gates_own_value_wins_over_gate_defaults() -> None:
    track = edited(TRACK, "gates:\n", "gate_defaults: {width_m: 12, height_m: 22, clearance_m: 1}\ngates:\n")
    gate, pylon, *_ = understood(
        edited(track, "heading_deg: 90", "heading_deg: 90\n    width_m: 14")
    ).race.course.passages
    assert isinstance(gate.element, Gate)
    assert isinstance(pylon.element, Pylon)
    assert (gate.element.width, gate.element.height, pylon.element.height) == (14.0, 22.0, 22.0)
    assert gate.element.tolerances.height == Interval(17.0, 27.0)
    assert (gate.element.tolerances.clearance, pylon.element.tolerances.clearance) == (1.0, 3.5)


def test_the_same_gate_twice_in_a_lap_gets_two_names() -> None:
    names = [passage.name for passage in understood(edited(TRACK, "top, g0]", "top, g1, g0]")).race.course.passages]
    assert names[:6] == ["0:g0", "1:g1", "1:g2", "1:top", "1:g1#2", "1:g0"]
    assert len(set(names)) == len(names)


def test_a_finish_is_flown_after_the_last_lap() -> None:
    track = edited(TRACK, "  laps: 2\n", "  laps: 2\n  finish: {gate: g2, direction: reverse}\n")
    finish = understood(track).race.course.passages[-1]
    assert (finish.name, finish.lap, finish.direction) == ("2:g2#2", 2, Direction.REVERSE)


def test_weather_is_turned_to_si() -> None:
    weather = """\
origin: {elevation_m: 400}
environment:
  temperature_offset_K: 15
  pressure_offset_hPa: -12
  wind: {from_deg: 270, speed_kt: 20, profile: power, exponent: 0.2}
  thermals: [{north_m: 1, east_m: 2, w_star_m_s: 2.5, mixing_height_m: 1e3}]
"""
    air = understood(TRACK + weather).race.air
    assert (air.temperature_offset, air.pressure_offset, air.elevation) == (15.0, -1200.0, 400.0)
    assert air.wind is not None
    assert (air.wind.profile, air.wind.exponent) == (Profile.POWER, 0.2)
    assert air.wind.east == pytest.approx(20 * KNOT)  # a west wind blows eastward
    assert air.wind.north == pytest.approx(0.0, abs=1e-12)
    assert air.thermals[0].mixing_height == 1000.0


def test_silent_settings_are_the_procedures_own() -> None:
    assert understood().settings == Settings()
    assert understood(settings="schema: airrace/settings/1\n").settings == Settings()


def test_how_much_is_proved_is_no_part_of_what_a_stage_stands_on() -> None:
    last, every = (understood(overrides=(f"settings.mesh_check={mesh_check}",)) for mesh_check in ("last", "all"))
    assert (last.settings.mesh_check, every.settings.mesh_check) == (MeshCheck.LAST, MeshCheck.ALL)
    assert last.resolved == every.resolved == understood().resolved


def test_settings_are_taken_over() -> None:
    text = "schema: airrace/settings/1\nguess: plan\nmesh: {interval_s: 0.1}\ncertificate: {angle_deg: 0.1}\n"
    settings = understood(settings=text, overrides=("settings.solver.primary=ipopt",)).settings
    assert settings.guess is GuessKind.PLAN
    assert settings.mesh == dataclasses.replace(Settings().mesh, interval=0.1)
    assert settings.certificate.angle == math.radians(0.1)
    assert settings.solver.primary == "ipopt"


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
    for path, what in ((track, words), (tmp_path, "is not a file")):
        (finding,) = loaded_findings(path)
        assert (finding.file, finding.line) == (str(path), 0)
        assert what in finding.message


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_courses_pass_all_their_gates_and_can_be_loaded_again_from_their_texts(path: Path) -> None:
    inputs = load_inputs(path)
    assert inputs.unused_gates == ()
    assert json.loads(json.dumps(inputs.resolved, allow_nan=False)) == inputs.resolved
    assert inputs_from_documents(inputs.track, inputs.aircraft, inputs.settings_file, inputs.overrides) == inputs


def test_rovinj_is_flown_out_and_back() -> None:
    passages = load_inputs(ROOT / "tracks/rovinj_2014.yaml").race.course.passages
    gates = [passage.element.name for passage in passages]
    assert gates == gates[::-1]
    assert len(gates) == 17
    flown: dict[str, set[Direction]] = {}
    for passage in passages:
        if isinstance(passage.element, Gate):
            flown.setdefault(passage.element.name, set()).add(passage.direction)
    assert all(directions == {Direction.FORWARD, Direction.REVERSE} for directions in flown.values())


def test_every_gate_of_rovinj_is_flown_towards_the_next_one() -> None:
    """Within 60 degrees of the way from the previous to the next element, but for the turn at g0."""
    passages = load_inputs(ROOT / "tracks/rovinj_2014.yaml").race.course.passages
    for before, here, after in zip(passages, passages[1:], passages[2:], strict=False):
        assert not isinstance(before.element, Manoeuvre)
        assert not isinstance(after.element, Manoeuvre)
        if isinstance(here.element, Gate) and before.element != after.element:
            chord = math.atan2(after.element.east - before.element.east, after.element.north - before.element.north)
            heading = here.element.heading + (math.pi if here.direction is Direction.REVERSE else 0.0)
            assert math.cos(heading - chord) > 0.5, here.name


def test_sixteen_phases_has_sixteen_and_a_quad() -> None:
    course = load_inputs(ROOT / "tracks/sixteen_phases.yaml").race.course
    assert len(course.passages) == 17
    west, south = (passage.element for passage in course.passages[5:7])
    assert isinstance(west, Gate)
    assert isinstance(south, Gate)
    assert (west.north, west.east) == (south.north, south.east)
    assert math.cos(west.heading - south.heading) == pytest.approx(0.0, abs=1e-12)
    assert {passage.element.height for passage in course.passages} == {20.0}


def test_the_half_cuban_eight_is_laterally_free_between_its_ends() -> None:
    _, *between, _ = load_inputs(ROOT / "tracks/half_cuban_eight.yaml").race.course.passages
    assert len(between) == 3
    for passage in between:
        assert isinstance(passage.element, Manoeuvre)
        assert (passage.element.north, passage.element.east) == (Interval(), Interval())


def test_overrides_reach_all_three_documents() -> None:
    inputs = understood(
        overrides=(
            "rules.n_z_max=1.2e1",
            "environment.wind.from_deg=90",
            "environment.wind.speed_m_s=8",
            "settings.regularisation=1e-3",
            "aircraft.airframe.mass_kg=720",
            "name=no",
            "gates.g0.type=level",
            "course.lap.0=g2",
            "course.lap.1.gate=g1",
            "course.lap.1.direction=null",
        )
    )
    assert inputs.race.course.rules.n_z.upper == 12.0
    assert inputs.race.air.wind is not None
    assert inputs.race.air.wind.speed == 8.0
    assert inputs.settings.regularisation == 1e-3
    assert inputs.race.aircraft.airframe.m == 720.0
    assert inputs.race.course.name == "no"
    assert [passage.name for passage in inputs.race.course.passages][1:3] == ["1:g2", "1:g1"]


WRONG_ELSEWHERE = [
    ("name: Every element", "name: 7"),
    ("rules: rbar-2016", "rules: {n_z_max: 99}"),
    ("elevation_m: 12", "elevation_m: high"),
    ("heading_deg: 70, bank: either", "heading_deg: 70, bank: both"),
    ("type: high-turn", "type: hihg-turn"),
    ("  laps: 2\n", "  laps: two\n"),
    ("keep: left", "keep: up"),
]


@pytest.mark.parametrize(("old", "new"), WRONG_ELSEWHERE, ids=[new for _, new in WRONG_ELSEWHERE])
def test_wrong_names_are_reported_together_with_what_is_wrong_elsewhere(old: str, new: str) -> None:
    track = edited(RICH, "top, roll, q, dive]", "topp, roll, roll, q, dive]")
    track = edited(track, "safety_lines: [beach]", "safety_lines: [beech]")
    keys = {finding.key for finding in findings_of(edited(track, old, new))}
    named = {"course.lap.2", "course.lap.4", "course.lap.1.safety_lines.0"}
    assert named < keys
    assert len(keys) == len(named) + 1


@pytest.mark.parametrize(
    ("old", "new"), [("  lap: [g1, {", "  lap: g1 # [g1, {"), ("course:\n", "coarse:\n"), ("gates:\n", "gatse:\n")]
)
def test_a_course_that_cannot_be_read_is_reported_as_such(old: str, new: str) -> None:
    found = findings_of(edited(RICH, old, new))
    assert all(finding.message for finding in found)
    assert not [finding for finding in found if "unknown gate" in finding.message]


def test_the_same_gate_across_the_end_of_a_lap_is_reported_where_the_lap_begins() -> None:
    track = edited(TRACK, "lap: [g1,", "lap: [g0, g1,")
    keys = [finding.key for finding in findings_of(edited(track, "start: g0", "start: g1"))]
    assert keys == ["course.lap.0"]
    once = edited(edited(track, "start: g0", "start: g1"), "laps: 2", "laps: 1")
    assert understood(once).race.course.passages[0].name == "0:g1"


def test_at_most_a_hundred_findings_are_told_of_a_document() -> None:
    track = edited(TRACK, "lap: [g1,", "lap: [" + "".join(f"no{index}, " for index in range(250)) + "g1,")
    found = findings_of(track, settings="schema: airrace/settings/1\nguess: 1\n")
    assert [finding.file for finding in found] == ["s.yaml"] + ["t.yaml"] * (FINDINGS_MAX + 1)
    assert found[-1].message == f"and {250 - FINDINGS_MAX} more findings from here on"
    assert found[-1].key == f"course.lap.{FINDINGS_MAX}"
    some = [Finding("t.yaml", line, 1, "", f"{line}") for line in range(FINDINGS_MAX, 0, -1)]
    assert shorten(some) == sorted(some)


def test_a_finding_quotes_no_more_of_a_file_than_can_be_read() -> None:
    (finding,) = findings_of(edited(TRACK, "schema: airrace/track/1", f"schema: {'x' * 5000}"))
    assert finding.message == f"expected `schema: airrace/track/2`, found `{'x' * 100}...`"
    wordy = Finding("t.yaml", 1, 1, "a", f"`b` {'is not what it was and ' * 20} `c`")
    assert shorten([wordy]) == [wordy]


ROVINJ = load_inputs("rovinj_2014").race


def read_back(scene: CourseAndAir, aircraft: Aircraft = ROVINJ.aircraft) -> Inputs:
    return inputs_from_documents(
        document_of_objects(scene, "mine"), document_of_objects(aircraft, "my aircraft"), None, ()
    )


@pytest.mark.parametrize("name", TRACKS.names)
def test_every_shipped_race_survives_the_round_trip(name: str) -> None:
    by_file = load_inputs(name)
    race = by_file.race
    inputs = read_back(CourseAndAir(race.course, race.air), race.aircraft)
    assert inputs.race == race
    assert inputs.resolved == by_file.resolved


def test_infinities_numbers_of_numpy_and_whole_numbers_survive() -> None:
    passages = [dataclasses.replace(one, lap=np.int64(one.lap)) for one in ROVINJ.course.passages]
    course = dataclasses.replace(ROVINJ.course, passages=tuple(passages))
    air = Air(elevation=np.float32(12.5), pressure_offset=3)
    scene = read_back(CourseAndAir(course, air)).race
    assert scene.course == ROVINJ.course
    assert scene.air == Air(elevation=12.5, pressure_offset=3.0)
    assert isinstance(scene.air.pressure_offset, float)
    assert math.isinf(scene.course.rules.alpha_A.upper)


def course_of(*passages: Passage) -> Course:
    return dataclasses.replace(ROVINJ.course, passages=passages)


FIRST, SECOND, *_ = ROVINJ.course.passages


@pytest.mark.parametrize(
    ("course", "message"),
    [(course_of(FIRST), "at least two passages"), (course_of(FIRST, FIRST), "two passages are called `0:g0`")],
)
def test_a_course_that_is_none_is_refused(course: Course, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_back(CourseAndAir(course, Air()))


def test_what_a_course_cannot_hold_is_refused_when_it_is_written() -> None:
    with pytest.raises(InputError, match=r"cannot hold that.*not 'object'"):
        document_of_objects(CourseAndAir(ROVINJ.course, Air(elevation=object())), "mine")  # type: ignore[arg-type]


def test_course_and_aircraft_must_fit_together_as_those_of_files_must() -> None:
    slow = dataclasses.replace(ROVINJ.aircraft, airframe=dataclasses.replace(ROVINJ.aircraft.airframe, b=30.0))
    with pytest.raises(InputError, match="wing"):
        read_back(CourseAndAir(ROVINJ.course, ROVINJ.air), slow)


def test_the_keys_of_files_reach_no_objects() -> None:
    track = document_of_objects(CourseAndAir(ROVINJ.course, ROVINJ.air), "mine")
    with pytest.raises(InputError, match=r"rules\.n_z_max: cannot be set here"):
        load_inputs(track, aircraft="edge540", overrides=["rules.n_z_max=9"])
    inputs = load_inputs(track, aircraft="edge540", overrides=["aircraft.airframe.mass_kg=650"])
    assert inputs.race.aircraft.airframe.m == 650.0
    with pytest.raises(UsageError, match="built in Python"):
        Variation(inputs)


def test_a_course_built_in_python_needs_an_aircraft() -> None:
    with pytest.raises(InputError, match="names no aircraft"):
        load_inputs(document_of_objects(CourseAndAir(ROVINJ.course, ROVINJ.air), "mine"))


TAMPERED = [
    {"course": None},
    {"air": {}},
    [],
    {"course": {"passages": [{"element": {"Path": {"a": 1}}}]}, "air": {}},
    {"course": {"passages": [{"element": {"Gate": {}, "Pylon": {}}}]}, "air": {}},
    {"course": {"name": 3, "passages": []}, "air": {}},
    {"course": {"passages": [], "unknown": 3}, "air": {}},
]


@pytest.mark.parametrize("objects", TAMPERED, ids=json.dumps)
def test_tampered_objects_are_refused_with_a_sentence(objects: object) -> None:
    text = document_of_objects(ROVINJ.aircraft, "mine").text
    tampered = Document("mine", json.dumps({**json.loads(text), "objects": objects}))
    assert is_of_objects(tampered)
    for read in (course_and_air_of, aircraft_of):
        with pytest.raises(InputError, match="does not hold"):
            read(tampered)


@given(st.text(max_size=30))
@example("[a")
@example(" a ")
@example("'a'")
@example("012")
def test_any_text_is_set_as_this_very_text(text: str) -> None:
    findings: list[Finding] = []
    (override,) = parse_overrides([f"name={value_text(text)}"], findings)
    assert (override.value.value, findings) == (text, [])
