"""A race director's remarks: each is made where it is due, and none on courses that were really flown."""

import dataclasses
import math
from collections.abc import Iterable
from pathlib import Path

import pytest
import races
from races import DEGREE, EDGE_540, KNOT, ROOT, RULES, course, knife_edge, pylon
from transformations import mirrored

from airrace.files.inputs import load_inputs
from airrace.flights.results.planned import planned_flight, remarks_on_line
from airrace.model.dynamics.flight_manual import top_speed
from airrace.model.environment import Air, StaticWind
from airrace.model.track.course import Course, Crowd, CrowdShape, Direction, Roll, Rules, SafetyLine
from airrace.model.track.gates import Element, Gate, Manoeuvre, Passing, Tolerances
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import Interval
from airrace.procedure.planning.lint import (
    Remark,
    RemarkKind,
    forgotten_lines,
    in_order,
    legs,
    review,
    swapped_axes,
    tightest,
)
from airrace.procedure.planning.route_decisions import PLANNED_MAX
from airrace.race import Race

STRAIGHT = dataclasses.replace(races.WINDOW, crossing=5 * DEGREE)


def level(name: str, north: float, east: float, heading: float, passing: Passing = Passing.WINDOW) -> Gate:
    """A level gate to be crossed along its axis; `heading` in degrees."""
    return dataclasses.replace(races.level(name, north, east, heading, passing), tolerances=STRAIGHT)


GOOD = course(
    "good", level("a", 0.0, 0.0, 0.0), level("b", 500.0, 0.0, 0.0), level("c", 1000.0, 300.0, 60.0), rules=RULES
)


def race(flown: Course, *, wind: StaticWind | None = None) -> Race:
    return Race(flown, EDGE_540, Air(wind=wind))


def of(elements: Iterable[Element], rules: Rules = RULES) -> Race:
    return race(course("constructed", *elements, rules=rules))


def changed(index: int, **changes: object) -> Race:
    """The good course with other attributes of one passage."""
    passages = list(GOOD.passages)
    passages[index] = dataclasses.replace(passages[index], **changes)
    return race(dataclasses.replace(GOOD, passages=tuple(passages)))


def reviewed(flown: Race) -> list[Remark]:
    """All remarks that `check` makes on a race."""
    return in_order([*review(flown), *remarks_on_line(planned_flight(flown))], flown.course)


def kinds(flown: Race) -> list[tuple[str, RemarkKind]]:
    return [(remark.passage, remark.kind) for remark in reviewed(flown)]


def only(flown: Race) -> Remark:
    """The one remark there is."""
    (remark,) = reviewed(flown)
    return remark


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_real_courses_give_no_cause_for_remarks_but_one_whose_line_forces_a_turn_upward(path: Path) -> None:
    expected = [("1:g5", RemarkKind.SAFETY_LINE)] if path.stem == "abu_dhabi_2016" else []
    assert kinds(load_inputs(path).race) == expected


def test_a_wind_above_the_race_rule_is_remarked_on_for_the_race_as_a_whole() -> None:
    remark = only(race(GOOD, wind=StaticWind(0.0, 31.0 * KNOT)))
    assert (remark.passage, remark.kind) == ("", RemarkKind.WIND)
    assert "31 kt" in remark.text
    assert reviewed(race(GOOD, wind=StaticWind(0.0, 30.0 * KNOT))) == reviewed(race(GOOD)) == []


@pytest.mark.parametrize("n_z", [Interval(-2.0, 13.0), Interval(-13.0, 10.0)])
def test_a_load_factor_the_aircraft_cannot_bear_is_remarked_on(n_z: Interval) -> None:
    assert kinds(of([one.element for one in GOOD.passages], Rules(n_z))) == [("", RemarkKind.LOAD_FACTOR)]


def at_the_start(flown: Race, limit: float) -> tuple[list[str], float]:
    """What is said of a limit (kt) of the speed at the start, and the speed (kt) with which the optimum begins."""
    passages = list(flown.course.passages)
    passages[0] = dataclasses.replace(passages[0], speed=Interval(upper=limit * KNOT))
    changed = dataclasses.replace(flown, course=dataclasses.replace(flown.course, passages=tuple(passages)))
    said = [one.text for one in review(changed) if one.kind is RemarkKind.START_SPEED]
    return said, float(races.optimum(changed, races.PLAN).trajectory["V_K"][0]) / KNOT


def test_a_start_speed_that_is_said_to_limit_nothing_is_not_reached_and_one_that_is_reached_is_not_said_to() -> None:
    propulsion = dataclasses.replace(EDGE_540.propulsion, P_max=0.4 * EDGE_540.propulsion.P_max)
    weak = dataclasses.replace(races.SMALL, aircraft=dataclasses.replace(EDGE_540, propulsion=propulsion))
    assert top_speed(weak.aircraft) < 199.0 * KNOT
    (said,), begun = at_the_start(weak, 200.0)
    assert begun == pytest.approx(200.0, abs=0.01)  # though it would take a dive
    assert "is more than Edge 540 class reaches in level flight" in said
    (said,), begun = at_the_start(races.SMALL, 300.0)
    assert begun <= EDGE_540.envelope.V.upper / KNOT + 1e-6
    assert "limits nothing: Edge 540 class flies 253 kt at most" in said
    assert at_the_start(races.SMALL, 200.0)[0] == []


def test_a_start_speed_that_limits_nothing_is_remarked_on_but_where_a_figure_begins_in_the_air() -> None:
    for limit in (math.inf, 300.0 * KNOT):
        assert kinds(changed(0, speed=Interval(upper=limit))) == [("a", RemarkKind.START_SPEED)]
    entry = Manoeuvre("entry", climb=0.0, heading=0.0, height=Interval.exactly(80.0))
    assert kinds(changed(0, element=entry, speed=Interval())) == []


@pytest.mark.parametrize(("width", "remarked"), [(9.9, True), (10.0, False), (14.0, False), (14.1, True)])
def test_a_width_that_no_racing_gate_has_is_remarked_on_once(width: float, remarked: bool) -> None:
    wide = dataclasses.replace(level("b", 500.0, 0.0, 0.0), width=width)
    around = [level("c", 500.0, 900.0, 180.0), level("d", 0.0, 900.0, 180.0)]
    assert kinds(of([level("a", 0.0, 0.0, 0.0), wide, *around, wide])) == [("b", RemarkKind.WIDTH)] * remarked


def test_a_gate_flown_against_the_way_of_the_course_is_remarked_on() -> None:
    against = level("b", 500.0, 0.0, 180.0)
    ends = level("a", 0.0, 0.0, 0.0), level("c", 1000.0, 0.0, 0.0)
    remarks = {remark.kind: remark for remark in reviewed(of([ends[0], against, ends[1]]))}
    assert remarks[RemarkKind.AXIS].passage == "b"
    assert "180 deg" in remarks[RemarkKind.AXIS].text
    reversed_ = changed(1, element=level("b", 500.0, 0.0, 180.0), direction=Direction.REVERSE)
    planned = changed(1, element=level("b", 500.0, 0.0, 180.0), direction=Direction.PLANNED)
    assert reviewed(reversed_) == reviewed(planned) == []
    for end in (0, 2):
        assert RemarkKind.AXIS in {kind for _, kind in kinds(changed(end, direction=Direction.REVERSE))}


def test_a_high_turn_or_a_roll_above_the_ceiling_is_remarked_on() -> None:
    top = Manoeuvre("top", height=Interval(lower=150.0), kind="high-turn")
    for ceiling, expected in ((140.0, [("top", RemarkKind.CEILING)]), (160.0, [])):
        rules = Rules(RULES.n_z, height=Interval(10.0, ceiling))
        assert kinds(of([level("a", 0.0, 0.0, 0.0), top, level("b", 500.0, 0.0, 0.0)], rules)) == expected
    tall = changed(1, roll=Roll(2.0 * math.pi, Interval(), gain=100.0))
    low = dataclasses.replace(tall.course, rules=Rules(RULES.n_z, height=Interval(10.0, 100.0)))
    assert kinds(tall) == []
    assert kinds(race(low)) == [("b", RemarkKind.CEILING)]


def stair(rise: float, passing: Passing = Passing.WINDOW) -> Gate:
    """A gate 100 m behind the first, higher by `rise`; both may be flown 5 m lower or higher, at 45 degrees at most."""
    plain = level("b", 100.0, 0.0, 0.0, passing)
    tolerances: Tolerances = dataclasses.replace(plain.tolerances, height=Interval(15.0 + rise, 25.0 + rise))
    return dataclasses.replace(plain, height=20.0 + rise, tolerances=tolerances)


@pytest.mark.parametrize(("rise", "steep"), [(109.0, False), (111.0, True)])
def test_gates_at_heights_that_the_allowed_climb_does_not_connect_are_remarked_on(rise: float, steep: bool) -> None:
    below, above = level("a", 0.0, 0.0, 0.0), stair(rise)
    assert kinds(of([below, above])) == [("b", RemarkKind.CLIMB)] * steep
    down = dataclasses.replace(below, heading=math.pi), dataclasses.replace(above, heading=math.pi)
    assert kinds(of([down[1], down[0]])) == [("a", RemarkKind.CLIMB)] * steep
    assert reviewed(of([level("a", 0.0, 0.0, 0.0, Passing.POINT), stair(200.0, Passing.POINT)])) == []


def test_a_turn_without_room_is_remarked_on_and_says_how_much_it_needs() -> None:
    cramped = of([level("a", 0.0, 0.0, 0.0), level("b", 60.0, 60.0, 90.0)])
    remark = only(cramped)
    assert (remark.passage, remark.kind) == ("b", RemarkKind.TURN)
    assert "stands 85 m from `a`" in remark.text
    assert f"radius of {tightest(cramped).radius:.0f} m" in remark.text
    slow = of([one.element for one in cramped.course.passages], dataclasses.replace(RULES, n_z=Interval(-1.0, 1.2)))
    (text,) = (remark.text for remark in reviewed(slow) if remark.kind is RemarkKind.TURN)
    assert " and 1.2 g it has a radius of " in text
    assert tightest(slow).n == 1.2


def test_a_gate_nearer_than_a_turn_radius_is_remarked_on_only_where_the_course_turns() -> None:
    first, straight, turned = level("a", 0.0, 0.0, 0.0), level("b", 100.0, 0.0, 0.0), level("b", -50.0, -118.0, 70.0)
    assert reviewed(of([first, straight])) == []
    found = [kind for kind in kinds(of([first, turned])) if kind[1] in (RemarkKind.CLOSE, RemarkKind.TURN)]
    assert found == [("b", RemarkKind.CLOSE)]


def test_two_passings_of_one_spot_are_a_quad_and_no_turn_without_room() -> None:
    quad = [
        level("a", 0.0, -500.0, 90.0),
        level("q1", 0.0, 0.0, 90.0),
        level("q2", 0.0, 0.0, 0.0),
        level("b", 500.0, 0.0, 0.0),
    ]
    assert reviewed(of(quad)) == []


ONE_BY_ONE = (level("a", 0.0, 0.0, 0.0), level("b", 400.0, 0.0, 0.0), level("c", 800.0, 100.0, 0.0))


def line(keep_right: bool, margin: float = 0.0, east: float = 20.0) -> SafetyLine:
    """From south to north."""
    return SafetyLine("beach", Point(-100.0, east), Point(100.0, east), keep_right, margin)


TURN_AROUND = [level("a", 0.0, 0.0, 0.0), level("b", 0.0, -500.0, 180.0)]


def test_a_planned_turn_across_a_safety_line_is_remarked_on() -> None:
    """The way from a to b leads to the west; it starts towards the north, 20 m west of the line."""
    for kept, expected in (
        (line(keep_right=False), []),
        (line(keep_right=False, margin=25.0), [("b", RemarkKind.SAFETY_LINE)]),
        (line(keep_right=True), [("b", RemarkKind.SAFETY_LINE)]),
        (line(keep_right=True, east=-550.0), []),
        (line(keep_right=True, east=-400.0), [("b", RemarkKind.SAFETY_LINE)]),
    ):
        flown = course("line", *TURN_AROUND)
        last = dataclasses.replace(flown.passages[1], safety_lines=(kept,))
        assert kinds(race(dataclasses.replace(flown, passages=(flown.passages[0], last)))) == expected


def with_crowd(crowd: Crowd) -> Race:
    """The good course, of which the first leg leads from south to north, 500 m at 20 m height, with people."""
    return race(dataclasses.replace(GOOD, crowd=(crowd,)))


@pytest.mark.parametrize("shape", [CrowdShape.POINT, CrowdShape.LINE, CrowdShape.AREA])
def test_a_crowd_too_near_to_a_leg_is_remarked_on(shape: CrowdShape) -> None:
    corners = [Point(250.0, -80.0), Point(300.0, -120.0), Point(200.0, -120.0)]
    corners = corners[: {CrowdShape.POINT: 1, CrowdShape.LINE: 2, CrowdShape.AREA: 3}[shape]]
    for distance, expected in ((79.0, []), (90.0, [("b", RemarkKind.CROWD)])):
        flown = with_crowd(Crowd("stands", shape, tuple(corners), distance, slant=False))
        assert kinds(flown) == expected
    assert "within 80 m of `stands`; 90 m are required" in only(flown).text


def test_a_slant_distance_counts_the_height() -> None:
    corner = (Point(250.0, -80.0),)
    assert kinds(with_crowd(Crowd("stands", CrowdShape.POINT, corner, 82.0, slant=False))) == [("b", RemarkKind.CROWD)]
    slant = only(with_crowd(Crowd("stands", CrowdShape.POINT, corner, 82.0, slant=True)))  # hypot(80, 20) = 82.5
    assert slant.kind is RemarkKind.CROWD
    assert slant.text.endswith("leads through the zone of `stands`; only its height keeps it 82 m away")
    assert kinds(with_crowd(Crowd("stands", CrowdShape.POINT, corner, 80.0, slant=True))) == []


@pytest.mark.parametrize("shape", [CrowdShape.LINE, CrowdShape.AREA])
def test_a_leg_over_a_crowd_is_called_so(shape: CrowdShape) -> None:
    corners = (Point(250.0, -30.0), Point(250.5, 30.0), Point(249.5, 30.0))  # thinner than the samples of a leg
    crowd = Crowd("stands", shape, corners if shape is CrowdShape.AREA else corners[:2], 10.0, slant=False)
    assert "leads over `stands`" in only(with_crowd(crowd)).text


def test_a_turn_over_a_crowd_is_remarked_on_where_the_straight_line_is_not() -> None:
    crowd = Crowd("stands", CrowdShape.POINT, (Point(120.0, -100.0),), 60.0, slant=False)
    flown = course("turn", *TURN_AROUND)
    remark = only(race(dataclasses.replace(flown, crowd=(crowd,))))
    assert remark.text.startswith("the planned line from `a` to `b` comes within")


def test_people_without_a_line_or_a_border_before_them_are_reported() -> None:
    stand = Crowd("stand", CrowdShape.LINE, (Point(0.0, 400.0), Point(300.0, 400.0)), distance=50.0)
    bare = dataclasses.replace(with_crowd(stand).course, passages=course("x", *ONE_BY_ONE).passages)

    def told(**changes: object) -> list[str]:
        return [one.text for one in forgotten_lines(dataclasses.replace(bare, **changes))]

    assert told() == ["no safety line or border lies between the race and `stand`; its distance alone counts"]
    square = tuple(Point(north, east) for north, east in ((-900, -900), (900, -900), (900, 300), (-900, 300)))
    assert told(airspace=square) == []
    for keep_right, count in ((False, 0), (True, 1)):
        lines = (line(keep_right, east=200.0),)
        held = tuple(dataclasses.replace(one, safety_lines=lines) for one in bare.passages)
        assert len(told(passages=(bare.passages[0], *held[1:]))) == count


def test_a_line_that_could_hold_on_more_legs_is_reported() -> None:
    first, second, third = course("x", *ONE_BY_ONE).passages

    def told(east: float) -> list[tuple[str, str]]:
        held = dataclasses.replace(second, safety_lines=(line(keep_right=False, east=east),))
        passages = (first, held, third)
        found = forgotten_lines(dataclasses.replace(course("x", *ONE_BY_ONE), passages=passages))
        return [(one.passage, one.text.partition(",")[0]) for one in found]

    assert told(200.0) == [(third.name, "the safety line `beach` does not hold on 1 of 2 legs")]
    assert told(50.0) == []  # the last gate stands beyond it


def test_a_turn_that_leaves_the_airspace_is_remarked_on() -> None:
    for north, expected in ((300.0, []), (100.0, [("b", RemarkKind.AIRSPACE)])):
        corners = (Point(-50.0, -600.0), Point(north, -600.0), Point(north, 50.0), Point(-50.0, 50.0))
        for border in (corners, corners[::-1]):
            assert kinds(race(dataclasses.replace(course("turn", *TURN_AROUND), airspace=border))) == expected


def test_a_leg_flown_in_every_lap_is_remarked_on_once() -> None:
    crowd = Crowd("stands", CrowdShape.POINT, (Point(250.0, 0.0),), 50.0, slant=False)
    elements = [level("a", 0.0, 0.0, 0.0), level("b", 500.0, 0.0, 0.0), pylon("c", 250.0, 900.0, 90.0)]
    laps = course("laps", *elements, *elements, *elements)
    assert kinds(race(dataclasses.replace(laps, crowd=(crowd,)))) == [("b", RemarkKind.CROWD)]


def heavy(factor: float) -> Race:
    """The good course flown by an aircraft that is so many times as heavy."""
    airframe = dataclasses.replace(EDGE_540.airframe, m=factor * EDGE_540.airframe.m)
    return Race(GOOD, dataclasses.replace(EDGE_540, airframe=airframe), Air())


@pytest.mark.parametrize("factor", [7.0, 20.0])
def test_aircraft_that_cannot_fly_level_is_said_to(factor: float) -> None:
    assert top_speed(heavy(factor).aircraft) == 0.0
    texts = [remark.text for remark in reviewed(heavy(factor)) if remark.kind is not RemarkKind.LOAD_FACTOR]
    assert any("cannot fly level" in text for text in texts)
    assert not any("in level flight" in text for text in texts)
    # A propeller that hardly pulls: the speed falls until a power of it overflows.
    propulsion = dataclasses.replace(EDGE_540.propulsion, eta_p=1e-6)
    weak = Race(GOOD, dataclasses.replace(EDGE_540, propulsion=propulsion), Air())
    assert any("cannot fly level" in remark.text for remark in reviewed(weak))


SHIPPED = [path for path in sorted((ROOT / "tracks").glob("*.yaml")) if path.stem not in ("half_cuban_eight",)]


def exchanged(flown: Race) -> Race:
    """The race with north and east of all places exchanged, and the headings as they were."""

    def moved(element: Element) -> Element:
        return dataclasses.replace(element, north=element.east, east=element.north)

    passages = tuple(dataclasses.replace(one, element=moved(one.element)) for one in flown.course.passages)
    return dataclasses.replace(flown, course=dataclasses.replace(flown.course, passages=passages))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_exchanged_latitudes_and_longitudes_are_remarked_on(path: Path) -> None:
    flown = load_inputs(path).race
    assert not swapped_axes(flown.course.passages)
    directed = sum(passage.element.directed for passage in flown.course.passages)
    assert swapped_axes(exchanged(flown).course.passages) == (directed >= 4)


def test_pylon_that_stands_aside_of_the_way_is_asked_about() -> None:
    ends = level("a", 0.0, 0.0, 0.0), level("b", 800.0, 0.0, 0.0)
    for side, asked in ((90.0, 0), (270.0, 1)):  # 40 m west of the line: east of it no detour is needed round
        flown = of([ends[0], pylon("p", 400.0, 40.0, side), ends[1]])
        texts = [remark.text for remark in reviewed(flown) if "pass_side_deg" in remark.text]
        assert len(texts) == asked
    assert texts == [
        "the straight line from `a` to `b` passes `p` 40 m away on the side that is asked for; is its `pass_side_deg` "
        "reversed?"
    ]


@pytest.mark.parametrize("apart", [0.0, 0.05, 1.0])
def test_two_gates_in_one_place_are_asked_about(apart: float) -> None:
    remark = only(of([level("a", 0.0, 0.0, 0.0), level("b", 500.0, 0.0, 0.0), level("c", 500.0 + apart, 0.0, 0.0)]))
    assert (remark.passage, remark.kind) == ("c", RemarkKind.CLOSE)
    where = f"{apart:.3g} m from `b`: that takes {apart / EDGE_540.envelope.V.lower:.2g} s"
    assert remark.text.startswith(f"`c` stands {where if apart else 'in the same place as `b`: only a circle'}")
    assert remark.text.endswith("are they one gate?")


def test_gates_that_can_be_flown_one_after_the_other_are_not_asked_about() -> None:
    shortest = 0.1 * EDGE_540.envelope.V.lower
    assert only(of([level("a", 0.0, 0.0, 0.0), level("b", 0.99 * shortest, 0.0, 0.0)])).kind is RemarkKind.CLOSE
    assert review(of([level("a", 0.0, 0.0, 0.0), level("b", 1.01 * shortest, 0.0, 0.0)])) == []


@pytest.mark.parametrize(("ceiling", "remarks"), [(20.0, 1), (24.9, 1), (25.1, 0)])
def test_floor_and_ceiling_without_room_between_them_are_remarked_on(ceiling: float, remarks: int) -> None:
    gates = [level("a", 0.0, 0.0, 0.0), level("b", 500.0, 0.0, 0.0)]
    narrow = of(gates, dataclasses.replace(RULES, height=Interval(20.0, ceiling)))
    assert kinds(narrow) == [("", RemarkKind.CEILING)] * remarks


def raised(gate: Gate, by: float) -> Gate:
    """The same gate on a hill, in m."""
    band = gate.tolerances.height
    lifted = dataclasses.replace(gate.tolerances, height=Interval(band.lower + by, band.upper + by))
    return dataclasses.replace(gate, height=gate.height + by, tolerances=lifted)


def test_climb_that_no_energy_pays_for_is_remarked_on() -> None:
    start, top = level("a", 0.0, 0.0, 0.0), level("b", 1500.0, 0.0, 0.0)
    remark = only(of([start, raised(top, 900.0)]))
    assert (remark.passage, remark.kind) == ("b", RemarkKind.CLIMB)
    assert "890 m are to be climbed" in remark.text  # from the top of the one window to the bottom of the other
    assert review(of([start, raised(top, 300.0)])) == []
    assert review(of([raised(start, 900.0), top])) == []  # downhill nothing has to be paid


def test_gate_below_the_floor_is_remarked_on() -> None:
    low = raised(level("b", 500.0, 0.0, 0.0), -12.0)
    remark = only(of([level("a", 0.0, 0.0, 0.0), low], dataclasses.replace(RULES, height=Interval(lower=14.0))))
    assert (remark.passage, remark.kind) == ("b", RemarkKind.CEILING)


def test_remarks_are_the_same_in_a_mirror_and_follow_the_order_of_the_race() -> None:
    gates = level("a", 0.0, 0.0, 0.0), knife_edge("e", 60.0, 30.0, 170.0, right=True), level("b", 90.0, 0.0, 0.0)
    crooked = of(gates)
    assert kinds(crooked)
    assert kinds(mirrored(crooked)) == kinds(crooked)
    wide = [dataclasses.replace(level(f"g{i}", 500.0 * i, 0.0, 0.0), width=20.0) for i in range(4)]
    windy = race(course("wide", *wide), wind=StaticWind(0.0, 40.0 * KNOT))
    assert [name for name, _ in kinds(windy)] == ["", "g0", "g1", "g2", "g3"]


def test_a_course_too_long_to_plan_is_looked_at_straight() -> None:
    gates = [level(f"g{i}", 60.0 * (i % 2), 500.0 * i, 90.0) for i in range(PLANNED_MAX + 1)]
    long = of(gates)
    assert {leg.turn for leg in legs(long)} == {None}
    assert len(legs(long)) == PLANNED_MAX
    assert reviewed(long) == []
