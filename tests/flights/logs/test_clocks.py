"""Clocks that jump are repaired where there is one way to, and times that are cut off are told to be."""

import math
from pathlib import Path

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, imported, known

from airrace.files.inputs import load_inputs
from airrace.flights.logs.clocks import clock_deviation, repair_jumps
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


def test_times_that_are_cut_to_whole_seconds_at_an_uneven_rate_are_known_to_be() -> None:
    rows = np.cumsum(np.random.default_rng(4).integers(11, 21, 40))
    rows = rows[rows < len(EXACT.time)]
    places = np.stack([EXACT.north, EXACT.east])[:, rows]
    assert clock_deviation(EXACT.time[rows], places) < 0.03
    assert clock_deviation(np.floor(EXACT.time[rows]), places) == pytest.approx(1.0 / math.sqrt(12.0), rel=1e-3)


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
