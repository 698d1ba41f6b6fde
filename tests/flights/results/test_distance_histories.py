"""Distances at every instant, as histories of a flight and as columns of its table."""

import dataclasses
import math
from typing import Any

import numpy as np
from example_flights import circling, half_cuban, rovinj

from airrace.flights.results.clearances import (
    distance_columns,
    distance_histories,
    distances,
    least_distances,
    least_of_all,
    with_distances,
    with_nearest,
)
from airrace.flights.results.derivation import table_columns
from airrace.flights.results.flight import Basis, Flight
from airrace.model.track.course import Crowd, CrowdShape, Obstacle, SafetyLine
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Array
from airrace.pages.report.contents import contents_of
from airrace.pages.views.map_model import map_model
from airrace.race import Race

STANDS = Crowd("north stand", CrowdShape.LINE, (Point(2000.0, -9000.0), Point(2000.0, 9000.0)), distance=100.0)
TOWER = Crowd("tower", CrowdShape.POINT, (Point(0.0, 0.0),), distance=50.0, slant=False)
SHORE = SafetyLine("shore", Point(0.0, -900.0), Point(1.0, -900.0), keep_right=True, margin=20.0)
MAST = Obstacle("mast", (Point(0.0, 0.0),), 4.0, 1000.0, 10.0)
SQUARE = tuple(Point(n, e) for n, e in ((-3000.0, -3000.0), (3000.0, -3000.0), (3000.0, 3000.0), (-3000.0, 3000.0)))


def surrounded() -> Race:
    course = rovinj().course
    first, second, *rest = course.passages
    passages = (first, dataclasses.replace(second, safety_lines=(SHORE,)), *rest)
    rules = dataclasses.replace(course.rules, height=Interval(5.0, 300.0))
    return dataclasses.replace(
        rovinj(),
        course=dataclasses.replace(
            course, passages=passages, crowd=(STANDS, TOWER), obstacles=(MAST,), airspace=SQUARE, rules=rules
        ),
    )


def circle() -> Flight:
    return with_distances(circling(surrounded()))


def test_distances_are_those_of_plane_geometry() -> None:
    flight = circle()
    north, east, height = flight["x"], flight["y"], flight["height"]
    ground = np.hypot(north, east)
    half = 0.5 * flight.aircraft.airframe.b
    expected: dict[str, Array] = {
        "distance_crowd_north_stand": np.hypot(2000.0 - north, height),
        "distance_crowd_tower": ground,
        "distance_safety_line_shore": east + 900.0,
        "distance_airspace": 3000.0 - np.maximum(np.abs(north), np.abs(east)),
        "distance_floor": height - 5.0,
        "distance_ceiling": 300.0 - height,
    }
    for name, values in expected.items():
        np.testing.assert_allclose(flight[name], values, atol=1e-9, err_msg=name)
        assert flight.basis(name) is Basis.DERIVED
    away = flight["distance_obstacle_mast"] + 4.0
    assert (away <= ground + 1e-9).all()
    assert (away >= ground - half - 1e-9).all()
    assert sum(name.startswith("distance_pylon_") for name in flight.histories) == 8


def test_bounds_are_those_that_hold_throughout() -> None:
    flight = circle()
    lower = {name: flight.limit(f"distance_{name}").lower for name in ("crowd_tower", "obstacle_mast", "floor")}
    assert lower == {"crowd_tower": 50.0, "obstacle_mast": 10.0, "floor": 0.0}
    assert flight.limit("distance_safety_line_shore").lower == -math.inf  # it holds on one leg alone


def test_no_value_is_less_than_the_least_and_crossings_have_theirs() -> None:
    flight = circle()
    told = {one.text: one for one in least_of_all(flight, distances(flight))}
    for name, one in flight.histories.items():
        if name.startswith("distance_") and name != "distance_safety_line_shore":
            text = one.quantity.text.removeprefix("distance from ")
            assert told[text].distance <= one.values.min() + 1e-9
    for crossing in flight.crossings:
        row = int(np.searchsorted(flight.time, crossing.time - 1e-9))
        assert crossing.value("distance_floor") == flight["distance_floor"][row]
    margins = [one.margin for one in least_distances(flight)]
    assert margins == sorted(margins)
    assert len(margins) == len(told) == 15


def test_names_are_different_and_fit_for_every_format() -> None:
    named = [dataclasses.replace(TOWER, name=name) for name in ("a b", "a-b", "a/b", "é")]
    race = dataclasses.replace(rovinj(), course=dataclasses.replace(rovinj().course, crowd=tuple(named)))
    found = [name for name in distance_histories(circling(race)) if "crowd" in name]
    assert found == ["distance_crowd_a_b", "distance_crowd_a_b_2", "distance_crowd_a_b_3", "distance_crowd_"]


def test_columns_of_a_table_are_the_histories_at_its_rows() -> None:
    race = surrounded()
    flight = with_distances(circling(race))
    states = {name: flight[name] for name in ("x", "y", "z", "V_K", "q0", "q1", "q2", "q3") if name in flight}
    assert len(states) == 8
    columns = distance_columns(race, states)
    assert [one.name for one in columns] == [name for name in flight.histories if name.startswith("distance_")]
    for rows in (slice(None), slice(3, 4), slice(5, 90)):
        known = {name: values[rows] for name, values in states.items()}
        for quantity, function in columns.items():
            np.testing.assert_allclose(function(known), flight[quantity.name][rows], atol=1e-9)
    assert not distance_columns(race, ["V_K"])
    assert table_columns(race, states)


def test_a_flight_without_a_position_stays_as_it_is() -> None:
    flight = circling(rovinj())
    histories = {name: one for name, one in flight.histories.items() if name != "x"}
    bare = dataclasses.replace(flight, histories=histories)
    assert with_distances(bare) is bare


def test_pictures_show_the_nearest_of_every_kind() -> None:
    flight = with_nearest(circle(), 50.0)
    each = [flight[name] for name in flight.histories if name.startswith("distance_pylon_")]
    nearest = np.minimum.reduce(each)
    np.testing.assert_array_equal(flight["nearest_pylon"], np.where(nearest <= 50.0, nearest, np.nan))
    np.testing.assert_array_equal(
        flight["nearest_crowd"], np.minimum(flight["distance_crowd_tower"], flight["distance_crowd_north_stand"])
    )
    contents = contents_of([circle()], [], map_model(surrounded()))
    strips: Any = contents["strips"]
    shown: dict[str, list[str]] = {one["title"]: [line["history"] for line in one["lines"]] for one in strips}
    assert shown["Wing to the nearest"] == ["nearest_pylon", "nearest_obstacle"]
    assert shown["Away from"] == ["nearest_crowd", "nearest_safety_line", "distance_airspace"]


def test_a_run_has_them_and_its_file_does_not() -> None:
    run = half_cuban()
    assert (run.flight()["distance_floor"] == run.flight()["height"] - 79.9).all()
    assert not any(one.name.startswith("distance") for one in run["point-mass"].trajectory.states)
