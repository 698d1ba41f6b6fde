"""Drawings of flights: plan, profile, histories and the kneeboard."""

import io
import itertools
import json
import math
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, TreeBuilder, XMLParser

import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj, windy
from matplotlib.text import Text
from typer.testing import CliRunner

from airrace.api.run import Run
from airrace.cli.main import app
from airrace.files.inputs import load_inputs
from airrace.flights.results import Flight, TimedCrossing
from airrace.flights.results.comparison import compare_flights
from airrace.pages.views.cue_tables import course_text, gate_text
from airrace.pages.views.drawing import Figure, save_figure
from airrace.pages.views.flight_figures import STRIPS, comparison_figure, flight_figure
from airrace.pages.views.kneeboard import (
    PAGE_HEIGHT,
    PAGE_WIDTH,
    PAPERS,
    KneeRow,
    fitting_turn,
    kneeboard_figures,
    rows_on_page,
)
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


def page_words(sheets: Sequence[Figure]) -> list[str]:
    """What stands on pages beside their maps, in order."""
    return [text.get_text() for sheet in sheets for part in sheet.subfigs for text in part.texts if text.get_text()]


def first_sheet(flight: Flight) -> Figure:
    return kneeboard_figures(flight)[0]


def kneeboard_texts(sheets: Sequence[Figure]) -> list[Text]:
    return [text for sheet in sheets for text in sheet.findobj(Text) if text.get_text().strip()]


def test_the_kneeboard_tells_every_gate_in_letters_that_can_be_read_on_a_knee() -> None:
    flight = circling(rovinj())
    sheets = kneeboard_figures(flight)
    assert {tuple(sheet.get_size_inches()) for sheet in sheets} == {(PAGE_WIDTH, PAGE_HEIGHT)}
    texts = kneeboard_texts(sheets)
    assert min(text.get_fontsize() for text in texts) >= 9.0
    words = [text.get_text() for text in texts]
    for crossing in flight.crossings:
        (line,) = [line for line in words if line.startswith(f"{gate_text(crossing.name)}  {crossing.time:.2f} s")]
        assert f"track {course_text(crossing.value('chi'))}" in line
    assert {"N", "grid 200 m"} <= set(words)
    assert "wind" not in words
    assert not any("LAP" in line for line in words)


@pytest.mark.parametrize(("run", "units"), [(half_cuban, "kt-m"), (windy, "kt-ft"), (half_cuban, "kmh-m")])
def test_every_number_of_the_kneeboard_is_that_of_the_briefing(run: Callable[[], Run], units: str) -> None:
    """Numbers of cues are read off the page and held against `brief --json`, rounded as they are shown."""
    flight, shown = run().flight(), UNITS[units]
    words = page_words(kneeboard_figures(flight, shown))
    rows = json.loads(json.dumps(run().brief().as_object()))["cues"]
    for row in rows:
        begin = words.index(f"{row['time_s']:.2f}")
        number, _, place, bank, pull, height, *_ = words[begin - 1 :]
        assert number == str(row["cue"])
        assert place.startswith("at ") or place.split()[0] == f"{abs(row['distance_m']) * shown.per_m:.0f}"
        assert bank.startswith(row["action"]) or bank == "no roll"
        if not row["vertical"]:
            side = "R" if row["bank_to_deg"] > 0.0 else "L"
            assert bank.endswith((f"{side}{abs(round(row['bank_to_deg']))}", "level", "inverted"))
        begins, extreme, ends, mean = (round(row[f"n_z_{name}"], 1) for name in ("from", "extreme", "to", "mean"))
        told = [float(load) for load in re.findall(r"-?[0-9.]+", pull)]
        assert told in ([begins, extreme, ends, mean], [begins, ends, mean], [mean])
        assert height == f"{row['height_from_m'] * shown.per_m:.0f}"
        if row["course_to_deg"] is not None:
            assert words[begin + 5] == f"{round(row['course_to_deg']) % 360:03d}"
        if row["apex_m"] is not None:
            apex = f"apex {row['apex_m'] * shown.per_m:.0f} {shown.length} at {row['apex_time_s']:.2f} s"
            assert any(line.endswith(apex) for line in words)
    assert sum(line.startswith(("ease ", "hold ", "roll ", "no roll")) for line in words) == len(rows)


def test_the_kneeboard_tells_wind_limits_and_units() -> None:
    flight = windy().flight()
    sheets = kneeboard_figures(flight, UNITS["kt-ft"])
    assert "wind" in {text.get_text() for text in kneeboard_texts(sheets)}
    words = page_words(sheets)
    assert "hgt ft" in words
    head = " ".join(words[:8])
    assert "wind from 070 with 20 kt" in head
    assert "limits -1 g to 10 g" in head
    assert "reserve: none" in head
    assert any(f"{flight.crossings[-1].value('height') / 0.3048:.0f} ft" in line for line in words)


def test_laps_are_pages_of_their_own_and_two_pages_share_a_sheet_of_a4() -> None:
    race = load_inputs("abu_dhabi_2016").race
    flight = circling(race)
    pages, sheets = kneeboard_figures(flight), kneeboard_figures(flight, per_sheet=PAPERS["a4"])
    assert len(sheets) == math.ceil(len(pages) / 2)
    assert tuple(sheets[0].get_size_inches()) == (2 * PAGE_WIDTH, PAGE_HEIGHT)
    laps = [[text.get_text() for text in kneeboard_texts([page]) if "LAP" in text.get_text()] for page in pages]
    assert sorted(map(str, laps)) == list(map(str, laps))
    assert {lap for (lap,) in laps} == {"LAP 1", "LAP 2"}


def test_labels_on_the_kneeboard_do_not_overlap_and_lie_on_the_map() -> None:
    sheet, *_ = kneeboard_figures(circling(rovinj()))
    plan = max((axes for part in sheet.subfigs for axes in part.axes), key=lambda axes: len(axes.lines))
    boxes = [text.get_window_extent() for text in plan.texts if text.get_text().startswith("g")]
    edge = plan.get_window_extent()
    assert len(boxes) >= 8
    assert not any(box.overlaps(other) for box, other in itertools.combinations(boxes, 2))
    assert all(edge.x0 < box.x0 and box.x1 < edge.x1 and edge.y0 < box.y0 and box.y1 < edge.y1 for box in boxes)


def test_a_map_is_turned_until_it_fills_its_place_and_stays_where_that_gains_nothing() -> None:
    angle = math.radians(60.0)
    line = np.linspace(-1.0, 1.0, 50)[:, None] * np.array([[math.cos(angle), math.sin(angle)]])
    for shape, diagonal in ((3.0, math.atan2(1.0, 3.0)), (1.0 / 3.0, math.atan2(3.0, 1.0))):
        assert math.degrees(fitting_turn(line, shape)) == pytest.approx(math.degrees(diagonal) - 60.0, abs=3.0)
    around = np.linspace(0.0, 2.0 * math.pi, 100)
    assert fitting_turn(np.stack([np.cos(around), np.sin(around)], axis=1), 1.5) == 0.0


@pytest.mark.parametrize("draw", [flight_figure, first_sheet])
def test_signs_that_no_font_has_are_drawn_without_a_word(draw: Callable[..., Figure], tmp_path: Path) -> None:
    one = circling(rovinj(), label="\u6771\u4eac \x01")
    one = replace(one, race=replace(one.race, course=replace(one.course, name="\u6771\u4eac \x01")))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(draw(one), tmp_path / "drawn.png")
    assert (tmp_path / "drawn.png").stat().st_size > 0


def test_a_missed_gate_is_told_in_the_kneeboard() -> None:
    flight = circling(rovinj())
    lost = TimedCrossing(flight.crossings[3].passage, math.nan, {})
    flight = replace(flight, crossings=(*flight.crossings[:3], lost, *flight.crossings[4:]))
    words = [text.get_text() for text in kneeboard_texts(kneeboard_figures(flight))]
    assert "g3  - missed" in words


def test_names_that_look_like_formulas_are_written_as_they_are() -> None:
    flight = circling(rovinj(), label="a $\\frac{$ b")
    flight = replace(flight, race=replace(flight.race, course=replace(flight.course, name="$x^2$ {{ $\\nothing$")))
    for figure in (
        flight_figure(flight),
        first_sheet(flight),
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


@pytest.mark.parametrize("draw", [flight_figure, first_sheet])
def test_a_drawing_is_valid_xml_whatever_names_hold(draw: Callable[..., Figure], tmp_path: Path) -> None:
    race, hostile = rovinj(), "a\x1b[1m\a\ufffe\x00b"
    passages = tuple(replace(one, name=hostile) for one in race.course.passages)
    course = replace(race.course, name=hostile, passages=passages)
    path = tmp_path / "drawing.svg"
    save_figure(draw(circling(replace(race, course=course), label=hostile)), path)
    parser = XMLParser(target=TreeBuilder(insert_comments=True))  # in which a drawing names its texts
    assert "a␛[1m␇\ufffd␀b" in "".join(one.text or "" for one in ElementTree.parse(path, parser).iter(Comment))


def test_pages_of_a_kneeboard_end_before_a_gate_or_an_apex_and_are_never_empty() -> None:
    gate, cue, apex = KneeRow(("g1",), is_gate=True), KneeRow(("1", "0.00")), KneeRow(("", "", "apex"))
    assert rows_on_page([gate, cue, gate, cue], 3) == 2
    assert rows_on_page([gate, cue, cue, apex], 3) == 2
    assert rows_on_page([gate, cue, cue, apex], 9) == 4
    assert rows_on_page([gate] * 30, 20) == 20  # of a flight that missed them all
    assert rows_on_page([gate, cue], 0) == 1
