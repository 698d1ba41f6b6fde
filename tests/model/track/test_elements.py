"""Elements of a course, and geodetic places."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.model.dynamics.observations import CrossingParameters, crossing_values
from airrace.model.frames import quaternion
from airrace.model.track.course import Origin, geodetic, metres
from airrace.model.track.element import Direction, Element
from airrace.model.track.gates import Gate, Manoeuvre, Passing, Pylon, Tolerances
from airrace.optimal_control.quantities import Interval
from airrace.procedure.formulation import crossing_parameters

SPAN = 7.43
HALF_TURN = math.pi
angles = st.floats(-math.pi, math.pi)
lengths = st.floats(-1000.0, 1000.0)
heights = st.floats(15.0, 200.0)
passings = st.sampled_from(Passing)


@st.composite
def tolerances(draw: st.DrawFn, height: float) -> Tolerances:
    below, above = draw(st.floats(0.0, 10.0)), draw(st.floats(0.0, 10.0))
    return Tolerances(
        clearance=draw(st.floats(0.1, 2.0)),
        height=Interval(height - below, height + above),
        bank=draw(st.floats(0.05, 1.5)),
        climb=Interval(-draw(st.floats(0.1, 1.0)), draw(st.floats(0.1, 1.0))),
        crossing=draw(st.floats(0.2, 1.4)),
    )


@st.composite
def gates(draw: st.DrawFn) -> Gate:
    height = draw(heights)
    where = draw(lengths), draw(lengths), height
    bank = draw(st.sampled_from((0.0, math.pi / 2, -math.pi / 2)))
    return Gate("g", *where, draw(angles), draw(st.floats(12.0, 20.0)), draw(passings), draw(tolerances(height)), bank)


@st.composite
def pylons(draw: st.DrawFn) -> Pylon:
    height = draw(heights)
    where = draw(lengths), draw(lengths), height
    return Pylon("p", *where, draw(angles), draw(st.floats(50.0, 200.0)), draw(passings), draw(tolerances(height)))


@st.composite
def manoeuvres(draw: st.DrawFn) -> Manoeuvre:
    optional = st.none() | angles
    climb = draw(st.none() | st.floats(-1.5, 1.5))
    where = {name: Interval.exactly(draw(lengths)) for name in ("north", "east", "height")}
    return Manoeuvre("m", bank=draw(optional), climb=climb, heading=draw(optional), **where)


elements = st.one_of(gates(), pylons(), manoeuvres())


@given(element=elements, direction=st.sampled_from(Direction), reference=angles)
def test_what_is_planned_along_the_axis_fulfils_the_conditions(
    element: Element, direction: Direction, reference: float
) -> None:
    for way in element.crossings(direction, reference, rolling=False):
        if abs(way.heading - way.axis) > 1e-9 or way.position is None:
            continue
        bank = way.bank or 0.0
        north, east, height = way.position
        position = (north, east, -height)
        q = quaternion(way.heading, way.climb, bank)
        place: CrossingParameters[float] = crossing_parameters(element.frame(way.axis, bank, SPAN))
        seen = vars(crossing_values(position=position, V_K=90.0, q=q, place=place))
        seen |= {"x": north, "y": east, "z": -height}
        for name, allowed in element.conditions(way.axis).items():
            assert allowed.lower - 1e-8 <= seen[name] <= allowed.upper + 1e-8, name


@given(element=elements, reference=angles)
def test_a_course_that_is_prescribed_is_among_those_of_the_plan(element: Element, reference: float) -> None:
    for direction in (Direction.FORWARD, Direction.REVERSE):
        course = element.course(direction)
        if course is not None:
            assert course in [way.heading for way in element.crossings(direction, reference, rolling=False)]


@given(gate=gates(), reference=angles)
def test_a_gate_still_to_be_planned_may_be_flown_either_way(gate: Gate, reference: float) -> None:
    both = gate.crossings(Direction.PLANNED, reference, rolling=False)
    ways = [gate.crossings(one, reference, rolling=False) for one in (Direction.FORWARD, Direction.REVERSE)]
    assert both == [*ways[0], *ways[1]]


@given(element=elements)
def test_a_drawing_lies_about_the_place(element: Element) -> None:
    drawing = element.drawing()
    assert drawing.legend
    for stretch in (drawing.across, drawing.window):
        if stretch is not None:
            middle = [0.5 * (stretch[0].north + stretch[1].north), 0.5 * (stretch[0].east + stretch[1].east)]
            assert middle == pytest.approx(element.place, abs=1e-9)


@given(element=st.one_of(gates(), pylons()))
def test_what_stands_somewhere_is_planned_at_its_nominal_height(element: Gate | Pylon) -> None:
    assert element.stands
    assert element.position == (element.north, element.east, element.height)
    assert element.heights.lower <= element.height <= element.heights.upper
    planned = element.crossings(Direction.FORWARD, 0.0, rolling=False)
    assert {way.position[2] for way in planned if way.position is not None} == {element.height}


ROVINJ = Origin(math.radians(45.08), math.radians(13.63), 10.0)


@given(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4), st.floats(-60.0, 60.0))
def test_there_and_back_again(north: float, east: float, latitude: float) -> None:
    origin = Origin(math.radians(latitude), 0.3, 250.0)
    back = metres(*geodetic(np.array([north]), np.array([east]), origin), origin)
    assert float(back[0][0]) == pytest.approx(north, abs=1e-6)
    assert float(back[1][0]) == pytest.approx(east, abs=1e-6)


def test_a_minute_of_latitude_is_about_a_sea_mile() -> None:
    latitude, _ = geodetic(np.array([1852.0]), np.array([0.0]), ROVINJ)
    assert math.degrees(float(latitude[0]) - math.radians(45.08)) * 60.0 == pytest.approx(1.0, abs=2e-3)


def test_a_course_without_an_origin_lies_nowhere() -> None:
    assert not Origin().has_coordinates
    with pytest.raises(ValueError, match="no latitude"):
        geodetic(np.zeros(1), np.zeros(1), Origin())
