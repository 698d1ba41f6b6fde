"""The courses that come with the package, as they are understood."""

import json
import math
from pathlib import Path

import pytest
from language_texts import ROOT

from airrace.inputs import inputs_from_documents, load_inputs
from airrace.quantities import Interval
from airrace.track.course import Direction
from airrace.track.gates import Gate, Manoeuvre


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_courses_load_and_can_be_loaded_again_from_their_texts(path: Path) -> None:
    inputs = load_inputs(path)
    assert json.loads(json.dumps(inputs.resolved, allow_nan=False)) == inputs.resolved
    assert inputs_from_documents(inputs.track, inputs.aircraft, inputs.settings_file, inputs.overrides) == inputs


def test_rovinj_is_flown_out_and_back() -> None:
    passages = load_inputs(ROOT / "tracks/rovinj_2014.yaml").race.course.passages
    gates = [passage.element.name for passage in passages]
    assert gates == gates[::-1]
    assert len(gates) == 17
    flown: dict[str, set[Direction]] = {}
    for passage in passages:
        if isinstance(passage.element, Gate):
            flown.setdefault(passage.element.name, set()).add(passage.direction)
    assert all(directions == {Direction.FORWARD, Direction.REVERSE} for directions in flown.values())


def test_every_gate_of_rovinj_is_flown_towards_the_next_one() -> None:
    """Within 60 degrees of the way from the previous to the next element, but for the turn at g0."""
    passages = load_inputs(ROOT / "tracks/rovinj_2014.yaml").race.course.passages
    for before, here, after in zip(passages, passages[1:], passages[2:], strict=False):
        assert not isinstance(before.element, Manoeuvre)
        assert not isinstance(after.element, Manoeuvre)
        if isinstance(here.element, Gate) and before.element != after.element:
            chord = math.atan2(after.element.east - before.element.east, after.element.north - before.element.north)
            heading = here.element.heading + (math.pi if here.direction is Direction.REVERSE else 0.0)
            assert math.cos(heading - chord) > 0.5, here.name


def test_sixteen_phases_has_sixteen_and_a_quad() -> None:
    course = load_inputs(ROOT / "tracks/sixteen_phases.yaml").race.course
    assert len(course.passages) == 17
    west, south = (passage.element for passage in course.passages[5:7])
    assert isinstance(west, Gate)
    assert isinstance(south, Gate)
    assert (west.north, west.east) == (south.north, south.east)
    assert math.cos(west.heading - south.heading) == pytest.approx(0.0, abs=1e-12)
    assert {passage.element.height for passage in course.passages} == {20.0}


def test_the_half_cuban_eight_is_laterally_free_between_its_ends() -> None:
    _, *between, _ = load_inputs(ROOT / "tracks/half_cuban_eight.yaml").race.course.passages
    assert len(between) == 3
    for passage in between:
        assert isinstance(passage.element, Manoeuvre)
        assert (passage.element.north, passage.element.east) == (Interval(), Interval())
