"""The plan of a race and its speed."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from races import (
    BESIDE,
    DEGREE,
    EDGE_540,
    PLAN,
    RACES,
    ROOT,
    RULES,
    SHIPPED,
    SMALL,
    WINDOW,
    course,
    knife_edge,
    level,
)
from races import planned as plan_of
from races import pylon as pylon_at
from transformations import mirrored, rotated

from airrace.files.inputs import load_inputs
from airrace.model.dynamics.flight_manual import top_speed
from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.environment import Air, g0
from airrace.model.frames import angle_between
from airrace.model.track.course import ClearanceRule, Course, Crowd, CrowdShape, Direction, SafetyLine
from airrace.model.track.gates import Gate, Manoeuvre, Pylon
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval
from airrace.procedure.guess import guess
from airrace.procedure.planning import plan as planning
from airrace.procedure.planning.plan import (
    ONE_PLACE,
    SLOPE_MAX,
    TURN,
    Plan,
    decisions_from_solution,
    plan,
    plan_race,
    plan_with_room,
)
from airrace.procedure.planning.planning_model import AIR_DENSITY, cruise
from airrace.procedure.planning.route_decisions import ANY, MIRRORED_TIES
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent
from airrace.procedure.stage import Stage
from airrace.procedure.stored_stages import derived_quantities, sampler
from airrace.race import Race

every_race = pytest.mark.parametrize("name", RACES)
OFFICIAL_SECONDS = 59.012  # of the winner at Rovinj in 2014, see the track file


def race_of(*elements: Gate | Pylon) -> Race:
    return Race(course("built", *elements), EDGE_540, Air())


@every_race
def test_all_passages_are_planned_in_order_and_as_they_prescribe(name: str) -> None:
    planned = plan_of(RACES[name])
    assert [waypoint.passage for waypoint in planned.waypoints] == list(RACES[name].course.passages)
    assert len(planned.legs) == len(planned.waypoints) - 1
    for waypoint in planned.waypoints:
        match waypoint.passage.element:
            case Gate() as gate:
                assert waypoint.position == (gate.north, gate.east, gate.height)
                expected = {Direction.FORWARD: 1.0, Direction.REVERSE: -1.0}[waypoint.passage.direction]
                assert math.cos(waypoint.axis - gate.heading) == pytest.approx(expected)
                assert abs(angle_between(waypoint.heading, waypoint.axis)) <= gate.tolerances.crossing + 1e-9
                assert waypoint.bank == gate.bank
            case Pylon() as pylon:
                assert waypoint.position is not None
                north, east = waypoint.position[0] - pylon.north, waypoint.position[1] - pylon.east
                beside = north * math.cos(pylon.side) + east * math.sin(pylon.side)
                assert pylon.tolerances.clearance + EDGE_540.airframe.b / 2 < beside < pylon.reach
                along = north * math.sin(pylon.side) - east * math.cos(pylon.side)
                assert along == pytest.approx(0.0, abs=1e-9)
                assert math.cos(waypoint.axis - pylon.side) == pytest.approx(0.0, abs=1e-9)
                assert abs(angle_between(waypoint.heading, waypoint.axis)) <= pylon.tolerances.crossing + 1e-9
            case Manoeuvre() as figure:
                assert (waypoint.position, waypoint.bank) == (figure.position, figure.bank)
                assert waypoint.climb == (figure.climb or 0.0)
                assert figure.heading is None or waypoint.heading == figure.heading
            case other:
                raise AssertionError(other)


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


def test_planned_time_of_rovinj_is_near_the_official_one_and_the_plan_the_same_every_time() -> None:
    planned = plan_of(SHIPPED["rovinj_2014"])
    assert planned.seconds == pytest.approx(OFFICIAL_SECONDS, rel=0.1)
    race = SHIPPED["rovinj_2014"]
    assert plan(race.course, cruise(race.aircraft, race.course.rules)) == planned


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
        plan(one.course, cruise(one.aircraft, one.course.rules), how)
        for one, how in ((race, MIRRORED_TIES), (image, ANY))
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


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_edge_of_a_flight_is_read_back(side: float) -> None:
    race = race_of(
        level("a", 0, 0, 0),
        knife_edge("edge", 350, side * 160, side * 70, right=True, either=True),
        level("c", 200, side * 500, side * 160),
    )
    planned = plan_of(race)
    mesh = [(0.1,) * 10] * 2
    state = guess(planned, mesh).state
    decisions = decisions_from_solution(race.course, PointMassState.quantities(), state, [0, 10, 20])
    assert decisions.edges == {1: side}
    assert decisions.rolls == decisions.lengths == {}


def test_pylon_between_two_gates_is_passed_on_whichever_side_is_asked_for() -> None:
    for side in (90.0, 270.0):
        post = dataclasses.replace(pylon_at("post", 300, 0, side), tolerances=BESIDE)
        waypoint = plan_of(race_of(level("a", 0, 0, 0), post, level("c", 600, 0, 0))).waypoints[1]
        assert waypoint.position is not None
        assert math.copysign(1.0, waypoint.position[1]) == math.copysign(1.0, 180.0 - side)
        assert angle_between(waypoint.heading, 0.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("apart", [0.0, 0.9 * ONE_PLACE, 1.1 * ONE_PLACE])
def test_a_gate_in_the_place_of_the_one_before_is_reached_round_a_circle(apart: float) -> None:
    race = race_of(level("a", 0.0, 0.0, 0.0), level("b", 400.0, 0.0, 0.0), level("c", 400.0 + apart, 0.0, 0.0))
    planned, twin = (plan(race.course, cruise(race.aircraft, race.course.rules), ties) for ties in (ANY, MIRRORED_TIES))
    way = planned.legs[1].path
    assert way is not None
    is_circle = apart < ONE_PLACE
    pace = cruise(race.aircraft, race.course.rules)
    assert way.length == pytest.approx(math.tau * pace.radius if is_circle else apart)
    assert planned.seconds == pytest.approx((400.0 + way.length) / pace.V)
    north, east, heading = (float(values[0]) for values in way.points(np.array([way.length])))
    assert (north, east, math.cos(heading)) == pytest.approx((400.0 + (0.0 if is_circle else apart), 0.0, 1.0))
    other = twin.legs[1].path
    assert other is not None
    if is_circle:
        assert other.curvatures[0] == -way.curvatures[0]


def test_pace_is_below_the_top_speed_and_lift_and_limits_carry_its_level_turns() -> None:
    top, S, weight = top_speed(EDGE_540), EDGE_540.airframe.S, EDGE_540.airframe.m * g0
    pace = cruise(EDGE_540, RULES)
    assert EDGE_540.envelope.V.lower < pace.V < top
    lift = 0.5 * AIR_DENSITY * pace.V**2 * S * EDGE_540.lift.C_L_max
    assert 1.0 < pace.n < min(RULES.n_z.upper, lift / weight)
    assert 0.0 < pace.p < EDGE_540.point_mass.p
    chi_dot = g0 * math.tan(math.acos(1.0 / pace.n)) / pace.V
    assert pace.radius == pytest.approx(pace.V / chi_dot, rel=1e-12)
    slow = dataclasses.replace(EDGE_540, envelope=dataclasses.replace(EDGE_540.envelope, V=Interval(35.0, 60.0)))
    assert cruise(slow, RULES).V <= 60.0


@pytest.mark.parametrize("n_z_max", [1.1, 1.5, 2.5, 4.5, 7.0, 10.0, 12.0])
def test_pace_never_pulls_more_than_the_rules_allow_and_turns_stay_narrow_enough_to_plan_with(n_z_max: float) -> None:
    pace = cruise(EDGE_540, dataclasses.replace(RULES, n_z=Interval(0.0, n_z_max)))
    assert pace.n > 1.0
    assert n_z_max < 4.0 or pace.n < n_z_max
    assert pace.radius < 1500.0


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The largest number of candidates at a stop, search by search."""
    found: list[int] = []
    search = planning._shortest

    def counted(stops, pace, *, prefer_last):  # as the function that it stands in for
        found.append(max(len(stop.candidates) for stop in stops))
        return search(stops, pace, prefer_last=prefer_last)

    monkeypatch.setattr(planning, "_shortest", counted)
    return found


def fresh() -> Race:
    """A race of which nothing is known yet."""
    return dataclasses.replace(SMALL)


def test_looking_at_a_flight_plans_nothing(searches: list[int]) -> None:
    race = fresh()
    (result,) = optimize(race, PLAN, until=Stage.POINT_MASS, threads=1, progress=Silent())
    searches.clear()
    sampler(race, result)(np.array([0.0, 1.0]))
    derived_quantities(race, result)
    assert searches == []


def test_a_race_that_differs_has_a_plan_of_its_own() -> None:
    race = fresh()
    slower = dataclasses.replace(race, course=dataclasses.replace(race.course, passages=race.course.passages[:3]))
    assert len(plan_race(race).waypoints) == 4
    assert len(plan_race(slower).waypoints) == 3


def bounded(kind: str, side: float) -> Course:
    """There and back, 60 m farther to one side, to which one turns; a boundary 50 m behind that forbids it."""
    there, back = level("there", 0.0, 0.0, 0.0), level("back", -500.0, side * 60.0, 180.0)
    made = course("there and back", there, back)
    east = side * 110.0
    if kind == "line":
        line = SafetyLine("line", Point(-1.0, east), Point(1.0, east), keep_right=side < 0.0)
        passages = (made.passages[0], dataclasses.replace(made.passages[1], safety_lines=(line,)))
        return dataclasses.replace(made, passages=passages)
    if kind == "airspace":
        far = -side * 2000.0
        corners = ((-2000.0, far), (2000.0, far), (2000.0, east), (-2000.0, east))
        return dataclasses.replace(made, airspace=tuple(Point(*one) for one in corners))
    if kind == "crowd":
        places = (Point(-500.0, side * 310.0), Point(500.0, side * 310.0))
        return dataclasses.replace(made, crowd=(Crowd("crowd", CrowdShape.LINE, places, 200.0),))
    return made


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["line", "airspace", "crowd"])
def test_a_plan_with_room_turns_the_other_way(kind: str, side: float) -> None:
    made = bounded(kind, side)
    first = plan_race(Race(made, EDGE_540, Air()))
    other = plan_with_room(made, first)
    assert other is not None
    for planned, sense in ((first, 1.0), (other, -1.0)):
        path = planned.legs[0].path
        assert path is not None
        turn = sum(length * bend for length, bend in zip(path.lengths, path.curvatures, strict=True))
        assert sense * side * turn > TURN
        _, east, _ = path.points(np.linspace(0.0, path.length, 201))
        assert (float((side * east).max()) > 110.0) is (planned is first)
    assert other.seconds > first.seconds


def over(height: float) -> Course:
    """Straight on through two gates 300 m apart, with a height to be reached between them."""
    top = Manoeuvre("top", height=Interval(lower=height), kind="high-turn")
    return course("over", level("one", 0.0, 0.0, 0.0), top, level("two", 300.0, 0.0, 0.0))


def test_a_plan_with_room_takes_a_longer_way_to_a_height() -> None:
    made = over(160.0)
    planned = plan_of(Race(made, EDGE_540, Air()))
    roomy = plan_with_room(made, planned)
    assert roomy is not None
    up, down = (leg.path for leg in roomy.legs)
    assert up is not None
    assert down is not None
    (lower, top, end) = (one.position[2] for one in roomy.waypoints if one.position is not None)
    assert up.length + down.length >= (2.0 * top - lower - end) / SLOPE_MAX > 300.0
    north, east, heading = (float(values[0]) for values in down.points(np.array([down.length])))
    assert (north, east) == pytest.approx((300.0, 0.0), abs=1e-6)
    assert angle_between(heading, roomy.waypoints[-1].heading) == pytest.approx(0.0, abs=1e-9)
    low = over(50.0)
    assert plan_with_room(low, plan_of(Race(low, EDGE_540, Air()))) is None


def aslant(width: float) -> Course:
    """Two gates one behind the other whose axes differ by 113 degrees, to be crossed at up to 60."""
    gates = [
        dataclasses.replace(one, width=width, tolerances=dataclasses.replace(one.tolerances, crossing=math.radians(60)))
        for one in (level("one", 0.0, 0.0, 252.0), level("two", -152.0, -28.5, 139.0))
    ]
    return course("aslant", *gates)


def test_a_plan_with_room_crosses_gates_so_straight_that_the_wing_fits_between_their_pylons() -> None:
    width, needed = 13.0, 0.5 * EDGE_540.airframe.b + 0.5  # half the span, and the least clearance
    made, wide = aslant(width), aslant(30.0)
    most = math.acos(needed / (0.5 * width))
    planned = plan_of(Race(made, EDGE_540, Air()))
    assert max(abs(angle_between(one.heading, one.axis)) for one in planned.waypoints) > most
    roomy = plan_with_room(made, planned)
    assert roomy is not None
    assert max(abs(angle_between(one.heading, one.axis)) for one in roomy.waypoints) <= most
    assert plan_with_room(wide, plan_of(Race(wide, EDGE_540, Air()))) is None
    knife_edges = [dataclasses.replace(one.element, bank=0.5 * math.pi) for one in made.passages]
    edged = course("on edge", *knife_edges)
    assert plan_with_room(edged, plan_of(Race(edged, EDGE_540, Air()))) is None


def test_there_is_no_other_plan_where_no_boundary_is_left_or_turning_the_other_way_leads_out_farther() -> None:
    free = bounded("none", 1.0)
    free = dataclasses.replace(free, rules=dataclasses.replace(free.rules, clearance=ClearanceRule.CROSSING))
    assert plan_with_room(free, plan_of(Race(free, EDGE_540, Air()))) is None
    corners = (Point(-2000.0, -10.0), Point(-2000.0, 130.0), Point(2000.0, 130.0), Point(2000.0, -10.0))
    narrow = dataclasses.replace(free, airspace=corners)
    assert plan_with_room(narrow, plan_of(Race(narrow, EDGE_540, Air()))) is None


@every_race
def test_part_of_a_plan_is_flown_as_in_the_whole(name: str) -> None:
    whole = plan_of(RACES[name])
    mesh = [(0.125,) * 8] * len(whole.legs)
    flight = guess(whole, mesh)
    rows = [PointMassState.names().index(f"q{number}") for number in range(4)]
    for first in range(len(whole.legs)):
        last = min(first + 2, len(whole.legs))
        part, begin = whole.part(range(first, last))
        piece = guess(part, mesh[: len(part.legs)])
        start, stop = 8 * (first - begin), 8 * (last - begin)
        state, expected = piece.state[:, start : stop + 1], flight.state[:, 8 * first : 8 * last + 1].copy()
        expected[rows] *= np.sign(expected[rows, 0] @ state[rows, 0])  # both signs are one attitude
        assert np.array_equal(state, expected)
        assert np.array_equal(piece.control[:, start:stop], flight.control[:, 8 * first : 8 * last])
