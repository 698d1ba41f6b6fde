"""Least distances and impacts of all closed-loop flights, beside geometry of their own."""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from safety_courses import COURSE, optimum
from short_course import AIRCRAFT, FROM_PLAN

from airrace.files.inputs import Document, inputs_from_documents
from airrace.flights.safety.closed_loop import ClosedLoop, Flights, fly
from airrace.flights.safety.disturbances import Scatter
from airrace.flights.safety.impacts import Fallen, fall, outlines_of, targets_of
from airrace.flights.safety.judge import FlightMeasurements, Judge, Thing, measure
from airrace.flights.safety.monte_carlo import Nearness, closed_loop_of, fly_closed_loop
from airrace.flights.safety.pilot import PilotModel
from airrace.model.track.polygons import Point, inside
from airrace.race import Race

SURROUNDINGS = """
crowd:
  stands: {polygon: [{north_m: 120, east_m: 100}, {north_m: 120, east_m: 300}, {north_m: 200, east_m: 300}], \
distance_m: 60}
safety_lines:
  shore: {from: {north_m: -500, east_m: 240}, to: {north_m: 900, east_m: 250}, keep: left}
obstacles:
  mast: {north_m: 150, east_m: -60, height_m: 40}
  shed: {north_m: 250, east_m: -120, height_m: 60, length_m: 20, width_m: 10, heading_deg: 0}
airspace: [{north_m: -900, east_m: -900}, {north_m: -900, east_m: 2500}, {north_m: 900, east_m: 2500}, \
{north_m: 900, east_m: -900}]
"""
COUNT = 40


@cache
def race() -> Race:
    given = inputs_from_documents(Document("course.yaml", COURSE + SURROUNDINGS), AIRCRAFT, FROM_PLAN, ())
    return given.race


@cache
def loop() -> ClosedLoop:
    return closed_loop_of(race(), optimum(), PilotModel())


@cache
def flights() -> Flights:
    return fly(loop(), Scatter(), 5, range(COUNT))


@cache
def judge() -> Judge:
    return Judge.from_optimum(race(), optimum(), loop())


@cache
def measured() -> FlightMeasurements:
    return measure(judge(), loop(), flights())


@cache
def fallen() -> Fallen:
    return fall(race(), loop(), flights())


def rows(flight: int) -> np.ndarray:
    """The samples of a flight between its first and its last passing."""
    clock, passings = flights().clock[:, flight], loop().nominal.passing_times
    return np.flatnonzero(
        (clock >= passings[0]) & (clock <= passings[-1]) & (np.arange(len(clock)) < flights().lost[flight])
    )


def from_segment(north: float, east: float, a: tuple[float, float], b: tuple[float, float]) -> float:
    """The distance of a place from a straight way, by projection."""
    along = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    share = min(max(((north - a[0]) * (b[0] - a[0]) + (east - a[1]) * (b[1] - a[1])) / along, 0.0), 1.0)
    return math.hypot(north - a[0] - share * (b[0] - a[0]), east - a[1] - share * (b[1] - a[1]))


def from_polygon(north: float, east: float, corners: Sequence[tuple[float, float]]) -> float:
    if inside(Point(north, east), [Point(*corner) for corner in corners]):
        return 0.0
    return min(from_segment(north, east, corners[n - 1], corners[n]) for n in range(len(corners)))


def left_of_shore(north: float, east: float) -> float:
    """The distance to the left of the safety line, which leads almost north."""
    return ((north + 500.0) * 10.0 - (east - 240.0) * 1400.0) / math.hypot(1400.0, 10.0)


def distances_of(flight: int) -> dict[str, float]:
    """The least distances of a flight, sample by sample, without any of the package's geometry of courses."""
    least: dict[str, float] = {}
    stands = [(corner.north, corner.east) for corner in race().course.crowd[0].corners]
    shed = next(obstacle for obstacle in race().course.obstacles if obstacle.name == "shed")
    semispan = 0.5 * race().aircraft.airframe.b
    for row in rows(flight):
        north, east, down, _, a, b, c, d = flights().state[row, :8, flight]
        people = math.hypot(from_polygon(north, east, stands), -down)  # slant, from the ground
        # the right wing is the second axis of the path, which is turned by no sideslip to speak of
        wing = (2.0 * (b * c - a * d), a * a - b * b + c * c - d * d, 2.0 * (c * d + a * b))
        tips = [(north + sign * semispan * wing[0], east + sign * semispan * wing[1]) for sign in (-1.0, 1.0)]
        found = {
            "crowd stands": people,
            "safety line shore": left_of_shore(north, east),
            "airspace": min(north + 900.0, 900.0 - north, east + 900.0, 2500.0 - east),
            "obstacle mast": from_segment(150.0, -60.0, *tips),
            "obstacle shed": min(from_segment(place.north, place.east, *tips) for place in shed.places) - shed.radius,
            "ground": -down - abs(semispan * wing[2]),
        }
        least = {name: min(distance, least.get(name, math.inf)) for name, distance in found.items()}
    return least


def test_least_distances_are_those_of_geometry_sample_by_sample() -> None:
    names = [thing.text for thing in judge().things]
    for flight in range(0, COUNT, 8):
        expected = distances_of(flight)
        assert set(names) == set(expected)
        for name, distance in zip(names, measured().distances[:, flight].tolist(), strict=True):
            assert distance == pytest.approx(expected[name], abs=0.15 if name.startswith("obstacle") else 0.02), name


def test_breaches_are_distances_below_what_is_asked() -> None:
    for kind in ("crowd", "safety line", "airspace"):
        (row,) = (row for row, thing in enumerate(judge().things) if thing.kind == kind)
        too_near = measured().distances[row] < judge().things[row].required - 0.1
        assert (measured().along[kind] == too_near).all()


def test_the_share_that_keeps_a_distance_is_counted_from_below() -> None:
    distances = np.arange(1000, dtype=np.float64)[::-1]
    found = Nearness.from_distances(Thing("crowd", "a", 2.0), distances, distances < 2.0)
    assert (found.least, found.kept, found.nearer.flights) == (0.0, 3.0, 2)
    assert (distances >= found.kept).sum() == 997
    assert math.isnan(Nearness.from_distances(Thing("crowd", "a", 2.0), distances[:333], distances[:333] < 0.0).kept)


def test_falls_in_vacuum_are_parabolas_from_every_tenth_of_a_second() -> None:
    g0, flight = 9.80665, 3
    vacuum, drag = fallen().stretches[flight]
    own = [row for row in rows(flight) if row % 5 == 0]
    assert len(own) == len(vacuum) == len(drag)
    for row, place in list(zip(own, vacuum, strict=True))[::7]:
        (north, east, down), speed = flights().state[row, :3, flight], flights().state[row, 3, flight]
        a, b, c, d = flights().state[row, 4:8, flight]
        path = (a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c))
        up, height = -speed * path[2], -down
        time = (up + math.sqrt(up * up + 2.0 * g0 * height)) / g0
        assert place == pytest.approx([north + time * speed * path[0], east + time * speed * path[1]], abs=1e-3)


def test_impacts_are_measured_from_people_lines_and_border() -> None:
    half, stands = 0.5 * race().aircraft.airframe.b, [(c.north, c.east) for c in race().course.crowd[0].corners]
    targets = [target.text for target in targets_of(race())]
    assert targets == ["crowd stands", "safety line shore", "airspace"]
    for flight in (0, 17):
        places = np.concatenate(fallen().stretches[flight])
        people = min(from_polygon(*place, stands) for place in places.tolist()) - half
        across = min(left_of_shore(*place) for place in places.tolist()) - half
        assert fallen().distances[0, flight] == pytest.approx(max(people, 0.0), abs=0.5)  # between both falls, too
        assert fallen().distances[0, flight] <= max(people, 0.0) + 1e-9
        assert fallen().distances[1, flight] == pytest.approx(across, abs=1e-6)


def test_the_outline_of_all_falls_holds_those_of_every_flight() -> None:
    outlines = outlines_of(race(), fallen().stretches)
    borders = [[Point(*corner) for corner in outline.border.tolist()] for outline in outlines]
    for flight in (0, 20, 39):
        for place in fallen().stretches[flight][0][::9].tolist():
            assert any(inside(Point(*place), border) for border in borders)


def test_flights_are_told_of_batch_by_batch_and_end_where_the_time_is_over() -> None:
    told: list[tuple[int, int, int]] = []
    result = fly_closed_loop(
        race(), optimum(), flights=300, threads=1, watch=lambda *numbers: told.append(numbers), until=-math.inf
    )
    assert (result.flights, result.asked) == (125, 300)
    assert [numbers[:2] for numbers in told] == [(0, 300), (125, 300)]
    assert told[-1][2] == result.broken.flights
    whole = fly_closed_loop(race(), optimum(), flights=125, threads=1)
    assert whole.counts == result.counts
    assert result.broken.flights >= max(result.outside.flights, result.counts["over-g"].flights)
