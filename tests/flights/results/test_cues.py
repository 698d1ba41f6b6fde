"""Cues: exactly the events of a history that is made of them, whatever the noise, and mirrored in a mirror."""

import csv
import functools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from example_flights import ROOT, circling, half_cuban, rovinj
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.flights.results import Basis, Flight, History, Source, TimedCrossing
from airrace.flights.results.cues import Action, Pull, RollAction, cues_of, turning_points
from airrace.flights.results.derivation import complete_histories
from airrace.model.frames import QUATERNION, quaternion
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.stage_tables import action_table, cue_text, place_text
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


def actions(flight: Flight) -> list[Action]:
    return [action for cue in cues_of(flight) for action in cue.actions]


def kinds(flight: Flight) -> list[tuple[str, ...]]:
    """What is done, in order, without numbers."""
    return [
        (type(one).__name__, *([one.side] if isinstance(one, RollAction | Pull) else [])) for one in actions(flight)
    ]


def test_a_constructed_history_has_exactly_its_events() -> None:
    right, turn, left, up, over, push = actions(constructed())
    assert isinstance(right, RollAction)
    assert isinstance(left, RollAction)
    assert isinstance(up, RollAction)
    assert isinstance(turn, Pull)
    assert isinstance(over, Pull)
    assert isinstance(push, Pull)
    for roll, begin, duration, bank, angle in ((right, 1.0, 0.4, 0.0, 80.0), (left, 5.0, 0.8, 80.0, -160.0)):
        assert roll.time == pytest.approx(begin, abs=0.06)
        assert roll.duration == pytest.approx(duration, abs=0.12)
        assert math.degrees(roll.bank_from) == pytest.approx(bank, abs=4.0)
        assert math.degrees(roll.angle) == pytest.approx(angle, abs=4.0)
    assert (left.level, left.inverted, right.level) == (True, False, False)
    for pull, begin, duration, peak in ((turn, 1.6, 2.0, 8.0), (over, 9.0, 2.5, 6.0), (push, 15.0, 0.6, -1.0)):
        assert pull.time == pytest.approx(begin, abs=0.06)
        assert pull.duration == pytest.approx(duration, abs=0.12)
        assert pull.n_z == pytest.approx(peak, abs=0.45)
    assert (turn.side, over.side, push.side) == ("right", "up", "down")
    assert math.degrees(turn.turn) == pytest.approx(90.0, abs=3.0)
    assert (turn.over_the_top, over.over_the_top) == (False, True)
    assert over.apex == pytest.approx(113.0, abs=5.0)
    assert math.isnan(turn.apex)


def test_cues_stand_on_the_leg_on_which_they_begin_and_at_the_nearer_passing() -> None:
    flight = constructed()
    cues = cues_of(flight)
    assert [len(one.actions) for one in cues] == [2, 1, 2, 1]
    assert [one.leg.number for one in cues] == [1, 1, 2, 3]
    names = [one.name for one in flight.crossings]
    assert [one.passing for one in cues] == [
        names[0],
        names[1],
        names[1],
        names[2] if cues[3].distance > 0 else names[3],
    ]
    for one in cues:
        passed = flight.crossings[names.index(one.passing)].time
        assert one.distance == pytest.approx(SPEED * (one.time - passed), rel=0.2)


def test_words_name_units_places_and_sides() -> None:
    first, second, third, _ = cues_of(constructed())
    assert cue_text(first).startswith("roll right 0° -> ")
    assert "; pull to 8" in cue_text(first)
    assert cue_text(first).endswith(" s, right")
    assert cue_text(second).endswith("through level")
    assert ", up, over the top, apex " in cue_text(third)
    assert cue_text(third).endswith(" m")
    assert cue_text(third, UNITS["kt-ft"]).endswith(" ft")
    assert place_text(first) == f"{first.distance:.0f} m after {first.passing}"
    assert place_text(replace(first, distance=-2.0)) == f"at {first.passing}"
    assert place_text(replace(first, distance=math.nan)) == ""


def mirrored(flight: Flight) -> Flight:
    """A flight seen in a mirror that exchanges east and west."""
    signs = {"y": -1.0, "p_Kbar": -1.0, "mu": -1.0, "chi": -1.0, "q1": -1.0, "q3": -1.0}
    values = {name: replace(one, values=signs.get(name, 1.0) * one.values) for name, one in flight.histories.items()}
    return replace(flight, histories=values)


@pytest.mark.parametrize("fly", [constructed, optimum])
def test_a_mirrored_flight_has_mirrored_cues(fly: Callable[[], Flight]) -> None:
    other = {"left": "right", "right": "left", "up": "up", "down": "down"}
    straight, turned = actions(fly()), actions(mirrored(fly()))
    assert len(straight) == len(turned) > 3
    for one, its in zip(straight, turned, strict=True):
        assert type(one) is type(its)
        assert one.time == pytest.approx(its.time, abs=1e-9)
        if isinstance(one, RollAction) and isinstance(its, RollAction):
            assert (one.angle, one.bank_to) == pytest.approx((-its.angle, -its.bank_to), abs=1e-9)
        if isinstance(one, Pull) and isinstance(its, Pull):
            assert other[one.side] == its.side
            assert (one.n_z, one.duration) == pytest.approx((its.n_z, its.duration))


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


@pytest.mark.parametrize(
    ("fly", "known"),
    [(constructed, lambda flight: flight), (optimum, lambda flight: flight), (optimum, without_roll_rate)],
)
def test_noise_of_a_recorder_makes_no_cue_and_hides_none(
    fly: Callable[[], Flight], known: Callable[[Flight], Flight]
) -> None:
    """Where no roll rate is recorded, it follows from the attitude."""
    flight = fly()
    for seed in range(5):
        one = known(noisy(flight, seed))
        assert kinds(one) == kinds(flight)
        moved = [abs(its.time - own.time) for its, own in zip(actions(one), actions(flight), strict=True)]
        assert sum(apart > 0.15 for apart in moved) <= 1  # a load that dips to the very middle has two beginnings
        for its, own in zip(actions(one), actions(flight), strict=True):
            if isinstance(its, Pull) and isinstance(own, Pull):
                assert its.n_z == pytest.approx(own.n_z, abs=0.3)


def test_turning_points_are_passed_over_where_they_are_small() -> None:
    values = np.array([0.0, 3.0, 2.5, 4.0, 0.0, 0.5, -1.0, 1.0])
    assert turning_points(values, 2.0) == [(0, -1), (3, 1), (6, -1), (7, 1)]
    assert turning_points(np.full(4, 2.0), 1.0) == []


def test_a_flight_without_attitude_or_changes_has_no_cues() -> None:
    flight = circling(rovinj())
    assert actions(flight) == []
    assert cues_of(replace(flight, histories={name: flight.histories[name] for name in ("x", "y", "z")})) == ()


def test_a_briefing_is_the_same_as_text_table_and_rows(tmp_path: Path) -> None:
    brief = half_cuban().brief()
    assert brief.lines == half_cuban()["point-mass"].cues().lines
    assert len(brief.lines) == len(brief)
    assert brief.lines[0].startswith(f"{brief[0].time:.2f} s, ")
    assert any(" 0:entry: " in line for line in brief.lines)
    rows = action_table(brief.cues).objects()
    assert len(brief.to_csv().splitlines()) == len(rows) + 1 == len(actions(brief.flight)) + 1
    assert json.loads(json.dumps(brief.as_object(), allow_nan=False))["actions"] == rows
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
    assert {"roll", "pull"} <= {one["action"] for one in answer["actions"]}
    assert told(stored, "--json", "--csv")[0] == 2
    assert told(stored, "--stage", "six-dof")[0] == 2
