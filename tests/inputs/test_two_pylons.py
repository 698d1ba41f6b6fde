"""A gate that is given by its two pylons is the gate that stands between them."""

import math

import pytest

from airrace.errors import InputError
from airrace.inputs import Document, inputs_from_documents, load_inputs
from airrace.track.course import Course
from airrace.track.gates import Gate

TRACK = """schema: airrace/track/1
name: two gates
aircraft: edge540
origin: {latitude_deg: 45.0, longitude_deg: 13.0}
rules: {n_z_max: 10}
gates:
  a: {type: level, north_m: 0, east_m: 0, heading_deg: 0}
  b: {type: %s}
course: {start: a, lap: [b]}
"""
AIRCRAFT = load_inputs("half_cuban_eight").aircraft


def course(gate: str) -> Course:
    return inputs_from_documents(Document("t.yaml", TRACK % gate), AIRCRAFT, None, ()).race.course


def second(gate: str) -> Gate:
    element = course(gate).passages[1].element
    assert isinstance(element, Gate)
    return element


def refused(gate: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        course(gate)
    return [f"{one.key}: {one.message}" for one in caught.value.findings]


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, 90.0, 200.0, 350.0])
@pytest.mark.parametrize("width", [12.0, 14.0])
def test_the_pylons_of_a_gate_say_where_it_stands(heading_deg: float, width: float) -> None:
    heading = math.radians(heading_deg)
    across = 0.5 * width * math.cos(heading + math.pi / 2), 0.5 * width * math.sin(heading + math.pi / 2)
    left, right = ((600.0 + side * across[0], 80.0 + side * across[1]) for side in (-1.0, 1.0))
    places = ", ".join(f"{{north_m: {north!r}, east_m: {east!r}}}" for north, east in (left, right))
    gate = second(f"level, pylons: [{places}]")
    same = second(f"level, north_m: 600, east_m: 80, heading_deg: {heading_deg}, width_m: {width}")
    assert (gate.north, gate.east, gate.width) == pytest.approx((same.north, same.east, same.width))
    assert math.cos(gate.heading - same.heading) == pytest.approx(1.0)


def test_exchanged_pylons_turn_the_gate() -> None:
    one, other = "{north_m: 606.5, east_m: 80}", "{north_m: 593.5, east_m: 80}"
    first, second_one = second(f"level, pylons: [{one}, {other}]"), second(f"level, pylons: [{other}, {one}]")
    assert math.degrees(first.heading) == pytest.approx(90.0)
    assert math.cos(first.heading - second_one.heading) == pytest.approx(-1.0)


def test_pylons_may_be_given_in_degrees() -> None:
    gate = second(
        "knife-edge, bank: left, pylons: "
        "[{latitude_deg: 45.005, longitude_deg: 13.001}, {latitude_deg: 45.005, longitude_deg: 13.00115}]"
    )
    assert gate.width == pytest.approx(11.83, abs=0.02)
    assert math.cos(gate.heading) == pytest.approx(1.0, abs=1e-4)


def test_a_quad_may_be_given_by_its_first_gate() -> None:
    pylons = "[{north_m: 600, east_m: 73.5}, {north_m: 600, east_m: 86.5}]"
    first, other = course(f"quad, then: left, pylons: {pylons}").passages[1:]
    assert isinstance(first.element, Gate)
    assert isinstance(other.element, Gate)
    assert math.cos(first.element.heading) == pytest.approx(1.0)
    assert math.sin(other.element.heading) == pytest.approx(-1.0)


PYLONS = "pylons: [{north_m: 606.5, east_m: 80}, {north_m: 593.5, east_m: 80}]"


@pytest.mark.parametrize("twice", ["heading_deg: 3", "width_m: 12", "north_m: 600, east_m: 80", "latitude_deg: 45"])
def test_a_place_that_is_given_twice_is_refused(twice: str) -> None:
    found = refused(f"level, {PYLONS}, {twice}")
    key = twice.split(":")[0]
    assert f"gates.b.{key}: the gate's place is given twice; keep it, or `pylons`" in found


def test_pylons_that_are_none_are_refused() -> None:
    same = refused("level, pylons: [{north_m: 600, east_m: 80}, {north_m: 600, east_m: 80}]")
    assert "gates.b.pylons: both pylons stand in the same place" in same
    (half,) = refused("level, pylons: [{north_m: 600, east_m: 80}, {north_m: 600}]")
    assert half.startswith("gates.b.pylons.1.east_m: missing")
    (neither,) = refused("level, north_m: 600, east_m: 80")
    assert neither.endswith("its axis when flown forward; or its two `pylons`")
    assert refused("level, pylons: [{north_m: 600, east_m: 80}]")
