"""Drawings of flights: plan, profile, histories and the kneeboard."""

import io
import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.results import TimedCrossing
from airrace.results.comparison import compare_flights
from airrace.views.drawing import Figure, save_figure
from airrace.views.flight_figures import (
    PAGE_HEIGHT,
    PAGE_WIDTH,
    STRIPS,
    comparison_figure,
    flight_figure,
    kneeboard_figure,
)


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
    assert "north is up, grid 200 m" in told
    figure.savefig(io.BytesIO(), format="pdf")


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
