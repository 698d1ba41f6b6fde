"""A course sketched from placemarks has its gates where they are drawn, and flies in the direction of the way."""

import json
import math
from pathlib import Path

import pytest

import airrace
from airrace.errors import InputError, UsageError
from airrace.export.globe import features
from airrace.inputs import load_inputs
from airrace.inputs.placemarks import Shape, read_placemarks
from airrace.track.course import Course
from airrace.track.gates import Gate, Pylon

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


def test_areas_are_people_and_airspace(tmp_path: Path) -> None:
    def area(name: str, east: float, size: float) -> str:
        corners = [(east, -size), (east + size, -size), (east + size, size), (east, size), (east, -size)]
        places = " ".join(f"{13.0 + e / 78_850.0:.9f},{45.0 + n / 111_130.0:.9f}" for e, n in corners)
        ring = f"<outerBoundaryIs><LinearRing><coordinates>{places}</coordinates></LinearRing></outerBoundaryIs>"
        return f"<Placemark><name>{name}</name><Polygon>{ring}</Polygon></Placemark>"

    gates = point("a left", -6.0, 0.0) + point("a right", 6.0, 0.0) + point("b", 0.0, 500.0)
    course = coarse(tmp_path, kml(gates + area("North stand", 400.0, 100.0) + area("Airspace", -2000.0, 4000.0)))
    assert [crowd.name for crowd in course.crowd] == ["North_stand"]
    assert len(course.airspace) == 4


def test_waypoints_of_gpx_are_read(tmp_path: Path) -> None:
    path = tmp_path / "marks.gpx"
    path.write_text('<gpx><wpt lat="45" lon="13"><name>a</name></wpt><rte><rtept lat="45.01" lon="13"/></rte></gpx>')
    marks = read_placemarks(path)
    assert [(mark.name, mark.shape, mark.places) for mark in marks] == [
        ("a", Shape.POINT, ((45.0, 13.0),)),
        ("", Shape.POINT, ((45.01, 13.0),)),
    ]


def test_what_is_no_gate_is_told(tmp_path: Path) -> None:
    ends = "<LineString><coordinates>13,45 13.01,45</coordinates></LineString>"
    line = f"<Placemark><name>shore: [x]</name>{ends}</Placemark>"
    coarse(tmp_path, kml(point("a", 0.0, 0.0) + line + point("b", 0.0, 500.0)))
    assert "# not taken over: 'shore: [x]', a line of 2 places" in (tmp_path / "sketched.yaml").read_text()


def test_hostile_names_stay_names(tmp_path: Path) -> None:
    names = ["&lt;script&gt;", "yes", "a: {b", "x" * 10_000, "]]&gt;", "'"]
    course = coarse(tmp_path, kml("".join(point(name, 0.0, 300.0 * i) for i, name in enumerate(names))))
    assert len(course.passages) == len(names)


@pytest.mark.parametrize(
    ("text", "name", "said"),
    [
        ("<kml/>", "a.kml", "holds no placemarks"),
        ("<kml>", "a.kml", "is no XML"),
        ('<!DOCTYPE kml [<!ENTITY a "b">]><kml/>', "a.kml", "holds a document type"),
        (kml(point("a", 0.0, 0.0)), "a.kml", "holds no two gates or pylons"),
        ("{", "a.geojson", "is neither KML, GPX nor GeoJSON"),
        ('{"type": "FeatureCollection", "features": [3]}', "a.geojson", "is no GeoJSON as RFC 7946 has it"),
        ('{"type": "Feature", "geometry": {"type": "Point", "coordinates": [13, 95]}}', "a.geojson", "95, 13 is no"),
        ('<gpx><wpt lat="north" lon="13"/></gpx>', "a.gpx", "`north, 13` is no latitude and longitude"),
    ],
)
def test_files_that_hold_no_course_are_refused(tmp_path: Path, text: str, name: str, said: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        airrace.init(tmp_path / "new", from_=tmp_path / name)
    assert said in str(caught.value)
    assert not (tmp_path / "new.yaml").exists()


def test_a_course_is_copied_or_sketched(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="leave one of them out"):
        airrace.init(tmp_path / "new", like="rovinj_2014", from_="marks.kml")
    with pytest.raises(InputError, match="no such file"):
        airrace.init(tmp_path / "new", from_=tmp_path / "marks.kml")
