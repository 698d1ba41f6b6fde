"""Drag, power and wind by output error: laws that hold for any flight."""

from dataclasses import replace

import numpy as np
import synthetic

from airrace.logs.output_error import Estimate, estimate_factors, recorded_path
from airrace.logs.smoothing import smooth
from airrace.runs.aircraft import read_aircraft_file
from airrace.trajectory import Array

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
