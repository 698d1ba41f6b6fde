"""Places in metres, degrees and from KML."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from language_texts import RICH, TRACK, edited, understood
from pymap3d import ned2geodetic

import airrace
from airrace.errors import InputError, UsageError
from airrace.files.export.globe import features
from airrace.files.inputs import load_inputs
from airrace.model.track.course import Course
from airrace.model.track.gates import Gate, Manoeuvre, Pylon
from airrace.model.track.polygons import Point

PHI, LAMBDA, HEIGHT = 45.08, 13.63, 250.0
ORIGIN = f"origin: {{latitude_deg: {PHI}, longitude_deg: {LAMBDA}, elevation_m: {HEIGHT}}}\n"
METRES = "    north_m: 0\n    east_m: 0\n"


def start(track: str) -> Gate:
    element = understood(track).race.course.passages[0].element
    assert isinstance(element, Gate)
    return element


def start_at(latitude: float, longitude: float) -> Gate:
    degrees = f"    latitude_deg: {latitude:.10f}\n    longitude_deg: {longitude:.10f}\n"
    return start(edited(TRACK, METRES, degrees) + ORIGIN)


@given(st.floats(-30_000, 30_000), st.floats(-30_000, 30_000))
def test_latitude_and_longitude_mean_the_same_place_as_metres_to_a_centimetre(north: float, east: float) -> None:
    down = 0.0
    for _ in range(3):  # at the origin's elevation, so deep below its horizon
        latitude, longitude, height = ned2geodetic(north, east, down, PHI, LAMBDA, HEIGHT)
        down += height - HEIGHT
    gate = start_at(latitude, longitude)
    assert math.hypot(gate.north - north, gate.east - east) < 0.01


def test_a_small_step_north_or_east_follows_the_ellipsoids_radii() -> None:
    """WGS 84: a = 6378137 m, f = 1/298.257223563; radii of curvature of meridian and prime vertical."""
    a, f, phi = 6378137.0, 1 / 298.257223563, math.radians(PHI)
    squared = f * (2 - f)
    prime = a / math.sqrt(1 - squared * math.sin(phi) ** 2)
    meridian = prime * (1 - squared) / (1 - squared * math.sin(phi) ** 2)
    step = math.radians(0.001)
    assert start_at(PHI + 0.001, LAMBDA).north == pytest.approx((meridian + HEIGHT) * step, abs=2e-3)
    assert start_at(PHI, LAMBDA + 0.001).east == pytest.approx((prime + HEIGHT) * math.cos(phi) * step, abs=2e-3)


def test_everything_that_has_a_position_takes_degrees() -> None:
    race = understood(RICH).race
    tower = next(crowd for crowd in race.course.crowd if crowd.name == "tower")
    assert tower.corners[0].north == pytest.approx(-1111.3, abs=0.5)
    assert tower.corners[0].east == pytest.approx(0.0, abs=1e-6)
    assert race.air.thermals[0].north == pytest.approx(555.7, abs=0.5)
    top = understood(edited(RICH, "east_max_m: 900", "latitude_deg: 45.08, longitude_deg: 13.63"))
    dive = next(passage.element for passage in top.race.course.passages if passage.name == "1:dive")
    assert isinstance(dive, Manoeuvre)
    assert Point(dive.north.lower, dive.east.upper) == Point(0.0, 0.0)


ROVINJ = load_inputs("rovinj_2014").race.course


def geojson(course: Course) -> str:
    """What stands on a course, as GeoJSON has it."""
    kinds = {"point": "Point", "line": "LineString", "area": "Polygon"}
    found: list[dict[str, object]] = []
    for one in features(course):
        places: list[object] = [list(place) for place in one.places]
        shapes = {"point": places[0], "line": places, "area": [[*places, places[0]]]}
        geometry = {"type": kinds[one.shape.value], "coordinates": shapes[one.shape.value]}
        found.append({"type": "Feature", "properties": {"name": one.name}, "geometry": geometry})
    return json.dumps({"type": "FeatureCollection", "features": found})


def kml(marks: str) -> str:
    return f'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{marks}</Document></kml>'


def point(name: str, east: float, north: float) -> str:
    """A placemark some metres from 45 N 13 E."""
    place = f"{13.0 + east / 78_850.0:.9f},{45.0 + north / 111_130.0:.9f},0"
    return f"<Placemark><name>{name}</name><Point><coordinates>{place}</coordinates></Point></Placemark>"


def coarse(folder: Path, text: str, name: str = "marks.kml") -> Course:
    (folder / name).write_text(text)
    return load_inputs(airrace.init(folder / "sketched", from_=folder / name, force=True)).race.course


def test_a_course_that_was_drawn_is_sketched_again(tmp_path: Path) -> None:
    course = coarse(tmp_path, geojson(ROVINJ), "rovinj.geojson")
    drawn = list({one.element.name: one.element for one in ROVINJ.passages}.values())
    found = [one.element for one in course.passages]
    first, zero = drawn[0].place, found[0].place
    assert first is not None
    assert zero is not None
    assert len(found) == len(drawn)
    for before, after in zip(drawn, found, strict=True):
        assert type(before) is type(after)
        assert before.place is not None
        assert after.place is not None
        here = [before.place[axis] - first[axis] for axis in (0, 1)]
        assert [after.place[axis] - zero[axis] for axis in (0, 1)] == pytest.approx(here, abs=0.05)
        if isinstance(before, Gate) and isinstance(after, Gate):
            assert after.width == pytest.approx(before.width, abs=0.01)
            assert abs(math.cos(after.heading - before.heading)) == pytest.approx(1.0, abs=1e-4)


def test_two_points_are_a_gate_and_one_is_a_pylon(tmp_path: Path) -> None:
    marks = point("Start right", 6.0, 0.0) + point("Start left", -6.0, 0.0) + point("turn", 60.0, 500.0)
    marks += point("end L", 300.0, 6.0) + point("end R", 300.0, -6.0)
    start, turn, end = (one.element for one in coarse(tmp_path, kml(marks)).passages)
    assert isinstance(start, Gate)
    assert isinstance(end, Gate)
    assert isinstance(turn, Pylon)
    assert start.width == pytest.approx(12.0, abs=0.05)
    assert math.cos(start.heading) > 0.99  # to the north, where the way leads
    assert math.sin(end.heading) > 0.99  # to the east
    assert math.cos(turn.side) > 0.7  # the way turns back to the south: outside is north


def test_hostile_names_stay_names(tmp_path: Path) -> None:
    names = ["&lt;script&gt;", "yes", "a: {b", "x" * 10_000, "]]&gt;", "'"]
    course = coarse(tmp_path, kml("".join(point(name, 0.0, 300.0 * i) for i, name in enumerate(names))))
    assert len(course.passages) == len(names)


def test_a_course_is_copied_or_sketched(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="leave one of them out"):
        airrace.init(tmp_path / "new", like="rovinj_2014", from_="marks.kml")
    with pytest.raises(InputError, match="no such file"):
        airrace.init(tmp_path / "new", from_=tmp_path / "marks.kml")
