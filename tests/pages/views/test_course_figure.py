"""Courses as figures, as SVG and on a terminal."""

import html
import io
import itertools
import re
import subprocess
import sys
import unicodedata
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from example_courses import SHIPPED, everything, race
from hypothesis import example, given
from hypothesis import strategies as st
from rich.table import Table
from rich.text import Text

from airrace.files.inputs import load_inputs
from airrace.files.inputs.document import TRACKS
from airrace.model.track.gates import Gate
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.course_figure import course_figure
from airrace.pages.views.course_page import course_page
from airrace.pages.views.drawing import Box, Figure, place_labels
from airrace.pages.views.map_model import SPEED_COLOURS, by_speed, map_model
from airrace.pages.views.plain_text import SafeStream, escape_html, keep_colours, plain
from airrace.pages.views.plan_svg import plan_svg
from airrace.pages.views.terminal import PlainConsole
from airrace.race import Race


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_course_is_drawn_with_one_scale_and_all_names_that_do_not_overlap(path: Path) -> None:
    seen = map_model(race(path))
    figure = course_figure(seen)
    figure.savefig(io.BytesIO(), format="png", dpi=figure.dpi)
    (axes,) = figure.axes
    assert axes.get_aspect() == 1.0
    texts = [text.get_text() for text in axes.texts if text.get_text()]
    assert {text.split("  ")[0] for text in texts} == {mark.label for mark in seen.marks if mark.label}
    numbers = sorted(int(number) for text in texts for number in text.split("  ")[1].split(", "))
    assert numbers == sorted(number for mark in seen.marks for number, _ in mark.passings)
    boxes = [text.get_window_extent() for text in axes.texts if text.get_text()]
    for one, other in itertools.combinations(boxes, 2):
        common = one.intersection(one, other)
        assert common is None or common.width * common.height < 0.1 * one.width * one.height


def test_gates_stand_to_scale() -> None:
    seen = map_model(race(SHIPPED[0]))
    (axes,) = course_figure(seen).axes
    drawn = np.concatenate([np.column_stack(line.get_data()) for line in axes.lines if len(line.get_xdata())])
    for mark in seen.marks:
        if isinstance(mark.element, Gate):
            half = 0.5 * mark.element.width
            away = np.hypot(drawn[:, 0] - mark.east, drawn[:, 1] - mark.north)
            assert (np.abs(away - half) < 1e-6).sum() >= 2


def test_legend_and_wind_show_what_is_there_and_only_that(tmp_path: Path) -> None:
    def entries(figure: Figure) -> str:
        (legend,) = figure.legends
        return "\n".join(text.get_text() for text in legend.get_texts())

    figures = [course_figure(map_model(race(everything(tmp_path)))) for _ in range(2)]
    for piece in ("lap 1", "crowd", "beach", "on the way to q/1, q/2", "airspace", "gate", "pylon"):
        assert piece in entries(figures[0])
    assert "wind 34 kt" in [text.get_text() for text in figures[0].axes[0].texts]
    images: list[bytes] = []
    for figure in figures:
        content = io.BytesIO()
        figure.savefig(content, format="png")
        images.append(content.getvalue())
    assert images[0] == images[1]
    bare = entries(course_figure(map_model(load_inputs("rovinj_2014").race)))
    assert not any(piece in bare for piece in ("crowd", "forbidden", "airspace", "lap 2"))


anchor_lists = st.lists(st.tuples(st.floats(0, 1000), st.floats(0, 1000)), min_size=1, max_size=12, unique=True)


@example(anchors=[(0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (1.0, 0.0)])  # a corner with hardly any room
@given(anchors=anchor_lists)
def test_labels_stay_within_the_frame_and_near_what_they_name(anchors: list[tuple[float, float]]) -> None:
    frame = Box(0.0, 0.0, 1000.0, 1000.0)
    boxes = place_labels(anchors, [(60.0, 12.0)] * len(anchors), np.array(anchors), frame, gap=5.0)
    for (across, up), box in zip(anchors, boxes, strict=True):
        assert box.overlap(frame) > 0.9 * box.width * box.height
        assert abs(box.left + 30.0 - across) <= 30.0 + 5.5 * 5.0 + 1e-6
        assert abs(box.bottom + 6.0 - up) <= 6.0 + 5.5 * 5.0 + 1e-6


def test_a_label_makes_way_for_what_is_drawn_and_for_other_labels() -> None:
    frame = Box(-500.0, -500.0, 1000.0, 1000.0)
    along = np.column_stack([np.linspace(0.0, 200.0, 50), np.zeros(50)])
    anchors = [(0.0, 0.0), (1.0, 1.0)]
    first, second = place_labels(anchors, [(60.0, 12.0)] * 2, along, frame, gap=5.0)
    assert first.count_inside(along) == second.count_inside(along) == 0
    assert first.overlap(second) == 0.0


SVG = "{http://www.w3.org/2000/svg}"


def drawn(race: Race, track: Array | None = None, speed: Array | None = None) -> ElementTree.Element:
    map_ = map_model(race)
    if track is None or speed is None:
        return ElementTree.fromstring(plan_svg(map_))
    return ElementTree.fromstring(plan_svg(map_.with_track(track), by_speed(track, speed)))


def places(root: ElementTree.Element, tag: str) -> Array:
    """All points of all lines of a kind, pixels; shape (n, 2)."""
    texts = [element.attrib["points"] for element in root.iter(f"{SVG}{tag}")]
    return np.array([[float(one) for one in pair.split(",")] for text in texts for pair in text.split()])


@pytest.mark.parametrize("name", TRACKS.names)
def test_every_shipped_course_is_drawn_within_its_frame(name: str) -> None:
    root = drawn(load_inputs(name).race)
    width, height = float(root.attrib["width"]), float(root.attrib["height"])
    for circle in root.iter(f"{SVG}circle"):
        assert 0.0 < float(circle.attrib["cx"]) < width
        assert 0.0 < float(circle.attrib["cy"]) < height


def test_north_is_up_east_is_right_and_the_scale_is_the_same_both_ways() -> None:
    race = load_inputs("rovinj_2014").race
    texts = {text.text for text in drawn(race).iter(f"{SVG}text")}
    assert {passage.element.name for passage in race.course.passages} <= texts
    north, east = np.array([0.0, 300.0, 300.0]), np.array([0.0, 0.0, 300.0])
    path = places(drawn(race, np.column_stack([north, east]), np.full(3, 80.0)), "polyline")
    first, second, third = path[:3]
    assert second[0] == pytest.approx(first[0])
    assert first[1] - second[1] == pytest.approx(third[0] - second[0], abs=0.2)
    assert first[1] > second[1]


def test_a_flight_widens_the_drawing_and_its_colours_go_from_slow_to_fast() -> None:
    race = load_inputs("rovinj_2014").race
    far = drawn(race, np.array([[0.0, 0.0], [5000.0, 0.0]]), np.array([80.0, 90.0]))
    path = places(far, "polyline")
    assert path.min() >= 0.0
    assert path[:, 1].max() <= float(far.attrib["height"])
    speed = np.linspace(60.0, 110.0, 61)
    root = drawn(race, np.column_stack([np.linspace(0.0, 800.0, 61), np.zeros(61)]), speed)
    assert [line.attrib["stroke"] for line in root.iter(f"{SVG}polyline")] == list(SPEED_COLOURS)


def test_everything_that_can_stand_beside_a_course_is_drawn_and_escaped(tmp_path: Path) -> None:
    flown = race(everything(tmp_path))
    hostile = replace(flown, course=replace(flown.course, name="<script>&"))
    root = drawn(hostile)
    assert [title.text for title in root.iter(f"{SVG}title")] == ["<script>& from above"]
    assert "<script>" not in course_page(map_model(hostile), ["a <b> warning"])
    assert len(list(root.iter(f"{SVG}polygon"))) > 0


ROOT = Path(__file__).parents[3]
TITLE = "\x1b]0;pwned\a"
COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def commands(text: str) -> list[str]:
    """The characters that a terminal would obey."""
    return [sign for sign in text if sign not in "\t\n" and unicodedata.category(sign) == "Cc"]


@given(st.text())
def test_no_control_character_is_left(text: str) -> None:
    assert commands(plain(text)) == []
    assert len(plain(text)) == len(text)
    assert plain(plain(text)) == plain(text)


@given(st.text(st.characters(exclude_categories=["Cc", "Cf", "Cs"])))
def test_what_is_harmless_stays_as_it_is(text: str) -> None:
    assert plain(text) == keep_colours(text) == text


@given(st.text(st.sampled_from("\x1b[]0;31mHJ\a\x9bx")))
def test_of_escapes_only_colours_are_left(text: str) -> None:
    assert commands(COLOUR.sub("", keep_colours(text))) == []


@given(st.text())
def test_a_text_in_a_page_is_apart_from_the_rest_and_can_be_written(text: str) -> None:
    isolated = escape_html(text)
    isolated.encode("utf-8")
    inside = isolated.removeprefix("<bdi>").removesuffix("</bdi>")
    assert not set("<>\"'\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\x00") & set(inside)
    assert html.unescape(inside) == plain(text)


def test_of_names_no_character_turns_the_direction_of_reading_or_is_none() -> None:
    assert plain("g1\u202e2g") == "g1\ufffd2g"
    name = b"caf\xe9.yaml".decode("utf-8", "surrogateescape")
    assert plain(name) == keep_colours(name) == "caf\ufffd.yaml"
    assert escape_html("\u05e9\u05e2\u05e8 1") == "<bdi>\u05e9\u05e2\u05e8 1</bdi>"
    assert escape_html("g1\u202e2g & \u2212 1.5") == "g1\ufffd2g &amp; \u2212 1.5"


def test_a_table_on_a_terminal_keeps_its_own_colours_alone() -> None:
    file = io.StringIO()
    table = Table(title=f"Reno{TITLE}")
    table.add_column(f"gate{TITLE}", style="bold red")
    table.add_row(f"g1{TITLE}")
    table.add_row(Text(f"g2{TITLE}"))
    PlainConsole(file=file, force_terminal=True, color_system="standard", width=60).print(table)
    assert "\x1b[1;31m" in file.getvalue()
    assert commands(COLOUR.sub("", file.getvalue())) == []
    assert file.getvalue().count("pwne") == 4


def test_a_watched_stream_shows_what_a_live_view_would_send() -> None:
    shown, sent = io.StringIO(), io.StringIO()
    SafeStream(shown).write("\x1b[2J")
    SafeStream(SafeStream(sent), commanded=True).write("\x1b[2J")
    assert (shown.getvalue(), sent.getvalue()) == ("␛[2J", "\x1b[2J")


@pytest.mark.parametrize("where", ["the name of the race", "a key", "the file"])
def test_a_hostile_course_commands_no_terminal(where: str, tmp_path: Path) -> None:
    text = (ROOT / "tracks" / "half_cuban_eight.yaml").read_text(encoding="utf-8")
    escaped = r'"\e]0;pwned\a"'
    match where:
        case "the name of the race":
            text = re.sub(r"(?m)^name: .*$", lambda _: f"name: {escaped}", text)
        case "a key":
            text += f"{escaped}: 1\n"
        case _:
            text += "unknown: 1\n"
    path = tmp_path / (f"a{TITLE}.yaml" if where == "the file" else "a.yaml")
    path.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "airrace", "check", str(path)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120.0)
    assert ran.returncode == (0 if where == "the name of the race" else 3)
    assert "pwned" in ran.stdout + ran.stderr
    assert commands(ran.stdout + ran.stderr) == []


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("::error::x", ":\N{RATIO}error::x"),
        ("a\n \u2003::set-output x", "a\n \u2003:\N{RATIO}set-output x"),
        ("gate ##[error]x", "gate ##\uff3berror]x"),
        ("##vso[task]", "##vso\uff3btask]"),
        ("2014::a, :b", "2014::a, :b"),
    ],
)
def test_no_line_is_a_command_to_a_runner_of_workflows(text: str, shown: str) -> None:
    assert keep_colours(text) == shown
    stream = io.StringIO()
    safe = SafeStream(stream)
    for sign in text:  # in as many pieces as there can be
        safe.write(sign)
    assert stream.getvalue() == shown
