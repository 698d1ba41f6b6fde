"""`airrace check` tells people and scripts all of a course; what it warns of does not change the exit code."""

import dataclasses
import io
import itertools
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from example_courses import AIRCRAFT, ROOT, SHIPPED, everything, many_gates, race
from hypothesis import given, settings
from hypothesis import strategies as st
from operations import assert_grows_no_faster_than_its_input
from typer.testing import CliRunner

from airrace.cli.course_tables import REMARKS_MAX, remarks_text
from airrace.cli.main import app
from airrace.cli.plan_view import ACROSS, DOWN, Canvas, Layer, plan_view
from airrace.cli.printed_result import render
from airrace.flights.results.planned import planned_flight, remarks_on_line
from airrace.model.environment import StaticWind
from airrace.pages.views.map_model import map_model
from airrace.procedure.planning.lint import Remark, RemarkKind, forgotten_lines, in_order, review
from airrace.procedure.planning.route_decisions import PLANNED_MAX

STYLE = re.compile(r"\x1b\[[0-9;]*m")
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


def check(*arguments: str | Path) -> str:
    """Stdout of a check that succeeds."""
    ran = CliRunner().invoke(app, ["check", *map(str, arguments), "--aircraft", str(AIRCRAFT)])
    assert (ran.exit_code, ran.stderr) == (0, "")
    return ran.stdout


def process(*arguments: str | Path, **environment: str) -> "subprocess.CompletedProcess[bytes]":
    """The real command, with other environment variables."""
    return subprocess.run(
        [sys.executable, "-m", "airrace", "check", *map(str, arguments)],
        env={**os.environ, **environment},
        capture_output=True,
        check=False,
    )


def test_people_are_told_of_every_passage_line_roll_crowd_border_and_limit(tmp_path: Path) -> None:
    path = everything(tmp_path)
    shown = check(path)
    for passage in race(path).course.passages:
        assert f"\n{passage.name} " in shown
    for piece in ("high-turn", "vertical-roll", "knife-edge", "> 152", "> 213", "315 deg either, at 80 to 90 deg"):
        assert piece in shown
    for name, what, distance in (
        ("stands", "crowd", "90 m slant"),
        ("tower", "crowd", "60 m over ground"),
        ("village", "crowd", "90 m slant"),
        ("beach", "safety line", "20 m"),
        ("airspace", "its border", "4 corners, 1.18 km2, 4.36 km around"),
    ):
        assert re.search(rf"^{name} .*{what}.*{distance}", shown, re.MULTILINE), name
    assert "10 to 400 m" in shown
    assert "up to 200 kt" in shown
    assert not CONTROL.search(shown)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_tables_and_map_fit_a_hundred_columns_and_the_map_thirty_five_rows(path: Path, tmp_path: Path) -> None:
    for track in (path, everything(tmp_path)):
        lines = check(track).splitlines()
        assert max(len(line) for line in lines if not line.startswith("warning: ")) <= 100
        drawn = [line for line in lines if re.search(r"[\u2800-\u28ff]", line)]
        assert len(drawn) <= 35


def test_warnings_are_sentences_for_people_and_objects_for_scripts(tmp_path: Path) -> None:
    path = everything(tmp_path)
    answered = json.loads(check(path, "--json"))
    flown = race(path)
    expected = in_order(
        [*review(flown), *forgotten_lines(flown.course), *remarks_on_line(planned_flight(flown))], flown.course
    )
    assert [warning["text"] for warning in answered["warnings"]] == [remark.text for remark in expected]
    told = {(warning["passage"], warning["kind"]) for warning in answered["warnings"]}
    assert {(None, "wind"), ("1:wide", "width"), ("1:q/2", "safety-line"), ("1:top", "crowd")} <= told
    assert [line for line in check(path).splitlines() if line.startswith("warning: ")] == [
        f"warning: {remark.text}" for remark in expected
    ]


def test_of_very_many_warnings_the_first_are_printed() -> None:
    remarks = [Remark(f"g{i}", RemarkKind.WIDTH, f"the gate of `g{i}`") for i in range(REMARKS_MAX + 7)]
    lines = remarks_text(remarks).splitlines()
    assert len(lines) == REMARKS_MAX + 1
    assert lines[-1] == "and 7 more warnings; --json has all of them"
    assert len(remarks_text(remarks[:3]).splitlines()) == 3


def test_scripts_are_told_of_surroundings_and_limits(tmp_path: Path) -> None:
    answered = json.loads(check(everything(tmp_path), "--json"))
    passages = {passage["passage"]: passage for passage in answered["passages"]}
    assert passages["1:q/1"]["safety_lines"] == ["beach"]
    assert passages["1:roll"]["roll"] == {
        "angle_deg": 315.0,
        "climb_deg": [80.0, 90.0],
        "gain_m": 0.0,
        "turning": "either",
    }
    assert [line["name"] for line in answered["safety_lines"]] == ["beach"]
    assert {crowd["name"]: (crowd["shape"], len(crowd["corners"])) for crowd in answered["crowd"]} == {
        "stands": ("line", 2),
        "tower": ("point", 1),
        "village": ("area", 3),
    }
    assert len(answered["airspace"]) == 4
    assert answered["limits"]["height_m"] == [10.0, 400.0]
    assert answered["limits"]["start_speed_m_s"][1] == pytest.approx(200 * 1852 / 3600)


def test_a_stdout_without_unicode_gets_ascii(tmp_path: Path) -> None:
    path = everything(tmp_path)
    text = path.read_text(encoding="utf-8").replace("Everything at once", "Über alles")
    path.write_text(text, encoding="utf-8")
    ran = process(path, "--aircraft", AIRCRAFT, PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert (ran.returncode, ran.stderr) == (0, b"")
    shown = ran.stdout.decode("ascii")
    assert "\\xdcber alles" in shown
    assert "north is up" in shown
    assert re.search(r"^ .*\.\.\.", shown, re.MULTILINE)
    assert re.search(r"^\|-+\| 200 m", shown, re.MULTILINE)


def coloured(path: Path, monkeypatch: pytest.MonkeyPatch, **environment: str) -> str:
    """What a terminal of 80 columns is sent."""
    from airrace.cli.courses import check as command

    class Terminal(io.StringIO):
        encoding = "utf-8"

        def isatty(self) -> bool:
            return True

    for name in ("NO_COLOR", "FORCE_COLOR", "COLORTERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"COLUMNS": "80", "TERM": "xterm-256color", **environment}.items():
        monkeypatch.setenv(name, value)
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    command(path, aircraft=AIRCRAFT)
    monkeypatch.undo()
    return terminal.getvalue()


def test_a_terminal_gets_colours_unless_refused_and_a_map_of_its_width(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = everything(tmp_path)
    drawn = [line for line in coloured(path, monkeypatch).splitlines() if re.search(r"[\u2800-\u28ff]", line)]
    assert all(len(STYLE.sub("", line)) <= 80 for line in drawn)
    assert len({style for line in drawn for style in STYLE.findall(line)}) >= 5
    assert not re.search(r"\x1b\[[0-9;]*3[0-9]", coloured(path, monkeypatch, NO_COLOR="1"))


def test_a_drawing_is_made_and_never_overwritten_unasked(tmp_path: Path) -> None:
    path, drawing = everything(tmp_path), tmp_path / "course.png"
    check(path, "--plot", drawing)
    content = drawing.read_bytes()
    assert content.startswith(b"\x89PNG")
    refused = CliRunner().invoke(app, ["check", str(path), "--aircraft", str(AIRCRAFT), "--plot", str(drawing)])
    assert refused.exit_code == 2
    assert "--force" in refused.stderr
    drawing.write_bytes(b"")
    check(path, "--plot", drawing, "--force")
    assert drawing.read_bytes() == content


@pytest.mark.parametrize(
    ("name", "code", "said"),
    [("course.jpg", 2, "must end in"), ("course", 2, "must end in"), ("no/a.png", 8, "folder")],
)
def test_a_drawing_that_cannot_be_written_is_refused(tmp_path: Path, name: str, code: int, said: str) -> None:
    ran = CliRunner().invoke(app, ["check", str(tmp_path / "none.yaml"), "--plot", str(tmp_path / name)])
    assert ran.exit_code == code
    assert said in ran.stderr
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_the_remedy_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airrace.pages.views.drawing.find_spec", lambda name: None)
    ran = CliRunner().invoke(app, ["check", str(SHIPPED[0]), "--plot", str(tmp_path / "a.png")])
    assert ran.exit_code == 2
    assert "pip install 'airrace[plot]'" in ran.stderr


@pytest.mark.parametrize("arguments", [(), ("--json",)])
def test_matplotlib_is_loaded_for_a_drawing_alone(arguments: Sequence[str]) -> None:
    program = (
        "import atexit, sys\nfrom airrace.__main__ import main\n"
        "atexit.register(lambda: print('matplotlib' in sys.modules, file=sys.stderr))\n"
        f"sys.argv = ['airrace', 'check', {str(ROOT / 'tracks' / 'rovinj_2014.yaml')!r}, *{list(arguments)!r}]\n"
        "main()\n"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stderr == "False\n"


def test_the_work_to_check_a_course_grows_with_its_gates_and_no_faster(tmp_path: Path) -> None:
    def work(count: int) -> None:
        assert len(json.loads(check(many_gates(tmp_path, count), "--json"))["passages"]) == count

    assert_grows_no_faster_than_its_input(work, PLANNED_MAX + 1)  # of fewer gates, more is told of each


@pytest.mark.slow
def test_of_a_course_of_thousands_of_gates_the_first_are_shown(tmp_path: Path) -> None:
    path = many_gates(tmp_path, 5000)
    shown = check(path)
    assert "... 4800 more" in shown
    assert "\n1:g4999 " in shown
    assert len(json.loads(check(path, "--json"))["passages"]) == 5000


INK = Layer("white", "#")


def canvas(columns: int = 10, rows: int = 5) -> Canvas:
    """Dots of one metre, the upper left corner at the origin."""
    return Canvas(columns, rows, north=0.0, west=0.0, dot=1.0)


def lines(drawn: Canvas, *, plain: bool = False) -> list[str]:
    return [row.plain for row in drawn.texts(plain=plain)]


def dots(drawn: Canvas) -> set[tuple[int, int]]:
    """Row and column of every dot, from the Braille patterns."""
    bits = {0: (0, 0), 1: (1, 0), 2: (2, 0), 3: (0, 1), 4: (1, 1), 5: (2, 1), 6: (3, 0), 7: (3, 1)}
    found: set[tuple[int, int]] = set()
    for row, line in enumerate(lines(drawn)):
        for column, letter in enumerate(line):
            pattern = ord(letter) - 0x2800 if letter != " " else 0
            found |= {
                (row * DOWN + down, column * ACROSS + across)
                for bit, (down, across) in bits.items()
                if pattern >> bit & 1
            }
    return found


def test_a_dot_appears_where_it_was_laid() -> None:
    for place in ((0, 0), (3, 1), (7, 2), (10, 19), (19, 19)):
        drawn = canvas()
        drawn.paint(INK, *np.array(place)[:, None])
        assert dots(drawn) == {place}


def test_a_slanted_line_has_a_dot_in_every_column_and_no_gap() -> None:
    drawn = canvas()
    drawn.line(INK, np.array([[-0.5, 0.5], [-7.5, 19.5]]))
    found = dots(drawn)
    assert {column for _, column in found} == set(range(20))
    ordered = sorted(found, key=lambda dot: dot[1])
    assert all(abs(a[0] - b[0]) <= 1 for a, b in itertools.pairwise(ordered))


def test_what_lies_outside_is_cut_off_and_a_broken_line_leaves_out_what_it_should() -> None:
    drawn = canvas()
    drawn.line(INK, np.array([[-5.5, -100.0], [-5.5, 100.0]]))
    assert dots(drawn) == {(5, column) for column in range(20)}
    drawn = canvas()
    drawn.line(INK, np.array([[-0.5, 0.5], [-0.5, 19.5]]), on=2, off=3)
    assert dots(drawn) == {(0, column) for column in range(20) if column % 5 < 2}


def test_no_text_covers_another_or_leaves_the_canvas() -> None:
    drawn = canvas()
    assert drawn.write(1, 2, "abc", "")
    assert not drawn.write(1, 4, "x", "")
    assert not drawn.write(1, 8, "xyz", "")
    assert not drawn.write(5, 0, "x", "")
    assert not drawn.write(0, -1, "x", "")
    assert drawn.write(1, 5, "x", "")
    assert lines(drawn)[1] == "  abcx"


def test_in_ascii_every_layer_has_its_own_character_and_the_upper_one_is_seen() -> None:
    drawn = canvas(3, 1)
    everywhere = np.ones((DOWN, 3 * ACROSS), bool)
    drawn.paint(Layer("red", "."), *np.nonzero(everywhere))
    left = everywhere.copy()
    left[:, ACROSS:] = False
    drawn.paint(INK, *np.nonzero(left))
    assert lines(drawn, plain=True) == ["#.."]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.parametrize("columns", [40, 100, 160])
def test_every_element_is_named_once_and_within_the_width(path: Path, columns: int) -> None:
    seen = map_model(race(path))
    shown = render(plan_view(seen, columns=columns)).splitlines()
    assert len(shown) <= 35
    assert all(len(line) <= columns for line in shown[:-2])
    if columns >= 100:
        for label in {mark.label for mark in seen.marks if mark.label}:
            found = re.findall(rf"(?<![\w#]){re.escape(label)}(?![\w#])", "\n".join(shown[:-3]))
            assert len(found) == 1, label


def test_north_is_up_and_both_directions_have_one_scale(tmp_path: Path) -> None:
    """Positions of the single characters that stand for pylons, against where they stand."""
    path = tmp_path / "pylons.yaml"
    places = {"a": (0, 0), "b": (0, 400), "c": (800, 400), "d": (800, 0)}
    gates = "\n".join(
        f"  {name}: {{type: pylon, north_m: {north}, east_m: {east}, pass_side_deg: 90}}"
        for name, (north, east) in places.items()
    )
    head = "schema: airrace/track/1\nname: Square\nrules: rbar-2016\ngates:\n"
    path.write_text(head + gates + "\ncourse: {start: a, lap: [b, c, d]}\n", encoding="utf-8")
    shown = render(plan_view(map_model(race(path)))).splitlines()
    rows = [row for row, line in enumerate(shown) if "\u2022" in line]
    north, south = min(rows), max(rows)
    columns = sorted({match.start() for row in (north, south) for match in re.finditer("\u2022", shown[row])})
    height, width = 2 * (south - north), columns[-1] - columns[0]  # in widths of a cell
    assert height / width == pytest.approx(2.0, abs=0.1)
    bar = re.search(r"├(─*)┤ (\d+) m", shown[-2])
    assert bar is not None
    cells, metres = len(bar[1]) + 2, float(bar[2])
    assert metres / cells == pytest.approx(400.0 / width, rel=0.1)


@pytest.mark.parametrize(("origin", "arrow"), [(0, "↓"), (90, "←"), (180, "↑"), (225, "↗"), (270, "→"), (320, "↘")])
def test_the_wind_blows_from_where_it_is_said_to(origin: float, arrow: str) -> None:
    calm = race(SHIPPED[0])
    air = dataclasses.replace(calm.air, wind=StaticWind(math.radians(origin), 10.0))
    said = render(plan_view(map_model(dataclasses.replace(calm, air=air)))).splitlines()[-2]
    assert f"{arrow} wind from {origin} deg, 19 kt" in said
    assert "no wind" in render(plan_view(map_model(calm)))


@settings(max_examples=30)
@given(height=st.floats(200.0, 5000.0), width=st.floats(200.0, 5000.0))
def test_a_course_of_any_shape_fits(height: float, width: float) -> None:
    seen = map_model(race(SHIPPED[0]))
    stretched = dataclasses.replace(seen, north=seen.south + height, east=seen.west + width)
    shown = render(plan_view(stretched)).splitlines()
    assert len(shown) <= 35
    assert max(map(len, shown)) <= 100


def test_people_lines_and_borders_are_drawn_and_named(tmp_path: Path) -> None:
    seen = map_model(race(everything(tmp_path)))
    shown = render(plan_view(seen, plain=True))
    assert shown.isascii()
    for name in ("stands", "tower", "village", "beach", "x", "=", ":", ",", "#"):
        assert name in shown


def test_a_quad_is_one_mark_with_both_passings(tmp_path: Path) -> None:
    marks = [mark for mark in map_model(race(everything(tmp_path))).marks if mark.element.name.startswith("q/")]
    assert [mark.label for mark in marks] == ["q", ""]
    assert [number for mark in marks for number, _ in mark.passings] == [3, 4]


def test_the_planned_ways_lead_through_all_places_of_the_race(tmp_path: Path) -> None:
    seen = map_model(race(SHIPPED[0]))
    points = np.concatenate([way.line for way in seen.ways])
    for mark in seen.marks:
        assert np.hypot(points[:, 0] - mark.north, points[:, 1] - mark.east).min() < 15.0
