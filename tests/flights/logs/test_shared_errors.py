"""Errors that no sample shows: positions that are off together, numbers that are cut off, a load factor that sticks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, known, race

from airrace.files.inputs.log_columns import read_layout
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.reading import read_log

EXACT = fixes(20.0, noise=0.02, gap=(0.0, 0.0))


def imported(text: str, folder: Path, accuracy: float | None = None) -> LogFlight:
    path = folder / "log.csv"
    path.write_text(text)
    return flight_from_log(read_log(path, ColumnLayout(accuracy=accuracy)), race(), label="log")


@pytest.mark.parametrize("shift", [(3.0, -4.0, 0.0), (0.0, 0.0, 4.0)])
def test_nothing_is_certain_that_the_stated_accuracy_explains(
    shift: tuple[float, float, float], tmp_path: Path
) -> None:
    off = Fixes(EXACT.time, EXACT.north + shift[0], EXACT.east + shift[1], EXACT.height + shift[2])
    without, told = (imported(csv_text(off), tmp_path, accuracy) for accuracy in (0.02, 3.0))
    assert any(one.certain for one in without.violations)
    assert not any(one.certain for one in told.violations)


def test_a_mapping_states_the_accuracy(tmp_path: Path) -> None:
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text("schema: airrace/log/1\nposition_accuracy_m: 2.5\n")
    layout, _ = read_layout(mapping)
    path = tmp_path / "log.csv"
    path.write_text(csv_text(EXACT))
    assert read_log(path, layout).accuracy == 2.5


def test_numbers_that_are_cut_off_move_passings_by_less_than_two_deviations(tmp_path: Path) -> None:
    """Half a step of 2 m at 80 m/s is 12 ms."""
    cut = Fixes(EXACT.time, *(2.0 * np.floor(one / 2.0) for one in (EXACT.north, EXACT.east, EXACT.height)))
    one = imported(csv_text(cut), tmp_path)
    first = known().passings["0:g0"]
    for crossing in one.flight.crossings:
        off = crossing.time - (known().passings[crossing.name] - first)
        assert abs(off) <= 2.0 * np.hypot(one.known[crossing.name].time, one.known["0:g0"].time)


def test_a_load_factor_that_sticks_breaks_no_rule_for_certain(tmp_path: Path) -> None:
    """It follows the flight up to the hardest turn, and stays there."""
    load = known().at("n_z", np.clip(EXACT.time, 0.0, known().time[-1])) + 1.5
    for stuck in (np.full_like(load, 11.0), np.where(EXACT.time < 25.0, load, 11.0)):
        rows = zip(csv_text(EXACT).splitlines(), ["load factor [g]", *(f"{one:.3f}" for one in stuck)], strict=True)
        one = imported("\n".join(",".join(row) for row in rows) + "\n", tmp_path)
        assert not [breach for breach in one.violations if breach.rule == "load-factor" and breach.certain]


def test_a_start_before_the_first_sample_has_no_certain_speed(tmp_path: Path) -> None:
    """The path goes straight on there: nobody knows how it was pulled."""
    five = fixes(5.0, noise=0.02, gap=(0.0, 0.0))
    late = five.time > 0.3
    cut = Fixes(*(one[late] for one in (five.time, five.north, five.east, five.height)))
    one = imported(csv_text(cut), tmp_path)
    assert one.flight.crossings[0].found
    assert one.known["0:g0"].speed > 5.0
    whole = imported(csv_text(replace(five)), tmp_path, 0.02)
    assert whole.known["0:g0"].speed < 1.0


@pytest.mark.parametrize(("accuracy", "certain"), [(0.5, True), (2.5, False), (None, False)])
def test_a_dip_below_the_floor_is_certain_where_heights_are_known(
    accuracy: float | None, certain: bool, tmp_path: Path
) -> None:
    """What smoothing takes from the dip is within its deviation, and nothing but heights around it tells more."""
    floor, middle, lasting = race().course.rules.height.lower, 28.0, 3.6  # so that it is pulled with 4 g
    share = np.cos(0.5 * np.pi * np.minimum(np.abs(EXACT.time - middle) / lasting, 1.0)) ** 2
    dipped = replace(EXACT, height=(1.0 - share) * EXACT.height + share * (floor - 5.5))
    judged = imported(csv_text(dipped), tmp_path, accuracy)
    (violation,) = [violation for violation in judged.violations if violation.rule == "floor"]
    assert abs(violation.value + 5.5) < 2.0 * violation.deviation
    assert violation.certain is certain
