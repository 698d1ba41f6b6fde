"""Drawings of flights: plan, profile, histories and the kneeboard."""

import io
import itertools
import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, TreeBuilder, XMLParser

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj, windy
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.flights.results import TimedCrossing
from airrace.flights.results.comparison import compare_flights
from airrace.pages.views.drawing import Figure, save_figure
from airrace.pages.views.flight_figures import STRIPS, comparison_figure, flight_figure
from airrace.pages.views.kneeboard import PAGE_HEIGHT, PAGE_WIDTH, fitting_turn, kneeboard_figure
from airrace.pages.views.tables import UNITS


def test_plan_and_profile_show_the_line_that_was_flown() -> None:
    flight = half_cuban().flight()
    plan, profile, *_ = flight_figure(flight).axes
    for axes, across, up in ((plan, "y", "x"), (profile, None, "height")):
        (line,) = [one for one in axes.collections if one.get_array() is not None and len(one.get_array()) > 50]
        points = np.array([piece[0] for piece in line.get_segments()])
        np.testing.assert_allclose(points[:, 0], (flight.time if across is None else flight[across])[:-1])
        np.testing.assert_allclose(points[:, 1], flight[up][:-1])
        np.testing.assert_allclose(line.get_array(), 0.5 * (flight["n_z"][1:] + flight["n_z"][:-1]))


def test_limits_are_drawn_where_they_held() -> None:
    flight = half_cuban().flight()
    (load,) = [axes for axes in flight_figure(flight).axes if axes.get_ylabel() == "load, g" and axes.lines]
    dashed = {line.get_ydata()[0] for line in load.lines if line.get_linestyle() == "--"}
    assert flight.limit("n_z").upper in dashed


def test_what_a_flight_does_not_know_is_left_out() -> None:
    labels = {axes.get_ylabel() for axes in flight_figure(circling(rovinj())).axes}
    assert {"speed, kt", "load, g", "bank, deg"} <= labels
    assert not {"surfaces, deg", "lever", "roll rate, deg/s"} & labels
    assert {strip.label for strip in STRIPS} > labels & {strip.label for strip in STRIPS}


def test_the_kneeboard_is_one_page_with_every_gate() -> None:
    flight = circling(rovinj())
    figure = kneeboard_figure(flight)
    assert tuple(figure.get_size_inches()) == (PAGE_WIDTH, PAGE_HEIGHT)
    told = [text.get_text() for axes in figure.axes for text in axes.texts]
    for crossing in flight.crossings:
        assert crossing.name in told
        assert f"{crossing.time:.2f}" in told
        assert f"{math.degrees(crossing.value('chi')) % 360.0:03.0f}" in told
    assert {"N", "grid 200 m"} <= set(told)
    assert "wind" not in told
    figure.savefig(io.BytesIO(), format="pdf")


def test_the_kneeboard_tells_cues_wind_and_the_units_that_are_asked_for() -> None:
    flight = windy().flight()
    figure = kneeboard_figure(flight, UNITS["kt-ft"])
    told = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert {"wind", "IAS kt", "hgt ft"} <= set(told)
    assert f"{flight.crossings[-1].value('height') / 0.3048:.0f}" in told
    cues = [text.get_text() for text in figure.texts]
    assert any("hold " in line for line in cues)
    assert any("pull " in line for line in cues)
    assert any(" ft after " in line or " ft before " in line for line in cues)


def test_numbers_on_the_kneeboard_do_not_overlap_and_lie_on_the_map() -> None:
    figure = kneeboard_figure(circling(rovinj()))
    plan = max(figure.axes, key=lambda axes: len(axes.lines))
    boxes = [text.get_window_extent() for text in plan.texts if text.get_text()[:1].isdigit()]
    edge = plan.get_window_extent()
    assert len(boxes) >= 8
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    assert all(edge.x0 < box.x0 and box.x1 < edge.x1 and edge.y0 < box.y0 and box.y1 < edge.y1 for box in boxes)


def test_a_map_is_turned_until_it_fills_its_place_and_stays_where_that_gains_nothing() -> None:
    angle = math.radians(60.0)
    line = np.linspace(-1.0, 1.0, 50)[:, None] * np.array([[math.cos(angle), math.sin(angle)]])
    for shape, diagonal in ((3.0, math.atan2(1.0, 3.0)), (1.0 / 3.0, math.atan2(3.0, 1.0))):
        assert math.degrees(fitting_turn(line, shape)) == pytest.approx(math.degrees(diagonal) - 60.0, abs=3.0)
    around = np.linspace(0.0, 2.0 * math.pi, 100)
    assert fitting_turn(np.stack([np.cos(around), np.sin(around)], axis=1), 1.5) == 0.0


@pytest.mark.parametrize("draw", [flight_figure, kneeboard_figure])
def test_signs_that_no_font_has_are_drawn_without_a_word(draw: Callable[..., Figure], tmp_path: Path) -> None:
    one = circling(rovinj(), label="\u6771\u4eac \x01")
    one = replace(one, race=replace(one.race, course=replace(one.course, name="\u6771\u4eac \x01")))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(draw(one), tmp_path / "drawn.png")
    assert (tmp_path / "drawn.png").stat().st_size > 0


def test_a_missed_gate_is_a_dash_in_the_kneeboard() -> None:
    flight = circling(rovinj())
    lost = TimedCrossing(flight.crossings[3].passage, math.nan, {})
    flight = replace(flight, crossings=(*flight.crossings[:3], lost, *flight.crossings[4:]))
    told = [text.get_text() for axes in kneeboard_figure(flight).axes for text in axes.texts]
    assert told.count("-") >= 6


def test_names_that_look_like_formulas_are_written_as_they_are() -> None:
    flight = circling(rovinj(), label="a $\\frac{$ b")
    flight = replace(flight, race=replace(flight.race, course=replace(flight.course, name="$x^2$ {{ $\\nothing$")))
    for figure in (
        flight_figure(flight),
        kneeboard_figure(flight),
        comparison_figure([compare_flights(flight, flight)]),
    ):
        figure.savefig(io.BytesIO(), format="png", dpi=30)


def plot(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["plot", *arguments])
    return result.exit_code, result.stderr


def test_the_command_draws_in_the_format_that_the_name_says(tmp_path: Path) -> None:
    stored = str(half_cuban().save(tmp_path / "run.h5"))
    for name, begin, more in (("a.png", b"\x89PNG", ()), ("b.svg", b"<?xml", ("--kneeboard",)), ("c.pdf", b"%PDF", ())):
        assert plot(f"{stored}:point-mass", "--output", str(tmp_path / name), *more) == (0, "")
        assert (tmp_path / name).read_bytes().startswith(begin)
    code, said = plot(stored, "--output", str(tmp_path / "a.png"))
    assert (code, said.count("\n")) == (2, 1)
    assert plot(stored, "--output", str(tmp_path / "a.gif"))[0] == 2


@pytest.mark.parametrize("draw", [flight_figure, kneeboard_figure])
def test_a_drawing_is_valid_xml_whatever_names_hold(draw: Callable[..., Figure], tmp_path: Path) -> None:
    race, hostile = rovinj(), "a\x1b[1m\a\ufffe\x00b"
    passages = tuple(replace(one, name=hostile) for one in race.course.passages)
    course = replace(race.course, name=hostile, passages=passages)
    path = tmp_path / "drawing.svg"
    save_figure(draw(circling(replace(race, course=course), label=hostile)), path)
    parser = XMLParser(target=TreeBuilder(insert_comments=True))  # in which a drawing names its texts
    assert "a␛[1m␇\ufffd␀b" in "".join(one.text or "" for one in ElementTree.parse(path, parser).iter(Comment))
