"""A gate that flights of several logs miss by the same vector stands elsewhere, whatever each log is off by itself."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, imported, known, race

from airrace.files.inputs import load_inputs
from airrace.flights.logs.errors import CommonErrors, Receiver, Window
from airrace.flights.logs.log_flight import LogFlight, judged_together
from airrace.flights.logs.quality import ReceiverAccuracy
from airrace.flights.logs.violations import CERTAIN_DEVIATIONS
from airrace.runs.joint_judgement import log_views_judged_together
from airrace.runs.log_view import LogView, fly_log_through

GATES = tuple(f"g{number}" for number in range(12))
HALF = 1.0
"""Half the free width of a gate, m."""


def recorded(
    seed: int, displaced: dict[str, tuple[float, float]], *, breach: tuple[str, float] | None = None
) -> CommonErrors:
    """What the passings of one log tell, with an offset and a drift of its own; every gate is passed along two axes."""
    random = np.random.default_rng(seed)
    time = np.array([0.0, 100.0])
    offset = random.uniform(-8.0, 8.0, 2)
    drift = 1.0 * random.standard_normal(2)
    windows: list[Window] = []
    for number, gate in enumerate(GATES + GATES):
        when = 4.0 * number
        heading = 0.6 * (number % len(GATES)) + (0.0 if number < len(GATES) else 0.5 * math.pi)
        right = np.array([-math.sin(heading), math.cos(heading)])
        if number:
            drift = math.exp(-4.0 / 20.0) * drift + math.sqrt(1.0 - math.exp(-8.0 / 20.0)) * random.standard_normal(2)
        line = random.uniform(-0.9, 0.9) * HALF
        if breach is not None and number == GATES.index(breach[0]):
            line = breach[1]
        measured = right @ (offset + drift + displaced.get(gate, (0.0, 0.0))) + line + 0.2 * random.standard_normal()
        lower, upper = measured - HALF, measured + HALF
        windows.append(Window(f"{number}:{gate}", gate, when, (*right.tolist(), 0.0), lower, upper, 0.2))
    return CommonErrors(Receiver(time, ReceiverAccuracy(np.full(2, 2.5), np.full(2, 4.0), "")), windows)


def together(logs: Sequence[CommonErrors]) -> CommonErrors:
    return logs[0].beside(logs[1:])


@pytest.mark.parametrize("vector", [(9.0, 0.0), (-6.0, 7.0), (0.0, -12.0)])
def test_a_displaced_gate_is_told_within_a_metre(vector: tuple[float, float]) -> None:
    for count in (3, 6):
        errors = together([recorded(100 * count + log, {"g5": vector}) for log in range(count)])
        assert set(errors.displaced) == {"g5"}
        place = errors.displaced["g5"]
        assert math.hypot(place.north - vector[0], place.east - vector[1]) < 1.0
        assert place.deviation < 1.5


@pytest.mark.parametrize("count", [1, 3, 6])
def test_no_gate_is_told_to_stand_elsewhere_where_none_does(count: int) -> None:
    for seed in range(0, 80, 10):
        assert together([recorded(seed + log, {}) for log in range(count)]).displaced == {}


def test_two_displaced_gates_are_both_told_and_no_third_one() -> None:
    vectors = {"g2": (9.0, 3.0), "g8": (-8.0, 6.0)}
    errors = together([recorded(log, vectors) for log in range(5)])
    assert set(errors.displaced) == set(vectors)
    for gate, (north, east) in vectors.items():
        assert math.hypot(errors.displaced[gate].north - north, errors.displaced[gate].east - east) < 2.0


def test_one_flight_that_misses_a_gate_displaces_it_for_nobody_and_stays_certain() -> None:
    logs = [recorded(0, {}, breach=("g5", 16.0)), *(recorded(log, {}) for log in range(1, 4))]
    errors = together(logs)
    assert errors.displaced == {}
    (own,) = [window for window in errors.windows if window.log == 0 and window.passing == "5:g5"]
    assert errors.judge(own).deviations > CERTAIN_DEVIATIONS


def test_errors_of_a_log_that_no_other_log_shares_stay_its_own() -> None:
    """Without a displaced gate, other logs change no judgement."""
    logs = [recorded(log, {}) for log in range(3)]
    alone, beside = logs[0], together(logs)
    for window in alone.windows:
        assert beside.judge(window).deviations == pytest.approx(alone.judge(window).deviations, abs=0.05)


PLACES = {passage.name: passage.element.place for passage in race().course.passages}


def log_text(seed: int, vector: tuple[float, float], line: float) -> str:
    """A log with offset, drift and a recorded roll that passes g4 so far beside where that stands, not its file."""
    random, seen = np.random.default_rng(seed), fixes(10.0, noise=0.02, seed=seed, gap=(0.0, 0.0))
    north, east = seen.north.copy(), seen.east.copy()
    for name in ("1:g4", "1:g4#2"):
        when = known().passings[name]
        chi = known().at("chi", np.array([when]))[0]
        side = np.array([-math.sin(chi), math.cos(chi)])
        place = np.array([known().at(axis, np.array([when]))[0] for axis in "xy"])
        beside = float(side @ (np.array(PLACES[name]) + vector - place)) + line
        bump = np.cos(0.5 * np.pi * np.minimum(np.abs(seen.time - when) / 1.5, 1.0)) ** 2
        north, east = north + beside * side[0] * bump, east + beside * side[1] * bump
    offset = random.uniform(-5.0, 5.0, 3)
    rows = csv_text(Fixes(seen.time, north + offset[0], east + offset[1], seen.height + offset[2])).splitlines()
    roll = np.degrees(known().at("mu", np.clip(seen.time, 0.0, known().time[-1])))
    cells = ["roll [deg]", *(f"{angle:.3f}" for angle in roll)]
    return "\n".join(f"{row},{cell}" for row, cell in zip(rows, cells, strict=True)) + "\n"


@pytest.fixture(scope="module")
def logs() -> list[LogFlight]:
    return [imported(log_text(seed, (12.0, 0.0), line)) for seed, line in enumerate((-2.0, 0.0, 2.0))]


def test_flights_are_judged_with_the_place_that_all_of_them_tell(logs: list[LogFlight]) -> None:
    judged = judged_together(logs)
    for log in judged:
        assert set(log.errors.common.displaced) == {"g4"}
        (sentence,) = [remark for remark in log.remarks if "g4 seems to stand" in remark]
        assert "the passings of 3 logs agree" in sentence
        assert not [breach for breach in log.violations if breach.certain]
    place = judged[0].errors.common.displaced["g4"]
    assert judged[1].errors.common.displaced["g4"] == place  # one place for all of them
    across = known().at("chi", np.array([known().passings["1:g4"]]))[0] + 0.5 * math.pi
    told = place.north * math.cos(across) + place.east * math.sin(across)
    assert abs(told - 12.0 * math.cos(across)) < 2.0 * place.deviation


def test_a_log_that_is_given_twice_tells_no_more_than_once(logs: list[LogFlight]) -> None:
    assert [log.violations for log in judged_together([logs[0], logs[0]])] == [logs[0].violations] * 2


def test_views_of_logs_are_judged_together_and_their_files_are_not(tmp_path: Path) -> None:
    inputs, views = load_inputs("rovinj_2014"), list[LogView]()
    for seed, line in enumerate((-2.0, 2.0)):
        path = tmp_path / f"{seed}.csv"
        path.write_text(log_text(seed, (13.0, 0.0), line))
        views.append(fly_log_through(path, inputs))
    judged = log_views_judged_together(views)
    for view, before in zip(judged, views, strict=True):
        (sentence,) = view.displaced
        assert sentence in view.flight().source.displaced
        assert sentence in view.remarks
        assert before.displaced == ()
        assert view.flight().source.penalties == "0 s"
    assert log_views_judged_together(views[:1]) == views[:1]
