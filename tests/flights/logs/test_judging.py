"""Runs through a course are found, and judged by its rules."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, flown, imported, known

from airrace.files.inputs import load_inputs
from airrace.files.inputs.rules import preset_names
from airrace.flights.logs.errors import CommonErrors, Receiver
from airrace.flights.logs.histories import between_samples
from airrace.flights.logs.quality import ReceiverAccuracy
from airrace.flights.logs.recording import Recording
from airrace.flights.logs.violations import NOT_KNOWN, FlightErrors, Violation, select_violations, violations
from airrace.flights.results import Basis, Flight, History, Source, TimedCrossing
from airrace.flights.results.penalties import ENDS_RACE, NONE_KNOWN, Penalties
from airrace.optimal_control.quantities import Quantity

EXACT = fixes(20.0, noise=0.02, gap=(0.0, 0.0))
ACCURATE = 0.02
"""The accuracy of positions that are exact but for their noise, m."""
RULES = Penalties(pylon=3.0, missed=4.0, too_high=2.0, too_low=ENDS_RACE, bank=2.0, climb=2.0, start_speed=1.0)


def near(passing: str, width: float = 0.8) -> np.ndarray:
    """How much of a bump each sample takes: 1 at a passing, 0 beyond a width, s."""
    off = np.abs(EXACT.time - known().passings[passing]) / width
    return np.where(off < 1.0, np.cos(0.5 * np.pi * np.minimum(off, 1.0)) ** 2, 0.0)


def certain(seen: Fixes) -> list[tuple[str, str, float]]:
    found = imported(csv_text(seen), RULES, ACCURATE).violations
    return [(one.passing, one.rule, one.penalty) for one in found if one.certain]


def with_columns(seen: Fixes, header: str, *columns: np.ndarray) -> str:
    lines = csv_text(seen).splitlines()
    rows = (",".join(map(str, row)) for row in zip(lines[1:], *columns, strict=True))
    return "\n".join([f"{lines[0]},{header}", *rows]) + "\n"


def test_a_gate_passed_too_high_too_low_beside_or_too_fast_costs_its_penalty() -> None:
    high = imported(csv_text(replace(EXACT, height=EXACT.height + 15.0 * near("1:g4"))), RULES, ACCURATE)
    (breach,) = [one for one in high.violations if one.rule == "too-high" and one.passing == "1:g4"]
    at = next(one for one in high.flight.crossings if one.name == "1:g4")
    assert (breach.value, breach.limit, breach.unit) == (pytest.approx(at.value("height"), abs=ACCURATE), 25.0, "m")
    assert (breach.time, breach.penalty, breach.certain) == (at.time, 2.0, True)
    low = replace(EXACT, height=EXACT.height - 5.0 * near("1:g4"))
    assert ("1:g4", "too-low", ENDS_RACE) in certain(low)
    side = known().at("chi", np.array([known().passings["1:g4"]]))[0] + math.pi / 2
    bump = 12.0 * near("1:g4", 1.5)
    aside = replace(EXACT, north=EXACT.north + math.cos(side) * bump, east=EXACT.east + math.sin(side) * bump)
    assert ("1:g4", "missed", 4.0) in certain(aside)
    fast = replace(EXACT, time=0.9 * EXACT.time)  # a clock that runs slow by a tenth
    assert ("0:g0", "start-speed", 1.0) in certain(fast)


def test_a_recorded_bank_is_judged_and_an_estimate_is_not_certain() -> None:
    rolled = sum(near(f"1:g{number}", 0.5) for number in (4, 5, 6, 7))
    roll = np.degrees(known().at("mu", EXACT.time)) + 40.0 * rolled
    heading = np.degrees(np.interp(EXACT.time, known().time, np.unwrap(known().histories["chi"])))
    text = with_columns(EXACT, "roll [deg],pitch [deg],heading [deg]", roll, 0.0 * roll, heading)
    one = imported(text, RULES, ACCURATE)
    assert one.flight.basis("phi") is Basis.MEASURED
    given = np.interp(one.flight.time + known().passings["0:g0"], EXACT.time, roll)
    off = np.remainder(np.degrees(one.flight["phi"]) - given + 180.0, 360.0) - 180.0
    assert np.median(np.abs(off)) < 0.5
    assert "p_Kbar" in one.flight
    banks = [breach for breach in one.violations if breach.rule == "bank" and breach.certain]
    assert {breach.passing for breach in banks} >= {"1:g4", "1:g5", "1:g6", "1:g7"}
    assert all(breach.penalty == 2.0 for breach in banks)
    estimated = [breach for breach in flown(20.0, 1).violations if breach.rule == "bank"]
    assert estimated
    assert not any(breach.certain for breach in estimated)


def test_an_optimum_that_is_recorded_without_noise_breaks_no_rule_with_certainty() -> None:
    """What an optimum's exports hold: places to the centimetre, attitudes between whose samples it rolls."""
    exact = fixes(20.0, noise=0.0, gap=(0.0, 0.0))
    angles = [np.degrees(known().at(name, exact.time)) for name in ("mu", "gamma", "chi")]
    one = imported(with_columns(exact, "roll [deg],pitch [deg],heading [deg]", *angles), RULES)
    assert one.flight.basis("phi") is Basis.MEASURED
    assert [breach for breach in one.violations if breach.certain] == []
    assert all(math.isfinite(breach.deviation) for breach in one.violations if breach.rule == "bank")


def test_the_deviation_between_samples_bounds_what_is_lost_there() -> None:
    """A straight line loses nothing; a swing loses what it bends, about a quarter of what twice the step loses."""
    time = np.arange(0.0, 10.0, 0.05)
    between = np.linspace(1.0, 9.0, 301)
    for values, exact in ((3.0 * time, 3.0 * between), (np.sin(4.0 * time), np.sin(4.0 * between))):
        recording = Recording("log.csv", "csv", time, {"phi": values}, np.arange(len(time)))
        off = np.abs(np.interp(between, time, values) - exact)
        known_to = between_samples(recording, "phi", between)
        assert np.all(off <= known_to + 1e-9)
        assert known_to.max() <= 0.05**2 * 16.0 / 8.0 * 1.01


def test_a_recorded_load_factor_is_kept_and_judged() -> None:
    load = np.where(np.abs(EXACT.time - 30.0) < 0.4, 10.8, 3.0) + 0.01 * np.sin(7.0 * EXACT.time)
    text = with_columns(EXACT, "load factor", load)
    for rules, penalty in (
        (replace(RULES, load_factor=1.0, load_factor_time=0.6), 1.0),
        (replace(RULES, load_factor=1.0, load_factor_time=0.6, load_factor_end=10.5), ENDS_RACE),
    ):
        one = imported(text, rules)
        assert one.flight.basis("n_z") is Basis.MEASURED
        (breach,) = [breach for breach in one.violations if breach.rule == "load-factor"]
        assert (breach.value, breach.penalty, breach.certain) == (pytest.approx(10.8, abs=0.02), penalty, True)
    short = imported(text, replace(RULES, load_factor=1.0, load_factor_time=1.0))
    assert not [breach for breach in short.violations if breach.rule == "load-factor"]


def test_the_better_of_two_runs_is_taken() -> None:
    later = replace(EXACT, time=EXACT.time + EXACT.time[-1] - EXACT.time[0] + 40.0)
    missing = (EXACT.time < 10.0) | (EXACT.time > 24.0)  # the first run is not recorded throughout
    both = Fixes(*(np.concatenate([getattr(EXACT, name)[missing], getattr(later, name)]) for name in vars(EXACT)))
    one = imported(csv_text(both))
    (remark,) = [remark for remark in one.remarks if "runs" in remark]
    assert re.fullmatch(r"the log holds 2 runs, which begin .* s after its first sample; this is run 2", remark)
    assert one.flight.race_time == pytest.approx(list(known().passings.values())[-1], abs=0.02)


def test_of_many_runs_the_beginnings_of_the_first_ones_are_remarked() -> None:
    one, laps = fixes(5.0), 14
    period = float(one.time[-1] - one.time[0]) + 30.0
    time = np.concatenate([one.time + lap * period for lap in range(laps)])
    again = Fixes(time, *(np.tile(column, laps) for column in (one.north, one.east, one.height)))
    (remark,) = [remark for remark in imported(csv_text(again)).remarks if "runs, which begin" in remark]
    assert re.fullmatch(
        r"the log holds 14 runs, which begin (\d+\.\d, ){12}\.\.\. s after its first sample; "
        r"this is run \d+, which begins at \d+\.\d s",
        remark,
    )


def test_a_passing_that_was_not_made_is_reported_and_its_legs_are_not_flown() -> None:
    stops = known().passings["1:g1#2"] + 0.5
    cut = Fixes(*(getattr(EXACT, name)[EXACT.time < stops] for name in vars(EXACT)))
    one = imported(csv_text(cut), RULES)
    assert math.isnan(one.flight.race_time)
    assert "not passed: 1:g0#2" in one.remarks
    assert ("1:g0#2", "missed", 4.0) in [(b.passing, b.rule, b.penalty) for b in one.violations]


def test_a_gate_that_was_flown_around_is_missed_by_its_distance() -> None:
    side = known().at("chi", np.array([known().passings["1:g4"]]))[0] + math.pi / 2
    bump = 110.0 * near("1:g4", 2.5)
    around = replace(EXACT, north=EXACT.north + math.cos(side) * bump, east=EXACT.east + math.sin(side) * bump)
    one = imported(csv_text(around), RULES)
    assert "not passed: 1:g4" in one.remarks
    (missed,) = [breach for breach in one.violations if breach.passing == "1:g4"]
    assert (missed.rule, missed.certain, missed.penalty, missed.unit) == ("missed", True, 4.0, "m")
    assert 60.0 < missed.value < 115.0
    assert missed.limit < 20.0


def test_nothing_is_certain_without_a_deviation_and_less_than_four_of_them() -> None:
    breach = Violation("1:g4", "too-high", 1.0, 29.0, 25.0, 1.0, "m", 2.0)
    assert breach.certain
    assert replace(breach, deviation=0.0).certain
    assert not replace(breach, deviation=1.01).certain
    assert not replace(breach, deviation=math.nan).certain
    assert not replace(breach, value=math.nan).certain


@pytest.mark.parametrize(("certain", "near_misses"), [(0, 0), (2, 0), (1, 9), (3, 31)])
def test_nine_of_ten_near_misses_are_one_sentence_and_certain_ones_come_first(certain: int, near_misses: int) -> None:
    sure = [Violation("a", "bank", 1.0, 20.0 + row, 10.0, 1.0, "deg", 2.0) for row in range(certain)]
    near_by = [Violation("b", "pylon", 1.0, 1.0 + 0.1 * row, 1.0, 1.0, "m", 3.0) for row in range(near_misses)]
    unknown = Violation("c", "missed", math.nan, math.nan, math.nan, math.nan, "", 4.0)
    listed, sentence = select_violations([*near_by, *sure, unknown])
    assert listed[:certain] == sure
    assert len(listed) - certain == math.ceil(near_misses / 10)
    assert [one.value for one in listed[certain:]] == sorted((one.value for one in listed[certain:]), reverse=True)
    others = near_misses - (len(listed) - certain)
    assert sentence == (
        ""
        if not others
        else f"{others} more near misses are within what the measurement may be wrong by: {others} pylon"
    )


def test_violations_come_with_the_certain_ones_first() -> None:
    found = imported(csv_text(replace(EXACT, height=EXACT.height + 15.0 * near("1:g4"))), RULES).violations
    assert [one.certain for one in found] == sorted((one.certain for one in found), reverse=True)
    assert found[0].certain


@pytest.mark.parametrize("noise", [0.02, 0.5])
def test_passings_are_known_worse_where_samples_are_missing(noise: float) -> None:
    around = (known().passings["1:g4"] - 0.6, known().passings["1:g4"] + 0.6)
    texts = [csv_text(fixes(10.0, noise=noise, gap=gap)) for gap in ((0.0, 0.0), around)]
    whole, broken = (imported(text, accuracy=ACCURATE) for text in texts)
    for name in ("across", "up", "time"):
        assert getattr(broken.known["1:g4"], name) > 2.0 * getattr(whole.known["1:g4"], name)
        assert getattr(broken.known["1:g1#2"], name) == pytest.approx(getattr(whole.known["1:g1#2"], name), rel=0.05)
    off = broken.flight.crossings[4].time - known().passings["1:g4"] + known().passings["0:g0"]
    assert abs(off) < 5.0 * broken.known["1:g4"].time


@pytest.mark.parametrize("name", preset_names())
def test_seasons_have_penalties_with_their_sources(name: str) -> None:
    penalties = load_inputs("rovinj_2014", overrides=[f"rules={name}"]).penalties
    assert penalties.start_speed == 1.0
    assert penalties.start_speed_end is not None
    assert "penalties from" in penalties.source


def test_a_course_without_a_season_has_no_penalties_and_they_change_no_inputs_of_a_run() -> None:
    assert load_inputs("half_cuban_eight").penalties == NONE_KNOWN
    assert "penalties" not in str(load_inputs("rovinj_2014").resolved)


def test_a_turn_that_stays_too_low_costs_less_than_a_roll() -> None:
    """Air Race X: 2 s and 3 s (airracex.com/regulations)."""
    given = load_inputs("air_race_x_2024")
    time = np.linspace(0.0, 1.0, 3)
    names = ("x", "y", "z", "height", "chi")
    histories = {name: History(Quantity(name, "m"), np.zeros(3), Basis.DERIVED) for name in names}
    missed = tuple(TimedCrossing(passage, math.nan, {}) for passage in given.race.course.passages)
    flight = Flight(given.race, Source("log"), time, histories, missed)
    accuracy = ReceiverAccuracy(np.ones(3), np.ones(3), "")
    errors = FlightErrors(lambda _: NOT_KNOWN, lambda _: NOT_KNOWN, CommonErrors(Receiver(time, accuracy)))
    found = violations(flight, {}, errors, given.penalties)
    costs = {one.passing.partition(":")[2]: one.penalty for one in found if one.rule == "manoeuvre"}
    assert costs == {"top": 2.0, "roll/begin": 3.0, "roll": 3.0}


def test_a_push_through_a_gate_is_no_certain_bank_where_no_roll_is_recorded() -> None:
    """The path shows along which line the lift points, and not whether the aircraft pulls on its back."""
    seen, when, lasting = fixes(20.0, noise=0.02, gap=(0.0, 0.0)), known().passings["1:g5#2"], 0.6
    share = np.cos(0.5 * np.pi * np.minimum(np.abs(seen.time - when) / lasting, 1.0)) ** 2
    acceleration = 4.5 * 9.81
    raised = seen.height + 2.0 * acceleration * (lasting / np.pi) ** 2 * share
    judged = imported(csv_text(replace(seen, height=raised)))
    (crossing,) = [crossing for crossing in judged.flight.crossings if crossing.name == "1:g5#2"]
    assert abs(crossing.value("mu")) > math.radians(120.0)
    assert not any(violation.certain for violation in judged.violations if violation.rule == "bank")
