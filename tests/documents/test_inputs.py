"""Whole inputs: what the files mean, and how errors are told."""

import dataclasses
import json
import math
from pathlib import Path

import pytest
from language_texts import AIRCRAFT, ROOT, TRACK, edited, findings_of, understood

from airrace.documents import Document, inputs_from_documents, load_inputs
from airrace.environment.air import Profile
from airrace.errors import Finding, InputError
from airrace.procedure.settings import GuessKind, Proof, Settings
from airrace.quantities import Interval
from airrace.track.course import Direction
from airrace.track.gates import INVERTED, KNIFE_EDGE_LEFT, Gate, Manoeuvre, Passing, Pylon

KNOT = 1852.0 / 3600.0


def finding_in_track(old: str, new: str) -> str:
    (finding,) = findings_of(edited(TRACK, old, new))
    return str(finding)


def finding_in_aircraft(old: str, new: str) -> str:
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, old, new))
    return str(finding)


# What the language means


def test_passages_follow_the_order_flown_over_all_laps() -> None:
    passages = understood().race.course.passages
    assert [passage.name for passage in passages] == [
        "0:g0",
        *("1:g1", "1:g2", "1:top", "1:g0"),
        *("2:g1", "2:g2", "2:top", "2:g0"),
    ]
    assert [passage.lap for passage in passages] == [1, 1, 1, 1, 1, 2, 2, 2, 2]
    assert passages[2].direction is Direction.PLANNED


def test_only_the_start_has_a_speed_limit() -> None:
    start, *others = understood().race.course.passages
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
    last, every = (understood(overrides=(f"settings.proof={proof}",)) for proof in ("last", "all"))
    assert (last.settings.proof, every.settings.proof) == (Proof.LAST, Proof.ALL)
    assert last.resolved == every.resolved == understood().resolved


def test_settings_are_taken_over() -> None:
    text = "schema: airrace/settings/1\nguess: plan\nmesh: {interval_s: 0.1}\ncertificate: {angle_deg: 0.1}\n"
    settings = understood(settings=text, overrides=("settings.solver.primary=ipopt",)).settings
    assert settings.guess is GuessKind.PLAN
    assert settings.mesh == dataclasses.replace(Settings().mesh, interval=0.1)
    assert settings.certificate.angle == math.radians(0.1)
    assert settings.solver.primary == "ipopt"


# Shipped files


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_courses_load_and_can_be_loaded_again_from_their_texts(path: Path) -> None:
    inputs = load_inputs(path)
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


# Errors in tracks


def test_a_missing_gate_field_names_the_gate_and_its_line() -> None:
    message = finding_in_track("    heading_deg: 90\n", "")
    assert message == (
        "t.yaml:7:3: gates.g0.heading_deg: missing; a level gate needs `heading_deg`: its axis when flown forward; "
        "or its two `pylons`"
    )


def test_an_unknown_key_comes_with_a_suggestion() -> None:
    message = finding_in_track("heading_deg: 90\n", "heading_deg: 90\n    heigth_m: 20\n")
    assert message == "t.yaml:12:5: gates.g0.heigth_m: unknown key `heigth_m`; did you mean `height_m`?"


def test_a_duplicate_key_is_found() -> None:
    message = finding_in_track("    east_m: 0\n", "    east_m: 0\n    north_m: 5\n")
    assert message == "t.yaml:11:5: gates.g0.north_m: duplicate key; first in line 9"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "n_z_max: 10",
            "n_z_max: ten",
            "t.yaml:4:12: rules.n_z_max: must be a number above 1 and at most 25, not the text `ten`",
        ),
        ("n_z_max: 10", "n_z_max: 99", "t.yaml:4:12: rules.n_z_max: must be above 1 and at most 25, not 99"),
        (
            "n_z_max: 10",
            "n_z_max: yes",
            "t.yaml:4:12: rules.n_z_max: must be a number above 1 and at most 25, not the text `yes`",
        ),
        (
            "n_z_max: 10",
            "n_z_max: true",
            "t.yaml:4:12: rules.n_z_max: must be a number above 1 and at most 25, not `true`",
        ),
        ("n_z_max: 10", "n_z_max:", "t.yaml:4:11: rules.n_z_max: has no value; give one, or leave the key out"),
        (
            "  n_z_max: 10\n",
            "",
            "t.yaml:3:1: rules.n_z_max: missing; a rule book needs `n_z_max`: the largest load factor",
        ),
        ("name: Test", "name: 2014", "t.yaml:2:7: name: must be text, not 2014; quote it if it is meant as text"),
        ("type: level", "type: levle", "t.yaml:8:11: gates.g0.type: unknown type `levle`; did you mean `level`?"),
        (
            "    type: level\n",
            "",
            "t.yaml:7:3: gates.g0.type: missing; `type` is one of: level, knife-edge, quad, pylon, manoeuvre, "
            "high-turn, vertical-roll",
        ),
        (
            "bank: left",
            "bank: leftt",
            (
                "t.yaml:13:77: gates.g2.bank: must be one of right, left, either, not the text `leftt`; did you mean "
                "`left`?"
            ),
        ),
        (
            "laps: 2",
            "laps: 1.5",
            "t.yaml:18:9: course.laps: must be a whole number at least 1 and at most 100, not 1.5",
        ),
        ("laps: 2", "laps: 0", "t.yaml:18:9: course.laps: must be at least 1 and at most 100, not 0"),
        ("start: g0", "start: g00", "t.yaml:16:10: course.start: unknown gate `g00`; did you mean `g0`?"),
        ("lap: [g1,", "lap: [g11,", "t.yaml:17:9: course.lap.0: unknown gate `g11`; did you mean `g1`?"),
        (
            "lap: [g1,",
            "lap: [3,",
            "t.yaml:17:9: course.lap.0: must be the name of a gate or {gate: NAME, direction: reverse}, not 3",
        ),
        (
            "lap: [g1,",
            "lap: [g0, g1,",
            "t.yaml:17:9: course.lap.0: `g0` is passed twice in a row; another element must come between",
        ),
        (
            "lap: [g1,",
            "lap: [{gate: g1, direction: reverse},",
            "t.yaml:17:31: course.lap.0.direction: only two-pylon gates have a direction; `g1` is none, leave it out",
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    height_m: 30\n    height_max_m: 25",
            "t.yaml:12:15: gates.g0.height_m: must lie within the window's heights, 25 to 25 m, not 30",
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    width_m: 8",
            (
                "t.yaml:12:14: gates.g0.width_m: a width of 8 m less two clearances of 0.5 m leaves 7 m; the wing of "
                "Edge 540 class spans 7.43 m"
            ),
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    clearance_m: 7",
            "t.yaml:7:3: gates.g0.width_m: a width of 13 m leaves nothing between two clearances of 7 m",
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    crossing_max_deg: 90",
            "t.yaml:12:23: gates.g0.crossing_max_deg: must be above 0 and at most 85, not 90",
        ),
        (
            "  n_z_max: 10",
            "  n_z_max: 10\n  ceiling_m: 12",
            (
                "t.yaml:8:3: gates.g0.height_m: lies at 15 to 25 m, outside of the flown heights of 10 to 12 m "
                "(rules: floor, ceiling)"
            ),
        ),
        (
            "inverted: true, height_min_m: 100",
            "",
            (
                "t.yaml:14:3: gates.top: a manoeuvre needs at least one condition: climb_deg, bank_deg, inverted, "
                "heading_deg, ..."
            ),
        ),
        (
            "inverted: true,",
            "inverted: true, climb_deg: 90,",
            "t.yaml:14:36: gates.top.inverted: has no meaning on a vertical line; leave it out",
        ),
        (
            "inverted: true,",
            "inverted: true, bank_deg: 0,",
            "t.yaml:14:52: gates.top.bank_deg: not together with `inverted`, which says a bank of 180 degrees",
        ),
        (
            "height_min_m: 100",
            "height_min_m: 100, height_m: 120",
            "t.yaml:14:71: gates.top.height_m: is exact; not together with `height_min_m` or `height_max_m`",
        ),
        (
            "  start_speed_max_kt: 200",
            "  start_speed_max_kt: 60",
            "t.yaml:5:23: rules.start_speed_max_kt: must be above 68.03 kt, the least speed of Edge 540 class; is 60",
        ),
        (
            "schema: airrace/track/1",
            "schema: airrace/track/2",
            "t.yaml:1:9: schema: expected `schema: airrace/track/1`, found `airrace/track/2`",
        ),
        (
            "schema: airrace/track/1\n",
            "",
            "t.yaml:1:1: schema: missing; the file must begin with `schema: airrace/track/1`",
        ),
        (
            "course:\n",
            "environment: {wind: {from_deg: 0}}\ncourse:\n",
            "t.yaml:15:15: environment.wind: missing; a wind needs `speed_kt` or `speed_m_s`",
        ),
        (
            "course:\n",
            "environment: {wind: {from_deg: 0, speed_kt: 1, speed_m_s: 1}}\ncourse:\n",
            (
                "t.yaml:15:48: environment.wind.speed_m_s: the speed is given twice; keep one of `speed_kt` and "
                "`speed_m_s`"
            ),
        ),
    ],
)
def test_an_error_in_a_track_says_where_what_and_what_would_be_right(old: str, new: str, message: str) -> None:
    if "ceiling_m" in new:  # concerns every element; the first finding is enough
        assert str(findings_of(edited(TRACK, old, new))[0]) == message
    else:
        assert finding_in_track(old, new) == message


def test_a_race_does_not_start_at_a_free_position() -> None:
    (finding,) = findings_of(edited(TRACK, "start: g0", "start: top"))
    assert (finding.line, finding.column, finding.key) == (16, 10, "course.start")


def test_all_findings_come_at_once() -> None:
    track = edited(edited(TRACK, "n_z_max: 10", "n_z_max: 0"), "pass_side_deg: 180", "pass_side: 180")
    aircraft = edited(AIRCRAFT, "mass_kg: 698 ", "mass_kg: -1 ")
    keys = [(finding.file, finding.key) for finding in findings_of(track, aircraft=aircraft, overrides=("laps",))]
    assert keys == [
        ("--set", "laps"),
        ("a.yaml", "airframe.mass_kg"),
        ("t.yaml", "rules.n_z_max"),
        ("t.yaml", "gates.g1.pass_side_deg"),
        ("t.yaml", "gates.g1.pass_side"),
    ]


def test_a_document_that_is_no_mapping_is_refused() -> None:
    (finding,) = findings_of("- a\n- b\n")
    assert str(finding) == "t.yaml:1:1: must be a mapping that begins with `schema: airrace/track/1`"


# Errors in aircraft


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "C_Lalpha: 4.8",
            "C_Lalpha: 0",
            "lift.C_Lalpha: lift must grow with the angle of attack; must be above 0 per rad",
        ),
        ("C_L_max: 1.40", "C_L_max: -0.1", "lift.C_L_max: the wing stalls before it lifts; must be above 0"),
        ("C_L_min: -1.40", "C_L_min: 0", "lift.C_L_min: the wing must be able to push down, too; must be below 0"),
        (
            "wing_area_m2: 9.10",
            "wing_area_m2: 0",
            "airframe.wing_area_m2: an aircraft without a wing has no lift; must be above 0",
        ),
        (
            "C_L_max: 1.40",
            "C_L_max: 0.05",
            (
                "lift.C_L_max: the wing cannot carry the aircraft: at 130 m/s, the envelope's top speed, C_L_max = "
                "0.05 lifts 4710 N at sea level, the weight is 6845 N"
            ),
        ),
        (
            "I_z_kg_m2: 1300",
            "I_z_kg_m2: 1500",
            "airframe.I_z_kg_m2: no body has such a moment of inertia: 1500 is more than the other two together, 1420",
        ),
        ("C_lxi: -0.31", "C_lxi: 0.31", "roll.C_lxi: must be at least -10 and below 0, not 0.31"),
    ],
)
def test_an_aircraft_that_could_not_fly_is_refused_in_its_own_terms(old: str, new: str, message: str) -> None:
    line = AIRCRAFT[: AIRCRAFT.index(old)].count("\n") + 1
    column = 3 + old.index(":") + 2
    assert finding_in_aircraft(old, new) == f"a.yaml:{line}:{column}: {message}"


def test_an_unsymmetric_aircraft_with_camber_fits_the_language() -> None:
    aircraft = AIRCRAFT
    for old, new in (
        ("C_L0: 0 ", "C_L0: 0.305 "),
        ("C_L_min: -1.40", "C_L_min: -0.8"),
        ("C_m0: 0\n", "C_m0: 0.06\n"),
        ("I_xz_kg_m2: 0\n", "I_xz_kg_m2: 203\n"),
    ):
        aircraft = edited(aircraft, old, new)
    built = understood(aircraft=aircraft).race.aircraft
    assert (built.lift.C_L0, built.lift.C_L_min, built.pitch.zero, built.airframe.I_xz) == (0.305, -0.8, 0.06, 203.0)


# Overrides


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


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("rules.n_z_max", "--set: rules.n_z_max: `rules.n_z_max` is not of the form key=value, e.g. rules.n_z_max=12"),
        ("rules.n_z_max=99", "--set: rules.n_z_max: must be above 1 and at most 25, not 99"),
        ("rules.n_zmax=9", "--set: rules.n_zmax: unknown key `n_zmax`; did you mean `n_z_max`?"),
        (
            "rules.n_z_max=012",
            "--set: rules.n_z_max: `012` is ambiguous (YAML 1.1 takes it as octal); write `12`, or quote it as text",
        ),
        ("rules.n_z_max=[1]", "--set: rules.n_z_max: only a single value can be set; edit the file for more"),
        ("name.first=x", "--set: name.first: `first` cannot be set inside the single value 'Test'"),
        ("course.lap.9=g1", "--set: course.lap.9: the list has items 0 to 3, none named `9`"),
        (
            "settings.certificate.kkt_error=1",
            "--set: settings.certificate.kkt_error: limits can only be tightened: must be at most 1e-06, not 1",
        ),
    ],
)
def test_an_error_in_an_override_names_the_option(override: str, message: str) -> None:
    (finding,) = findings_of(overrides=(override,))
    assert str(finding) == message


# Files


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
