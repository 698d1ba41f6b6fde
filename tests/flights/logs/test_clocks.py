"""Clocks that jump are repaired where there is one way to, and times that are cut off are told to be."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, imported, known

from airrace.files.inputs import load_inputs
from airrace.flights.logs.clocks import cut_step, repair_cut, repair_jumps, spread_repeated
from airrace.flights.logs.log_flight import flight_of_part
from airrace.flights.logs.violations import Violation
from airrace.pages.views.log_tables import penalties_text
from airrace.runs.log_view import fly_log_through

EXACT = fixes(10.0, noise=0.02, gap=(0.0, 0.0))
LINES = np.arange(len(EXACT.time))


def late(seen: Fixes, behind: float, jump: float) -> Fixes:
    return Fixes(np.where(seen.time > behind, seen.time + jump, seen.time), seen.north, seen.east, seen.height)


@pytest.mark.parametrize("jump", [65.533, 4.0])
def test_a_clock_that_jumps_while_the_aircraft_flies_on_is_repaired_and_told(jump: float) -> None:
    flown = imported(csv_text(late(EXACT, 30.0, jump)))
    assert flown.flight.race_time == pytest.approx(known().passings["1:g0#2"] - known().passings["0:g0"], abs=0.01)
    assert any(f"the clock jumps by {jump:.3f} s in line" in remark for remark in flown.remarks)
    assert [breach for breach in flown.violations if breach.certain] == []


def test_a_gap_behind_which_the_aircraft_is_elsewhere_is_no_jump() -> None:
    for gap in (2.0, 5.0):
        seen = fixes(10.0, noise=0.02, gap=(20.0, 20.0 + gap))
        lines = np.arange(len(seen.time))
        time, remarks = repair_jumps(seen.time, np.stack([seen.north, seen.east]), lines)
        assert np.array_equal(time, seen.time)
        assert remarks == ()


def test_a_repaired_clock_is_even_and_repair_changes_no_even_one() -> None:
    places = np.stack([EXACT.north, EXACT.east])
    jumped = late(EXACT, 10.0, 33.0)
    assert repair_jumps(jumped.time, places, LINES)[0] == pytest.approx(EXACT.time, abs=1e-3)
    assert repair_jumps(EXACT.time, places, LINES)[1] == ()


def sampled(times: np.ndarray, noise: float = 0.02, seed: int = 0) -> Fixes:
    """The flight at any times, with white noise."""
    fine = fixes(100.0, noise=0.0, gap=(0.0, 0.0))
    random = np.random.default_rng(seed)
    places = (np.interp(times, fine.time, values) for values in (fine.north, fine.east, fine.height))
    return Fixes(times, *(place + noise * random.standard_normal(len(times)) for place in places))


def sampling_times(step: tuple[float, float], seed: int) -> np.ndarray:
    """Times from before the start to behind the finish, with steps drawn between two."""
    random = np.random.default_rng(seed)
    times = EXACT.time[0] + np.cumsum(random.uniform(*step, 700))
    return times[times < EXACT.time[-1]]


STEPS = {"5.5 Hz": (1.0 / 5.5, 1.0 / 5.5), "5 Hz, jittering": (0.16, 0.24), "1.1 to 2.1 s": (1.1, 2.1)}


@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS)
def test_times_that_are_cut_to_whole_seconds_at_an_uneven_rate_follow_from_the_way(step: tuple[float, float]) -> None:
    """Their errors are those that are told, and less than those of the times as they are written."""
    off, written, told = [], [], []
    for seed in range(8):
        seen = sampled(sampling_times(step, seed), 1.0, seed)
        places, cut = np.stack([seen.north, seen.east]), np.floor(seen.time + 40.0)
        assert cut_step(cut, places) == pytest.approx(1.0, abs=1e-6)
        spread = spread_repeated(cut, 1.0)[0]
        time, deviation, _ = repair_cut(spread, places, 1.0)
        off.append(time - seen.time - 40.0)
        written.append(spread - seen.time - 40.0)
        told.append(deviation)
    normal = np.concatenate(off) / np.concatenate(told)
    assert 0.2 < np.std(normal) < 1.15
    assert np.mean(np.abs(normal) > 3.0) < 0.01
    assert np.std(np.concatenate(off)) < 0.8 * np.std(np.concatenate(written))


def test_times_of_an_even_clock_are_not_cut() -> None:
    """Nor are those of five samples each second, which are spread evenly, and those that are written in full."""
    for seen in (sampled(np.arange(-4.0, 55.0, 1.0)), sampled(np.arange(-4.0, 55.0, 2.0))):
        assert cut_step(seen.time, np.stack([seen.north, seen.east])) == 0.0
    five = sampled(np.arange(-4.0, 55.0, 0.2) + 0.01)
    assert cut_step(np.floor(five.time), np.stack([five.north, five.east])) == 0.0
    uneven = sampled(sampling_times((1.1, 2.1), 3))
    assert cut_step(uneven.time, np.stack([uneven.north, uneven.east])) == 0.0


def test_an_aircraft_that_stands_tells_no_times() -> None:
    time = np.repeat(np.arange(40.0), np.random.default_rng(1).integers(4, 7, 40))
    time, _ = spread_repeated(time, 1.0)
    repaired, deviation, _ = repair_cut(time, np.zeros((2, len(time))), 1.0)
    assert np.array_equal(repaired, time)
    assert deviation == pytest.approx(1.0 / math.sqrt(12.0))


@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS)
def test_a_race_time_by_times_that_are_cut_off_is_as_true_as_it_is_told_to_be(step: tuple[float, float]) -> None:
    seen = sampled(sampling_times(step, 5))
    flown = imported(csv_text(replace(seen, time=np.floor(seen.time + 0.3))))
    known_time = known().passings["1:g0#2"] - known().passings["0:g0"]
    deviation = math.hypot(flown.known["0:g0"].time, flown.known["1:g0#2"].time)
    assert abs(flown.flight.race_time - known_time) < 2.0 * deviation
    assert deviation < 0.5
    assert any("cut to whole seconds at an uneven rate: the way between them tells" in text for text in flown.remarks)
    assert not [breach for breach in flown.violations if breach.certain]


def test_a_race_time_states_its_deviation_and_judgements_their_assumption(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(csv_text(EXACT))
    view = fly_log_through(path, load_inputs("rovinj_2014"))
    assert 0.0 < view.race_time_deviation < 0.1
    assert "nothing is stated (--accuracy does)" in view.assumption
    assert view.as_object()["race_time_deviation_s"] == view.race_time_deviation


def test_a_penalty_that_no_rule_states_is_not_zero() -> None:
    missed = Violation("1:g4", "missed", 1.0, 20.0, 6.5, 0.1, "m", math.nan)
    high = Violation("1:g5", "too-high", 2.0, 40.0, 25.0, 0.1, "m", 2.0)
    over = Violation("", "load-factor", 2.0, 14.0, 12.0, 0.1, "g", math.inf)
    near = Violation("1:g5", "bank", 2.0, 14.0, 12.0, 5.0, "deg", 2.0)
    assert penalties_text([near]) == "0 s"
    assert penalties_text([missed, near]) == "not known for missed"
    assert penalties_text([missed, high]) == "2 s, not known for missed"
    assert penalties_text([missed, over]) == "ends the race"


LOOPED = """
schema: airrace/track/1
name: Looped
aircraft: edge540
rules: rbar-2016
gates:
  a: {type: level, north_m: 0, east_m: 0, heading_deg: 0}
  b: {type: level, north_m: 900, east_m: 0, heading_deg: 0}
  c: {type: level, north_m: 1800, east_m: 0, heading_deg: 0}
course: {start: a, lap: [b], finish: c}
"""
LOOP_RADIUS = 90.0
"""m; flown with 95 m/s at its foot, it takes 11.2 g there."""


def looped(times: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """North, east and up, m, shape (3, n), of straight flight to the north with two loops, at a constant energy."""
    way = np.arange(-1000.0, 5000.0, 0.5)
    once = 2.0 * math.pi * LOOP_RADIUS
    angle = (np.clip(way - 400.0, 0.0, once) + np.clip(way - 1300.0 - once, 0.0, once)) / LOOP_RADIUS
    north, up = np.cumsum(np.cos(angle)) * 0.5 - 1000.0, 20.0 + LOOP_RADIUS * (1.0 - np.cos(angle))
    speed = np.sqrt(95.0**2 - 2.0 * 9.81 * (up - 20.0))
    clock = np.concatenate([[0.0], np.cumsum(0.5 / speed[:-1])])
    clock -= np.interp(0.0, way, clock)
    places = np.stack([np.interp(times, clock, north), np.zeros(len(times)), np.interp(times, clock, up)])
    return places + noise * np.random.default_rng(seed).standard_normal(places.shape)


@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS)
def test_cut_times_are_as_true_in_a_loop_as_they_are_told_to_be(step: tuple[float, float]) -> None:
    """Over ground the aircraft stands twice in every loop; the way in space and the energy tell the times."""
    for seed in range(8):
        times = -5.0 + np.cumsum(np.random.default_rng(seed).uniform(*step, 300))
        times = times[times < 40.0]
        cut, places = np.floor(times + 40.3), looped(times, 0.3, 1)
        assert cut_step(cut, places) == pytest.approx(1.0, abs=1e-6)
        time, deviation, _ = repair_cut(spread_repeated(cut, 1.0)[0], places, 1.0)
        assert np.max(np.abs(time - times - 40.3) / deviation) < 4.0
        assert np.median(deviation) < 0.25


def test_times_that_the_way_does_not_tell_stay_as_they_are() -> None:
    """Without its heights a loop looks like an aircraft that stops and turns back."""
    times = np.arange(-5.0, 40.0, 1.0 / 5.5)
    spread = spread_repeated(np.floor(times + 40.3), 1.0)[0]
    time, deviation, rate = repair_cut(spread, looped(times, 0.3, 1)[:2], 1.0)
    assert np.array_equal(time, spread)
    assert deviation == pytest.approx(1.0 / math.sqrt(12.0))
    assert (rate > 0.3).all()


def test_whole_seconds_of_a_recorder_that_skips_are_not_cut_where_the_aircraft_climbs() -> None:
    """They are exact; the speed changes by the height, as the energy tells. Some heights are missing."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        times = -5.0 + np.cumsum(random.choice([1.0, 2.0, 3.0], 60))
        times = times[times < 40.0]
        places = looped(times, 0.3, 1)
        places[2, random.random(len(times)) < 0.1] = np.nan
        assert cut_step(times, places) == 0.0


def test_a_legal_loop_breaks_no_limit_for_a_clock_that_is_cut(tmp_path: Path) -> None:
    """Nor is its load factor off by more than three of the standard deviations that are told."""
    (tmp_path / "looped.yaml").write_text(LOOPED)
    inputs = load_inputs(str(tmp_path / "looped.yaml"))
    for seed in range(3):
        times = -5.0 + np.random.default_rng(seed).uniform() + np.arange(0.0, 50.0, 1.0 / 5.5)
        north, east, up = looped(times, 0.3, seed)
        log = tmp_path / "log.csv"
        log.write_text(csv_text(Fixes(np.floor(times + 40.0), north, east, up)))
        view = fly_log_through(log, inputs)
        assert not [breach for breach in view.violations if breach.certain], seed
        assert view.flight()["n_z"].max() == pytest.approx(1.0 + 95.0**2 / (9.81 * LOOP_RADIUS), abs=1.0)


def test_the_error_of_a_clock_is_in_speeds_and_load_factors() -> None:
    flown = imported(csv_text(EXACT))
    off = np.full(len(flown.recording.time), 0.05)
    part = replace(flown.recording, columns={**flown.recording.columns, "clock_rate_deviation": off})
    again = flight_of_part(part, flown.flight.race, label="log")
    for crossing in again.flight.crossings:
        before, behind = flown.errors.at(crossing.time), again.errors.at(crossing.time)
        added = math.sqrt(behind.speed**2 - before.speed**2)
        assert added == pytest.approx(0.05 * crossing.value("V_K"), rel=0.02)
        assert behind.load > 0.1 * crossing.value("n_z")
        assert behind.path == pytest.approx(before.path, rel=0.02)
