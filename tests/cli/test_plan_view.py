"""The picture in the terminal: places are where they belong, at one scale, and nothing covers anything."""

import dataclasses
import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from example_courses import SHIPPED, everything, race
from hypothesis import given, settings
from hypothesis import strategies as st

from airrace.cli.plan_view import ACROSS, DOWN, Canvas, Layer, plan_view
from airrace.cli.tables import rendered
from airrace.environment.air import StaticWind
from airrace.views.map_model import map_model

INK = Layer("white", "#")


def canvas(columns: int = 10, rows: int = 5) -> Canvas:
    """Dots of one metre, the upper left corner at the origin."""
    return Canvas(columns, rows, north=0.0, west=0.0, dot=1.0)


def lines(drawn: Canvas, *, plain: bool = False) -> list[str]:
    return [row.plain for row in drawn.drawn(plain=plain)]


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
        grid = np.zeros((20, 20), bool)
        grid[place] = True
        drawn.paint(INK, grid)
        assert dots(drawn) == {place}


def test_a_slanted_line_has_a_dot_in_every_column_and_no_gap() -> None:
    drawn = canvas()
    drawn.line(INK, np.array([[-0.5, 0.5], [-7.5, 19.5]]))
    found = dots(drawn)
    assert {column for _, column in found} == set(range(20))
    ordered = sorted(found, key=lambda dot: dot[1])
    assert all(abs(a[0] - b[0]) <= 1 for a, b in itertools.pairwise(ordered))


def test_what_lies_outside_is_cut_off() -> None:
    drawn = canvas()
    drawn.line(INK, np.array([[-5.5, -100.0], [-5.5, 100.0]]))
    assert dots(drawn) == {(5, column) for column in range(20)}


def test_a_broken_line_leaves_out_what_it_should() -> None:
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
    drawn.paint(Layer("red", "."), everywhere)
    left = everywhere.copy()
    left[:, ACROSS:] = False
    drawn.paint(INK, left)
    assert lines(drawn, plain=True) == ["#.."]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.parametrize("columns", [40, 100, 160])
def test_every_element_is_named_once_and_within_the_width(path: Path, columns: int) -> None:
    seen = map_model(race(path))
    shown = rendered(plan_view(seen, None, columns=columns)).splitlines()
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
    shown = rendered(plan_view(map_model(race(path)), None)).splitlines()
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
    seen = map_model(race(SHIPPED[0]))
    said = rendered(plan_view(seen, StaticWind(math.radians(origin), 10.0))).splitlines()[-2]
    assert f"{arrow} wind from {origin} deg, 19 kt" in said
    assert "no wind" in rendered(plan_view(seen, None))


@settings(max_examples=30)
@given(height=st.floats(200.0, 5000.0), width=st.floats(200.0, 5000.0))
def test_a_course_of_any_shape_fits(height: float, width: float) -> None:
    seen = map_model(race(SHIPPED[0]))
    stretched = dataclasses.replace(seen, north=seen.south + height, east=seen.west + width)
    shown = rendered(plan_view(stretched, None)).splitlines()
    assert len(shown) <= 35
    assert max(map(len, shown)) <= 100


def test_people_lines_and_borders_are_drawn_and_named(tmp_path: Path) -> None:
    seen = map_model(race(everything(tmp_path)))
    shown = rendered(plan_view(seen, None, plain=True))
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
