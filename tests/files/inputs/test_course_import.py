"""Courses from placemarks: everything is recognised, or told as a guess or as not taken over."""

import codecs
import io
import json
import math
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.course_words import Subject, subject_in, words_of
from airrace.files.inputs.placemarks import Placemark, PlacemarkShape, read_placemarks
from airrace.model.track.course import Course, CrowdShape
from airrace.model.track.gates import Gate, Pylon
from airrace.model.track.polygons import area
from airrace.runs.courses import CourseFile, begin_course

Places = Sequence[tuple[float, float]]
"""Metres east and north of 45 N 13 E."""
GATES = (("Start left", [(-6.0, 0.0)]), ("Start right", [(6.0, 0.0)]), ("Gate 2", [(-6.0, 500.0), (6.0, 500.0)]))
ALL_AROUND = [(-900.0, -900.0), (900.0, -900.0), (900.0, 900.0), (-900.0, 900.0)]


def degrees(places: Places) -> list[list[float]]:
    return [[13.0 + east / 78_846.8, 45.0 + north / 111_131.7] for east, north in places]


def geometry(places: Places, *, area: bool = False) -> dict[str, object]:
    found = degrees(places)
    if area:
        return {"type": "Polygon", "coordinates": [[*found, found[0]]]}
    return (
        {"type": "LineString", "coordinates": found} if len(found) > 1 else {"type": "Point", "coordinates": found[0]}
    )


def feature(name: str, shape: object, key: str = "name", **properties: object) -> dict[str, object]:
    return {"type": "Feature", "properties": {key: name, **properties}, "geometry": shape}


def gates() -> list[dict[str, object]]:
    return [feature(name, geometry(places)) for name, places in GATES]


def sketch(folder: Path, features: Sequence[object]) -> tuple[CourseFile, Course]:
    (folder / "marks.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return sketch_file(folder, "marks.geojson")


def sketch_file(folder: Path, name: str) -> tuple[CourseFile, Course]:
    written = begin_course(folder / "sketched", from_=folder / name, yes=True, force=True)
    return written, load_inputs(written.path).race.course


def told(written: CourseFile) -> list[tuple[str, str]]:
    """What placemarks are taken as, without what every sketch guesses: elevation, rules, and the sides of pylons."""
    told_ = [(one.name, one.taken_as) for one in written.remarks if one.name not in ("origin", "rules")]
    return [(name, taken) for name, taken in told_ if not taken.startswith("passed on its side")]


def kml(marks: str) -> str:
    return f'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{marks}</Document></kml>'


def mark(name: str, places: Places, tag: str = "LineString", beside: str = "") -> str:
    text = " ".join(f"{east:.9f},{north:.9f},0" for east, north in degrees(places))
    return f"<Placemark><name>{name}</name>{beside}<{tag}><coordinates>{text}</coordinates></{tag}></Placemark>"


@pytest.mark.parametrize(
    ("name", "subject"),
    [
        ("Crowd line A", Subject.CROWD),
        ("Tribune level 1", Subject.CROWD),
        ("Vertical mast", Subject.OBSTACLE),
        ("Level 3", Subject.ELEMENT),
        ("safety-line", Subject.SAFETY_LINE),
        ("SafetyLine", Subject.SAFETY_LINE),
        ("no_fly_line", Subject.SAFETY_LINE),
        ("Race airspace", Subject.AIRSPACE),
        ("Obstacle: crane", Subject.OBSTACLE),
        ("Radio mast", Subject.OBSTACLE),
        ("Gate at the mast", Subject.ELEMENT),
        ("Pylon 3", Subject.ELEMENT),
        ("Standby boat", None),
        ("Startled duck", None),
        ("", None),
    ],
)
def test_whole_words_tell_what_a_placemark_is(name: str, subject: Subject | None) -> None:
    assert subject_in(name) is subject


def test_short_names_are_those_of_elements_but_words_come_first() -> None:
    names = ("g4", "P 12", "7", "wp3a", "c", "quay", "vip")
    found = {name: Placemark(name, PlacemarkShape.POINT).named_subject for name in names}
    assert found == dict.fromkeys(("g4", "P 12", "7", "wp3a", "c"), Subject.ELEMENT) | {
        "quay": None,
        "vip": Subject.CROWD,
    }
    assert words_of("g1_left") == words_of("g1Left") == words_of("G1 left") == ["g", "1", "left"]


@pytest.mark.parametrize("form", ["{} left/{} right", "{}_left/{}_right", "{}L/{}R", "{}-l/{}-r", "left {}/right {}"])
def test_names_of_the_two_sides_make_a_gate(tmp_path: Path, form: str) -> None:
    left, right = form.split("/")
    features = [
        feature(side.format(name), geometry([(east, north)]))
        for name, north in (("g1", 0.0), ("g2", 500.0))
        for side, east in ((right, 6.0), (left, -6.0))
    ]
    written, course = sketch(tmp_path, features)
    for passage in course.passages:
        gate = passage.element
        assert isinstance(gate, Gate)
        assert gate.width == pytest.approx(12.0, abs=0.05)
        assert math.cos(gate.heading) > 0.999  # to the north, as left and right say
    assert [one.element.name for one in course.passages] == ["g1", "g2"]
    assert told(written) == []


def test_left_and_right_alone_pair_in_their_order(tmp_path: Path) -> None:
    features = [
        feature(side, geometry([(east, north)]))
        for north in (0.0, 500.0)
        for side, east in (("left", -6.0), ("right", 6.0))
    ]
    _, course = sketch(tmp_path, features)
    assert [one.element.place[0] for one in course.passages if one.element.place] == pytest.approx(
        [0.0, 500.0], abs=0.5
    )


def test_a_side_without_its_other_and_one_that_stands_far_off_are_reported(tmp_path: Path) -> None:
    alone = [feature("g3 left", geometry([(50.0, 900.0)]))]
    far = [feature("g4 left", geometry([(0.0, 1200.0)])), feature("g4 right", geometry([(90.0, 1200.0)]))]
    written, course = sketch(tmp_path, [*gates(), *alone, *far])
    assert [type(one.element) for one in course.passages] == [Gate, Gate, Pylon, Pylon, Pylon]
    assert told(written) == [(name, "a single pylon") for name in ("g3 left", "g4 left", "g4 right")]


def test_a_gate_flown_against_its_sides_is_reported(tmp_path: Path) -> None:
    back = [feature("g3 left", geometry([(-6.0, 200.0)])), feature("g3 right", geometry([(6.0, 200.0)]))]
    written, _ = sketch(tmp_path, [*gates(), *back])  # from 500 m back to 200 m, to the south
    assert told(written) == [("g3", "a gate")]


def test_people_lines_and_airspace_are_taken_over_without_a_guess(tmp_path: Path) -> None:
    around = [
        feature("Crowd line", geometry([(300.0, 0.0), (300.0, 400.0), (350.0, 600.0)])),
        feature("Spectators", geometry([(-400.0, 300.0)])),
        feature("Safety line", geometry([(150.0, -100.0), (150.0, 700.0)])),
        feature("Airspace", geometry(ALL_AROUND, area=True)),
    ]
    written, course = sketch(tmp_path, [*around, *gates()])
    assert told(written) == []
    assert {one.name: one.shape for one in course.crowd} == {
        "Crowd_line": CrowdShape.LINE,
        "Spectators": CrowdShape.POINT,
    }
    assert len(course.airspace) == 4
    (line,) = course.safety_lines
    assert not line.keep_right  # northbound, the gates stand to the left of it
    assert line.end.north - line.start.north == pytest.approx(800.0, abs=0.5)
    assert all(one.safety_lines for one in course.passages[1:])


def test_a_line_is_kept_from_the_side_on_which_it_was_drawn_the_other_way(tmp_path: Path) -> None:
    _, course = sketch(tmp_path, [*gates(), feature("Safety line", geometry([(150.0, 700.0), (150.0, -100.0)]))])
    assert course.safety_lines[0].keep_right


def test_a_bent_safety_line_is_one_along_every_stretch(tmp_path: Path) -> None:
    written, course = sketch(
        tmp_path, [*gates(), feature("Safety line", geometry([(150.0, 0.0), (150.0, 600.0), (-200.0, 650.0)]))]
    )
    assert [line.keep_right for line in course.safety_lines] == [False, False]
    assert [taken for _, taken in told(written)] == [
        f"a safety line along its stretch {n}, without ends" for n in (1, 2)
    ]


def test_a_line_with_elements_on_both_sides_holds_on_the_legs_beside_it(tmp_path: Path) -> None:
    beyond = [feature("g3", geometry([(400.0, 700.0)])), feature("g4", geometry([(0.0, 900.0)]))]
    written, course = sketch(
        tmp_path, [*gates(), *beyond, feature("Safety line", geometry([(150.0, 0.0), (150.0, 600.0)]))]
    )
    assert [len(one.safety_lines) for one in course.passages] == [0, 1, 0, 0]
    assert told(written) == [("Safety line", "a safety line on 1 of 3 legs")]


def test_what_no_name_tells_is_guessed_or_dropped_and_reported(tmp_path: Path) -> None:
    unknown = [
        feature("Yachts", geometry([(-400.0, 0.0), (-300.0, 0.0), (-300.0, 100.0)], area=True)),
        feature("Sector 7b", geometry(ALL_AROUND, area=True)),
        feature("Windsock", geometry([(60.0, 60.0)])),
        feature("Quay wall", geometry([(200.0, 0.0), (200.0, 300.0)])),
        feature("Jetty", geometry([(-6.0, 800.0), (6.0, 800.0)])),
        feature("Airspace", geometry([(0.0, 0.0)])),
        {"type": "Feature", "properties": {"name": "Nowhere"}, "geometry": None},
    ]
    written, course = sketch(tmp_path, [*gates(), *unknown])
    assert [one.element.name for one in course.passages] == ["Start", "Gate_2", "Jetty"]
    assert [one.name for one in course.crowd] == ["Yachts"]
    assert dict(told(written)) == {
        "Yachts": "people",
        "Sector 7b": "the airspace",
        "Windsock": "",
        "Quay wall": "",
        "Jetty": "a gate",
        "Airspace": "",
        "Nowhere": "",
    }
    text = written.path.read_text()
    assert all(f"# {one.text}\n" in text for one in written.remarks)
    listed = written.as_object()
    assert [len(listed["guessed"]), len(listed["not_taken_over"])] == [5, 4]  # elevation and rules are guessed, too


def test_obstacles_are_as_high_as_their_names_tell(tmp_path: Path) -> None:
    places = [(200.0, 0.0), (240.0, 0.0), (240.0, 30.0), (200.0, 30.0)]
    turned = [(0.8 * east - 0.6 * north, 0.6 * east + 0.8 * north) for east, north in places]
    things = [
        feature("Obstacle lighthouse 40 m", geometry([(300.0, 300.0)])),
        feature("Crane 100 ft", geometry([(300.0, 400.0)])),
        feature("Mast", geometry([(300.0, 500.0)])),
        feature("Building 12 m", geometry(turned, area=True)),
        feature("Power line 30 m", geometry([(-300.0, 0.0), (-300.0, 200.0), (-400.0, 200.0)])),
    ]
    written, course = sketch(tmp_path, [*gates(), *things])
    heights = {one.name: one.height for one in course.obstacles}
    lines = {"Power_line_30_m": 30.0, "Power_line_30_m_2": 30.0}
    assert (
        heights == {"Obstacle_lighthouse_40_m": 40.0, "Crane_100_ft": 30.5, "Mast": 50.0, "Building_12_m": 12.0} | lines
    )
    assert area(course.obstacles[3].corners) == pytest.approx(1200.0, rel=0.01)
    assert area(course.obstacles[4].corners) == pytest.approx(400.0, rel=0.01)
    assert [name for name, _ in told(written)] == ["Mast", "Building 12 m", "Power line 30 m"]


def test_more_than_a_course_has_room_for_is_dropped_and_reported(tmp_path: Path) -> None:
    """The file that is written is one that can be read."""
    corners = [(400.0 + 60.0 * (n % 2), 100.0 * n) for n in range(40)]
    wires = [feature(f"Power line {n} 20 m", geometry([(e + 300.0 * n, m) for e, m in corners])) for n in range(2)]
    people = [feature(f"Crowd {n}", geometry([(-500.0, 50.0 * n)])) for n in range(21)]
    lines = [
        feature(f"Safety line {n}", geometry([(300.0 + 50.0 * n + m % 2 * 5.0, 20.0 * m) for m in range(41)]))
        for n in range(3)
    ]
    written, course = sketch(tmp_path, [*gates(), *wires, *people, *lines])
    counts = len(course.obstacles), len(course.crowd), len(course.safety_lines)
    assert counts == (39, 20, 80)
    assert [name for name, taken in told(written) if not taken] == ["Power line 1 20 m", "Crowd 20", "Safety line 2"]


def test_obstacles_are_no_higher_or_longer_than_a_course_allows(tmp_path: Path) -> None:
    things = [
        feature("Tower 1200 m", geometry([(300.0, 300.0)])),
        feature("Tank 0 m", geometry([(300.0, 400.0)])),
        feature("Power line 20 m", geometry([(400.0, 0.0), (400.0, 5100.0)])),
        feature("Bridge 20 m", geometry([(500.0, 0.0), (560.0, 5100.0), (600.0, 0.0)], area=True)),
    ]
    written, course = sketch(tmp_path, [*gates(), *things])
    assert {one.name: one.height for one in course.obstacles} == {"Tower_1200_m": 1000.0, "Tank_0_m": 0.1}
    assert dict(told(written)) == {
        "Tower 1200 m": "an obstacle 1000 m high",
        "Tank 0 m": "an obstacle 0.1 m high",
        "Power line 20 m": "",
        "Bridge 20 m": "",
    }


def test_an_export_of_airrace_is_the_course_again_without_its_flights(tmp_path: Path) -> None:
    """What a passing is called looks like a gate's name; its kind tells better."""
    marks = [
        feature("1:g2 4.2 s", geometry([(0.0, 500.0)]), kind="passing"),
        feature("1:3", geometry([(0.0, 520.0)]), kind="passing"),
        feature("north", geometry([(300.0, 300.0)]), kind="obstacle", note="80 m high, keep the wing 10 m away"),
    ]
    written, course = sketch(tmp_path, [*gates(), *marks])
    assert len(course.passages) == 2
    assert [one.height for one in course.obstacles] == [80.0]
    assert told(written) == [("1:g2 4.2 s", ""), ("1:3", ""), ("north", "an obstacle")]


def test_points_without_a_word_are_pylons_where_no_other_has_one(tmp_path: Path) -> None:
    written, course = sketch(tmp_path, [feature(f"{n} buoy", geometry([(0.0, 300.0 * n)])) for n in range(3)])
    assert len(course.passages) == 3
    assert [taken for _, taken in told(written)] == ["a pylon of the race"] * 3


def test_parts_of_multi_geometries_are_read(tmp_path: Path) -> None:
    lines = {"type": "MultiLineString", "coordinates": [degrees([(-6.0, n), (6.0, n)]) for n in (0.0, 400.0)]}
    pair = {"type": "MultiPoint", "coordinates": degrees([(-6.0, 800.0), (6.0, 800.0)])}
    points = {"type": "MultiPoint", "coordinates": degrees([(40.0, n) for n in (1000.0, 1200.0, 1400.0)])}
    rings = [
        [[*degrees(ring), degrees(ring)[0]]]
        for ring in ([(400.0, n), (500.0, n), (500.0, n + 50.0)] for n in (0.0, 200.0))
    ]
    areas = {"type": "MultiPolygon", "coordinates": rings}
    written, course = sketch(
        tmp_path, [feature("g1", lines), feature("g3", pair), feature("p", points), feature("Public", areas)]
    )
    assert [type(one.element) for one in course.passages] == [Gate] * 3 + [Pylon] * 3
    assert [one.shape for one in course.crowd] == [CrowdShape.AREA] * 2
    assert told(written) == []


@pytest.mark.parametrize("key", ["Name", "NAME", "title", "Label"])
def test_names_are_found_whatever_the_attribute_is_called(tmp_path: Path, key: str) -> None:
    _, course = sketch(tmp_path, [feature(name, geometry(places), key) for name, places in GATES])
    assert [one.element.name for one in course.passages] == ["Start", "Gate_2"]


def test_what_stands_beside_a_name_helps_and_is_reported(tmp_path: Path) -> None:
    written, course = sketch(
        tmp_path, [*gates(), feature("North", geometry([(300.0, 0.0), (300.0, 100.0)]), kind="crowd")]
    )
    assert [one.name for one in course.crowd] == ["North"]
    assert told(written) == [("North", "people")]


def test_folders_and_lost_parts_of_kml_are_reported(tmp_path: Path) -> None:
    hole = "".join(f"{east},{north} " for east, north in degrees([(310.0, 10.0), (320.0, 10.0), (320.0, 20.0)]))
    ring = "".join(f"{east},{north} " for east, north in degrees([(300.0, 0.0), (400.0, 0.0), (400.0, 100.0)]))
    area = (
        "<Placemark><name>Stand</name><Polygon><outerBoundaryIs><LinearRing><coordinates>"
        f"{ring}</coordinates></LinearRing></outerBoundaryIs><innerBoundaryIs><LinearRing><coordinates>{hole}"
        "</coordinates></LinearRing></innerBoundaryIs></Polygon></Placemark>"
    )
    marks = (
        "".join(mark(name, places, "Point" if len(places) == 1 else "LineString") for name, places in GATES)
        + f"<Folder><name>Spectators</name>{mark('West', [(-300.0, 0.0), (-300.0, 99.0)])}</Folder>"
        + area
        + "<NetworkLink><name>more</name></NetworkLink><Placemark><name>empty</name></Placemark>"
        + mark("Airspace", [*ALL_AROUND, ALL_AROUND[0]])  # a closed line
    )
    (tmp_path / "marks.kml").write_text(kml(marks))
    written, course = sketch_file(tmp_path, "marks.kml")
    assert {one.name for one in course.crowd} == {"West", "Stand"}
    assert len(course.airspace) == 4
    assert dict(told(written)) == {"Stand, a hole": "", "more": "", "empty": "", "West": "people"}


def test_kmz_is_the_kml_in_it(tmp_path: Path) -> None:
    text = kml("".join(mark(name, places, "Point" if len(places) == 1 else "LineString") for name, places in GATES))
    (tmp_path / "marks.kml").write_text(text)
    with zipfile.ZipFile(tmp_path / "marks.kmz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("files/icon.png", b"")
        archive.writestr("doc.kml", text)
    assert read_placemarks(tmp_path / "marks.kmz") == read_placemarks(tmp_path / "marks.kml")


def test_routes_and_tracks_of_gpx_are_read(tmp_path: Path) -> None:
    def points(tag: str, places: Places, named: str = "") -> str:
        name = f"<name>{named}</name>" if named else ""
        return "".join(f'<{tag} lat="{north}" lon="{east}">{name}</{tag}>' for east, north in degrees(places))

    track = f"<trk><name>Flight 3</name><trkseg>{points('trkpt', [(0.0, n) for n in range(9)])}</trkseg></trk>"
    (tmp_path / "marks.gpx").write_text(
        f"<gpx>{points('wpt', [(0.0, 0.0)], 'P1')}<rte>{points('rtept', [(90.0, 500.0), (0.0, 900.0)])}</rte>"
        f"<rte><name>Safety line</name>{points('rtept', [(200.0, 0.0), (200.0, 900.0)])}</rte>{track}</gpx>"
    )
    written, course = sketch_file(tmp_path, "marks.gpx")
    assert len(course.passages) == 3
    assert [line.name for line in course.safety_lines] == ["Safety_line"]
    assert ("Flight 3", "") in told(written)


FAULTY = {
    "people at a gate": feature("spectators", geometry([(20.0, 480.0), (50.0, 520.0), (20.0, 520.0)], area=True)),
    "a dent": feature("airspace", geometry([*ALL_AROUND[:2], (-800.0, 0.0), *ALL_AROUND[2:]], area=True)),
    "a border that crosses itself": feature("crowd", geometry([ALL_AROUND[i] for i in (0, 2, 1, 3)], area=True)),
    "a mast in a gate": feature("mast 60 m", geometry([(3.0, 505.0)])),
    "a gate too narrow": feature("Gate 3", geometry([(-2.0, 900.0), (2.0, 900.0)])),
    "a gate too far away": feature("Gate 3", geometry([(-6.0, 90_000.0), (6.0, 90_000.0)])),
    "a line without length": feature("safety line", geometry([(90.0, 500.0), (90.0, 500.005)])),
}


@pytest.mark.parametrize("placemark", FAULTY.values(), ids=FAULTY.keys())
def test_what_check_refuses_of_a_sketch_is_reported_when_it_is_written(tmp_path: Path, placemark: object) -> None:
    (tmp_path / "marks.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": [*gates(), placemark]})
    )
    written = begin_course(tmp_path / "sketched", from_=tmp_path / "marks.geojson")
    with pytest.raises(InputError) as refused:
        load_inputs(written.path)
    assert [one.message for one in written.faults] == [one.message for one in refused.value.findings]
    assert [task.split(": ")[1] for task in written.tasks] == [one.key for one in refused.value.findings]
    listed = written.path.read_text().splitlines()[-len(written.tasks) :]
    assert listed == [f"# {task}" for task in written.tasks]
    assert len(written.as_object()["to_put_right"]) == len(written.tasks)
    shown = CliRunner().invoke(app, ["init", str(tmp_path / "again"), "--from", str(tmp_path / "marks.geojson")])
    assert shown.exit_code == 0
    assert written.tasks[0].partition(":")[0] in shown.output
    assert "refuses it" in shown.output
    whole, _ = sketch(tmp_path, gates())
    assert whole.tasks == ()


def archive_of(name: str, content: bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        archive.writestr(name, content)
    return file.getvalue()


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_an_archive_with_any_byte_flipped_is_read_or_refused(tmp_path: Path, method: int) -> None:
    text = kml("".join(mark(name, places, "Point" if len(places) == 1 else "LineString") for name, places in GATES))
    whole, path, refused = archive_of("doc.kml", text.encode(), method), tmp_path / "marks.kmz", 0
    for index in range(len(whole)):
        path.write_bytes(whole[:index] + bytes([whole[index] ^ 0xFF]) + whole[index + 1 :])
        try:
            read_placemarks(path)
        except InputError:
            refused += 1
    assert refused > len(whole) // 2


NO_COURSES: dict[str, tuple[bytes, str]] = {
    "no document in an archive": (archive_of("readme.txt", b""), "is an archive without a KML document"),
    "a damaged archive": (archive_of("doc.kml", b"<kml/>")[:40], "is a damaged archive"),
    "LZMA": (archive_of("doc.kml", b"<kml/>", zipfile.ZIP_LZMA), "neither stored nor deflated (method 14); pack it"),
    "BZIP2": (archive_of("doc.kml", b"<kml/>", zipfile.ZIP_BZIP2), "neither stored nor deflated (method 12); pack it"),
    "too large": (archive_of("doc.kml", b"<kml>" + b" " * 3_000_000), "is too large unpacked"),
    "too deep": (b"<kml>" + b"<Folder>" * 5_000 + b"</Folder>" * 5_000 + b"</kml>", "elements within elements"),
    "encoding": (
        b'<?xml version="1.0" encoding="foo"?><kml/>',
        "declares an encoding that is not read; save it as UTF-8",
    ),
    "damaged UTF-16": (codecs.BOM_UTF16_LE + "<kml/>".encode("utf-16-le")[:-1], "is damaged UTF-16"),
    "no placemarks": (b"<kml/>", "holds no placemarks"),
    "no XML": (b"<kml>", "is no XML"),
    "document type": (b'<!DOCTYPE kml [<!ENTITY a "b">]><kml/>', "holds a document type"),
    "one point": (kml(mark("a", [(0.0, 0.0)], "Point")).encode(), "holds no two gates or pylons"),
    "no geometry": (b'{"type": "Feature", "properties": {}, "geometry": null}', "holds no placemarks"),
    "no coordinates": (b'{"type": "MultiPoint", "coordinates": 3}', "is no GeoJSON as RFC 7946 has it"),
    "no feature": (b'{"type": "FeatureCollection", "features": [3]}', "is no GeoJSON as RFC 7946 has it"),
    "no JSON": (b"{", "is neither KML, GPX nor GeoJSON"),
    "no latitude": (b'{"type": "Feature", "geometry": {"type": "Point", "coordinates": [13, 95]}}', "95, 13 is no"),
    "no number": (b'<gpx><wpt lat="north" lon="13"/></gpx>', "`north, 13` is no latitude and longitude"),
    "a log": (
        b"$GPRMC,135954.00,A,4505.04,N,01337.41,E,199.22,67.27,130414,,,R*6C\n",
        "this is NMEA, the sentences of a receiver; `airrace import",
    ),
}


@pytest.mark.parametrize("kind", NO_COURSES)
def test_files_that_hold_no_course_are_refused_and_nothing_is_written(tmp_path: Path, kind: str) -> None:
    content, words = NO_COURSES[kind]
    (tmp_path / "marks").write_bytes(content)
    with pytest.raises(InputError) as refused:
        begin_course(tmp_path / "new", from_=tmp_path / "marks")
    assert words in str(refused.value)
    assert not (tmp_path / "new.yaml").exists()


def test_pylons_of_a_slalom_are_passed_in_turns_and_others_outside(tmp_path: Path) -> None:
    """Sides are square to the way: in a straight row each is the other one, a turn behind it changes none."""
    row = [feature(f"Pylon {n}", geometry([(0.0, 700.0 + 200.0 * n)])) for n in range(1, 5)]
    turn = [feature("Pylon 9", geometry([(400.0, 2000.0)])), feature("Gate 10", geometry([(806.0, 0.0), (794.0, 0.0)]))]
    written, course = sketch(tmp_path, [*gates(), *row, *turn])
    sides = {
        passage.element.name: math.degrees(passage.element.passing_side or 0.0) % 360.0
        for passage in course.passages
        if isinstance(passage.element, Pylon)
    }
    assert [sides[f"Pylon_{n}"] for n in range(1, 4)] == pytest.approx([90.0, 270.0, 90.0], abs=1.0)
    assert math.cos(math.radians(sides["Pylon_9"])) > 0.5  # away from the inside of the turn, to the north
    guessed = {remark.name: remark.reason for remark in written.remarks if remark.taken_as.startswith("passed on")}
    assert guessed["Pylon_2"] == "pylons of a straight row are passed in turns"
    assert guessed["Pylon_9"] == "that is the outside of the turn"


def test_a_start_that_is_the_finish_and_a_knife_edge_are_known_by_their_names(tmp_path: Path) -> None:
    names = ("START / FINISH", "Gate 2 (knife edge)", "Gate 3")
    lines = [feature(name, geometry([(-6.0, 400.0 * n), (6.0, 400.0 * n)])) for n, name in enumerate(names)]
    written, course = sketch(tmp_path, lines)
    assert course.passages[0].element.name == course.passages[-1].element.name
    assert course.passages[1].element.prescribed_bank == pytest.approx(math.pi / 2.0)
    assert ("START_FINISH", "start and finish") in told(written)
