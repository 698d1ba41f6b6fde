"""Airspace as OpenAir and waypoints as SeeYou CUP: what they draw is what the course holds, and faults have a line."""

import math
from pathlib import Path

import pytest

from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.course_words import Subject
from airrace.files.inputs.openair import read_openair
from airrace.files.inputs.placemarks import PlacemarkShape, read_placemarks
from airrace.files.inputs.seeyou import read_cup
from airrace.model.track.course import Course
from airrace.model.track.gates import Gate, Pylon
from airrace.runs.courses import CourseFile, begin_course

CENTRE = (45.09, 13.63)
MILE = 1.0 / 60.0
"""A nautical mile in degrees of latitude, about."""


def sketch(folder: Path, name: str, text: str) -> tuple[CourseFile, Course]:
    (folder / name).write_text(text)
    written = begin_course(folder / "sketched", from_=folder / name, force=True)
    return written, load_inputs(written.path).race.course


def airspace(*records: str, kind: str = "R") -> str:
    return "\n".join(["* by hand", f"AC {kind}", "AN RACE 1", "AL GND", "AH 1500 ft", *records]) + "\n"


def distance(place: tuple[float, float]) -> float:
    """From the centre, nautical miles."""
    north, east = place[0] - CENTRE[0], (place[1] - CENTRE[1]) * math.cos(math.radians(CENTRE[0]))
    return math.hypot(north, east) / MILE


def azimuth(place: tuple[float, float]) -> float:
    north, east = place[0] - CENTRE[0], (place[1] - CENTRE[1]) * math.cos(math.radians(CENTRE[0]))
    return math.degrees(math.atan2(east, north)) % 360.0


X = "V X=45:05:24 N 013:37:48 E"


def test_a_circle_has_its_radius_all_around() -> None:
    (circle,) = read_openair("a.txt", airspace(X, "DC 2"))
    assert [distance(corner) for corner in circle.corners] == pytest.approx([2.0] * 37, rel=2e-3)
    assert (circle.name, circle.floor, circle.ceiling) == ("RACE 1", "GND", "1500 ft")


@pytest.mark.parametrize("turn", ["+", "-"])
def test_an_arc_turns_the_way_that_is_stated(turn: str) -> None:
    """From north to east: a quarter clockwise, three quarters the other way."""
    (arc,) = read_openair("a.txt", airspace(X, f"V D={turn}", "DA 1.5, 0, 90"))
    angles = [azimuth(corner) for corner in arc.corners]
    assert len(angles) == (10 if turn == "+" else 28)
    assert (angles[0] % 360.0, angles[-1]) == (pytest.approx(0.0, abs=1e-6), pytest.approx(90.0))
    assert angles[len(angles) // 2] == pytest.approx(45.0 if turn == "+" else 225.0, abs=6.0)
    ends = "DB 45:06:54 N 013:37:48 E, 45:05:24 N 013:39:55 E"
    (between,) = read_openair("a.txt", airspace(X, f"V D={turn}", ends))
    assert between.corners[0] == (45.115, 13.63)
    assert len(between.corners) == len(arc.corners)


def test_spellings_of_a_place_are_the_same() -> None:
    texts = ("45:05:24 N 013:37:48 E", "45:05.4N 013:37.8E", "45.09 N 13.63 E", "45:05:24N, 013:37:48E")
    for text in texts:
        (point,) = read_openair("a.txt", airspace(f"DP {text}"))
        assert point.corners == [pytest.approx(CENTRE)]


@pytest.mark.parametrize(
    ("record", "message"),
    [
        ("DC 45:04:54.43 N 013:38:31.86 E", "is not OpenAir: expected `DC RADIUS_NM`"),
        ("DP 45:04:54.43 N", "is not OpenAir: expected `DP 45:04:54 N 013:37:36 E`"),
        ("DC 1.0", "has no centre: expected `V X=` before it"),
        ("DA 1.0, 20", "is not OpenAir: expected `DA RADIUS_NM, BEGIN_DEG, END_DEG`"),
    ],
)
def test_a_record_that_is_none_is_refused_with_its_line(record: str, message: str) -> None:
    text = airspace(record) if "centre" in message else airspace(record, X)
    if record.startswith("DA"):
        text = airspace(X, record)
    with pytest.raises(InputError) as refused:
        read_openair("a.txt", text)
    (finding,) = refused.value.findings
    assert message in finding.message
    assert finding.line == (7 if record.startswith("DA") else 6)


def test_a_restricted_area_becomes_the_airspace_and_a_control_zone_does_not(tmp_path: Path) -> None:
    square = [f"DP {lat} N {lon} E" for lat, lon in ((45.08, 13.62), (45.10, 13.62), (45.10, 13.65), (45.08, 13.65))]
    zone = "AC CTR\nAN TOWN\nV X=45.2 N 13.7 E\nDC 5.0\nDC 6.0\n"
    written, course = sketch(tmp_path, "area.txt", airspace(*square) + zone)
    assert len(course.airspace) == 4
    taken = {remark.name: (remark.taken_as, remark.reason) for remark in written.remarks}
    assert taken["TOWN"] == ("", "airspace of the class CTR, no race area")
    assert "GND to 1500 ft" in taken["RACE 1"][1]
    assert taken["start, finish"][0] == "a course to begin with"
    assert written.tasks == ()


CUP = """name,code,country,lat,lon,elev,style,rwdir,rwlen,freq,desc
"Field","F",HR,4505.000N,01338.000E,12.0m,5,090,800m,"123.4",""
"Gate 2 left","G2L",HR,4505.300N,01337.800E,40ft,1,,,,""
"Start left","SL",HR,4505.040N,01337.800E,12.0m,1,,,,""
"Start right","SR",HR,4505.040N,01337.808E,12.0m,1,,,,""
"Gate 2 right","G2R",HR,4505.300N,01337.808E,12.0m,1,,,,""
"Pylon 3","P3",HR,4505.500N,01338.200E,12.0m,1,,,,""
"Crowd 1","C1",HR,4505.000N,01336.900E,12.0m,1,,,,""
"Crowd 2","C2",HR,4505.500N,01336.900E,12.0m,1,,,,""
"Border 1","B1",HR,4504.500N,01336.800E,12.0m,1,,,,""
"Border 2","B2",HR,4506.000N,01336.800E,12.0m,1,,,,""
"Border 3","B3",HR,4506.000N,01339.000E,12.0m,1,,,,""
"Border 4","B4",HR,4504.500N,01339.000E,12.0m,1,,,,""
"Radio","R",HR,4505.100N,01338.900E,12.0m,8,,,,"60 m"
-----Related Tasks-----
"Race","Start left","Start right","Gate 2 left","Gate 2 right","Pylon 3"
Options,NoStart=12:00:00
"""


def test_waypoints_become_the_course_that_their_names_say(tmp_path: Path) -> None:
    written, course = sketch(tmp_path, "race.cup", CUP)
    elements = {passage.element.name: passage.element for passage in course.passages}
    assert list(elements) == ["Start", "Gate_2", "Pylon_3"]
    assert isinstance(elements["Gate_2"], Gate)
    assert isinstance(elements["Pylon_3"], Pylon)
    assert [len(crowd.corners) for crowd in course.crowd] == [2]
    assert len(course.airspace) == 4
    assert [(obstacle.name, obstacle.height) for obstacle in course.obstacles] == [("Radio", 60.0)]
    assert course.origin.elevation == 12.0
    assert ("Field", "") in [(remark.name, remark.taken_as) for remark in written.remarks]


def test_a_task_orders_the_waypoints_and_places_have_their_sides() -> None:
    waypoints = read_cup("race.cup", CUP)
    assert [waypoint.name for waypoint in waypoints[:3]] == ["Start left", "Start right", "Gate 2 left"]
    assert (waypoints[0].latitude, waypoints[0].longitude) == (pytest.approx(45.084), pytest.approx(13.63))
    assert waypoints[2].elevation == pytest.approx(12.192)
    south_west = CUP.replace("4505.040N,01337.800E", "4505.040S,01337.800W")
    assert (read_cup("race.cup", south_west)[0].latitude, read_cup("race.cup", south_west)[0].longitude) == (
        pytest.approx(-45.084),
        pytest.approx(-13.63),
    )


def test_a_waypoint_without_a_place_is_refused_with_its_line() -> None:
    with pytest.raises(InputError) as refused:
        read_cup("race.cup", CUP.replace("4505.500N,01338.200E", "45.0917,13.6367"))
    (finding,) = refused.value.findings
    assert finding.line == 7
    assert "expected one such as 4505.047N" in finding.message


GERMAN = {
    "Start links": Subject.ELEMENT,
    "Tor 2 rechts": Subject.ELEMENT,
    "Ziel": Subject.ELEMENT,
    "Zuschauer": Subject.CROWD,
    "Tribüne": Subject.CROWD,
    "Sicherheitslinie": Subject.SAFETY_LINE,
    "Fernsehturm 45 m": Subject.OBSTACLE,
    "Hochspannungsleitung": Subject.OBSTACLE,
    "Luftraum": Subject.AIRSPACE,
    "Porte 3 gauche": Subject.ELEMENT,
}


def test_names_in_other_languages_are_understood(tmp_path: Path) -> None:
    rows = "".join(f'"{name}","",AT,4505.04{row}N,01337.8{row}0E,,1\n' for row, name in enumerate(GERMAN))
    (tmp_path / "de.cup").write_text("name,code,country,lat,lon,elev,style\n" + rows)
    marks = read_placemarks(tmp_path / "de.cup")
    assert {mark.name: mark.subject for mark in marks} == GERMAN
    assert {mark.shape for mark in marks} == {PlacemarkShape.POINT}
