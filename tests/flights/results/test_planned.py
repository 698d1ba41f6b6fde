"""The line that is drawn of a course before anyone flies is the one that is measured and warned of."""

import json
import math
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from example_courses import ROOT, SHIPPED, everything, many_gates, race
from example_flights import circling, rovinj
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.files.inputs import load_inputs
from airrace.flights.results import Flight, legs_of
from airrace.flights.results.clearances import BESIDE, NEAR_MISS, near_misses
from airrace.flights.results.planned import is_planned, plan_clearances, planned_flight, remarks_on_line
from airrace.model.track.course import ClearanceRule, Crowd, CrowdShape
from airrace.model.track.polygons import Point
from airrace.pages.views.map_model import map_model
from airrace.procedure.guess import leg_seconds
from airrace.procedure.planning.lint import RemarkKind
from airrace.procedure.planning.plan import plan_race
from airrace.race import Race


def every_race(folder: Path) -> list[Race]:
    random = sorted((ROOT / "tests" / "courses").glob("random_?.yaml"))
    return [
        *(race(path) for path in SHIPPED),
        race(everything(folder)),
        *(load_inputs(path, aircraft="edge540").race for path in random),
    ]


def from_corners(places: np.ndarray, crowd: Crowd) -> np.ndarray:
    """The distance over ground of places (n, 2) from a crowd, by trying many points of its border; zero inside."""
    corners = [np.array([one.north, one.east]) for one in crowd.corners]
    closed = crowd.shape is CrowdShape.AREA
    pairs = [*pairwise(corners), *([(corners[-1], corners[0])] if closed else [])] or [(corners[0], corners[0])]
    border = np.concatenate([a + np.linspace(0.0, 1.0, 800)[:, None] * (b - a) for a, b in pairs])
    away = np.array([np.hypot(*(border - place).T).min() for place in places])
    if closed:
        windings = [
            abs(sum(math.remainder(b - a, 2.0 * math.pi) for a, b in pairwise([*angles, angles[0]]))) > math.pi
            for angles in ([math.atan2(*(corner - place)) for corner in corners] for place in places)
        ]
        away[windings] = 0.0
    return away


def test_the_planned_flight_makes_every_passing_where_and_when_the_plan_does(tmp_path: Path) -> None:
    for flown in every_race(tmp_path):
        planned = planned_flight(flown)
        assert (np.diff(planned.time) > 0.0).all()
        assert [one.passage for one in planned.crossings] == list(flown.course.passages)
        np.testing.assert_allclose([leg.time for leg in legs_of(planned)], leg_seconds(plan_race(flown)), atol=1e-9)
        for crossing, waypoint in zip(planned.crossings, plan_race(flown).waypoints, strict=True):
            if waypoint.position is not None:
                here = [crossing.value(name) for name in ("x", "y")]
                assert here == pytest.approx(list(waypoint.position[:2]), abs=1e-6)
        for leg, part in zip(legs_of(planned), plan_race(flown).legs, strict=True):
            assert is_planned(planned, leg.rows) == (part.path is not None)


def test_what_is_drawn_is_the_planned_flight(tmp_path: Path) -> None:
    for flown in every_race(tmp_path):
        planned = planned_flight(flown)
        for way in map_model(flown, planned).ways:
            if not way.planned:
                continue  # a straight line, of which the ends are drawn
            assert np.isin(way.line[:, 0], planned["x"]).all()
            assert np.isin(way.line[:, 1], planned["y"]).all()


@pytest.mark.slow
def test_no_line_is_drawn_through_the_zone_of_a_crowd_without_a_remark(tmp_path: Path) -> None:
    """Crowds are put beside and onto the drawn lines; the pictures and the remarks are measured independently."""
    met = 0
    for number, flown in enumerate(every_race(tmp_path)):
        drawn = map_model(flown).ways
        if not drawn:
            continue
        north, east = drawn[number % len(drawn)].line.mean(axis=0).tolist()
        line = Point(north, east), Point(north + 40.0, east + 90.0)
        area = Point(north, east), Point(north + 80.0, east), Point(north, east + 80.0)
        for crowd in (
            Crowd("line", CrowdShape.LINE, line, 60.0, slant=number % 2 == 0),
            Crowd("area", CrowdShape.AREA, area, 30.0),
        ):
            visited = replace(flown, course=replace(flown.course, crowd=(crowd,)))
            planned = planned_flight(visited)
            told = " ".join(one.text for one in remarks_on_line(planned) if one.kind is RemarkKind.CROWD)
            away = from_corners(np.concatenate([way.line for way in map_model(visited, planned).ways]), crowd)
            if away.min() < crowd.distance - 1.0:
                met += 1
                assert f"`{crowd.name}`" in told, flown.course.name
            (least,) = (one for one in plan_clearances(planned) if one.kind == "crowd")
            assert least.required == crowd.distance
            if not crowd.slant:
                assert least.distance <= away.min() + 0.2
    assert met > 15


def test_least_distances_are_those_of_the_planned_line_and_told_so(tmp_path: Path) -> None:
    path = everything(tmp_path)
    ran = CliRunner().invoke(app, ["check", str(path), "--aircraft", "edge540", "--json"])
    told = json.loads(ran.stdout)["planned"]
    assert told["optimised"] is False
    planned = planned_flight(race(path))
    assert [(one["kind"], one["name"]) for one in told["least_distances"]][1:] == [
        ("crowd", "stands"),
        ("crowd", "tower"),
        ("crowd", "village"),
        ("safety line", "beach"),
        ("airspace", ""),
        ("floor", ""),
        ("ceiling", ""),
    ]
    by_name = {one["name"] or one["kind"]: one for one in told["least_distances"]}
    assert by_name["ceiling"]["distance_m"] == pytest.approx(400.0 - np.nanmax(planned["height"]))
    assert by_name["floor"]["distance_m"] == pytest.approx(np.nanmin(planned["height"]) - 10.0)
    tower = np.hypot(planned["x"] - 620.0, planned["y"] + 60.0)
    assert by_name["tower"]["distance_m"] == pytest.approx(np.nanmin(tower))
    assert by_name["beach"]["leg"] == ["1:q/1", "1:q/2"]
    shown = CliRunner().invoke(app, ["check", str(path), "--aircraft", "edge540"]).stdout
    assert "planned, not optimised" in shown
    assert re.search(rf"^crowd tower +{by_name['tower']['distance_m']:.1f} +60.0 ", shown, re.MULTILINE)


def test_a_course_too_long_to_be_planned_is_straight_and_tells_of_no_pylons(tmp_path: Path) -> None:
    planned = planned_flight(race(many_gates(tmp_path, 401)))
    assert not any(is_planned(planned, leg.rows) for leg in legs_of(planned))
    assert {one.kind for one in plan_clearances(planned)} <= {"crowd", "safety line", "airspace"}
    assert remarks_on_line(planned) == []


def test_a_pylon_in_the_way_of_a_leg_that_does_not_pass_it_is_remarked_on() -> None:
    flown = rovinj()
    planned = planned_flight(flown)
    leg = legs_of(planned)[3]
    row = int(leg.rows[len(leg.rows) // 2])
    passages = list(flown.course.passages)
    moved = replace(passages[1].element, north=float(planned["x"][row]), east=float(planned["y"][row]))
    passages = [replace(one, element=moved) if one.element.name == moved.name else one for one in passages]
    there = replace(planned, race=replace(flown, course=replace(flown.course, passages=tuple(passages))))
    there = replace(
        there, crossings=tuple(replace(c, passage=p) for c, p in zip(planned.crossings, passages, strict=True))
    )
    told = [one for one in remarks_on_line(there) if one.kind is RemarkKind.PYLON]
    assert (
        f"from `{leg.before.name}` to `{leg.after.name}` leads the wing past a pylon of `g1` at 0.0 m" in told[0].text
    )
    assert told[0].text.endswith("; 3.5 m are required")
    rules = replace(flown.course.rules, clearance=ClearanceRule.CROSSING)
    there = replace(there, race=replace(there.race, course=replace(there.course, rules=rules)))
    assert remarks_on_line(there)[-1].text.endswith("; no rule keeps it away from there")
    assert not [one for one in remarks_on_line(planned) if one.kind is RemarkKind.PYLON]


def beside_a_gate(east: float, seconds: float) -> Flight:
    """A circle that begins northwards at the origin, with a pylon to the west of it that is passed at some time."""
    flight = circling(rovinj(), bank=0.1, height=10.0)
    first, second = flight.course.passages[:2]
    pylon = replace(second.element, north=0.0, east=east)
    passages = (replace(first, element=replace(first.element, north=5000.0)), replace(second, element=pylon))
    course = replace(flight.course, passages=passages)
    times = (0.0, seconds)
    crossings = tuple(replace(flight.crossings[i], passage=passages[i], time=times[i]) for i in range(2))
    return replace(flight, race=replace(flight.race, course=course), crossings=crossings)


@pytest.mark.parametrize("seconds", [0.1, 5.0])
def test_a_near_miss_belongs_to_a_passing_right_beside_it(seconds: float) -> None:
    half = 0.5 * rovinj().aircraft.airframe.b * math.cos(0.1)
    (miss,) = near_misses(beside_a_gate(-half - 1.0, seconds))
    assert miss.clearance.distance == pytest.approx(1.0, abs=1e-6)
    assert miss.clearance.required == 3.5
    if seconds <= BESIDE:
        assert miss.where == "0.10 s before 1:g1"
    else:
        assert (miss.passing, miss.where) == (None, "on the leg 0:g0 -> 1:g1")


def test_a_pylon_at_its_clearance_is_no_near_miss() -> None:
    half = 0.5 * rovinj().aircraft.airframe.b * math.cos(0.1)
    assert near_misses(beside_a_gate(-half - 3.5 + 0.5 * NEAR_MISS, 0.1)) == ()
    assert len(near_misses(beside_a_gate(-half - 3.5 + 2.0 * NEAR_MISS, 0.1))) == 1
