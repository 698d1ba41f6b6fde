"""The plan: every element is crossed as it may be, and no other choice of headings is shorter."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from races import BESIDE, COURSES, DEGREE, EDGE_540, RACES, ROOT, SHIPPED, WINDOW, course, knife_edge, level
from races import planned as plan_of
from races import pylon as pylon_at
from transformations import mirrored, rotated

from airrace.environment.air import Air
from airrace.frames import angle_between
from airrace.inputs import load_inputs
from airrace.planning.plan import ONE_PLACE, Plan, plan
from airrace.planning.planning_model import cruise
from airrace.planning.race import Race
from airrace.planning.route_decisions import ANY, TWIN
from airrace.track.course import Direction
from airrace.track.gates import Gate, Manoeuvre, Pylon

every_race = pytest.mark.parametrize("name", RACES)
OFFICIAL_SECONDS = 59.012  # of the winner at Rovinj in 2014, see the track file


def race_of(*elements: Gate | Pylon) -> Race:
    return Race(course("built", *elements), EDGE_540, Air())


@every_race
def test_all_passages_are_planned_in_the_order_flown(name: str) -> None:
    planned = plan_of(RACES[name])
    assert [waypoint.passage for waypoint in planned.waypoints] == list(RACES[name].course.passages)
    assert len(planned.legs) == len(planned.waypoints) - 1


@every_race
def test_gates_are_crossed_at_their_centre_and_within_their_crossing_angle(name: str) -> None:
    for waypoint in plan_of(RACES[name]).waypoints:
        gate = waypoint.passage.element
        if isinstance(gate, Gate):
            assert waypoint.position == (gate.north, gate.east, gate.height)
            forward = math.cos(waypoint.axis - gate.heading)
            expected = {Direction.FORWARD: 1.0, Direction.REVERSE: -1.0}[waypoint.passage.direction]
            assert forward == pytest.approx(expected)
            assert abs(angle_between(waypoint.heading, waypoint.axis)) <= gate.tolerances.crossing + 1e-9
            assert waypoint.bank == gate.bank


@every_race
def test_pylons_are_passed_on_their_side_beyond_clearance_and_wing(name: str) -> None:
    for waypoint in plan_of(RACES[name]).waypoints:
        element = waypoint.passage.element
        if isinstance(element, Pylon):
            assert waypoint.position is not None
            offset = (waypoint.position[0] - element.north, waypoint.position[1] - element.east)
            beside = offset[0] * math.cos(element.side) + offset[1] * math.sin(element.side)
            along = offset[0] * math.sin(element.side) - offset[1] * math.cos(element.side)
            assert element.tolerances.clearance + EDGE_540.airframe.b / 2 < beside < element.reach
            assert along == pytest.approx(0.0, abs=1e-9)
            assert math.cos(waypoint.axis - element.side) == pytest.approx(0.0, abs=1e-9)
            assert abs(angle_between(waypoint.heading, waypoint.axis)) <= element.tolerances.crossing + 1e-9


@every_race
def test_manoeuvres_keep_what_they_prescribe(name: str) -> None:
    for waypoint in plan_of(RACES[name]).waypoints:
        element = waypoint.passage.element
        if isinstance(element, Manoeuvre):
            assert waypoint.position == element.position
            assert waypoint.climb == (element.climb or 0.0)
            assert waypoint.bank == element.bank
            assert element.heading is None or waypoint.heading == element.heading


@every_race
def test_legs_lead_from_waypoint_to_waypoint_in_the_planned_direction(name: str) -> None:
    planned = plan_of(RACES[name])
    for leg, (a, b) in zip(planned.legs, itertools.pairwise(planned.waypoints), strict=True):
        if leg.path is None:
            assert a.position is None or b.position is None or a.climb or b.climb
            continue
        north, east, heading = (values.tolist() for values in leg.path.points(np.array([0.0, leg.path.length])))
        assert a.position is not None
        assert b.position is not None
        assert north == pytest.approx([a.position[0], b.position[0]], abs=1e-6)
        assert east == pytest.approx([a.position[1], b.position[1]], abs=1e-6)
        assert abs(angle_between(heading[0], a.heading)) < 1e-9
        assert abs(angle_between(heading[1], b.heading)) < 1e-6
        assert max(abs(one) for one in leg.path.curvatures) <= 1.0 / planned.cruise.radius + 1e-12


@every_race
def test_planned_time_is_that_of_its_legs_and_no_shorter_than_straight_lines(name: str) -> None:
    planned = plan_of(RACES[name])
    level_legs = sum(leg.path.length for leg in planned.legs if leg.path is not None) / planned.cruise.V
    assert level_legs <= planned.seconds + 1e-9
    if all(leg.path is not None for leg in planned.legs):
        assert planned.seconds == pytest.approx(level_legs)
        at = [waypoint.position for waypoint in planned.waypoints if waypoint.position is not None]
        straight = sum(math.dist(a[:2], b[:2]) for a, b in itertools.pairwise(at))
        assert straight / planned.cruise.V <= planned.seconds


def test_planned_time_of_rovinj_is_near_the_official_one() -> None:
    assert plan_of(SHIPPED["rovinj_2014"]).seconds == pytest.approx(OFFICIAL_SECONDS, rel=0.1)


@every_race
def test_mirrored_course_has_the_mirrored_plan(name: str) -> None:
    planned, image = plan_of(RACES[name]), plan_of(mirrored(RACES[name]))
    assert image.seconds == pytest.approx(planned.seconds, rel=1e-12)
    for a, b in zip(planned.waypoints, image.waypoints, strict=True):
        assert abs(angle_between(a.heading, -b.heading)) < 1e-9
        assert b.climb == a.climb
        assert (b.bank or 0.0) == -(a.bank or 0.0)
        if a.position is not None:
            north, east, height = a.position
            assert b.position == pytest.approx((north, -east, height), abs=1e-9)


@pytest.mark.parametrize("angle", [1.0, 37.0, 170.0, 260.0])
@pytest.mark.parametrize("name", [*RACES, "air_race_x_2024"])
def test_plan_does_not_depend_on_the_direction_of_north(name: str, angle: float) -> None:
    race = RACES[name] if name in RACES else load_inputs(ROOT / "tracks" / f"{name}.yaml").race
    assert plan_of(rotated(race, angle * DEGREE)).seconds == pytest.approx(plan_of(race).seconds, rel=1e-6)
    assert plan_of(mirrored(race)).seconds == pytest.approx(plan_of(race).seconds, rel=1e-6)


@pytest.mark.parametrize("name", [*RACES, "air_race_x_2024"])
def test_twin_of_a_plan_is_the_mirror_image_of_the_plan_of_the_mirrored_course(name: str) -> None:
    """So whatever is planned of a course is planned of its image, too, though not in the same order."""
    race = RACES[name] if name in RACES else load_inputs(ROOT / "tracks" / f"{name}.yaml").race
    image = mirrored(race)
    twin, other = (
        plan(one.course, cruise(one.aircraft, one.course.rules), how) for one, how in ((race, TWIN), (image, ANY))
    )
    assert twin.seconds == pytest.approx(plan_of(race).seconds, rel=1e-9)
    for a, b in zip(twin.waypoints, other.waypoints, strict=True):
        assert angle_between(a.heading, -b.heading) == pytest.approx(0.0, abs=1e-9)
        assert a.rolled == pytest.approx(-b.rolled, abs=1e-9)


def exhaustive_seconds(race: Race) -> float:
    """The shortest of all plans in which every gate is crossed at one of its allowed multiples of 10 degrees."""
    shortest = math.inf
    gates = [passage.element for passage in race.course.passages]
    choices = [[10.0 * step for step in range(-2, 3)] for _ in gates]
    for offsets in itertools.product(*choices):
        aimed = [
            dataclasses.replace(
                gate,
                heading=gate.heading + offset * DEGREE,
                tolerances=dataclasses.replace(gate.tolerances, crossing=1e-6),
            )
            for gate, offset in zip(gates, offsets, strict=True)
            if isinstance(gate, Gate)
        ]
        shortest = min(shortest, plan_of(race_of(*aimed)).seconds)
    return shortest


def test_no_choice_of_headings_is_shorter_than_the_plan() -> None:
    narrow = dataclasses.replace(WINDOW, crossing=20 * DEGREE)
    gates = [
        dataclasses.replace(gate, tolerances=narrow)
        for gate in (level("a", 0, 0, 10), level("b", 300, 90, 80), level("c", 200, 420, 200))
    ]
    assert plan_of(race_of(*gates)).seconds == pytest.approx(exhaustive_seconds(race_of(*gates)), rel=1e-12)


def directed(direction: Direction) -> Plan:
    """Three gates, the middle one flown in a direction."""
    race = race_of(level("a", 0, 0, 0), level("b", 400, 50, 175), level("c", 800, 0, 0))
    a, b, c = race.course.passages
    passages = (a, dataclasses.replace(b, direction=direction), c)
    return plan_of(dataclasses.replace(race, course=dataclasses.replace(race.course, passages=passages)))


def test_direction_left_to_the_plan_is_the_shorter_one() -> None:
    forward, reverse = directed(Direction.FORWARD), directed(Direction.REVERSE)
    assert reverse.seconds < forward.seconds
    assert directed(Direction.PLANNED).waypoints[1].heading == reverse.waypoints[1].heading
    assert directed(Direction.PLANNED).seconds == reverse.seconds


def test_wider_crossing_angle_never_makes_the_plan_longer() -> None:
    seconds = []
    for crossing in (0.1, 15.0, 30.0, 60.0):
        tolerances = dataclasses.replace(WINDOW, crossing=crossing * DEGREE)
        gates = [
            dataclasses.replace(gate, tolerances=tolerances)
            for gate in (level("a", 0, 0, 0), level("b", 250, 200, 20), level("c", 0, 420, 150))
        ]
        seconds.append(plan_of(race_of(*gates)).seconds)
    assert seconds == sorted(seconds, reverse=True)
    assert seconds[-1] < seconds[0]


@pytest.mark.parametrize(("side", "bank"), [(1.0, math.pi / 2), (-1.0, -math.pi / 2)])
def test_knife_edge_gate_for_either_wing_is_flown_on_the_wing_of_its_turn(side: float, bank: float) -> None:
    race = race_of(
        level("a", 0, 0, 0),
        knife_edge("edge", 350, side * 160, side * 70, right=True, either=True),
        level("c", 200, side * 500, side * 160),
    )
    assert plan_of(race).waypoints[1].bank == bank


def test_pylon_between_two_gates_is_passed_on_whichever_side_is_asked_for() -> None:
    for side in (90.0, 270.0):
        post = dataclasses.replace(pylon_at("post", 300, 0, side), tolerances=BESIDE)
        waypoint = plan_of(race_of(level("a", 0, 0, 0), post, level("c", 600, 0, 0))).waypoints[1]
        assert waypoint.position is not None
        assert math.copysign(1.0, waypoint.position[1]) == math.copysign(1.0, 180.0 - side)
        assert angle_between(waypoint.heading, 0.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", COURSES)
def test_plan_is_the_same_every_time(name: str) -> None:
    assert plan_of(SHIPPED[name]) == plan_of(SHIPPED[name])


@pytest.mark.parametrize("apart", [0.0, 0.9 * ONE_PLACE, 1.1 * ONE_PLACE])
def test_a_gate_in_the_place_of_the_one_before_is_reached_round_a_circle(apart: float) -> None:
    race = race_of(level("a", 0.0, 0.0, 0.0), level("b", 400.0, 0.0, 0.0), level("c", 400.0 + apart, 0.0, 0.0))
    planned, twin = (plan(race.course, race.pace, ties) for ties in (ANY, TWIN))
    way = planned.legs[1].path
    assert way is not None
    is_circle = apart < ONE_PLACE
    assert way.length == pytest.approx(math.tau * race.pace.radius if is_circle else apart)
    assert planned.seconds == pytest.approx((400.0 + way.length) / race.pace.V)
    north, east, heading = (float(values[0]) for values in way.points(np.array([way.length])))
    assert (north, east, math.cos(heading)) == pytest.approx((400.0 + (0.0 if is_circle else apart), 0.0, 1.0))
    other = twin.legs[1].path
    assert other is not None
    if is_circle:
        assert other.curvatures[0] == -way.curvatures[0]
