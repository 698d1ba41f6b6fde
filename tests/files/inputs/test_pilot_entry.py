"""The keys of a pilot's limits: presets, keys of one's own, `--set`, and their numbers among the parameters."""

import dataclasses
import math
import textwrap
from pathlib import Path

import pytest

from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.document import Document
from airrace.files.inputs.rules import PILOT_PRESETS
from airrace.files.inputs.variation import Variation
from airrace.model.parameters import unit_and_step
from airrace.model.track.course import PilotLimits, StartSpeed
from airrace.procedure.planning.lint import RemarkKind
from airrace.procedure.planning.parameters import relaxable_parameters
from airrace.runs.courses import check_course
from airrace.runs.execution_plan import plan_new_run

TRACK = Path("rovinj_2014")


def pilot_of(*overrides: str) -> PilotLimits:
    return load_inputs(TRACK, overrides=overrides).race.course.rules.pilot


def text_of_language(number: int, *rules: str) -> Document:
    """A course of two gates in a version of the track language."""
    text = f"""
    schema: airrace/track/{number}
    name: Two gates
    aircraft: edge540
    rules: {{n_z_max: 10{"".join(f", {rule}" for rule in rules)}}}
    gates:
      a: {{type: level, north_m: 0, east_m: 0, heading_deg: 0}}
      b: {{type: level, north_m: 900, east_m: 0, heading_deg: 0}}
    course: {{start: a, lap: [b]}}
    """
    return Document("two.yaml", textwrap.dedent(text).lstrip())


def test_race_is_the_default_and_none_is_for_who_asks() -> None:
    assert pilot_of() == pilot_of("rules.pilot=race") == PILOT_PRESETS["race"].build()
    assert pilot_of("rules.pilot=none") == PilotLimits()
    inputs = load_inputs(text_of_language(2))
    assert (inputs.race.course.rules.pilot, inputs.remark) == (PILOT_PRESETS["race"].build(), "")
    own = load_inputs(text_of_language(2, "pilot: {gate_roll_rate_max_deg_s: 60}")).race.course.rules.pilot
    assert own == dataclasses.replace(PILOT_PRESETS["race"].build(), roll_rate=math.radians(60.0))


def test_the_previous_language_has_no_limits_and_says_so_where_it_matters(
    caplog: pytest.LogCaptureFixture,
) -> None:
    previous = load_inputs(text_of_language(1))
    assert previous.race.course.rules.pilot == PilotLimits()
    assert "`race` holds" in previous.remark
    assert [remark.kind for remark in check_course(previous).warnings[:1]] == [RemarkKind.LANGUAGE]
    plan_new_run(previous)
    assert "two.yaml: in airrace/track/1 no pilot's limits hold" in caplog.text
    for name in PILOT_PRESETS:
        inputs = load_inputs(text_of_language(1, f"pilot: {name}"))
        assert (inputs.race.course.rules.pilot, inputs.remark) == (PILOT_PRESETS[name].build(), "")
    own = load_inputs(text_of_language(1, "pilot: {gate_roll_rate_max_deg_s: 60}")).race.course.rules.pilot
    assert own == PilotLimits(roll_rate=math.radians(60.0))


@pytest.mark.parametrize("name", PILOT_PRESETS)
def test_a_preset_is_named_in_a_word_and_its_keys_are_overridden_one_by_one(name: str) -> None:
    assert pilot_of(f"rules.pilot={name}") == pilot_of(f"rules.pilot.preset={name}") == PILOT_PRESETS[name].build()
    own = pilot_of(f"rules.pilot={name}", "rules.pilot.gate_roll_rate_max_deg_s=60")
    assert own.roll_rate == pytest.approx(math.radians(60.0))
    assert own.n_z_low == PILOT_PRESETS[name].build().n_z_low


def test_display_is_nowhere_milder_than_race() -> None:
    race, display = PILOT_PRESETS["race"].build(), PILOT_PRESETS["display"].build()
    assert display.n_z_min >= race.n_z_min
    assert display.n_z_low >= race.n_z_low
    assert display.n_z_ends >= race.n_z_ends
    assert display.onset <= race.onset
    assert display.roll_rate <= race.roll_rate
    assert display.sideslip <= race.sideslip
    assert display.n_y <= race.n_y
    assert display.settled_start >= race.settled_start
    assert display.settled_finish >= race.settled_finish
    assert display.steady_start >= race.steady_start
    assert display.steady_finish >= race.steady_finish


def test_numbers_of_the_preset_are_parameters_and_limits_that_may_give_way() -> None:
    inputs = load_inputs(TRACK)
    without = load_inputs(TRACK, overrides=["rules.pilot=none"])
    keys = {key for key, value in PILOT_PRESETS["race"].model_dump().items() if isinstance(value, float)}
    found = {key for key in Variation(inputs).parameters if key.startswith("rules.pilot.")}
    assert found == {f"rules.pilot.{key}" for key in keys}
    milder = {one.key for one in relaxable_parameters(inputs.race)}
    assert found - milder == {"rules.pilot.low_height_m"}
    assert not any("pilot" in one.key for one in relaxable_parameters(without.race))
    for one in relaxable_parameters(inputs.race):
        if one.key in found:
            assert one.set(inputs.race, one.value) == inputs.race
    assert [unit_and_step(f"rules.pilot.{key}")[0] for key in ("gate_onset_max_g_s", "turn_tolerance_g")] == [
        "g/s",
        "g",
    ]


@pytest.mark.parametrize(
    "text",
    [
        "rules.pilot=fast",
        "rules.pilot.settled=maybe",
        "rules.pilot.steady_turn=yes",
        "rules.pilot.gate_onset_max_g_s=0",
        "rules.pilot.low_height_m=30",
    ],
)
def test_what_is_out_of_range_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"pilot"):
        pilot_of("rules.pilot=none", text)


def test_the_start_speed_is_over_ground_unless_the_rules_say_otherwise() -> None:
    assert load_inputs(TRACK).race.course.rules.start_speed is StartSpeed.GROUND
    for kind in StartSpeed:
        said = load_inputs(TRACK, overrides=[f"rules.start_speed={kind.value}"]).race.course.rules
        assert said.start_speed is kind
