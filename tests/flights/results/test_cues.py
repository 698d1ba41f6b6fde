"""Cues: a chain from passing to passing that can be flown as told, whatever the noise, and mirrored in a mirror."""

import csv
import functools
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from example_flights import ROOT, circling, half_cuban, rovinj, shipped
from spoken_flight import spoken_deviations
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.flights.results import Basis, Flight, History, Source, TimedCrossing
from airrace.flights.results.cues import cues_of, load_profile, roll_rate_of, turning_points
from airrace.flights.results.derivation import complete_histories
from airrace.model.frames import QUATERNION, quaternion
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.cue_tables import bank_text, cue_rows, cue_text, gate_text, place_text
from airrace.pages.views.tables import UNITS
from airrace.race import Race
from airrace.runs.stage_data import Brief

SPEED, STEP, PASSED = 90.0, 0.01, (0.0, 6.0, 12.0, 18.0)
"""Of the history below: m/s, s, and when it makes its passings, s."""


def ramp(time: Array, begin: float, duration: float, before: float, behind: float) -> Array:
    """A value that changes at a constant rate."""
    return np.interp(time, [begin, begin + duration], [before, behind])


def hump(time: Array, begin: float, duration: float, base: float, peak: float) -> Array:
    """A value that rises within 0.3 s, stays, and falls within 0.3 s; half of it lasts for `duration`."""
    rise = 0.15
    corners = [begin - rise, begin + rise, begin + duration - rise, begin + duration + rise]
    return np.interp(time, corners, [0.0, peak - base, peak - base, 0.0])


def constructed(mirror: float = 1.0) -> Flight:
    """A roll and a turn to the right, a roll through level, a pull up over the top, a push, and corrections besides.

    Course, climb and place are what the cues say of them, not what these loads would do: the histories are independent.
    """
    race = rovinj()
    race = replace(race, course=replace(race.course, passages=race.course.passages[: len(PASSED)]))
    time = np.linspace(0.0, PASSED[-1], round(PASSED[-1] / STEP) + 1)
    bank = ramp(time, 1.0, 0.4, 0.0, 80.0) + ramp(time, 5.0, 0.8, 0.0, -160.0) + ramp(time, 8.0, 0.5, 0.0, 80.0)
    bank += ramp(time, 3.0, 0.1, 0.0, 10.0) + ramp(time, 4.0, 0.1, 0.0, -10.0)  # a correction, and a roll of 170 to it
    n_z = 1.0 + hump(time, 1.6, 2.0, 1.0, 8.0) + hump(time, 9.0, 2.5, 1.0, 6.0) + hump(time, 15.0, 0.6, 1.0, -1.0)
    n_z += 0.4 * np.sin(4.0 * time)
    course = ramp(time, 1.6, 2.0, 20.0, 110.0)
    height = 20.0 + 100.0 * np.exp(-0.5 * ((time - 10.5) / 0.8) ** 2) + 8.0 * np.sin(time)
    back = np.where((time > 10.0) & (time < 11.0), 180.0, 0.0)  # on its back at the top
    angles = np.radians([mirror * course, np.zeros_like(time), mirror * (bank + back)])
    attitude = np.array([quaternion(*row) for row in angles.T.tolist()]).T
    columns: dict[tuple[str, str], Array] = {
        ("x", "m"): SPEED * time,
        ("y", "m"): np.zeros_like(time),
        ("z", "m"): -height,
        ("V_K", "m/s"): np.full_like(time, SPEED),
        ("n_z", "1"): n_z,
        ("p_Kbar", "rad/s"): mirror * np.radians(np.gradient(bank, time)),
        **{(name, "1"): row for name, row in zip(QUATERNION, attitude, strict=True)},
    }
    given = {name: History(Quantity(name, unit), values, Basis.SOLVED) for (name, unit), values in columns.items()}
    return flight_through(race, "constructed", time, given, PASSED)


def flight_through(
    race: Race, label: str, time: Array, given: Mapping[str, History], passed: Sequence[float]
) -> Flight:
    """A flight of given histories that makes its passings at given times."""
    histories = complete_histories(race, given)
    crossings: list[TimedCrossing] = []
    for passage, when in zip(race.course.passages, passed, strict=True):
        values = {name: float(np.interp(when, time, one.values)) for name, one in histories.items()}
        crossings.append(TimedCrossing(passage, when, values))
    return Flight(race, Source(label), time, histories, tuple(crossings))


@functools.cache
def optimum() -> Flight:
    """The optimum of Rovinj 2014 that the tests of logs record."""

    def rows(name: str) -> list[dict[str, str]]:
        with (ROOT / "tests" / "flights" / "logs" / name).open() as file:
            return list(csv.DictReader(line for line in file if not line.startswith("#")))

    table = rows("rovinj_2014.csv")
    columns = {name: np.array([float(row[name]) for row in table]) for name in table[0]}
    angles = np.radians([columns[name] for name in ("chi_deg", "gamma_deg", "mu_deg")])
    attitude = np.array([quaternion(*row) for row in angles.T.tolist()]).T
    attitude[:, 1:] *= np.cumprod(np.where(np.sum(attitude[:, 1:] * attitude[:, :-1], axis=0) < 0.0, -1.0, 1.0))
    values = {name: columns[key] for name, key in (("x", "x_m"), ("y", "y_m"), ("V_K", "V_K_m_s"), ("n_z", "n_z"))}
    values |= {"z": -columns["height_m"], "p_Kbar": np.radians(columns["p_Kbar_deg_s"])}
    values |= zip(QUATERNION, attitude, strict=True)
    given = {name: History(Quantity(name, ""), one, Basis.SOLVED) for name, one in values.items()}
    passed = [float(row["time_s"]) for row in rows("rovinj_2014.splits.csv")]
    return flight_through(rovinj(), "optimum", columns["time_s"], given, passed).at_rate(50.0)


def test_a_constructed_history_has_its_rolls_turns_and_apex() -> None:
    cues = cues_of(constructed())
    rolls = [
        cue for cue in cues if cue.action == "roll" and cue.duration > 0.2
    ]  # the histories turn on their back at once
    assert [roll.side for roll in rolls] == ["right", "left", "right"]
    for roll, begin, duration, bank, angle in zip(
        rolls, (1.0, 5.0, 8.0), (0.4, 0.8, 0.5), (0.0, 80.0, -80.0), (80.0, -160.0, 80.0), strict=True
    ):
        assert roll.time == pytest.approx(begin, abs=0.06)
        assert roll.duration == pytest.approx(duration, abs=0.25)
        assert math.degrees(roll.begin.bank) == pytest.approx(bank, abs=4.0)
        assert math.degrees(roll.rolled) == pytest.approx(angle, abs=8.0)
    assert [roll.level for roll in rolls] == [False, True, False]
    assert max(cue.n_z_extreme for cue in cues) == pytest.approx(8.0, abs=0.45)
    assert min(cue.n_z_extreme for cue in cues) == pytest.approx(-1.0, abs=0.45)
    ((cue, apex),) = [(cue, cue.apex) for cue in cues if cue.apex is not None]
    assert cue.time <= apex.time < cue.end.time
    assert apex.over_the_top
    assert apex.height == pytest.approx(113.0, abs=5.0)


@pytest.mark.parametrize("fly", [constructed, optimum])
def test_cues_are_a_chain_from_passing_to_passing(fly: Callable[[], Flight]) -> None:
    flight = fly()
    cues = cues_of(flight)
    assert [cue.number for cue in cues] == list(range(1, len(cues) + 1))
    for before, behind in itertools.pairwise(cues):
        assert astuple(before.end) == pytest.approx(astuple(behind.begin), abs=1e-9, nan_ok=True)
    passed = [crossing.time for crossing in flight.crossings]
    begins = {cue.time for cue in cues}
    assert set(passed[:-1]) <= begins
    assert cues[-1].end.time == passed[-1]
    for cue in cues:
        assert cue.leg.before.time <= cue.time < cue.end.time <= cue.leg.after.time
        if not cue.vertical:
            turned = math.remainder(cue.end.bank - cue.begin.bank - cue.rolled, 2.0 * math.pi)
            assert turned == pytest.approx(0.0, abs=1e-9)


def test_two_pulls_with_a_level_gate_between_them_are_cues_of_their_own() -> None:
    """An apex behind a gate belongs to the leg behind it, whatever is pulled before."""
    flight = optimum()
    (apex,) = [cue for cue in cues_of(flight) if cue.apex is not None]
    assert apex.apex is not None
    assert apex.leg.before.time < apex.apex.time < apex.leg.after.time
    assert (apex.leg.before.name, apex.leg.after.name) == ("1:g0", "1:g7#2")


def test_places_are_told_from_the_nearer_passing() -> None:
    for cue in cues_of(constructed()):
        nearer = cue.leg.before if cue.passing == cue.leg.before.name else cue.leg.after
        assert cue.passing == nearer.name
        assert cue.distance == pytest.approx(SPEED * (cue.time - nearer.time), rel=0.3, abs=1.0)
        assert abs(cue.distance) <= 0.5 * 1.3 * SPEED * cue.leg.time


def test_a_load_profile_begins_ends_and_averages_as_told() -> None:
    time = np.linspace(0.0, 2.0, 2001)
    for begin, extreme, end, mean in (
        (1.0, 8.0, 3.0, 6.5),
        (5.0, 1.0, 2.0, 1.6),
        (2.0, 6.0, 6.0, 5.0),
        (3.0, 3.0, 3.0, 3.0),
    ):
        load = load_profile(time, 2.0, begin, extreme, end, mean)
        assert (load[0], load[-1]) == pytest.approx((begin, end))
        assert extreme in (load.max(), load.min())
        assert load.mean() == pytest.approx(mean, abs=5e-3)


def test_words_name_units_places_sides_and_gates_as_a_map_does() -> None:
    cues = cues_of(constructed())
    texts = [cue_text(cue) for cue in cues]
    assert any(text.startswith("roll right level to R80 in 0.") for text in texts)
    assert any(text.startswith("roll left R80 to L80 in 1.") and ", through level; " in text for text in texts)
    (apex,) = [cue for cue in cues if cue.apex is not None]
    assert "over the top, apex " in cue_text(apex)
    assert " ft at " in cue_text(apex, UNITS["kt-ft"])
    roll = next(cue for cue in cues if cue.action == "roll")
    assert place_text(roll) == f"{roll.distance:.0f} m after g0"
    assert place_text(replace(roll, distance=-2.0)) == "at g0"
    assert place_text(replace(roll, distance=math.nan)) == ""
    assert [bank_text(math.radians(bank)) for bank in (-88.0, 9.4, 0.3, 180.0, -179.8)] == [
        *("L88", "R9", "level", "inverted", "inverted"),
    ]
    assert [gate_text(name) for name in ("2:g4#2", "0:entry", "a:b", "2:roll/begin")] == [
        *("g4", "entry", "a:b", "roll/begin"),
    ]


def mirrored(flight: Flight) -> Flight:
    """A flight seen in a mirror that exchanges east and west."""
    signs = {"y": -1.0, "p_Kbar": -1.0, "mu": -1.0, "chi": -1.0, "q1": -1.0, "q3": -1.0}
    values = {
        name: replace(history, values=signs.get(name, 1.0) * history.values)
        for name, history in flight.histories.items()
    }
    return replace(flight, histories=values)


@pytest.mark.parametrize("fly", [constructed, optimum])
def test_a_mirrored_flight_has_mirrored_cues(fly: Callable[[], Flight]) -> None:
    sides = {"left": "right", "right": "left", "": ""}
    straight, turned = cues_of(fly()), cues_of(mirrored(fly()))
    assert len(straight) == len(turned) > 3
    for cue, mirror in zip(straight, turned, strict=True):
        assert mirror.side == sides[cue.side]
        assert mirror.rolled == pytest.approx(-cue.rolled, abs=1e-9)
        assert (mirror.time, mirror.n_z_extreme, mirror.n_z_mean) == (cue.time, cue.n_z_extreme, cue.n_z_mean)


def assert_words_lead(flight: Flight) -> None:
    """From the flight's state at every passing, words stay within 15 m and 5 degrees of it up to the next."""
    deviations = spoken_deviations(flight)
    assert [deviation.leg for deviation in deviations] == [crossing.name for crossing in flight.crossings[1:]]
    assert max(deviation.distance for deviation in deviations) < 15.0
    assert math.degrees(max(deviation.angle for deviation in deviations)) < 5.0
    assert sum(deviation.cues for deviation in deviations) < 6 * len(deviations)


@pytest.mark.parametrize("fly", [optimum, lambda: half_cuban().flight()])
def test_who_flies_the_words_of_cues_stays_on_the_line(fly: Callable[[], Flight]) -> None:
    assert_words_lead(fly())


@pytest.mark.slow
@pytest.mark.parametrize("stage", ["point-mass", "six-dof"])
@pytest.mark.parametrize("course", [course.stem for course in sorted((ROOT / "tracks").glob("*.yaml"))])
def test_who_flies_the_words_of_a_shipped_course_stays_on_the_line(course: str, stage: str) -> None:
    assert_words_lead(shipped(course)[stage].flight())


def noisy(flight: Flight, seed: int) -> Flight:
    """A flight as a recorder sees it: 1 deg of attitude, 0.1 g, 3 deg/s of roll, 0.5 m of height, all white."""
    random, count = np.random.default_rng(seed), len(flight.time)
    noise: Mapping[str, float] = {"n_z": 0.1, "height": 0.5, "p_Kbar": math.radians(3.0), "mu": math.radians(1.0)}
    histories = dict(flight.histories)
    for name, deviation in noise.items():
        one = histories[name]
        histories[name] = replace(one, values=one.values + deviation * random.standard_normal(count))
    q0, q1, q2, q3 = (flight[name] for name in QUATERNION)
    x, y, z = 0.5 * math.radians(1.0) * random.standard_normal((3, count))
    turned = np.array(
        [
            q0 - q1 * x - q2 * y - q3 * z,
            q1 + q0 * x + q2 * z - q3 * y,
            q2 + q0 * y + q3 * x - q1 * z,
            q3 + q0 * z + q1 * y - q2 * x,
        ]
    )
    for name, row in zip(QUATERNION, turned / np.linalg.norm(turned, axis=0), strict=True):
        histories[name] = replace(histories[name], values=row)
    return replace(flight, histories=histories)


def without_roll_rate(flight: Flight) -> Flight:
    return replace(flight, histories={name: one for name, one in flight.histories.items() if name != "p_Kbar"})


@pytest.mark.parametrize("fly", [constructed, optimum])
@pytest.mark.parametrize("recorded", [lambda flight: flight, without_roll_rate])
def test_noise_of_a_recorder_hides_no_roll_and_hardly_moves_it(
    fly: Callable[[], Flight], recorded: Callable[[Flight], Flight]
) -> None:
    """Where no roll rate is recorded, it follows from the attitude."""
    flight = fly()
    edges = [cue.time for cue in cues_of(flight) if cue.action == "roll" and abs(cue.rolled) > 1.0]
    for seed in range(3):
        cues = cues_of(recorded(noisy(flight, seed)))
        assert len(cues) < 1.5 * len(cues_of(flight))
        for edge in edges:
            assert min(abs(cue.time - edge) for cue in cues) < 0.25


def test_turning_points_are_passed_over_where_they_are_small() -> None:
    values = np.array([0.0, 3.0, 2.5, 4.0, 0.0, 0.5, -1.0, 1.0])
    assert turning_points(values, 2.0) == [(0, -1), (3, 1), (6, -1), (7, 1)]
    assert turning_points(np.full(4, 2.0), 1.0) == []


def test_a_level_turn_is_held_and_a_flight_without_attitude_has_no_cues() -> None:
    flight = circling(rovinj())
    assert {(cue.action, round(math.degrees(cue.end.bank))) for cue in cues_of(flight)} == {("hold", 60)}
    assert cues_of(replace(flight, histories={name: flight.histories[name] for name in ("x", "y", "z")})) == ()


def test_a_briefing_is_the_same_as_text_table_and_rows(tmp_path: Path) -> None:
    brief = half_cuban().brief()
    assert brief.lines == half_cuban()["point-mass"].cues().lines
    assert len(brief.lines) == len(brief)
    assert brief.lines[0].startswith(f"{brief[0].time:.2f} s, at entry: ")
    rows = cue_rows(brief.cues).objects()
    assert len(brief.to_csv().splitlines()) == len(rows) + 1 == len(brief) + 1
    assert json.loads(json.dumps(brief.as_object(), allow_nan=False))["cues"] == rows
    assert brief.to_csv(tmp_path / "cues.csv") == (tmp_path / "cues.csv").read_text()
    assert repr(brief).count("\n") >= len(brief)
    assert "<table" in brief._repr_html_()
    assert isinstance(brief[:1], Brief)


def told(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["brief", *arguments])
    return result.exit_code, result.stdout, result.stderr


def test_the_command_prints_the_table_the_rows_or_the_object(tmp_path: Path) -> None:
    stored = str(half_cuban().save(tmp_path / "run.h5"))
    code, text, _ = told(stored)
    assert code == 0
    assert "roll" in text
    assert "pull" in text
    assert max(map(len, text.splitlines())) <= 80
    assert " ft" in told(stored, "--units", "kt-ft")[1]
    assert told(stored, "--csv")[1] == half_cuban().brief().to_csv()
    answer = json.loads(told(stored, "--json")[1])
    assert answer["stage"] == "point-mass"
    assert {"roll", "hold"} <= {cue["action"] for cue in answer["cues"]}
    assert told(stored, "--json", "--csv")[0] == 2
    assert told(stored, "--stage", "six-dof")[0] == 2


def test_the_rate_of_a_roll_does_not_depend_on_which_of_its_two_quaternions_an_attitude_has() -> None:
    time = np.linspace(0.0, 1.0, 51)
    half = 0.5 * math.radians(80.0) * time
    q = np.stack([np.cos(half), np.sin(half), 0.0 * half, 0.0 * half])
    signs = np.where(np.arange(51) % 7 < 3, -1.0, 1.0)
    assert roll_rate_of(time, q) == pytest.approx(math.radians(80.0), rel=1e-3)
    assert roll_rate_of(time, signs * q) == pytest.approx(math.radians(80.0), rel=1e-3)
