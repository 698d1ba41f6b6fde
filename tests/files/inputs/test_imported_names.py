"""What names say in the languages of race organisers: the same drawing makes the same course in each of them."""

import math
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.model.track.course import Course
from airrace.model.track.gates import Gate, Pylon
from airrace.runs.courses import CourseFile, begin_course

Places = Sequence[tuple[float, float]]
"""Metres east and north of 45 N 13 E."""


def mark(name: str, places: Places, *, area: bool = False) -> str:
    text = " ".join(f"{13.0 + east / 78_846.8:.9f},{45.0 + north / 111_131.7:.9f},0" for east, north in places)
    coordinates = f"<coordinates>{text}</coordinates>"
    if area:
        shape = f"<Polygon><outerBoundaryIs><LinearRing>{coordinates}</LinearRing></outerBoundaryIs></Polygon>"
    else:
        tag = "Point" if len(places) == 1 else "LineString"
        shape = f"<{tag}>{coordinates}</{tag}>"
    return f"<Placemark><name>{name}</name>{shape}</Placemark>"


def folder_of(name: str, *marks: str) -> str:
    return f"<Folder><name>{name}</name>{''.join(marks)}</Folder>"


def gate(name: str, north: float, east: float = 0.0) -> str:
    return mark(name, [(east - 6.0, north), (east + 6.0, north)])


def document(*marks: str, title: str = "") -> str:
    return (
        '<?xml version="1.0" encoding="UTF-8"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        f"<name>{title}</name>{''.join(marks)}</Document></kml>"
    )


def sketch(folder: Path, *marks: str, title: str = "", yes: bool = False) -> tuple[CourseFile, Course]:
    (folder / "marks.kml").write_text(document(*marks, title=title), encoding="utf-8")
    written = begin_course(folder / "sketched", from_=folder / "marks.kml", yes=yes, force=True)
    return written, load_inputs(written.path).race.course


def names(course: Course) -> list[str]:
    return [passage.element.name for passage in course.passages]


KEYS: tuple[str, ...] = (
    "start",
    "gate",
    "left",
    "right",
    "knife",
    "pylon",
    "finish",
    "crowd",
    "line",
    "tower",
    "space",
)
LANGUAGES = {
    "English": "Start/Gate/left/right/knife edge/Pylon/Finish/Spectators/Safety line/Radio tower 45 m/Airspace",
    "German": "Start/Tor/links/rechts/Messerflug/Pylon/Ziel/Zuschauer/Sicherheitslinie/Fernsehturm 45 m/Luftraum",
    "German, without umlauts": "Starttor/Tor/links/rechts/Messerflug/Pylone/Zieltor/Tribuene/Sperrlinie/Turm 45 m/"
    "Luftraum",
    "French": "Départ/Porte/gauche/droite/tranche/Pylône/Arrivée/Public/Ligne de sécurité/Tour 45 m/Espace aérien",
    "Italian": "Partenza/Porta/sinistra/destra/coltello/Pilone/Traguardo/Pubblico/Linea di sicurezza/Torre 45 m/"
    "Spazio aereo",
    "Spanish": "Salida/Puerta/izquierda/derecha/cuchillo/Pilón/Meta/Espectadores/Línea de seguridad/Torre 45 m/"
    "Espacio aéreo",
}


def drawing(words: Mapping[str, str]) -> list[str]:
    """A start by two points, a gate by two points, a knife edge, a pylon and a finish, and what lies around."""
    return [
        mark(f"{words['start']} {words['right']}", [(6.0, 0.0)]),
        mark(f"{words['start']} {words['left']}", [(-6.0, 0.0)]),
        mark(f"{words['gate']} 2 {words['left']}", [(-6.0, 500.0)]),
        mark(f"{words['crowd']}", [(300.0, -100.0), (300.0, 900.0)]),
        mark(f"{words['gate']} 2 {words['right']}", [(6.0, 500.0)]),
        gate(f"{words['gate']} 3 ({words['knife']})", 900.0),
        mark(f"{words['pylon']} 4", [(-100.0, 1300.0)]),
        gate(f"{words['finish']}", 900.0, -300.0),
        mark(f"{words['line']}", [(150.0, -100.0), (150.0, 900.0)]),
        mark(f"{words['tower']}", [(-600.0, 400.0)]),
        mark(words["space"], [(-900.0, -900.0), (900.0, -900.0), (900.0, 2000.0), (-900.0, 2000.0)], area=True),
    ]


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_drawing_is_one_course_in_every_language(tmp_path: Path, language: str) -> None:
    words = dict(zip(KEYS, LANGUAGES[language].split("/"), strict=True))
    written, course = sketch(tmp_path, *drawing(words), title="Harbour 2027.kml")
    assert course.name == "Harbour 2027"
    elements = [passage.element for passage in course.passages]
    assert [type(element) for element in elements] == [Gate, Gate, Gate, Pylon, Gate]
    assert [element.prescribed_bank is not None and abs(element.prescribed_bank) > 1.0 for element in elements] == [
        False,
        False,
        True,
        False,
        False,
    ]
    assert len(course.crowd) == len(course.safety_lines) == 1
    assert [obstacle.height for obstacle in course.obstacles] == [45.0]
    assert len(course.airspace) == 4
    assert not [remark for remark in written.remarks if not remark.taken_as]
    assert not written.tasks


@pytest.mark.parametrize(
    "both", ["Start/Finish", "START-ZIEL", "Start und Ziel", "Départ / Arrivée", "Partenza e arrivo"]
)
def test_a_start_that_is_the_finish_closes_the_race(tmp_path: Path, both: str) -> None:
    _, course = sketch(
        tmp_path, gate(both, 0.0), gate("2", 500.0), mark("3", [(200.0, 800.0)]), gate("4", 500.0, 300.0)
    )
    assert names(course) == [names(course)[0], "g_2", "g_3", "g_4", names(course)[0]]


def test_start_numbers_and_finish_are_the_order_whatever_the_file_s_is(tmp_path: Path) -> None:
    marks = [gate("Ziel", 0.0, 400.0), gate("Tor 10", 500.0, 400.0), gate("Tor 2", 500.0), gate("Start", 0.0)]
    written, course = sketch(tmp_path, *marks)
    assert names(course) == ["Start", "Tor_2", "Tor_10", "Ziel"]
    assert "order" in [remark.name for remark in written.remarks]
    _, course = sketch(tmp_path, *sorted(marks, reverse=True))
    assert names(course) == ["Start", "Tor_2", "Tor_10", "Ziel"]


def test_a_gate_of_two_numbers_is_passed_twice_and_back_in_reverse(tmp_path: Path) -> None:
    _, course = sketch(
        tmp_path, gate("Start", 0.0), gate("Gate 2/4", 500.0), gate("Gate 3", 900.0), gate("Finish", -300.0)
    )
    assert names(course) == ["Start", "Gate_2_4", "Gate_3", "Gate_2_4", "Finish"]
    there, back = course.passages[1], course.passages[3]
    assert there.direction is not back.direction


@pytest.mark.parametrize(
    "pair", ["2a/2b", "Gate 2 A/Gate 2 B", "Tor 2.1/Tor 2.2", "G2 north/G2 south", "P2/P2", "2 G/2 D"]
)
def test_two_points_of_one_number_near_each_other_are_a_gate_and_a_guess(tmp_path: Path, pair: str) -> None:
    first, second = pair.split("/")
    marks = [gate("Start", 0.0), mark(first, [(-6.0, 500.0)]), mark(second, [(6.0, 500.0)]), gate("Gate 3", 900.0)]
    written, course = sketch(tmp_path, *marks)
    assert [type(passage.element) for passage in course.passages] == [Gate] * 3
    assert f"{first}, {second}" in [remark.name for remark in written.remarks]


def test_pylons_of_a_gate_pair_by_number_though_one_is_called_and_drawn_otherwise(tmp_path: Path) -> None:
    base = [(-7.0, 499.0), (-5.0, 499.0), (-5.0, 501.0), (-7.0, 501.0)]
    marks = [gate("Start", 0.0), mark("Tor 2 rechts", [(6.0, 500.0)]), mark("Pylon 2 left", base, area=True)]
    _, course = sketch(tmp_path, *marks)
    assert [type(passage.element) for passage in course.passages] == [Gate, Gate]


@pytest.mark.parametrize("first", [1.0, -1.0])
def test_a_slalom_on_an_arc_alternates_its_sides(tmp_path: Path, first: float) -> None:
    """Every pylon turns the way a little to one side: the outside of the turn would always be the same."""
    arc = [(first * 4.0 * number**2, 200.0 * number) for number in range(1, 6)]
    marks = [mark(f"Slalom {number}", [place]) for number, place in enumerate(arc, start=2)]
    _, course = sketch(tmp_path, gate("Start", 0.0), *marks, gate("Finish", 1300.0, first * 150.0))
    pylons = [passage.element for passage in course.passages if isinstance(passage.element, Pylon)]
    easts = [math.sin(pylon.side) for pylon in pylons]
    assert [east > 0.0 for east in easts] == [(number % 2 == 0) == (easts[0] > 0.0) for number in range(5)]


def test_a_quad_is_one_by_its_corners_or_its_points_and_entered_ahead(tmp_path: Path) -> None:
    square = [(-10.0, 490.0), (10.0, 490.0), (10.0, 510.0), (-10.0, 510.0)]
    around = [gate("Start", 0.0)], [gate("Gate 3", 900.0)]
    points = [mark(f"Quad 2 {corner}", [place]) for corner, place in zip("DBCA", square, strict=True)]
    for quad in ([mark("Viereck 2", square, area=True)], points):
        written, course = sketch(tmp_path, *around[0], *quad, *around[1])
        first, second = course.passages[1].element, course.passages[2].element
        assert isinstance(first, Gate)
        assert isinstance(second, Gate)
        assert (first.north, first.east, first.width) == pytest.approx((500.0, 6.0, 20.0), abs=0.1)
        assert abs(first.heading) < 0.01
        assert any(remark.taken_as.startswith("first passed at 0 deg") for remark in written.remarks)


def test_folders_say_what_bare_names_in_them_are(tmp_path: Path) -> None:
    marks = [
        folder_of("Tore", gate("Alpha", 0.0), gate("Bravo", 500.0)),
        folder_of("Slalom", mark("1", [(0.0, 800.0)]), mark("2", [(0.0, 1000.0)])),
        folder_of("Sicherheit", folder_of("Zuschauer", mark("1", [(300.0, 0.0), (300.0, 500.0)]))),
        folder_of("Hindernisse", mark("A", [(-300.0, 0.0)])),
    ]
    _, course = sketch(tmp_path, *marks)
    assert [type(passage.element) for passage in course.passages] == [Gate, Gate, Pylon, Pylon]
    assert [crowd.name for crowd in course.crowd] == ["g_1_2"]
    assert [obstacle.name for obstacle in course.obstacles] == ["A"]


def test_areas_called_gates_are_gates_or_pylons_and_points_of_one_line_are_a_line(tmp_path: Path) -> None:
    slab = [(-7.0, 499.0), (7.0, 499.0), (7.0, 501.0), (-7.0, 501.0)]
    base = [(99.0, 799.0), (101.0, 799.0), (101.0, 801.0), (99.0, 801.0)]
    line = [mark(f"Sicherheitslinie {number}", [(300.0, 400.0 * number)]) for number in (1, 2)]
    written, course = sketch(
        tmp_path, gate("Start", 0.0), mark("Gate 2", slab, area=True), mark("Pylon 3", base, area=True), *line
    )
    assert [type(passage.element) for passage in course.passages] == [Gate, Gate, Pylon]
    assert len(course.safety_lines) == 1
    assert {"Gate 2", "Pylon 3", "Sicherheitslinie"} <= {remark.name for remark in written.remarks if remark.taken_as}


@pytest.mark.parametrize("lost", ["Widownia", "Zuschauer"])
def test_a_course_that_would_lose_its_people_asks_for_a_yes(tmp_path: Path, lost: str) -> None:
    """A name in a language that is not read, and people with more corners than a course has room for."""
    corners = [(300.0 + number % 2, 20.0 * number) for number in range(2 if lost == "Widownia" else 60)]
    marks = [gate("Start", 0.0), gate("Gate 2", 500.0), mark(lost, [*corners, (300.0, 1300.0)])]
    with pytest.raises(InputError, match=f"'{lost}'.* would be left out: .*; name it as what it is .* --yes"):
        sketch(tmp_path, *marks)
    assert not (tmp_path / "sketched.yaml").exists()
    written, course = sketch(tmp_path, *marks, yes=True)
    assert course.crowd == ()
    assert [remark.name for remark in written.remarks if not remark.taken_as] == [lost]
    command = ["init", str(tmp_path / "again"), "--from", str(tmp_path / "marks.kml")]
    assert CliRunner().invoke(app, command).exit_code != 0
    assert CliRunner().invoke(app, [*command, "--yes"]).exit_code == 0


def test_what_is_left_out_needs_no_yes_where_the_course_holds_its_people(tmp_path: Path) -> None:
    marks = [gate("Start", 0.0), gate("Gate 2", 500.0), mark("Public", [(300.0, 0.0)]), mark("Rescue", [(0.0, 250.0)])]
    written, _ = sketch(tmp_path, *marks)
    assert [remark.name for remark in written.remarks if not remark.taken_as] == ["Rescue"]
    with pytest.raises(InputError, match="'150 m', a line of 2 places, would be left out"):
        sketch(tmp_path, *marks, mark("150 m", [(200.0, 0.0), (200.0, 900.0)]))


def test_a_turn_behind_a_slalom_turns_no_side_of_it(tmp_path: Path) -> None:
    row = [mark(f"Slalom {number}", [(0.0, 200.0 * number)]) for number in (2, 3, 4)]
    _, course = sketch(tmp_path, gate("Start / Ziel", 0.0), *row)
    pylons = [passage.element for passage in course.passages if isinstance(passage.element, Pylon)]
    assert [math.sin(pylon.side) for pylon in pylons] == pytest.approx([1.0, -1.0, 1.0], abs=0.1)


def test_a_recorded_track_is_a_flight_and_a_drawn_one_is_not(tmp_path: Path) -> None:
    pylons = "".join(f'<wpt lat="{45.0 + 0.005 * n}" lon="13"><name>Pylon {n}</name></wpt>' for n in range(3))
    track = "<trk><name>G-RACE</name><trkseg>{}</trkseg></trk>"
    places = "".join(f'<trkpt lat="{45.0 + 0.001 * n}" lon="13.01">{{}}</trkpt>' for n in range(9))
    flown = places.replace("{}", "<time>2027-05-01T10:00:00Z</time>")
    path = _file(tmp_path / "flown.gpx", f"<gpx>{pylons}{track.format(flown)}</gpx>".encode())
    written = begin_course(tmp_path / "sketched", from_=path)
    assert ("G-RACE", "it belongs to a flight") in [(remark.name, remark.reason) for remark in written.remarks]
    drawn = _file(tmp_path / "drawn.gpx", f"<gpx>{pylons}{track.format(places.replace('{}', ''))}</gpx>".encode())
    with pytest.raises(InputError, match="'G-RACE', a line of 9 places, would be left out"):
        begin_course(tmp_path / "sketched", from_=drawn, force=True)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
@pytest.mark.parametrize("packed", [False, True])
def test_an_encoding_changes_no_course(tmp_path: Path, encoding: str, *, packed: bool) -> None:
    words = dict(zip(KEYS, LANGUAGES["French"].split("/"), strict=True))
    text = document(*drawing(words), title="Épreuve")
    begin_course(tmp_path / "plain", from_=_file(tmp_path / "plain.kml", text.encode()))
    declared = text.replace("UTF-8", encoding[:6].upper() if encoding.startswith("utf-16") else "UTF-8")
    content = declared.encode(encoding)
    path = tmp_path / ("marks.kmz" if packed else "marks.kml")
    if packed:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("__MACOSX/._doc.kml", b"\0\5\x16\7")
            archive.writestr("doc.kml", content)
    else:
        path.write_bytes(content)
    written = begin_course(tmp_path / "coded", from_=path)
    plain, coded = (load_inputs(tmp_path / f"{name}.yaml").race.course for name in ("plain", "coded"))
    assert coded == plain
    assert coded.name == "Épreuve"
    assert not written.tasks


def _file(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def test_the_elevation_of_a_waypoint_is_that_of_the_origin(tmp_path: Path) -> None:
    points = "".join(
        f'<wpt lat="{45.0 + 0.005 * n}" lon="13"><ele>395</ele><name>Pylon {n}</name></wpt>' for n in range(3)
    )
    path = _file(tmp_path / "marks.gpx", f"<gpx><metadata><name>Lago</name></metadata>{points}</gpx>".encode())
    course = load_inputs(begin_course(tmp_path / "sketched", from_=path).path).race.course
    assert (course.name, course.origin.elevation) == ("Lago", 395.0)


def test_a_point_whose_name_states_a_height_is_an_obstacle_and_a_guess(tmp_path: Path) -> None:
    marks = [gate("Start", 0.0), gate("Gate 2", 500.0), mark("Château d'eau 30 m", [(-300.0, 0.0)])]
    written, course = sketch(tmp_path, *marks)
    assert [obstacle.height for obstacle in course.obstacles] == [30.0]
    assert ("Château d'eau 30 m", "an obstacle") in [(remark.name, remark.taken_as) for remark in written.remarks]
