"""A transformed race is the same race: changed back it is as before, and whatever is measured on a course stays."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest
from transformations import Change, changed, mirrored, moved, rotated

from airrace.files.inputs import Document, inputs_from_documents, load_inputs
from airrace.model.track.course import Turning
from airrace.model.track.gates import Gate, Manoeuvre, Pylon
from airrace.model.track.polygons import Point, distance, inside, to_right
from airrace.optimal_control.quantities import Interval
from airrace.procedure.planning.plan import plan
from airrace.procedure.planning.planning_model import cruise
from airrace.race import Race

ROOT = Path(__file__).parents[1]
TRACKS = sorted(path.stem for path in (ROOT / "tracks").glob("*.yaml"))
EVERYTHING = """
schema: airrace/track/1
name: Everything that has a place or a direction
aircraft: edge540.yaml
environment:
  wind: {from_deg: 290, speed_m_s: 7}
  thermals: [{north_m: 150, east_m: 80, w_star_m_s: 2, mixing_height_m: 1000}]
rules: {n_z_max: 10}
gates:
  first: {type: level, north_m: 0, east_m: 10, heading_deg: 20, height_m: 20, width_m: 13}
  pylon: {type: pylon, north_m: 300, east_m: 60, pass_side_deg: 110, height_m: 20, clearance_m: 3, reach_m: 90}
  edge: {type: knife-edge, north_m: 480, east_m: -120, heading_deg: 270, height_m: 20, width_m: 13, bank: right}
  any: {type: knife-edge, north_m: 380, east_m: -320, heading_deg: 200, height_m: 20, width_m: 13}
  roll: {type: vertical-roll, roll_deg: 180, turning: left}
  corner: {type: manoeuvre, north_m: 250, east_m: -310, height_m: 60, heading_deg: 170, bank_deg: 30}
  last: {type: level, north_m: 20, east_m: -300, heading_deg: 170, height_m: 20, width_m: 13}
safety_lines:
  shore: {from: {north_m: 0, east_m: 200}, to: {north_m: 400, east_m: 250}, keep: left, margin_m: 5}
crowd:
  stands: {line: [{north_m: 0, east_m: 400}, {north_m: 300, east_m: 420}], distance_m: 100}
airspace:
  - {north_m: -500, east_m: -900}
  - {north_m: 1000, east_m: -900}
  - {north_m: 1000, east_m: 390}
  - {north_m: -500, east_m: 390}
course:
  start: first
  lap: [{gate: pylon, safety_lines: [shore]}, edge, any, roll, corner]
  finish: last
"""
AIRCRAFT = Document("edge540.yaml", (ROOT / "configs" / "edge540.yaml").read_text(encoding="utf-8"))
FULL = inputs_from_documents(Document("everything.yaml", EVERYTHING), AIRCRAFT, None, ()).race
SHIPPED = {name: load_inputs(ROOT / "tracks" / f"{name}.yaml").race for name in TRACKS}
RACES = {**SHIPPED, "everything": FULL}
ANGLE = math.radians(37.0)
CHANGES = [Change(mirror=True), Change(turn=ANGLE), Change(north=1234.0, east=-567.0), Change(True, ANGLE, 80.0, -9.0)]
AZIMUTHS = {"heading", "side", "origin"}


def numbers(value: Any, name: str = "") -> list[Any]:
    """Everything in a race, in order; a direction is its cosine and its sine."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return [one for field in dataclasses.fields(value) for one in numbers(getattr(value, field.name), field.name)]
    if isinstance(value, tuple):
        return [one for part in value for one in numbers(part)]
    if name in AZIMUTHS and isinstance(value, float):
        return [math.cos(value), math.sin(value)]
    return [value]


def same(race: Race, other: Race) -> bool:
    """Whether two races are the same but for rounding."""
    ours, theirs = numbers(race), numbers(other)
    assert len(ours) == len(theirs)
    return all(
        one == pytest.approx(two, rel=1e-12, abs=1e-9)
        if isinstance(one, float) and isinstance(two, float) and not math.isinf(one)
        else one == two
        for one, two in zip(ours, theirs, strict=True)
    )


def places(race: Race) -> list[Point]:
    """Where the elements stand, as far as they stand somewhere."""
    found: list[Point] = []
    for passage in race.course.passages:
        match passage.element:
            case Gate() | Pylon() as one:
                found.append(Point(one.north, one.east))
            case Manoeuvre(north=north, east=east):
                found += [Point(north.lower, east.lower)] if north.lower == north.upper else []
    return found


def measured(race: Race) -> list[float]:
    """Distances between elements, from lines, crowd and thermals, and angles between directions."""
    stood, course = places(race), race.course
    lines = [(line, passage) for passage in course.passages for line in passage.safety_lines]
    values = [math.dist((a.north, a.east), (b.north, b.east)) for a in stood for b in stood]
    values += [(1 if line.keep_right else -1) * to_right(line.start, line.end, a) for line, _ in lines for a in stood]
    values += [distance(a, crowd.corners, closed=False) for crowd in course.crowd for a in stood]
    values += [math.dist((one.north, one.east), (a.north, a.east)) for one in race.air.thermals for a in stood]
    values += [float(inside(a, course.airspace)) for a in stood if course.airspace]
    wind = race.air.wind
    for passage in course.passages:
        if wind is not None and isinstance(passage.element, Gate):
            values.append(math.cos(passage.element.heading - wind.origin))
        if isinstance(passage.element, Gate):  # how far its axis and its bank point to the next element's place
            gate = passage.element
            for a in stood:
                along = math.cos(gate.heading) * (a.north - gate.north) + math.sin(gate.heading) * (a.east - gate.east)
                right = math.cos(gate.heading) * (a.east - gate.east) - math.sin(gate.heading) * (a.north - gate.north)
                values += [along, right * math.sin(gate.bank)]
        if isinstance(passage.element, Pylon):
            one = passage.element
            values += [
                math.cos(one.side) * (a.north - one.north) + math.sin(one.side) * (a.east - one.east) for a in stood
            ]
    return values


@pytest.mark.parametrize("name", RACES)
def test_a_race_mirrored_turned_or_moved_there_and_back_is_the_race(name: str) -> None:
    race = RACES[name]
    assert mirrored(mirrored(race)) == race
    assert same(rotated(race, 2.0 * math.pi), race)
    assert same(rotated(rotated(race, ANGLE), -ANGLE), race)
    assert not same(rotated(race, ANGLE), race)
    assert same(moved(moved(race, 1234.0, -567.0), -1234.0, 567.0), race)
    assert not same(moved(race, 0.0, 1.0), race)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", RACES)
def test_nothing_that_is_measured_on_a_course_depends_on_where_it_lies(name: str, change: Change) -> None:
    race = RACES[name]
    assert measured(changed(race, change)) == pytest.approx(measured(race), rel=1e-9, abs=1e-8)


@pytest.mark.parametrize("change", [Change(mirror=True), Change(turn=math.radians(40.0)), Change(north=1e3, east=-5e2)])
@pytest.mark.parametrize("name", TRACKS)
def test_a_transformed_race_is_planned_to_take_as_long(name: str, change: Change) -> None:
    race = RACES[name]
    other = changed(race, change)  # 40 degrees, for courses at pylons are planned on a grid of 10
    times = [plan(one.course, cruise(one.aircraft, one.course.rules)).seconds for one in (race, other)]
    assert times[1] == pytest.approx(times[0], rel=1e-9)


def test_a_mirror_exchanges_left_and_right() -> None:
    image = mirrored(FULL)
    rolls = [passage.roll for passage in image.course.passages if passage.roll is not None]
    assert [roll.turning for roll in rolls] == [Turning.RIGHT]
    banks = {one.element.name: one.element.bank for one in image.course.passages if isinstance(one.element, Gate)}
    assert banks["edge"] == -math.pi / 2
    (line,) = [line for passage in image.course.passages for line in passage.safety_lines]
    assert line.keep_right


def test_a_range_is_mirrored_and_moved_but_not_turned() -> None:
    first, *others = FULL.course.passages
    anywhere = Manoeuvre("anywhere", north=Interval(10.0, 20.0), east=Interval(-5.0, 40.0))
    passages = (first, dataclasses.replace(first, element=anywhere), *others)
    race = dataclasses.replace(FULL, course=dataclasses.replace(FULL.course, passages=passages))
    image = changed(race, Change(mirror=True, north=1.0, east=100.0)).course.passages[1].element
    assert isinstance(image, Manoeuvre)
    assert (image.north, image.east) == (Interval(11.0, 21.0), Interval(60.0, 105.0))
    with pytest.raises(ValueError, match="anywhere lies within a range"):
        rotated(race, ANGLE)
