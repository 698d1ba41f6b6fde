"""What is told of every leg, and how close a flight comes to things."""

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.cli.run_tables import near_miss_table
from airrace.cli.tables import rendered
from airrace.environment.atmosphere import g0
from airrace.report.flight_page import legs_section
from airrace.results import Flight, legs_of
from airrace.results.clearances import PYLON_HEIGHT, Clearance, distances, least, near_misses
from airrace.results.leg_facts import leg_facts
from airrace.runs.json_objects import legs_object
from airrace.track.limits import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point

SPEED, BANK = 80.0, math.radians(60.0)
RADIUS = SPEED**2 / (g0 * math.tan(BANK))
"""m, of the circle that `circling` flies around the place (0, RADIUS) north and east."""


def with_course(flight: Flight, **changes: object) -> Flight:
    return replace(flight, race=replace(flight.race, course=replace(flight.course, **changes)))


def nearest(flight: Flight, kind: str, leg: int = 1) -> Clearance:
    """The least distance on a leg from things of a kind."""
    found = least(flight, legs_of(flight)[leg - 1], distances(flight))
    return min((one for one in found if one.kind == kind), key=lambda one: one.distance)


def test_a_level_circle_is_the_same_on_every_leg() -> None:
    flight = circling(rovinj())
    for facts in leg_facts(flight):
        assert facts.n_z.least == pytest.approx(1.0 / math.cos(BANK))
        assert facts.n_z.greatest == pytest.approx(1.0 / math.cos(BANK))
        assert (facts.height.least, facts.height.greatest) == (50.0, 50.0)
        assert facts.V_A.least == pytest.approx(SPEED)
        assert facts.energy_in == pytest.approx(50.0 + SPEED**2 / (2.0 * g0))
        assert facts.energy_out == facts.energy_in
        assert math.isnan(facts.roll_rate)


def test_extremes_of_the_race_are_extremes_of_a_leg() -> None:
    flight = half_cuban().flight()
    facts = leg_facts(flight)
    assert max(one.n_z.greatest for one in facts) == flight["n_z"].max()
    assert min(one.height.least for one in facts) == flight["height"].min()
    assert max(one.roll_rate for one in facts) == np.abs(flight["p_Kbar"]).max()
    assert sum(one.leg.time for one in facts) == pytest.approx(flight.race_time, abs=1e-12)
    for one, following in pairwise(facts):
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
    found = nearest(flight, "safety line")
    rows = legs_of(flight)[0].rows
    assert found.distance == pytest.approx(min(side * flight["y"][rows]), abs=1e-9)
    assert not [one for one in least(flight, legs_of(flight)[1], distances(flight)) if one.kind == "safety line"]


def test_floor_and_airspace() -> None:
    flight = circling(rovinj())
    corners = tuple(Point(*place) for place in ((-400.0, -30.0), (-400.0, 900.0), (400.0, 900.0), (400.0, -30.0)))
    for turned in (corners, corners[::-1]):
        inside = nearest(with_course(flight, airspace=turned), "airspace")
        assert inside.distance == pytest.approx(30.0, abs=1e-6)
    assert nearest(flight, "floor").distance == pytest.approx(50.0 - flight.course.rules.height.lower)


def beside_a_pylon(bank: float, height: float) -> tuple[Flight, np.ndarray]:
    """A circle with a pylon 20 m to the left of its beginning, and the distance from it all along."""
    flight = circling(rovinj(), bank=bank, height=height)
    pylon = replace(flight.course.passages[1].element, north=0.0, east=-20.0)
    passages = (flight.course.passages[0], replace(flight.course.passages[1], element=pylon))
    flight = replace(with_course(flight, passages=passages), crossings=flight.crossings[:2])
    (found,) = [one for one in distances(flight) if one.name == pylon.name]
    return flight, found.values


@pytest.mark.parametrize("bank", [0.1, 0.7, 1.3])
def test_wing_tips_reach_half_a_span_times_the_cosine_of_the_bank(bank: float) -> None:
    """The turn goes to the right, so the left tip is the nearest; the body is nose up by a few degrees."""
    flight, away = beside_a_pylon(bank, 10.0)
    half = 0.5 * flight.aircraft.airframe.b * math.cos(bank)
    assert away[0] == pytest.approx(20.0 - half, abs=1e-6)


def test_above_a_pylon_its_top_is_what_counts() -> None:
    flight, away = beside_a_pylon(1.0, 100.0)
    half = 0.5 * flight.aircraft.airframe.b
    lowest = 100.0 - half * math.sin(1.0)
    assert away[0] == pytest.approx(math.hypot(20.0 - half * math.cos(1.0), lowest - PYLON_HEIGHT), abs=1e-6)


@pytest.fixture
def run_file(tmp_path: Path) -> str:
    return str(half_cuban().save(tmp_path / "run.h5"))


def show(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["show", *arguments])
    return result.exit_code, result.stdout, result.stderr


def test_show_tells_the_legs_in_eighty_columns(run_file: str) -> None:
    code, out, err = show(run_file, "--legs", "--certificate")
    assert (code, err) == (0, "")
    assert max(len(line) for line in out.splitlines()) <= 80
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


def test_near_misses_are_told_in_the_answer_and_in_the_object(run_file: str) -> None:
    """The half Cuban eight has no pylons; between those of a gate 3 m wide there is no room for a wing."""
    assert "near misses" not in show(run_file)[1]
    (stage,) = (one for one in json.loads(show(run_file, "--json")[1])["stages"] if "legs" in one)
    assert stage["near_misses"] == []
    flight = narrow()
    (miss,) = (one for one in near_misses(flight) if one.clearance.time == 0.0)
    (first, *_) = legs_object(flight)["near_misses"]
    assert first["distance_m"] == miss.clearance.distance == pytest.approx(0.0, abs=1e-12)
    assert (first["name"], first["beside"], first["required_m"]) == ("g0", "0:g0", 0.5)
    assert "at 0:g0" in rendered(near_miss_table(near_misses(flight)), columns=80)
    assert "g0 (0.00 m, at 0:g0)" in legs_section(flight)


def narrow() -> Flight:
    """A circle at the height of the pylons, through a gate that is narrower than the wing."""
    flight = circling(rovinj(), bank=0.1, height=10.0)
    gate = replace(flight.course.passages[0].element, width=3.0, heading=0.0)
    passages = [replace(one, element=gate) if one.element.name == gate.name else one for one in flight.course.passages]
    crossings = tuple(replace(one, passage=passage) for one, passage in zip(flight.crossings, passages, strict=True))
    return replace(with_course(flight, passages=tuple(passages)), crossings=crossings)
