"""Whole inputs: what the files mean."""

import dataclasses
import math

import pytest
from language_texts import TRACK, edited, understood

from airrace.environment.air import Profile
from airrace.procedure.settings import GuessKind, MeshCheck, Settings
from airrace.quantities import Interval
from airrace.track.course import Direction
from airrace.track.gates import INVERTED, KNIFE_EDGE_LEFT, Gate, Manoeuvre, Passing, Pylon

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
