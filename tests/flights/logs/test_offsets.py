"""Errors that all samples share and sensors that stand still accuse nobody."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from synthetic import csv_text, fixes, gpx_text, imported, known, on_globe, table

from airrace.flights.logs.log_flight import LogFlight
from airrace.flights.logs.reading import read_log
from airrace.optimal_control.trajectory import Array

EXACT = fixes(20.0, noise=0.02, gap=(0.0, 0.0))
HEIGHTS = [f"{one:.4f}" for one in EXACT.height]


def attitude(late: float = 0.0) -> list[Array]:
    return [np.degrees(known().at(name, EXACT.time - late)) for name in ("mu", "gamma", "chi")]


def with_attitude(roll: Array, late: float = 0.0) -> LogFlight:
    lines = csv_text(EXACT).splitlines()
    columns = (roll, *attitude(late)[1:])
    rows = (",".join(map(str, row)) for row in zip(lines[1:], *columns, strict=True))
    return imported("\n".join([f"{lines[0]},roll [deg],pitch [deg],heading [deg]", *rows]) + "\n")


def assert_accuses_nobody(one: LogFlight, remark: str) -> None:
    assert [breach for breach in one.violations if breach.certain] == []
    assert [text for text in one.remarks if re.search(remark, text)]


@pytest.mark.parametrize("begin", [-10.0, 25.0])
def test_a_roll_that_stands_still_is_not_used_there(begin: float) -> None:
    roll, _, _ = attitude()
    stuck = np.where((EXACT.time > begin) & (EXACT.time < begin + 40.0), 3.0, roll)
    assert_accuses_nobody(with_attitude(stuck), "stands still in turns from line")


@pytest.mark.parametrize("late", [0.1, -0.2])
def test_a_roll_by_another_clock_is_reported_and_less_certain(late: float) -> None:
    side = "late" if late > 0.0 else "early"
    assert_accuses_nobody(with_attitude(attitude(late)[0], late), f"roll comes {abs(late):.2f} s {side}")


def test_a_roll_of_an_oblique_sensor_is_reported_and_less_certain() -> None:
    assert_accuses_nobody(with_attitude(attitude()[0] + 5.0), r"off the path's by [45]\.\d deg")


@pytest.mark.parametrize("below", [0.5, 1.0, 3.0])
def test_heights_that_are_off_together_are_less_certain(below: float) -> None:
    low = imported(csv_text(type(EXACT)(EXACT.time, EXACT.north, EXACT.east, EXACT.height - below)))
    assert_accuses_nobody(low, "almost all passings are about .* m too low")


def test_gates_in_a_long_gap_are_not_missed_for_certain() -> None:
    """But one that is flown around, as every sample tells, is."""
    one = imported(csv_text(fixes(5.0, noise=0.3, gap=(33.0, 45.5))))
    assert [crossing.name for crossing in one.flight.crossings if not crossing.found] == ["1:g4#2"]
    assert [breach for breach in one.violations if breach.certain] == []
    off = np.abs(EXACT.time - known().passings["1:g6#2"])
    around = EXACT.east + 150.0 * np.where(off < 2.0, np.cos(0.25 * np.pi * np.minimum(off, 2.0)) ** 2, 0.0)
    detour = imported(csv_text(type(EXACT)(EXACT.time, EXACT.north, around, EXACT.height)))
    assert ("1:g6#2", "missed") in {(one.passing, one.rule) for one in detour.violations if one.certain}


@pytest.mark.parametrize("digits", [5, 4])
def test_coordinates_that_are_cut_off_make_climbing_passings_less_certain(digits: int) -> None:
    places = on_globe(EXACT)[:2]
    cut = [[f"{math.trunc(one * 10**digits) / 10**digits:.{digits}f}" for one in values] for values in places]
    rows = zip((f"{one + 100.0:.3f}" for one in EXACT.time), *cut, HEIGHTS, strict=True)
    one = imported(table("time,latitude,longitude,height", rows))
    shift = 0.5 * 10.0**-digits * math.radians(6.371e6)  # of latitudes that are cut off, m
    for crossing in (one for one in one.flight.crossings if one.found):
        true = known().passings[crossing.name]
        away = math.hypot(*(crossing.value(name) - known().at(name, np.array([true]))[0] for name in ("x", "y")))
        assert away < 4.0 * math.hypot(one.known[crossing.name].across, shift)
    assert [breach for breach in one.violations if breach.certain] == []


def test_elements_beside_the_track_change_nothing(tmp_path: Path) -> None:
    text = gpx_text(fixes(2.0))
    path = tmp_path / "log.gpx"
    path.write_text(text)
    plain = read_log(path)
    path.write_text(re.sub("(<trk>)", r"<wpt lat='1' lon='2'><ele>9</ele><time>x</time></wpt><trk/>\1", text))
    assert np.array_equal(read_log(path).columns["altitude"], plain.columns["altitude"])


@pytest.mark.parametrize("noise", [0.02, 0.3, 1.0])
def test_a_roll_by_the_same_clock_is_not_said_to_come_early_or_late(noise: float) -> None:
    seen = fixes(10.0, noise=noise, gap=(0.0, 0.0))
    roll = np.degrees(known().at("mu", seen.time))
    rows = zip(csv_text(seen).splitlines(), ["roll [deg]", *(f"{angle:.1f}" for angle in roll)], strict=True)
    one = imported("\n".join(",".join(row) for row in rows) + "\n")
    assert not [remark for remark in one.remarks if "against the positions" in remark]
