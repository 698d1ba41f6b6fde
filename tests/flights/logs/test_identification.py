"""Drag, power and wind by output error: laws that hold for any flight; and the roll rate from a recorded roll."""

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic

from airrace.flights.logs.identification import Estimate, estimate_factors, measure_roll_rate, recorded_path
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.smoothing import smooth
from airrace.optimal_control.trajectory import Array
from airrace.runs.aircraft_file import read_aircraft_file

AIR = replace(synthetic.race().air, wind=None)
START = read_aircraft_file("edge540").aircraft


def recorded() -> tuple[Array, Array]:
    fixes = synthetic.fixes(20.0, noise=0.05, gap=(-10.0, -9.0))
    rows = (fixes.time > 0.0) & (fixes.time < 18.0)
    return fixes.time[rows], np.stack([fixes.north, fixes.east, fixes.height])[:, rows]


def estimated(time: Array, places: Array, start: object = START) -> Estimate:
    path = recorded_path(smooth(time, places), time, places, float(time[0]), float(time[-1]))
    return estimate_factors(start, AIR, [path])


def test_the_fitted_aircraft_does_not_depend_on_where_the_fit_starts() -> None:
    time, places = recorded()
    other = replace(START, drag=replace(START.drag, C_D0=1.1 * START.drag.C_D0, k=0.93 * START.drag.k))
    found, again = estimated(time, places), estimated(time, places, other)
    assert found.visible.all()
    assert np.abs(found.factors).max() < 0.1  # it was flown by an aircraft like the start
    drag, drag_again = found.aircraft(START).drag, again.aircraft(other).drag
    np.testing.assert_allclose([drag_again.C_D0, drag_again.k], [drag.C_D0, drag.k], rtol=0.02)


def test_the_same_flight_in_moving_air_shows_the_same_aircraft_and_the_wind() -> None:
    time, places = recorded()
    wind = np.array([2.0, -1.0])
    drift = np.vstack([np.outer(wind, time - time[0]), np.zeros_like(time)])
    still, windy = estimated(time, places), estimated(time, places + drift)
    np.testing.assert_allclose(windy.factors, still.factors, atol=0.01)
    np.testing.assert_allclose(windy.winds[0] - still.winds[0], wind, atol=0.1)


def test_straight_flight_tells_nothing_of_drag_and_power() -> None:
    time = np.arange(0.0, 20.0, 0.1)
    random = np.random.default_rng(1)
    places = np.stack([95.0 * time, np.zeros_like(time), np.full_like(time, 20.0)])
    found = estimated(time, places + 0.5 * random.standard_normal(places.shape))
    assert not found.visible.any()
    assert not found.factors.any()


def test_logs_in_different_winds_are_fitted_together() -> None:
    time, places = recorded()
    winds = np.array([[2.0, -1.0], [-1.5, 0.5]])
    paths = [
        recorded_path(smooth(time, moved), time, moved, float(time[0]), float(time[-1]))
        for moved in (places + np.outer([*wind, 0.0], time - time[0]) for wind in winds)
    ]
    one, both = estimate_factors(START, AIR, paths[:1]), estimate_factors(START, AIR, paths)
    np.testing.assert_allclose(both.winds[1] - both.winds[0], winds[1] - winds[0], atol=0.1)
    np.testing.assert_allclose(both.factors, one.factors, atol=0.02)
    assert np.all(both.deviations[:3] < 0.85 * one.deviations[:3])  # white noise has 0.71


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
