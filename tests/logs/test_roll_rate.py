"""The roll rate of an aircraft from a recorded roll."""

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic

from airrace.logs.log_flight import LogFlight, flight_from_log
from airrace.logs.reading import read_log
from airrace.logs.roll_rate import measure_roll_rate
from airrace.runs.aircraft import read_aircraft_file

START = read_aircraft_file("edge540").aircraft


@functools.cache
def logged(hz: float, folder: Path, *, roll: bool = True) -> LogFlight:
    fixes, random = synthetic.fixes(hz, noise=0.5), np.random.default_rng(3)
    columns, header = (
        [fixes.time + 10.0, fixes.north, fixes.east, fixes.height],
        "time [s],north [m],east [m],height [m]",
    )
    if roll:
        banks = synthetic.banks(fixes.time, 400.0)
        columns, header = [*columns, banks + 0.5 * random.standard_normal(len(banks))], f"{header},roll [deg]"
    path = folder / "log.csv"
    np.savetxt(path, np.stack(columns, axis=1), "%.3f", ",", header=header, comments="")
    return flight_from_log(read_log(path), synthetic.race(), label="log")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs")


def test_the_roll_rate_does_not_depend_on_that_of_the_start(folder: Path) -> None:
    found = measure_roll_rate(START, [logged(20.0, folder)])
    assert found is not None
    assert found.aircraft(START).point_mass.p == pytest.approx(math.radians(400.0), rel=3.0 * found.deviation)
    slower = replace(
        START,
        roll=replace(START.roll, C_lxi=0.8 * START.roll.C_lxi),
        point_mass=replace(START.point_mass, p=0.8 * START.point_mass.p),
    )
    again = measure_roll_rate(slower, [logged(20.0, folder)])
    assert again is not None
    assert again.factor == pytest.approx(found.factor - math.log(0.8), abs=0.005)
    aircraft, same = found.aircraft(START), again.aircraft(slower)
    assert same.point_mass.p == pytest.approx(aircraft.point_mass.p, rel=0.005)
    assert same.roll.C_lxi == pytest.approx(aircraft.roll.C_lxi, rel=0.005)


def test_of_several_logs_the_quickest_roll_counts(folder: Path) -> None:
    quick = logged(20.0, folder)
    rates = quick.flight.histories["p_Kbar"]
    histories = {**quick.flight.histories, "p_Kbar": replace(rates, values=0.9 * rates.values)}
    slow = replace(quick, flight=replace(quick.flight, histories=histories))
    assert measure_roll_rate(START, [slow, quick]) == measure_roll_rate(START, [quick])


def test_a_record_that_no_such_aircraft_can_fly_is_doubted(folder: Path) -> None:
    log = logged(20.0, folder)
    rates = log.flight.histories["p_Kbar"]
    histories = {**log.flight.histories, "p_Kbar": replace(rates, values=3.0 * rates.values)}
    assert measure_roll_rate(START, [replace(log, flight=replace(log.flight, histories=histories))]) is None


def test_a_roll_that_is_not_recorded_or_too_coarse_or_not_held_tells_nothing(folder: Path) -> None:
    assert measure_roll_rate(START, [logged(20.0, folder, roll=False)]) is None
    assert measure_roll_rate(START, [logged(5.0, folder)]) is None
    quick = logged(20.0, folder)
    rates, peak = quick.flight.histories["p_Kbar"], 5.0 * np.hanning(24)
    values = np.zeros_like(rates.values)
    values[500:524] = peak
    brief = replace(quick.flight, histories={**quick.flight.histories, "p_Kbar": replace(rates, values=values)})
    assert measure_roll_rate(START, [replace(quick, flight=brief)]) is None
