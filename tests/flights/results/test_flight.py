"""One flight: crossings, legs, and the comparison of two."""

import json
import math
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj, windy
from typer.testing import CliRunner

from airrace.cli import run_tables
from airrace.cli.main import app
from airrace.cli.printed_result import render
from airrace.cli.run_tables import comparison_texts, near_miss_table
from airrace.errors import UsageError
from airrace.flights.results import Basis, Flight, laps_of, legs_of
from airrace.flights.results.clearances import Clearance, distances, least, near_misses
from airrace.flights.results.comparison import Comparison, compare_flights, conditions
from airrace.flights.results.flight import Source, TimedCrossing
from airrace.flights.results.flight_facts import leg_facts
from airrace.model.environment import StaticWind, g0
from airrace.model.frames import rotation
from airrace.model.track.course import ClearanceRule, Crowd, CrowdShape, PilotLimits, SafetyLine, StartSpeed
from airrace.model.track.element import PYLON_HEIGHT
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval
from airrace.pages.report.flight_page import flight_page, legs_section
from airrace.pages.views.comparison_tables import difference_text
from airrace.pages.views.tables import RACE
from airrace.procedure import stored_stages
from airrace.procedure.result import Status
from airrace.runs.json_objects import comparison_object, legs_object


def test_a_flight_of_an_optimum_has_its_nodes_and_an_independent_integration_between_them() -> None:
    run = half_cuban()
    flight, flown = run.flight(), run["point-mass"].trajectory
    integrated = stored_stages.sampler(run.race, run["point-mass"].result)(flight.time)
    for name, tolerance in (("x", 2e-3), ("y", 2e-3), ("z", 2e-3), ("V_K", 2e-4), ("n_z", 1e-7), ("q0", 2e-4)):
        np.testing.assert_allclose(flight[name], integrated[name], rtol=0.0, atol=tolerance)
    assert np.isin(flown.time, flight.time).all()
    assert np.diff(flight.time).max() <= 0.02 + 1e-12
    assert np.diff(flight.time).min() > 0.0
    np.testing.assert_array_equal(flight["x"][np.searchsorted(flight.time, flown.time)], flown["x"])
    for crossing, split in zip(flight.crossings, run.splits, strict=True):
        assert (crossing.name, crossing.time) == (split.name, split.time)
        assert crossing.value("height") == pytest.approx(split.height, abs=1e-9)
        assert crossing.value("n_z") == pytest.approx(split.n_z, abs=1e-9)
        assert math.remainder(crossing.value("mu") - split.bank, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert crossing.value("gamma") == pytest.approx(split.climb, abs=1e-9)


def test_legs_share_their_passings_and_add_up_to_the_race_time() -> None:
    flight = circling(rovinj())
    for parts in (legs_of(flight), laps_of(flight)):
        assert sum(one.time for one in parts) == pytest.approx(flight.race_time, abs=1e-9)
    optimum = half_cuban().flight()
    assert optimum.race_time == pytest.approx(half_cuban().race_time, abs=1e-12)
    for leg, following in pairwise(legs_of(optimum)):
        assert leg.rows[-1] == following.rows[0]


def test_energy_height_changes_by_the_work_of_what_acts_along_the_path() -> None:
    """`h_E' = V_K n_x`: nothing but thrust and drag changes the energy."""
    flight = half_cuban().flight()
    power = flight["V_K"] * flight["n_x"]
    work = np.concatenate(([0.0], np.cumsum(np.diff(flight.time) * 0.5 * (power[:-1] + power[1:]))))
    np.testing.assert_allclose(flight["h_E"] - flight["h_E"][0], work, atol=0.05)
    np.testing.assert_allclose(flight["h_E"], flight["height"] + flight["V_K"] ** 2 / (2 * g0), rtol=1e-15)


def test_airspeeds_follow_from_wind_and_density() -> None:
    """In still air they are the ground speed, else the wind triangle: `V_A^2 = V_K^2 + W^2 + 2 V_K W cos(chi)`.

    Density at 1000 m is 0.90746 of that at sea level [ISO 2533]; compressibility adds less than 0.2 percent.
    """
    flight = half_cuban().flight()
    np.testing.assert_allclose(flight["V_A"], flight["V_K"], rtol=1e-12)
    flight = circling(rovinj(StaticWind(origin=0.0, speed=12.0)))
    expected = np.sqrt(80.0**2 + 12.0**2 + 2.0 * 80.0 * 12.0 * np.cos(flight["chi"]))
    np.testing.assert_allclose(flight["V_A"], expected, rtol=1e-12)
    for altitude, density, tolerance in ((0.0, 1.0, 1e-9), (1000.0, 0.90746, 2e-3)):
        flight = circling(rovinj(), height=altitude - rovinj().course.origin.elevation)
        np.testing.assert_allclose(flight["V_I"] / flight["V_A"], math.sqrt(density), rtol=tolerance)


def test_the_body_lies_where_lift_and_angle_of_attack_put_it() -> None:
    """In still air and without sideslip x_B is turned up from the path by the angle of attack, wings along y_Kbar."""
    flight = half_cuban().flight()
    b = np.array([flight[f"b{i}"] for i in range(4)])
    np.testing.assert_allclose(np.linalg.norm(b, axis=0), 1.0, atol=1e-12)
    assert (np.sum(b[:, 1:] * b[:, :-1], axis=0) > 0.9).all()  # it does not flip
    R_OB = np.array([rotation(column) for column in b.T.tolist()])
    R_OK = np.array([rotation([flight[f"q{i}"][k] for i in range(4)]) for k in range(len(flight.time))])
    between = np.einsum("nij,nij->n", R_OB[:, :, :1], R_OK[:, :, :1])
    np.testing.assert_allclose(between, np.cos(flight["alpha_A"]) * np.cos(flight["beta_A"]), atol=1e-9)
    up = np.einsum("ni,ni->n", R_OB[:, :, 0], -R_OK[:, :, 2])
    np.testing.assert_allclose(up, np.sin(flight["alpha_A"]), atol=1e-9)


def test_the_body_points_into_the_wind() -> None:
    """The velocity relative to the air, seen from the body, makes the angles of attack and of sideslip."""
    flight = windy().flight()
    assert np.abs(flight["V_A"] - flight["V_K"]).max() > 3.0
    wind = windy().race.air.wind
    assert wind is not None
    for k in range(0, len(flight.time), 37):
        R = np.array(rotation([flight[f"b{i}"][k] for i in range(4)]))
        chi, gamma = flight["chi"][k], flight["gamma"][k]
        e = np.array([math.cos(gamma) * math.cos(chi), math.cos(gamma) * math.sin(chi), -math.sin(gamma)])
        u, v, w = R.T @ (flight["V_K"][k] * e - np.array([wind.north, wind.east, 0.0]))
        assert math.atan2(w, u) == pytest.approx(flight["alpha_A"][k], abs=1e-9)
        assert math.asin(v / flight["V_A"][k]) == pytest.approx(flight["beta_A"][k], abs=1e-9)


def test_resampling_keeps_angles_continuous_and_quaternions_of_unit_length() -> None:
    flight = circling(rovinj(), seconds=60.0)
    finer = flight.at_rate(97.0)
    turned = np.unwrap(finer["chi"])
    np.testing.assert_allclose(turned, g0 * math.tan(math.radians(60.0)) / 80.0 * finer.time, atol=1e-9)
    assert np.abs(finer["chi"]).max() <= math.pi
    np.testing.assert_allclose(sum(finer[f"b{i}"] ** 2 for i in range(4)), 1.0, atol=1e-12)
    assert finer.time[-1] == flight.time[-1]


def test_histories_say_where_they_come_from_and_what_bounds_held_and_others_are_not_there() -> None:
    flight = half_cuban().flight()
    assert (flight.basis("x"), flight.basis("V_I")) == (Basis.SOLVED, Basis.DERIVED)
    rules, envelope = flight.course.rules, flight.aircraft.envelope
    assert flight.limit("n_z").upper == min(rules.n_z.upper, envelope.n_z.upper)
    assert flight.limit("height").lower == rules.height.lower
    assert circling(rovinj()).has("latitude", "longitude")
    assert not flight.has("latitude")  # this course has no origin
    assert "eta" not in flight
    assert np.isnan(flight.values("eta")).all()
    assert not flight.limit("eta").constrained
    with pytest.raises(KeyError):
        flight["eta"]


def test_a_stage_without_a_flight_is_refused() -> None:
    stage = half_cuban()["point-mass"]
    lost = replace(stage, result=replace(stage.result, outcome=Status.INFEASIBLE))
    with pytest.raises(UsageError, match="found no flight: it ended infeasible"):
        lost.flight()


SPEED, BANK = 80.0, math.radians(60.0)
RADIUS = SPEED**2 / (g0 * math.tan(BANK))
"""m, of the circle that `circling` flies around the place (0, RADIUS) north and east."""


def with_course(flight: Flight, **changes: object) -> Flight:
    return replace(flight, race=replace(flight.race, course=replace(flight.course, **changes)))


def nearest(flight: Flight, kind: str, leg: int = 1) -> Clearance:
    """The least distance on a leg from things of a kind."""
    found = least(flight, legs_of(flight)[leg - 1], distances(flight))
    return min((one for one in found if one.kind == kind), key=lambda one: one.distance)


def test_facts_of_a_level_circle_are_known_and_extremes_of_a_race_are_those_of_a_leg() -> None:
    for facts in leg_facts(circling(rovinj())):
        assert facts.n_z.least == pytest.approx(1.0 / math.cos(BANK))
        assert facts.n_z.greatest == pytest.approx(1.0 / math.cos(BANK))
        assert (facts.height.least, facts.height.greatest) == (50.0, 50.0)
        assert facts.V_A.least == pytest.approx(SPEED)
        assert facts.energy_in == pytest.approx(50.0 + SPEED**2 / (2.0 * g0))
        assert facts.energy_out == facts.energy_in
        assert math.isnan(facts.roll_rate)
    flight = half_cuban().flight()
    every = leg_facts(flight)
    assert max(one.n_z.greatest for one in every) == flight["n_z"].max()
    assert min(one.height.least for one in every) == flight["height"].min()
    assert max(one.roll_rate for one in every) == np.abs(flight["p_Kbar"]).max()
    for one, following in pairwise(every):
        assert one.energy_out == following.energy_in


def test_distance_from_a_crowd_in_the_centre_of_a_circle_is_its_radius() -> None:
    middle = (Point(0.0, RADIUS),)
    for slant, expected in ((False, RADIUS), (True, math.hypot(RADIUS, 40.0))):
        crowd = Crowd("stands", CrowdShape.POINT, middle, distance=30.0, height=10.0, slant=slant)
        found = nearest(with_course(circling(rovinj()), crowd=(crowd,)), "crowd")
        assert found.distance == pytest.approx(expected, abs=1e-6)
        assert found.margin == pytest.approx(expected - 30.0, abs=1e-6)


@pytest.mark.parametrize(("keep_right", "side"), [(True, 1.0), (False, -1.0)])
def test_a_safety_line_counts_on_the_legs_that_name_it(*, keep_right: bool, side: float) -> None:
    """The line runs north along the tangent at the start; the circle lies to its right."""
    line = SafetyLine("beach", Point(-10.0, 0.0), Point(10.0, 0.0), keep_right, margin=5.0)
    flight = circling(rovinj())
    passages = list(flight.course.passages)
    passages[1] = replace(passages[1], safety_lines=(line,))
    flight = with_course(flight, passages=tuple(passages))
    rows = legs_of(flight)[0].rows
    assert nearest(flight, "safety line").distance == pytest.approx(min(side * flight["y"][rows]), abs=1e-9)
    assert not [one for one in least(flight, legs_of(flight)[1], distances(flight)) if one.kind == "safety line"]


def test_floor_and_airspace() -> None:
    flight = circling(rovinj())
    corners = tuple(Point(*place) for place in ((-400.0, -30.0), (-400.0, 900.0), (400.0, 900.0), (400.0, -30.0)))
    for turned in (corners, corners[::-1]):
        inside = nearest(with_course(flight, airspace=turned), "airspace")
        assert inside.distance == pytest.approx(30.0, abs=1e-6)
    assert nearest(flight, "floor").distance == pytest.approx(50.0 - flight.course.rules.height.lower)


@pytest.mark.parametrize(("bank", "height"), [(0.1, 10.0), (0.7, 10.0), (1.3, 10.0), (1.0, 100.0)])
def test_distance_from_a_pylon_is_that_of_the_wing_tip_and_of_its_top_above_it(bank: float, height: float) -> None:
    """A pylon stands 20 m to the left of the beginning of a circle to the right, so the left tip is the nearest."""
    flight = circling(rovinj(), bank=bank, height=height)
    pylon = replace(flight.course.passages[1].element, north=0.0, east=-20.0)
    passages = (flight.course.passages[0], replace(flight.course.passages[1], element=pylon))
    flight = replace(with_course(flight, passages=passages), crossings=flight.crossings[:2])
    (found,) = [one for one in distances(flight) if one.name == pylon.name]
    half = 0.5 * flight.aircraft.airframe.b
    left = half * np.linspace(-1.0, 1.0, 100001)  # places on the wing, to the left
    above = np.maximum(height + left * math.sin(bank) - PYLON_HEIGHT, 0.0)
    assert found.values[0] == pytest.approx(np.hypot(20.0 - left * math.cos(bank), above).min(), abs=1e-6)


@pytest.fixture
def run_file(tmp_path: Path) -> str:
    return str(half_cuban().save(tmp_path / "run.h5"))


def show(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["show", *arguments])
    return result.exit_code, result.stdout, result.stderr


def test_show_tells_the_legs_in_eighty_columns(run_file: str) -> None:
    code, out, err = show(run_file, "--legs", "--certificate")
    assert (code, err) == (0, "")
    assert max(len(line) for line in out.splitlines() if run_file not in line) <= 80
    for words in ("energy", "indicated", "nearest", "replay_defect"):
        assert words in out
    assert "replay_defect" not in show(run_file)[1]


def test_show_tells_one_stage_alone(run_file: str) -> None:
    out = show(run_file, "--stage", "homotopy")[1]
    assert "point-mass" not in out
    code, out, err = show(run_file, "--stage", "six-dof")
    assert (code, out) == (2, "")
    assert err == "airrace: this run has no stage 'six-dof'; it has: homotopy, point-mass\n"


def test_the_object_holds_the_legs_of_the_last_flight(run_file: str) -> None:
    first, last = json.loads(show(run_file, "--json")[1])["stages"]
    assert "legs" not in first
    facts = leg_facts(half_cuban().flight())
    for leg, one in zip(last["legs"], facts, strict=True):
        assert leg["passing"] == one.leg.name
        assert leg["time_s"] == pytest.approx(one.leg.time)
        assert leg["n_z_g"]["greatest"] == pytest.approx(one.n_z.greatest)
        assert [clear["kind"] for clear in leg["clearances"]] == [clear.kind for clear in one.clearances]
    assert sum(lap["time_s"] for lap in last["laps"]) == pytest.approx(half_cuban().race_time)


def test_near_misses_are_reported_in_the_answer_and_in_the_object(run_file: str) -> None:
    """The half Cuban eight has no pylons; between those of a gate 3 m wide there is no room for a wing."""
    assert "near misses" not in show(run_file, "--all")[1]
    (stage,) = (one for one in json.loads(show(run_file, "--json")[1])["stages"] if "legs" in one)
    assert stage["near_misses"] == []
    flight = narrow()
    (miss,) = (one for one in near_misses(flight) if one.clearance.time == 0.0)
    (first, *_) = legs_object(flight)["near_misses"]
    assert first["distance_m"] == miss.clearance.distance == pytest.approx(0.0, abs=1e-12)
    assert (first["name"], first["beside"], first["required_m"]) == ("g0", "0:g0", 0.5)
    assert "at 0:g0" in render(near_miss_table(near_misses(flight)), columns=80)
    assert "g0 (0.00 m, at 0:g0)" in legs_section(flight, RACE)


def narrow() -> Flight:
    """A circle at the height of the pylons, through a gate that is narrower than the wing."""
    flight = circling(rovinj(), bank=0.1, height=10.0)
    gate = replace(flight.course.passages[0].element, width=3.0, heading=0.0)
    passages = [replace(one, element=gate) if one.element.name == gate.name else one for one in flight.course.passages]
    crossings = tuple(replace(one, passage=passage) for one, passage in zip(flight.crossings, passages, strict=True))
    return replace(with_course(flight, passages=tuple(passages)), crossings=crossings)


KNOT = 1852.0 / 3600.0


def optima() -> Comparison:
    return compare_flights(half_cuban().flight(label="still"), windy().flight(label="windy"))


def without_passing(flight: Flight, number: int) -> Flight:
    """A flight that misses a gate."""
    lost = TimedCrossing(flight.crossings[number].passage, float("nan"), {})
    return replace(flight, crossings=(*flight.crossings[:number], lost, *flight.crossings[number + 1 :]))


def test_a_flight_compared_with_itself_differs_nowhere() -> None:
    flight = half_cuban().flight()
    comparison = compare_flights(flight, flight)
    assert comparison.tie
    assert comparison.difference == 0.0
    assert not np.any(comparison.progress.difference)
    for leg in comparison.legs:
        assert (leg.difference, leg.cumulative, leg.by_way, leg.by_speed) == (0.0, 0.0, 0.0, 0.0)
        assert leg.differences == ()
    assert list(conditions(flight, flight)) == []


def test_the_difference_along_the_course_ends_at_the_difference_of_the_race_times() -> None:
    comparison = optima()
    assert comparison.progress.difference[0] == 0.0
    assert comparison.progress.difference[-1] == pytest.approx(comparison.difference, abs=1e-9)
    assert comparison.legs[-1].cumulative == pytest.approx(comparison.difference, abs=1e-12)
    assert sum(leg.difference for leg in comparison.legs) == pytest.approx(comparison.difference, abs=1e-12)


def test_the_difference_at_every_passing_is_the_difference_of_the_clocks() -> None:
    comparison = optima()
    here = np.searchsorted(comparison.progress.distance, comparison.progress.passings - 1e-9)
    for row, leg in zip(here[1:], comparison.legs, strict=True):
        assert comparison.progress.difference[row] == pytest.approx(leg.cumulative, abs=1e-9)


def test_flights_that_change_places_change_the_sign() -> None:
    here = optima()
    there = compare_flights(here.flight, here.reference)
    assert there.difference == -here.difference
    np.testing.assert_allclose(there.progress.difference, -here.progress.difference, atol=1e-12)
    for one, other in zip(here.legs, there.legs, strict=True):
        assert other.by_way == pytest.approx(-one.by_way, abs=1e-12)
        assert [two.name for two in other.differences] == [two.name for two in one.differences]


def test_what_is_lost_by_the_way_and_by_the_speed_adds_up() -> None:
    for leg in optima().legs:
        assert leg.by_way + leg.by_speed == pytest.approx(leg.difference, abs=1e-9)


def test_a_wider_circle_at_the_same_speed_is_lost_by_the_way_alone() -> None:
    """Both turn once around at 80 m/s; the larger bank takes the smaller circle."""
    race = rovinj()
    turns = [circling(race, bank=bank, seconds=seconds) for bank, seconds in ((1.0, 20.0), (0.8, 25.0))]
    for leg in compare_flights(*turns).legs:
        assert leg.by_speed == pytest.approx(0.0, abs=1e-5)
        assert leg.by_way == pytest.approx(leg.difference, abs=1e-5)


def test_a_slower_flight_of_the_same_way_is_lost_by_the_speed_alone() -> None:
    """`tan(bank) = V^2 / (g0 r)`: circles of one radius, at 80 and at 75 m/s."""
    race = rovinj()
    bank = float(np.arctan(np.tan(1.0) * (75.0 / 80.0) ** 2))
    fast, slow = circling(race, bank=1.0), circling(race, speed=75.0, bank=bank, seconds=20.0 * 80.0 / 75.0)
    for leg in compare_flights(fast, slow).legs:
        assert leg.by_way == pytest.approx(0.0, abs=1e-4)
        assert leg.by_speed == pytest.approx(leg.difference, abs=1e-4)
        (speed,) = [one for one in leg.differences if one.name == "speed_in"]
        assert speed.reference - speed.value == pytest.approx(5.0 / KNOT)
        assert difference_text(speed) == "9.7 kt slower in"


def test_legs_are_sorted_by_what_is_lost() -> None:
    lost = [leg.difference for leg in optima().by_loss]
    assert lost == sorted(lost, reverse=True)


def test_five_milliseconds_are_a_tie() -> None:
    race = rovinj()
    assert compare_flights(circling(race, seconds=20.0), circling(race, seconds=20.004)).tie
    assert not compare_flights(circling(race, seconds=20.0), circling(race, seconds=20.006)).tie


def test_a_missed_gate_leaves_the_rest_of_the_clock_as_it_is() -> None:
    whole = circling(rovinj(), seconds=21.0)
    comparison = compare_flights(circling(rovinj()), without_passing(whole, 3))
    assert np.isnan(comparison.legs[2].difference)
    assert comparison.difference == pytest.approx(1.0)
    assert comparison.progress.difference[-1] == pytest.approx(1.0)
    assert np.isnan(comparison.progress.difference).any()
    assert np.isnan(comparison.by_loss[-1].difference)


def test_flights_of_other_passings_are_refused() -> None:
    with pytest.raises(UsageError, match=re.escape("passing 0 is 0:entry (manoeuvre) in the one and 0:g0 (gate)")):
        compare_flights(circling(rovinj()), half_cuban().flight())
    flight = circling(rovinj())
    course = replace(flight.course, passages=flight.course.passages[:-1])
    shorter = replace(flight, race=replace(flight.race, course=course))
    with pytest.raises(UsageError, match="the one has 16 passings, the other 17"):
        compare_flights(flight, shorter)


def test_conditions_that_differ_are_reported() -> None:
    told = {what: (first, second) for what, first, second in conditions(half_cuban().flight(), windy().flight())}
    assert told == {"wind": ("none", "20 kt from 70 deg")}
    flight = circling(rovinj())
    line = SafetyLine("beach", Point(-10.0, 0.0), Point(10.0, 0.0), keep_right=True, margin=5.0)
    crowd = Crowd("stands", CrowdShape.POINT, (Point(0.0, 0.0),), 30.0)
    passages = (*flight.course.passages[:-1], replace(flight.course.passages[-1], safety_lines=(line,)))
    course = replace(flight.course, passages=passages, crowd=(crowd,))
    other = replace(flight, race=replace(flight.race, course=course))
    assert list(conditions(flight, other)) == [("safety lines", "none", "beach"), ("people", "none", "stands")]
    moved = replace(other, race=replace(other.race, course=replace(course, crowd=(replace(crowd, distance=40.0),))))
    assert list(conditions(other, moved)) == [("people", "stands", "stands otherwise")]


def test_every_rule_that_differs_is_reported_in_words() -> None:
    flight = half_cuban().flight()
    without = replace(flight.course, rules=replace(flight.course.rules, pilot=PilotLimits()))
    flight = replace(flight, race=replace(flight.race, course=without))
    pilot = PilotLimits(n_z_low=0.5, steady_start=True)
    rules = replace(flight.course.rules, pilot=pilot, n_z=Interval(-1.0, 9.0), p=3.0)
    rules = replace(rules, clearance=ClearanceRule.CROSSING, start_speed=StartSpeed.TRUE)
    other = replace(flight, race=replace(flight.race, course=replace(flight.course, rules=rules)))
    told = {what: (first, second) for what, first, second in conditions(flight, other)}
    assert told["rules: clearance"] == ("flight", "crossing")
    assert told["rules: start_speed"] == ("ground_speed", "true_airspeed")
    assert told["rules: n_z"] == ("-2 to 10", "-1 to 9")
    assert told["rules: p"] == ("none", "3")
    assert told["rules: n_z_low"] == ("none", "0.5")
    assert told["rules: steady_start"] == ("no", "yes")
    assert len(told) == 6


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (None, ""),
        (Status.CERTIFIED, ""),
        (Status.SOLVED, "x is solved on one mesh"),
        (Status.GUESS, "x is a guess"),
        (Status.NOT_CERTIFIED, "x is not certified"),
    ],
)
def test_the_trust_that_a_flight_deserves_is_reported_in_its_own_word(state: Status | None, words: str) -> None:
    reference = circling(rovinj())
    other = replace(reference, source=Source("x", status=state))
    verdict, *_ = comparison_texts([compare_flights(reference, other)], every=False)
    assert [line.strip() for line in verdict.splitlines()[1:]] == ([words] if words else [])
    good = state not in (Status.GUESS, Status.NOT_CERTIFIED)
    assert ('class="verdict good"' in flight_page([other])) == good
    told = comparison_object(other, [])["reference"]
    assert isinstance(told, dict)
    assert told["status"] == (None if state is None else state.value)


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    paths = tmp_path / "still.h5", tmp_path / "windy.h5"
    for run, path in zip((half_cuban(), windy()), paths, strict=True):
        run.save(path)
    return str(paths[0]), str(paths[1])


def run(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["compare", *arguments])
    return result.exit_code, result.stdout, result.stderr


def test_the_command_tells_the_difference_in_eighty_columns(files: tuple[str, str]) -> None:
    code, out, _ = run(*files, "--all")
    assert code == 0
    assert out.startswith("windy.h5 against still.h5: ")
    assert "wind: 20 kt from 70 deg against none" in out
    assert max(len(line) for line in out.splitlines()) <= 80


def test_the_command_says_ties(files: tuple[str, str]) -> None:
    code, out, _ = run(files[0], files[0])
    assert code == 0
    assert "a tie within 5 ms" in out


def test_the_object_holds_the_same_numbers(files: tuple[str, str]) -> None:
    code, out, _ = run(*files, "--json")
    answer = json.loads(out)
    (flight,) = answer["flights"]
    comparison = optima()
    assert code == 0
    assert (answer["reference"]["label"], flight["label"]) == ("still.h5", "windy.h5")
    assert flight["difference_s"] == pytest.approx(comparison.difference)
    assert [leg["passing"] for leg in flight["legs"]] == [leg.name for leg in comparison.legs]
    assert flight["progress"]["difference_s"][-1] == pytest.approx(comparison.difference)
    assert not flight["tie"]


def test_the_object_holds_every_word_of_the_table(files: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_tables, "PAGE", 300)  # so that no words are wrapped
    (flight,) = json.loads(run(*files, "--json")[1])["flights"]
    table = run(*files, "--all")[1].splitlines()
    assert any(leg["differs"] for leg in flight["legs"])
    for leg in flight["legs"]:
        (row,) = [line for line in table if line.split()[:1] == [leg["passing"]]]
        numbers, words = row.split()[1:5], " ".join(row.split()[5:])
        assert words == "; ".join(one["text"] for one in leg["differs"])
        named = ("flight_s", "difference_s", "by_longer_way_s", "by_lower_speed_s")
        assert [float(one) for one in numbers] == pytest.approx([leg[name] for name in named], abs=5.1e-4)


def test_the_drawing_is_written_and_not_overwritten(files: tuple[str, str], tmp_path: Path) -> None:
    drawing = tmp_path / "two.svg"
    assert run(*files, "--plot", str(drawing))[0] == 0
    assert drawing.read_bytes().startswith(b"<?xml")
    code, _, err = run(*files, "--plot", str(drawing))
    assert code == 2
    assert err.count("\n") == 1
    assert "--force" in err


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("{still}",), 2, "a comparison takes two flights or more"),
        (("{still}", "{still}:six-dof"), 2, "this run has no stage 'six-dof'"),
        (("{still}", "none.h5"), 7, "none.h5"),
        (("{still}", "{still}", "--plot", "a.jpg"), 2, "cannot draw into a.jpg"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_a_sentence(
    files: tuple[str, str], arguments: tuple[str, ...], code: int, said: str
) -> None:
    ended, out, err = run(*(one.format(still=files[0]) for one in arguments))
    assert (ended, out) == (code, "")
    assert said in err
    assert err.count("\n") == 1
