"""Footprints: outlines, distances from people, symmetry, and the command."""

import json
import math
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from command import run
from lxml import etree
from transformations import Change, changed

import airrace
from airrace.errors import UsageError
from airrace.files.inputs import load_inputs
from airrace.flights.safety.falls_and_glides import States, level_fall_distance
from airrace.flights.safety.footprint import Footprint, Track, footprint_of
from airrace.flights.safety.outlines import Outline, Raster, sweep
from airrace.model.environment import StaticWind
from airrace.model.track.course import Crowd, CrowdShape
from airrace.model.track.polygons import Point, area
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

SPEED, HEIGHT = 105.0, 25.0
WAY = float(level_fall_distance(np.array([SPEED]), np.array([HEIGHT]))[0])


def race(*crowd: Crowd, wind: StaticWind | None = None) -> Race:
    """Rovinj with people."""
    given = load_inputs("rovinj_2014").race
    return replace(given, course=replace(given.course, crowd=crowd), air=replace(given.air, wind=wind))


def standing(north: float, east: float, edge: float = 20.0) -> Crowd:
    """A square of people around a place."""
    half = 0.5 * edge
    corners = ((half, -half), (half, half), (-half, half), (-half, -half))
    places = tuple(Point(north + one, east + other) for one, other in corners)
    return Crowd("people", CrowdShape.AREA, places, distance=100.0)


def straight(seconds: float = 4.0, change: Change | None = None) -> Track:
    """A level flight to the north from the origin; or that as a change leaves it."""
    change = change or Change()
    time = np.linspace(0.0, seconds, round(50.0 * seconds) + 1)
    place = np.array([(*change.place(SPEED * t, 0.0), HEIGHT) for t in time.tolist()])
    course = change.azimuth(0.0)
    velocity = SPEED * np.array([math.cos(course), math.sin(course), 0.0])
    return Track("straight", time, States(place, np.tile(velocity, (len(time), 1))))


def size(outlines: tuple[Outline, ...]) -> float:
    """The area of some ground, m2."""

    def ring(corners: Array) -> float:
        return -area([Point(*corner) for corner in corners.tolist()])

    return sum(ring(one.border) + sum(map(ring, one.holes)) for one in outlines)


def test_a_ring_of_points_gives_a_border_and_a_hole_that_run_against_one_another() -> None:
    angle = np.linspace(0.0, 2.0 * math.pi, 2000)
    points = np.stack([100.0 * np.sin(angle), 50.0 + 100.0 * np.cos(angle)], axis=1)
    (found,) = Raster.from_stretches([(points, points)], 10.0, 400).outlines()
    assert len(found.holes) == 1
    assert size((found,)) == pytest.approx(math.pi * (110.0**2 - 90.0**2), rel=0.04)
    assert size((Outline(found.border),)) > 0.0 > size((Outline(found.holes[0]),))
    assert np.hypot(found.border[:, 0], found.border[:, 1] - 50.0) == pytest.approx(110.0, abs=1.0)


def test_a_swept_stretch_leaves_no_gap() -> None:
    begin, end = np.array([[0.0, 0.0], [0.0, 50.0]]), np.array([[30.0, 0.0], [10.0, 60.0]])
    assert np.linalg.norm(np.diff(sweep(begin, end, 1.0), axis=0), axis=1).min() < 1.0
    (found,) = Raster.from_stretches([(begin, end)], 2.0, 200).outlines()
    assert not found.holes
    corners = [Point(0.0, 0.0), Point(0.0, 50.0), Point(10.0, 60.0), Point(30.0, 0.0)]
    assert size((found,)) == pytest.approx(abs(area(corners)) + 2.0 * 145.0, rel=0.05)  # and its border, 2 m wide


def test_the_footprint_of_level_flight_is_a_strip_as_wide_as_the_aircraft() -> None:
    found = footprint_of(race(), [straight()])
    assert found.lengths["vacuum"] == pytest.approx(WAY)
    assert found.lengths["level"] == pytest.approx(WAY)
    assert np.all(found.lengths["drag"] < WAY)
    (strip,) = found.falls
    reached = found.drag.place[0, 0] - found.half_span, 4.0 * SPEED + WAY + found.half_span
    assert (strip.border[:, 0].min(), strip.border[:, 0].max()) == pytest.approx(reached, abs=1.5)
    assert np.abs(strip.border[:, 1]).max() == pytest.approx(found.half_span, abs=1.0)


def test_people_under_the_strip_are_hit_while_impacts_lie_on_them() -> None:
    (hit,) = footprint_of(race(standing(WAY + 200.0, 0.0)), [straight()]).crowds
    found = footprint_of(race(), [straight()])
    assert hit.distance == 0.0
    stretch = float(found.lengths["vacuum"][0] - found.lengths["drag"][0])
    long = (20.0 + 2.0 * found.half_span + stretch) / SPEED
    assert hit.seconds == pytest.approx(long, abs=0.05)
    assert hit.overlap == pytest.approx(20.0 * 2.0 * found.half_span, rel=0.1)
    assert hit.straight_seconds > 3.9
    assert hit.turned_seconds == pytest.approx(4.0)


def test_people_beside_the_strip_are_as_far_away_as_they_stand() -> None:
    found = footprint_of(race(standing(300.0, 80.0)), [straight()])
    (beside,) = found.crowds
    assert beside.distance == pytest.approx(70.0 - found.half_span)
    assert beside.seconds == beside.overlap == beside.straight_seconds == 0.0
    (far,) = footprint_of(race(standing(-20_000.0, 0.0)), [straight()]).crowds
    assert far.turned_seconds == 0.0


def measures(found: Footprint) -> list[float]:
    """What does not depend on where the course lies."""
    (one,) = found.crowds
    numbers = [one.distance, one.time, one.seconds, one.straight_seconds, one.turned_seconds]
    return [*numbers, *(float(way.max()) for way in found.lengths.values()), float(found.reach.distance.max())]


@pytest.mark.parametrize(
    "change", [Change(mirror=True), Change(turn=0.7), Change(north=300.0, east=-1200.0)], ids=["mirror", "turn", "move"]
)
def test_a_changed_race_has_the_changed_footprint(change: Change) -> None:
    given = race(standing(350.0, 60.0), wind=StaticWind(math.radians(300.0), 8.0))
    before = footprint_of(given, [straight()])
    after = footprint_of(changed(given, change), [straight(change=change)])
    assert measures(after) == pytest.approx(measures(before), abs=1e-6)
    places = np.array([change.place(*place) for place in before.drag.place.tolist()])
    assert after.drag.place == pytest.approx(places, abs=1e-6)
    assert size(after.falls) == pytest.approx(size(before.falls), rel=0.05)  # the raster does not turn along
    assert size((after.glides,)) == pytest.approx(size((before.glides,)))
    corners = np.array([change.place(*corner) for corner in before.falls[0].border.tolist()])
    nearest = np.linalg.norm(corners[:, None] - after.falls[0].border, axis=-1).min(axis=1)
    assert nearest.max() < 2.0 * (before.raster.cell + after.raster.cell)


def test_wind_moves_the_impacts_downwind_and_the_more_the_larger_the_drag() -> None:
    crosswind = race(wind=StaticWind(math.radians(270.0), 10.0))
    small, large = (footprint_of(crosswind, [straight()], drag_area=area).drag.place[:, 1] for area in (0.5, 5.0))
    assert np.all(small > 0.0)
    assert np.all(small < large)
    assert np.all(large < 10.0 * footprint_of(crosswind, [straight()], drag_area=5.0).drag.time)


def test_several_flights_together_have_the_footprint_of_each_and_nothing_between_them() -> None:
    aside = Change(east=200.0)
    tracks = [straight(), straight(change=aside)]
    both, single = footprint_of(race(standing(350.0, 260.0)), tracks), footprint_of(race(), tracks[:1])
    assert len(both.falls) == 2
    assert size(both.falls) == pytest.approx(2.0 * size(single.falls), rel=0.1)
    (one,) = both.crowds
    assert one.distance == pytest.approx(50.0 - both.half_span)
    assert both.labels == ["straight"] * (2 * len(tracks[0].time))


@pytest.mark.parametrize("given", [{"drag_area": 0.0}, {"drag_area": -1.0}, {"glide_ratio": 500.0}])
def test_numbers_that_no_aircraft_has_are_refused(given: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="is out of range"):
        footprint_of(race(), [straight()], **given)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flown") / "eight.h5"
    airrace.optimize("half_cuban_eight", until="point-mass", search="off", output=path)
    return path


def test_a_loop_that_is_vertical_somewhere_falls_without_a_jump(flown: Path) -> None:
    flight = airrace.open(flown).flight()
    found = footprint_of(flight.race, [Track.from_flight(flight)])
    steps = np.linalg.norm(np.diff(found.vacuum.place, axis=0), axis=1)
    assert steps.max() < 30.0


def test_the_command_tells_falls_and_says_what_it_is_not(flown: Path) -> None:
    said = run("footprint", flown)
    assert said.code == 0
    assert "not the scatter formula of any" in said.out
    assert "the course names no people" in said.out
    answer = run("footprint", flown, "--json", "--glide-ratio", "6").answer
    assert answer["glide_ratio"] == 6.0
    assert answer["crowds"] == []
    assert answer["falls"]["vacuum_farthest_m"] > answer["falls"]["drag_farthest_m"] > 100.0
    assert answer["outlines"]["falls"]


@pytest.mark.parametrize("suffix", ["geojson", "kml", "csv", "png"])
def test_the_command_writes_what_the_name_of_the_file_says(flown: Path, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"eight.{suffix}"
    said = run("footprint", flown, "--output", path, "--origin", "45.08,13.63")
    assert said.code == 0, said.err
    content = path.read_bytes()
    if suffix == "geojson":
        features = json.loads(content)["features"]
        pieces = [one for one in features if one["properties"]["kind"] == "footprint"]
        assert [one["properties"]["name"] for one in pieces] == ["free fall", "glide without power"]
        ring = np.array(pieces[0]["geometry"]["coordinates"][0][0])
        assert ring[0] == pytest.approx(ring[-1])
        assert np.abs(ring - (13.63, 45.08)).max() < 0.05
    elif suffix == "csv":
        table = np.genfromtxt(path, delimiter=",", names=True, skip_header=2, dtype=None, encoding="utf-8")
        ways = np.hypot(table["vacuum_north_m"] - table["north_m"], table["vacuum_east_m"] - table["east_m"])
        assert ways == pytest.approx(table["vacuum_way_m"], abs=1e-6)
    elif suffix == "kml":
        schema = etree.XMLSchema(etree.parse(str(files("pykml") / "schemas" / "kml22gx.xsd")))
        assert schema.validate(etree.fromstring(content)), schema.error_log
        assert content.count(b"<outerBoundaryIs>") >= 2
    else:
        assert content.startswith(b"\x89PNG")


def test_bad_calls_end_with_one_sentence(flown: Path, tmp_path: Path) -> None:
    for words in (
        ["--output", tmp_path / "x.dwg"],
        ["--drag-area", "-1"],
        ["--output", tmp_path / "x.kml"],
        ["--origin", "junk"],
    ):
        said = run("footprint", flown, *words)
        assert said.code == 2
        assert said.err.count("\n") == 1, said.err
