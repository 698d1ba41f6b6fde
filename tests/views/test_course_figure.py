"""The drawing of a course: to scale, complete, and with labels that cover nothing."""

import io
import itertools
from pathlib import Path

import numpy as np
import pytest
from example_courses import SHIPPED, everything, race
from hypothesis import example, given
from hypothesis import strategies as st

from airrace.track.gates import Gate
from airrace.views.course_figure import course_figure
from airrace.views.labels import Box, placed
from airrace.views.map_model import map_model


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_course_is_drawn_with_one_scale_and_all_names(path: Path) -> None:
    flown = race(path)
    seen = map_model(flown)
    figure = course_figure(flown, seen)
    (axes,) = figure.axes
    assert axes.get_aspect() == 1.0
    texts = [text.get_text() for text in axes.texts if text.get_text()]
    assert {text.split("  ")[0] for text in texts} == {mark.label for mark in seen.marks if mark.label}
    numbers = sorted(int(number) for text in texts for number in text.split("  ")[1].split(", "))
    assert numbers == sorted(number for mark in seen.marks for number, _ in mark.passings)


def test_labels_do_not_overlap() -> None:
    for path in SHIPPED:
        flown = race(path)
        figure = course_figure(flown, map_model(flown))
        figure.savefig(io.BytesIO(), format="png", dpi=figure.dpi)
        (axes,) = figure.axes
        boxes = [text.get_window_extent() for text in axes.texts if text.get_text()]
        for one, other in itertools.combinations(boxes, 2):
            common = one.intersection(one, other)
            assert common is None or common.width * common.height < 0.1 * one.width * one.height, path.stem


def test_gates_stand_to_scale() -> None:
    flown = race(SHIPPED[0])
    seen = map_model(flown)
    (axes,) = course_figure(flown, seen).axes
    drawn = np.concatenate([np.column_stack(line.get_data()) for line in axes.lines if len(line.get_xdata())])
    for mark in seen.marks:
        if isinstance(mark.element, Gate):
            half = 0.5 * mark.element.width
            away = np.hypot(drawn[:, 0] - mark.east, drawn[:, 1] - mark.north)
            assert (np.abs(away - half) < 1e-6).sum() >= 2


def test_the_legend_names_what_is_there_and_only_that(tmp_path: Path) -> None:
    def entries(path: Path) -> str:
        flown = race(path)
        (legend,) = course_figure(flown, map_model(flown)).legends
        return "\n".join(text.get_text() for text in legend.get_texts())

    full = entries(everything(tmp_path))
    for piece in ("lap 1", "crowd", "beach", "on the way to q/1, q/2", "airspace", "gate", "pylon"):
        assert piece in full
    bare = entries(next(path for path in SHIPPED if path.stem == "rovinj_2014"))
    assert not any(piece in bare for piece in ("crowd", "forbidden", "airspace", "lap 2"))


def test_the_wind_is_drawn_where_there_is_one(tmp_path: Path) -> None:
    flown = race(everything(tmp_path))
    (axes,) = course_figure(flown, map_model(flown)).axes
    assert "wind 34 kt" in [text.get_text() for text in axes.texts]


def test_a_course_is_drawn_the_same_every_time(tmp_path: Path) -> None:
    flown = race(everything(tmp_path))
    images: list[bytes] = []
    for _ in range(2):
        content = io.BytesIO()
        course_figure(flown, map_model(flown)).savefig(content, format="png")
        images.append(content.getvalue())
    assert images[0] == images[1]


places = st.lists(st.tuples(st.floats(0, 1000), st.floats(0, 1000)), min_size=1, max_size=12, unique=True)


@example(anchors=[(0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (1.0, 0.0)])  # a corner with hardly any room
@given(anchors=places)
def test_labels_stay_within_the_frame_and_near_what_they_name(anchors: list[tuple[float, float]]) -> None:
    frame = Box(0.0, 0.0, 1000.0, 1000.0)
    boxes = placed(anchors, [(60.0, 12.0)] * len(anchors), np.array(anchors), frame, gap=5.0)
    for (across, up), box in zip(anchors, boxes, strict=True):
        assert box.overlap(frame) > 0.9 * box.width * box.height
        assert abs(box.left + 30.0 - across) <= 30.0 + 5.5 * 5.0 + 1e-6
        assert abs(box.bottom + 6.0 - up) <= 6.0 + 5.5 * 5.0 + 1e-6


def test_a_label_makes_way_for_what_is_drawn_and_for_other_labels() -> None:
    frame = Box(-500.0, -500.0, 1000.0, 1000.0)
    along = np.column_stack([np.linspace(0.0, 200.0, 50), np.zeros(50)])
    anchors = [(0.0, 0.0), (1.0, 1.0)]
    first, second = placed(anchors, [(60.0, 12.0)] * 2, along, frame, gap=5.0)
    assert first.holds(along) == second.holds(along) == 0
    assert first.overlap(second) == 0.0
