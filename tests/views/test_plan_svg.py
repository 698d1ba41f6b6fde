"""The drawing for web pages: well-formed, within its frame, in the colours of the flight's speed."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from example_courses import everything
from example_courses import race as race_of

from airrace.inputs import load_inputs
from airrace.inputs.shipped import TRACKS
from airrace.planning.race import Race
from airrace.quantities import Quantity
from airrace.trajectory import Array, Trajectory
from airrace.views.course_page import course_page
from airrace.views.map_model import map_model
from airrace.views.plan_svg import COLOURS, plan_svg

SVG = "{http://www.w3.org/2000/svg}"


def drawn(race: Race, flight: Trajectory | None = None) -> ElementTree.Element:
    return ElementTree.fromstring(plan_svg(map_model(race), flight))


def places(root: ElementTree.Element, tag: str) -> Array:
    """All points of all lines of a kind, pixels; shape (n, 2)."""
    texts = [element.attrib["points"] for element in root.iter(f"{SVG}{tag}")]
    return np.array([[float(one) for one in pair.split(",")] for text in texts for pair in text.split()])


def flown(north: Array, east: Array, speed: Array) -> Trajectory:
    states = tuple(Quantity(name, unit) for name, unit in (("x", "m"), ("y", "m"), ("V_K", "m/s")))
    nodes = len(north)
    return Trajectory(
        phases=("0:a -> 1:b",),
        first_node=np.array([0, nodes - 1]),
        durations=np.array([10.0]),
        time=np.linspace(0.0, 10.0, nodes),
        states=states,
        state=np.stack([north, east, speed]),
        controls=(),
        control=np.zeros((0, nodes - 1)),
    )


@pytest.mark.parametrize("name", TRACKS.names)
def test_every_shipped_course_is_drawn_within_its_frame(name: str) -> None:
    root = drawn(load_inputs(name).race)
    width, height = float(root.attrib["width"]), float(root.attrib["height"])
    for circle in root.iter(f"{SVG}circle"):
        assert 0.0 < float(circle.attrib["cx"]) < width
        assert 0.0 < float(circle.attrib["cy"]) < height


def test_gates_and_pylons_bear_their_names() -> None:
    race = load_inputs("rovinj_2014").race
    written = {text.text for text in drawn(race).iter(f"{SVG}text")}
    assert {passage.element.name for passage in race.course.passages} <= written


def test_north_is_up_east_is_right_and_the_scale_is_the_same_both_ways() -> None:
    race = load_inputs("rovinj_2014").race
    north, east = np.array([0.0, 300.0, 300.0]), np.array([0.0, 0.0, 300.0])
    path = places(drawn(race, flown(north, east, np.array([80.0, 80.0, 80.0]))), "polyline")
    first, second, third = path[:3]
    assert second[0] == pytest.approx(first[0])
    assert first[1] - second[1] == pytest.approx(third[0] - second[0], abs=0.2)
    assert first[1] > second[1]


def test_a_flight_beyond_the_course_widens_the_drawing() -> None:
    race = load_inputs("rovinj_2014").race
    far = drawn(race, flown(np.array([0.0, 5000.0]), np.zeros(2), np.array([80.0, 90.0])))
    path = places(far, "polyline")
    assert path.min() >= 0.0
    assert path[:, 1].max() <= float(far.attrib["height"])


def test_the_colours_go_from_slow_to_fast() -> None:
    race = load_inputs("rovinj_2014").race
    speed = np.linspace(60.0, 110.0, 61)
    root = drawn(race, flown(np.linspace(0.0, 800.0, 61), np.zeros(61), speed))
    assert [line.attrib["stroke"] for line in root.iter(f"{SVG}polyline")] == list(COLOURS)


def test_everything_that_can_stand_beside_a_course_is_drawn_and_escaped(tmp_path: Path) -> None:
    race = race_of(everything(tmp_path))
    course = replace(race.course, name="<script>&")
    root = drawn(replace(race, course=course))
    titles = [title.text for title in root.iter(f"{SVG}title")]
    assert titles == ["<script>& from above"]
    hostile = replace(race, course=course)
    assert "<script>" not in course_page(hostile, map_model(hostile), ["a <b> warning"])
    assert len(list(root.iter(f"{SVG}polygon"))) > 0
