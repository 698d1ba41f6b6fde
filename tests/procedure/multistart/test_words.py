"""Ways in words, and what they are read off: where a flight goes, not how it is stored."""

import dataclasses
import math

import numpy as np
import pytest
from races import SMALL, prepared
from search_races import SLALOM, planned_coarse_solution
from transformations import mirrored

from airrace.procedure.guess import guess
from airrace.procedure.multistart.coarse_solution import CoarseSolution
from airrace.procedure.multistart.description import describe_route, named, shape_in_words, way_in_words
from airrace.procedure.multistart.segments import Shape, differing, same_way, shape, stretches
from airrace.procedure.multistart.tilted_turns import tilt_turn
from airrace.procedure.phase_segments import joined, phase_piece

DEGREE = math.radians(1.0)
FLAT = Shape(
    turn=180 * DEGREE,
    aside=180 * DEGREE,
    steepest=5 * DEGREE,
    height=22.0,
    rise=2.0,
    gain=0.0,
    overhead=False,
    seconds=6.0,
    length=500.0,
)
OVER = dataclasses.replace(FLAT, steepest=88 * DEGREE, height=163.0, rise=143.0, overhead=True)


@pytest.mark.parametrize(
    ("flown", "words"),
    [
        (FLAT, "180 degrees to the right, flat"),
        (dataclasses.replace(FLAT, turn=-180 * DEGREE), "180 degrees to the left, flat"),
        (dataclasses.replace(FLAT, turn=-3 * DEGREE), "straight, flat"),
        (dataclasses.replace(FLAT, height=83.0, rise=1.0, gain=61.0), "180 degrees to the right, climbing 60 m"),
        (dataclasses.replace(FLAT, turn=0.0, gain=-38.0), "straight, descending 40 m"),
        (dataclasses.replace(FLAT, height=83.0, rise=63.0), "180 degrees to the right, 80 m high"),
        (dataclasses.replace(FLAT, turn=3 * DEGREE, height=83.0, rise=63.0), "straight, 80 m high"),
        (OVER, "over the top to the right, 160 m high"),
        (dataclasses.replace(OVER, aside=0.1 * DEGREE), "over the top, 160 m high"),
        (dataclasses.replace(OVER, turn=-170 * DEGREE), "over the top to the left, 160 m high"),
        (dataclasses.replace(OVER, overhead=False), "180 degrees to the right, 160 m high"),
        (dataclasses.replace(OVER, steepest=40 * DEGREE), "180 degrees to the right, 160 m high"),
    ],
)
def test_shape_is_told_in_words(flown: Shape, words: str) -> None:
    assert shape_in_words(flown) == words


def test_way_names_the_passages_at_both_ends() -> None:
    course, places = SLALOM.course, stretches(SLALOM.course)
    assert [named(course, one) for one in places] == ["first -> left", "left -> right", "right -> last"]
    told = way_in_words(course, planned_coarse_solution(SLALOM), places[1:]).split("; ")
    assert [one.split(": ")[0] for one in told] == ["left -> right", "right -> last"]


def test_flight_is_told_by_its_long_turns() -> None:
    assert describe_route(SMALL.course, planned_coarse_solution(SMALL), stretches(SMALL.course)) == "no long turns"
    told = describe_route(SLALOM.course, planned_coarse_solution(SLALOM), stretches(SLALOM.course))
    assert [one.split(": ")[0] for one in told.split("; ")] == ["left -> right", "right -> last"]


def test_mirrored_flight_has_the_mirrored_shapes() -> None:
    image = mirrored(SLALOM)
    for place in stretches(SLALOM.course):
        own, seen = shape(planned_coarse_solution(SLALOM), place), shape(planned_coarse_solution(image), place)
        assert seen.turn == pytest.approx(-own.turn, abs=0.02)
        assert seen.overhead is own.overhead
        for name in ("steepest", "height", "rise", "seconds", "length"):
            assert getattr(seen, name) == pytest.approx(getattr(own, name), rel=0.02, abs=0.5), name


def test_stretches_lie_one_behind_the_other_over_the_whole_course() -> None:
    places = stretches(SMALL.course)
    assert [one.number for one in places] == list(range(len(places)))
    assert (places[0].first, places[-1].last) == (0, len(SMALL.course.passages) - 1)
    assert [one.last for one in places[:-1]] == [one.first for one in places[1:]]


def test_flight_differs_nowhere_from_itself_and_not_by_the_sign_of_its_quaternions() -> None:
    found, places = planned_coarse_solution(SMALL), stretches(SMALL.course)
    state = found.iterate.state.copy()
    state[4:8] *= -1.0
    turned = with_state(found, state)
    assert differing(found, found, places) == []
    assert differing(found, turned, places) == []


def test_flight_differs_where_it_is_moved_or_banked_otherwise() -> None:
    found, places = planned_coarse_solution(SMALL), stretches(SMALL.course)
    first, last = found.problem.first_node[1], found.problem.first_node[2]
    inside = slice(first + 1, last)
    higher = found.iterate.state.copy()
    higher[2, inside] -= 30.0
    assert differing(found, with_state(found, higher), places) == [places[1]]
    upside_down = found.iterate.state.copy()
    q0, q1, q2, q3 = found.iterate.state[4:8, inside]
    upside_down[4:8, inside] = np.array([-q1, q0, q3, -q2])  # rolled by half a turn
    assert differing(found, with_state(found, upside_down), places) == [places[1]]
    slightly = found.iterate.state.copy()
    slightly[:2, inside] += 3.0
    assert differing(found, with_state(found, slightly), places) == []


def test_stretches_of_the_same_flight_are_the_same_way_only_where_they_are_flown_in_one_place() -> None:
    found, places = planned_coarse_solution(SMALL), stretches(SMALL.course)
    assert same_way(found, places[1], found, places[1])
    assert not same_way(found, places[0], found, places[2])


def with_state(found: CoarseSolution, state: np.ndarray) -> CoarseSolution:
    return dataclasses.replace(found, iterate=dataclasses.replace(found.iterate, state=state))


# slanted turns


def level_turn() -> CoarseSolution:
    """The planned, level flight of the wound race, unsolved."""
    found = planned_coarse_solution(SLALOM)
    flight = prepared(SLALOM)
    return dataclasses.replace(found, flight=flight, iterate=guess(flight.plan, found.problem.mesh))


@pytest.mark.parametrize("angle", [50.0, 85.0])
def test_slanted_turn_keeps_its_ends_durations_and_mesh_and_leads_higher(angle: float) -> None:
    planned = level_turn()
    pieces = [phase_piece(planned.iterate, planned.problem, index) for index in (1, 2)]
    raised = tilt_turn(pieces, angle * DEGREE)
    own, other = joined(pieces), joined(raised)
    assert other.state.shape == own.state.shape
    assert other.control.shape == own.control.shape
    assert other.durations.tolist() == own.durations.tolist()
    assert other.state[:3, [0, -1]] == pytest.approx(own.state[:3, [0, -1]], abs=1e-9)
    assert -other.state[2].min() > -own.state[2].min() + 30.0
    assert (other.state[2] <= own.state[2] + 1e-9).all()  # nowhere lower
    assert np.linalg.norm(other.state[4:8], axis=0) == pytest.approx(1.0)


def test_turn_that_is_not_slanted_stays_where_it_is() -> None:
    planned = level_turn()
    pieces = [phase_piece(planned.iterate, planned.problem, index) for index in (1, 2)]
    assert joined(tilt_turn(pieces, 0.0)).state[:3] == pytest.approx(joined(pieces).state[:3], abs=1e-9)


def test_steeper_slant_leads_higher() -> None:
    planned = level_turn()
    pieces = [phase_piece(planned.iterate, planned.problem, index) for index in (1, 2)]
    tops = [-joined(tilt_turn(pieces, angle * DEGREE)).state[2].min() for angle in (0.0, 20.0, 50.0, 85.0)]
    assert tops == sorted(tops)
