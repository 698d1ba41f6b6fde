"""The rules of a season by name: what they say, what overrides them, and how a bare name is reached into."""

import math
from importlib import resources

import pytest
from language_texts import TRACK, edited, findings_of, understood

from airrace.inputs.presets import preset_names, read_preset
from airrace.quantities import Interval
from airrace.track.course import Course, Direction, Rules
from airrace.track.gates import KNIFE_EDGE_LEFT, LEVEL, Gate, Pylon

KNOT = 1852.0 / 3600.0
BY_HAND = "rules:\n  n_z_max: 10\n  start_speed_max_kt: 200\n"
SEASONS = ("rbar-2010", "rbar-2014", "rbar-2015", "rbar-2016", "rbar-2017", "rbar-2018", "rbar-2019", "air-race-x-2024")
TWELVE_G = ("rbar-2010", "air-race-x-2024")


def with_rules(rules: str) -> str:
    return edited(TRACK, BY_HAND, f"rules: {rules}\n")


def course(rules: str, *overrides: str) -> Course:
    return understood(with_rules(rules), overrides=overrides).race.course


def start(found: Course) -> Gate:
    element = found.passages[0].element
    assert isinstance(element, Gate)
    return element


def test_there_is_a_preset_for_every_season() -> None:
    assert preset_names() == tuple(sorted(SEASONS))


@pytest.mark.parametrize("name", SEASONS)
def test_every_number_of_a_preset_has_its_source_beside_it(name: str) -> None:
    text = (resources.files("airrace.inputs") / "presets" / f"{name}.yaml").read_text(encoding="utf-8")
    numbers = [line for line in text.splitlines() if line.startswith("  ")]
    bare = [line for line in numbers if "#" not in line]
    # The upper end of the heights stands below the lower one, with the same source.
    assert [line.split(":")[0].strip() for line in bare] == ["passing", "height_max_m"]
    assert read_preset(name).source


@pytest.mark.parametrize(("name", "n_z"), [(name, 12.0 if name in TWELVE_G else 10.0) for name in SEASONS])
def test_a_preset_alone_makes_a_rule_book(name: str, n_z: float) -> None:
    found = course(name)
    assert found.rules == Rules(n_z=Interval(-2.0, n_z), height=Interval(lower=10.0))
    assert found.passages[0].speed == Interval(upper=200 * KNOT)
    assert start(found).tolerances.height == Interval(15.0, 25.0)
    assert start(found).tolerances.bank == math.radians(10.0)


@pytest.mark.parametrize("name", SEASONS)
def test_every_season_asks_for_nearly_level_flight_at_gates_of_all_kinds_and_at_pylons(name: str) -> None:
    """Air Race X publishes these angles; the other seasons take them from there."""
    passages = course(name).passages
    standing = [one.element for one in passages if isinstance(one.element, Gate | Pylon)]
    assert {type(one) for one in standing} == {Gate, Pylon}
    assert {one.bank for one in standing if isinstance(one, Gate)} == {LEVEL, KNIFE_EDGE_LEFT}
    assert {one.tolerances.climb for one in standing} == {Interval(math.radians(-5.0), math.radians(10.0))}


def test_without_a_season_a_course_limits_the_climb_at_its_gates_to_45_degrees() -> None:
    assert start(understood().race.course).tolerances.climb == Interval(math.radians(-45.0), math.radians(45.0))


def test_own_keys_override_the_presets_one_by_one() -> None:
    preset, own = course("rbar-2010"), course("{preset: rbar-2010, n_z_max: 9, ceiling_m: 300}")
    assert own.rules == Rules(n_z=Interval(-2.0, 9.0), height=Interval(10.0, 300.0))
    assert own.passages[0] == preset.passages[0]


def test_a_default_written_out_overrides_a_preset_too() -> None:
    """What counts is that the file says it, not that it differs from the language's default."""
    rules = course("{preset: rbar-2016, n_z_min: -2.0, floor_m: 0}").rules
    assert (rules.n_z.lower, rules.height.lower) == (-2.0, 0.0)


def test_own_gate_defaults_override_the_presets_one_by_one() -> None:
    track = with_rules("air-race-x-2024") + "gate_defaults: {climb_max_deg: 20, width_m: 12}\n"
    gate = start(understood(track).race.course)
    assert gate.tolerances.climb == Interval(math.radians(-5.0), math.radians(20.0))
    assert (gate.width, gate.tolerances.clearance) == (12.0, 0.5)


def test_a_preset_is_the_same_as_its_keys_by_hand() -> None:
    preset = read_preset("rbar-2016")
    rules = preset.rules.model_dump_json(exclude_unset=True)
    defaults = preset.gate_defaults.model_dump_json(exclude_unset=True)
    by_hand = understood(with_rules(rules) + f"gate_defaults: {defaults}\n").race
    assert by_hand == understood(with_rules("rbar-2016")).race


@pytest.mark.parametrize("rules", ["rbar-2016", "{preset: rbar-2016}", "{preset: rbar-2016, n_z_max: 8}"])
def test_one_rule_can_be_set_on_the_command_line_however_the_file_says_the_rest(rules: str) -> None:
    assert course(rules, "rules.n_z_max=12").rules.n_z.upper == 12.0
    assert course(rules, "rules.n_z_max=12").rules.height == course(rules).rules.height


def test_the_season_can_be_set_on_the_command_line() -> None:
    assert course("rbar-2016", "rules=rbar-2010").rules.n_z.upper == 12.0
    assert course("rbar-2016", "rules.preset=rbar-2010").rules.n_z.upper == 12.0
    assert course("rbar-2016", "rules=rbar-2010", "rules.n_z_max=11").rules.n_z.upper == 11.0


@pytest.mark.parametrize(
    ("rules", "message"),
    [
        ("rbr-2016", "t.yaml:3:8: rules.preset: unknown preset `rbr-2016`; did you mean `rbar-2016`? known are air-"),
        ("{preset: fai}", "t.yaml:3:17: rules.preset: unknown preset `fai`; known are air-race-x-2024, rbar-2010, "),
        ("2016", "t.yaml:3:8: rules: must be the name of a preset, or a mapping (`key: value` lines), not 2016"),
        ("[a]", "t.yaml:3:8: rules: must be the name of a preset, or a mapping (`key: value` lines), not a list"),
        ("{preset: 2016}", "t.yaml:3:17: rules.preset: must be text, not 2016; quote it if it is meant as text"),
        (
            "{floor_m: 5}",
            "t.yaml:3:1: rules.n_z_max: missing; a rule book needs `n_z_max`: the largest load factor",
        ),
        ("{preset: rbar-2016, ceiling_m: 5}", "t.yaml:3:39: rules.ceiling_m: must be above the floor of 10 m"),
    ],
)
def test_rules_that_are_none_are_refused(rules: str, message: str) -> None:
    found = findings_of(with_rules(rules))
    assert str(found[0]).startswith(message)
    assert len(found) == 1


# Bare names of gates


def test_a_bare_gate_can_be_reached_into() -> None:
    flown = understood(overrides=("course.lap.3.direction=reverse",)).race.course.passages
    assert {passage.name: passage.direction for passage in flown}["1:g0"] is Direction.REVERSE


def test_a_gate_that_was_set_can_be_reached_into_by_the_next_override() -> None:
    flown = understood(overrides=("course.lap.0=g2", "course.lap.0.direction=reverse", "course.lap.1=g1")).race.course
    assert [(passage.name, passage.direction) for passage in flown.passages[1:3]] == [
        ("1:g2", Direction.REVERSE),
        ("1:g1", Direction.FORWARD),
    ]


def test_a_finish_is_a_bare_name_as_well() -> None:
    finished = understood(overrides=("course.finish=g2", "course.finish.direction=reverse")).race.course.passages[-1]
    assert (finished.name, finished.direction) == ("2:g2#2", Direction.REVERSE)


def test_a_text_elsewhere_is_no_shorthand() -> None:
    (finding,) = findings_of(edited(TRACK, "rules:", "origin: home\nrules:"))
    assert str(finding) == "t.yaml:3:9: origin: must be a mapping (`key: value` lines), not the text `home`"


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("foo=1", "unknown key `foo`; known here: schema, name, "),
        ("foo=1", ", course, aircraft., settings."),
        ("setings.guess=plan", "unknown key `setings`; did you mean `settings.`?"),
        ("aircaft.airframe.mass_kg=700", "did you mean `aircraft`?"),
    ],
)
def test_a_key_that_no_track_knows_may_be_meant_for_another_document(override: str, words: str) -> None:
    (finding,) = findings_of(overrides=(override,))
    assert finding.file == "--set"
    assert words in finding.message


def test_a_key_in_a_file_is_not_meant_for_another_document() -> None:
    (finding,) = findings_of(TRACK + "foo: 1\n")
    assert finding.message.endswith("crowd, airspace, course")
