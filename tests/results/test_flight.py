"""A flight has named histories on one axis, whatever it was made from."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj, windy

from airrace.environment.air import StaticWind
from airrace.environment.atmosphere import g0
from airrace.errors import UsageError
from airrace.frames import rotation
from airrace.procedure import results_api
from airrace.procedure.result import Outcome
from airrace.results import Basis, laps_of, legs_of


def test_states_between_the_nodes_are_those_of_an_independent_integration() -> None:
    run = half_cuban()
    flight, result = run.flight(), run["point-mass"].result
    integrated = results_api.sampler(run.race, result)(flight.time)
    for name, tolerance in (("x", 2e-3), ("y", 2e-3), ("z", 2e-3), ("V_K", 2e-4), ("n_z", 1e-7), ("q0", 2e-4)):
        np.testing.assert_allclose(flight[name], integrated[name], rtol=0.0, atol=tolerance)


def test_nodes_are_among_the_times_and_no_step_is_longer_than_asked() -> None:
    flight, flown = half_cuban().flight(), half_cuban()["point-mass"].trajectory
    assert np.isin(flown.time, flight.time).all()
    assert np.diff(flight.time).max() <= 0.02 + 1e-12
    assert np.diff(flight.time).min() > 0.0
    rows = np.searchsorted(flight.time, flown.time)
    np.testing.assert_array_equal(flight["x"][rows], flown.of("x"))


def test_crossings_are_the_gate_splits() -> None:
    run = half_cuban()
    flight = run.flight()
    for crossing, split in zip(flight.crossings, run.splits, strict=True):
        assert (crossing.name, crossing.time) == (split.name, split.time)
        assert crossing.value("height") == pytest.approx(split.height, abs=1e-9)
        assert crossing.value("n_z") == pytest.approx(split.n_z, abs=1e-9)
        assert math.remainder(crossing.value("mu") - split.bank, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert crossing.value("gamma") == pytest.approx(split.climb, abs=1e-9)


def test_splits_add_up_to_the_race_time() -> None:
    flight = circling(rovinj())
    legs, laps = legs_of(flight), laps_of(flight)
    assert sum(leg.time for leg in legs) == pytest.approx(flight.race_time, abs=1e-9)
    assert sum(lap.time for lap in laps) == pytest.approx(flight.race_time, abs=1e-9)
    assert half_cuban().flight().race_time == pytest.approx(half_cuban().race_time, abs=1e-12)


def test_neighbouring_legs_share_the_time_of_their_passing() -> None:
    legs = legs_of(half_cuban().flight())
    for leg, following in pairwise(legs):
        assert leg.rows[-1] == following.rows[0]


def test_energy_height_changes_by_the_work_of_what_acts_along_the_path() -> None:
    """`h_E' = V_K n_x`: nothing but thrust and drag changes the energy."""
    flight = half_cuban().flight()
    work = np.concatenate(
        ([0.0], np.cumsum(np.diff(flight.time) * 0.5 * (flight["V_K"] * flight["n_x"])[:-1]))
    ) + np.concatenate(([0.0], np.cumsum(np.diff(flight.time) * 0.5 * (flight["V_K"] * flight["n_x"])[1:])))
    np.testing.assert_allclose(flight["h_E"] - flight["h_E"][0], work, atol=0.05)
    np.testing.assert_allclose(flight["h_E"], flight["height"] + flight["V_K"] ** 2 / (2 * g0), rtol=1e-15)


def test_airspeed_is_ground_speed_in_still_air() -> None:
    flight = half_cuban().flight()
    np.testing.assert_allclose(flight["V_A"], flight["V_K"], rtol=1e-12)


def test_airspeed_in_wind_is_the_wind_triangle() -> None:
    """A level circle over ground in a steady wind from the north: `V_A^2 = V_K^2 + W^2 + 2 V_K W cos(chi)`."""
    flight = circling(rovinj(StaticWind(origin=0.0, speed=12.0)))
    expected = np.sqrt(80.0**2 + 12.0**2 + 2.0 * 80.0 * 12.0 * np.cos(flight["chi"]))
    np.testing.assert_allclose(flight["V_A"], expected, rtol=1e-12)


def test_indicated_airspeed_is_true_airspeed_in_the_standard_air_of_sea_level() -> None:
    flight = circling(rovinj(), height=-rovinj().course.origin.elevation)
    np.testing.assert_allclose(flight["V_I"], flight["V_A"], rtol=1e-9)


def test_indicated_airspeed_falls_with_the_density() -> None:
    """Density at 1000 m is 0.90746 of that at sea level [ISO 2533]; compressibility adds less than 0.2 percent."""
    flight = circling(rovinj(), height=1000.0 - rovinj().course.origin.elevation)
    np.testing.assert_allclose(flight["V_I"] / flight["V_A"], math.sqrt(0.90746), rtol=2e-3)


def test_the_body_lies_where_lift_and_angle_of_attack_put_it() -> None:
    """In still air and without sideslip x_B is turned up from the path by the angle of attack, wings along y_Kbar."""
    flight = half_cuban().flight()
    R_OB = np.array([rotation([flight[f"b{i}"][k] for i in range(4)]) for k in range(len(flight.time))])
    R_OK = np.array([rotation([flight[f"q{i}"][k] for i in range(4)]) for k in range(len(flight.time))])
    between = np.einsum("nij,nij->n", R_OB[:, :, :1], R_OK[:, :, :1])
    np.testing.assert_allclose(between, np.cos(flight["alpha_A"]) * np.cos(flight["beta_A"]), atol=1e-9)
    up = np.einsum("ni,ni->n", R_OB[:, :, 0], -R_OK[:, :, 2])
    np.testing.assert_allclose(up, np.sin(flight["alpha_A"]), atol=1e-9)


def test_the_body_points_into_the_wind() -> None:
    """The velocity relative to the air, seen from the body, makes the angles of attack and of sideslip."""
    flight = windy().flight()
    assert np.abs(flight["V_A"] - flight["V_K"]).max() > 3.0
    for k in range(0, len(flight.time), 37):
        R = np.array(rotation([flight[f"b{i}"][k] for i in range(4)]))
        chi, gamma = flight["chi"][k], flight["gamma"][k]
        e = np.array([math.cos(gamma) * math.cos(chi), math.cos(gamma) * math.sin(chi), -math.sin(gamma)])
        wind = windy().race.air.wind
        assert wind is not None
        u, v, w = R.T @ (flight["V_K"][k] * e - np.array([wind.north, wind.east, 0.0]))
        assert math.atan2(w, u) == pytest.approx(flight["alpha_A"][k], abs=1e-9)
        assert math.asin(v / flight["V_A"][k]) == pytest.approx(flight["beta_A"][k], abs=1e-9)


def test_attitudes_do_not_flip_and_have_unit_length() -> None:
    flight = half_cuban().flight()
    b = np.array([flight[f"b{i}"] for i in range(4)])
    np.testing.assert_allclose(np.linalg.norm(b, axis=0), 1.0, atol=1e-12)
    assert (np.sum(b[:, 1:] * b[:, :-1], axis=0) > 0.9).all()


def test_resampling_keeps_angles_continuous_and_quaternions_of_unit_length() -> None:
    flight = circling(rovinj(), seconds=60.0)
    finer = flight.at_rate(97.0)
    turned = np.unwrap(finer["chi"])
    np.testing.assert_allclose(turned, g0 * math.tan(math.radians(60.0)) / 80.0 * finer.time, atol=1e-9)
    assert np.abs(finer["chi"]).max() <= math.pi
    np.testing.assert_allclose(sum(finer[f"b{i}"] ** 2 for i in range(4)), 1.0, atol=1e-12)
    assert finer.time[-1] == flight.time[-1]


def test_what_a_flight_does_not_have_is_not_a_number() -> None:
    flight = half_cuban().flight()
    assert "eta" not in flight
    assert np.isnan(flight.values("eta")).all()
    assert not flight.limit("eta").bounded
    with pytest.raises(KeyError):
        flight["eta"]


def test_histories_say_where_they_come_from_and_what_bounds_held() -> None:
    flight = half_cuban().flight()
    assert flight.basis("x") is Basis.SOLVED
    assert flight.basis("V_I") is Basis.DERIVED
    rules, envelope = flight.course.rules, flight.aircraft.envelope
    assert flight.limit("n_z").upper == min(rules.n_z.upper, envelope.n_z.upper)
    assert flight.limit("height").lower == rules.height.lower


def test_positions_on_the_globe_are_there_where_the_course_has_an_origin() -> None:
    placed = circling(rovinj())
    assert placed.has("latitude", "longitude")
    assert not half_cuban().flight().has("latitude")


def test_a_stage_without_a_flight_is_refused() -> None:
    stage = half_cuban()["point-mass"]
    lost = replace(stage, result=replace(stage.result, outcome=Outcome.INFEASIBLE))
    with pytest.raises(UsageError, match="found no flight: it ended infeasible"):
        lost.flight()
