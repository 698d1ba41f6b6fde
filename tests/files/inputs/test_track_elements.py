"""Elements of a track file."""

import itertools
import math
from typing import Literal

import pytest
from language_texts import RICH, TWO_GATES, edited, findings_of, understood

from airrace.files.inputs import Document, inputs_from_documents, load_inputs
from airrace.files.inputs.kinds.kind import CompositeElement, GateDefaultsEntry, KindEntry, kinds, register
from airrace.files.inputs.nodes import PASSAGES_MAX
from airrace.files.inputs.places import Places
from airrace.files.inputs.schema import tags_of
from airrace.files.inputs.track import track_language
from airrace.model.track.course import Course, Direction, EndState, Passage, Roll, Turning
from airrace.model.track.gates import KNIFE_EDGE_LEFT, KNIFE_EDGE_RIGHT, LEVEL, Gate, Manoeuvre
from airrace.optimal_control.quantities import Interval

QUAD = "{type: quad, north_m: 280, east_m: 480, heading_deg: 270, then: left}"


def passages(*overrides: str, track: str = RICH) -> dict[str, Passage]:
    course = understood(track, overrides=overrides).race.course
    named = {passage.name: passage for passage in course.passages}
    assert len(named) == len(course.passages)
    return named


def gate(passage: Passage) -> Gate:
    assert isinstance(passage.element, Gate)
    return passage.element


def flown_heading(passage: Passage) -> float:
    return gate(passage).heading + (math.pi if passage.direction is Direction.REVERSE else 0.0)


def finding(*overrides: str, track: str = RICH) -> tuple[str, str]:
    (found,) = findings_of(track, overrides=overrides)
    return found.key, found.message


def test_every_element_is_flown_in_the_order_of_the_course() -> None:
    lap = ("g1", "g2", "top", "roll/begin", "roll", "q/1", "q/2", "dive")
    assert list(passages()) == ["0:g0", *(f"1:{name}" for name in lap), *(f"2:{name}" for name in lap), "2:g0"]


# Quads


@pytest.mark.parametrize("direction", ["forward", "reverse"])
@pytest.mark.parametrize(("then", "turn"), [("left", -math.pi / 2), ("right", math.pi / 2)])
def test_a_quad_turns_to_the_side_it_says_whichever_way_it_is_flown(then: str, turn: float, direction: str) -> None:
    found = passages(f"gates.q.then={then}", f"course.lap.4.direction={direction}")
    first, second = found["1:q/1"], found["1:q/2"]
    between = flown_heading(second) - flown_heading(first)
    assert math.cos(between - turn) == pytest.approx(1.0)
    first_heading = math.radians(270 if direction == "forward" else 90)
    assert math.cos(flown_heading(first) - first_heading) == pytest.approx(1.0)
    assert (gate(first).north, gate(first).east) == (gate(second).north, gate(second).east) == (280.0, 480.0)


@pytest.mark.parametrize("heading", [0.0, 33.0, 270.0])
def test_the_gates_of_a_quad_share_four_pylons_beside_either_way_through_its_middle(heading: float) -> None:
    given = passages(f"gates.q.heading_deg={heading}", "gates.q.width_m=12")
    gates = [given[f"1:q/{number}"].element for number in (1, 2)]
    places = [{(round(one.north, 6), round(one.east, 6)) for one in gate.drawing().posts} for gate in gates]
    assert places[0] == places[1]
    assert len(places[0]) == 4
    for gate in gates:
        assert isinstance(gate, Gate)
        across = -math.sin(gate.heading), math.cos(gate.heading)
        beside = [across[0] * (north - gate.north) + across[1] * (east - gate.east) for north, east in places[0]]
        assert sorted(beside) == pytest.approx([-6.0, -6.0, 6.0, 6.0], abs=1e-5)


def test_a_quad_with_either_side_leaves_the_second_direction_to_the_plan() -> None:
    found = passages("gates.q.then=either")
    assert (found["1:q/1"].direction, found["1:q/2"].direction) == (Direction.FORWARD, Direction.PLANNED)
    found = passages("gates.q.then=either", "course.lap.4.direction=planned")
    assert (found["1:q/1"].direction, found["1:q/2"].direction) == (Direction.PLANNED, Direction.PLANNED)


@pytest.mark.parametrize(
    ("name", "bank", "either"),
    [
        ("level", LEVEL, False),
        ("left", KNIFE_EDGE_LEFT, False),
        ("right", KNIFE_EDGE_RIGHT, False),
        ("either", KNIFE_EDGE_RIGHT, True),
    ],
)
def test_a_quad_prescribes_each_bank_by_itself(name: str, bank: float, either: bool) -> None:
    found = passages(f"gates.q.second_bank={name}")
    assert (gate(found["1:q/1"]).bank, gate(found["1:q/1"]).either_bank) == (LEVEL, False)
    assert (gate(found["1:q/2"]).bank, gate(found["1:q/2"]).either_bank) == (bank, either)
    assert gate(passages(f"gates.q.bank={name}")["1:q/1"]).bank == bank


def test_a_quad_has_the_tolerances_of_a_gate() -> None:
    found = passages("gates.q.crossing_max_deg=20", "gates.q.width_m=14")
    assert gate(found["1:q/1"]).tolerances == gate(found["1:q/2"]).tolerances
    assert gate(found["1:q/1"]).tolerances.crossing == math.radians(20)
    assert gate(found["1:q/2"]).width == 14.0
    assert gate(found["1:q/2"]).height == 21.0


def test_no_single_flight_through_a_quad_counts_as_both_passings() -> None:
    found = passages("gate_defaults.crossing_max_deg=70")
    assert gate(found["0:g0"]).tolerances.crossing == math.radians(70)
    assert gate(found["1:q/1"]).tolerances.crossing == gate(found["1:q/2"]).tolerances.crossing == math.radians(40)


# High turns and rolls


def test_a_high_turn_is_a_height_and_nothing_else() -> None:
    assert passages()["1:top"].element == Manoeuvre("top", height=Interval(lower=152.4), kind="high-turn")
    bounded = passages("gates.top.height_max_m=200")["1:top"].element
    assert bounded == Manoeuvre("top", height=Interval(152.4, 200.0), kind="high-turn")


def test_a_vertical_roll_begins_and_ends_on_its_line() -> None:
    found = passages()
    climb, tolerance = math.radians(90), math.radians(10)
    begin, end = found["1:roll/begin"], found["1:roll"]
    assert begin.element == Manoeuvre("roll/begin", climb=climb, climb_tolerance=tolerance, kind="vertical-roll")
    assert end.element == Manoeuvre(
        "roll", climb=climb, climb_tolerance=tolerance, height=Interval(lower=213.4), kind="vertical-roll"
    )
    assert begin.roll is None
    assert end.roll == Roll(
        angle=math.radians(315), climb=Interval(math.radians(80), math.radians(90)), gain=60.0, turning=Turning.EITHER
    )


def test_a_roll_downward_gains_no_height() -> None:
    roll = passages("gates.roll.climb_deg=-85", "gates.roll.height_gain_m=null", "gates.roll.turning=left")[
        "1:roll"
    ].roll
    assert roll is not None
    assert roll.climb == Interval(math.radians(-90), math.radians(-75))
    assert (roll.gain, roll.turning) == (-math.inf, Turning.LEFT)


def test_a_line_of_45_degrees_is_steep_enough_for_a_roll() -> None:
    assert passages("gates.roll.climb_deg=45")


# Laps


def test_laps_can_differ_from_one_another() -> None:
    track = edited(RICH, "  lap: [g1, {gate", "  each_lap: [[g1, {gate")
    track = edited(track, "roll, q, dive]\n  laps: 2\n", "roll], [q, {gate: g2}, dive, g1, q]]\n")
    found = passages(track=track)
    assert list(found)[:6] == ["0:g0", "1:g1", "1:g2", "1:top", "1:roll/begin", "1:roll"]
    assert list(found)[6:] == ["2:q/1", "2:q/2", "2:g2", "2:dive", "2:g1", "2:q/1#2", "2:q/2#2", "2:g0"]
    assert [passage.lap for passage in found.values()] == [1] * 6 + [2] * 8


def test_more_passings_than_can_be_flown_are_refused() -> None:
    lap = ", ".join(["g1, g2"] * (PASSAGES_MAX // 200 + 1))
    track = edited(edited(RICH, "q, dive]", f"q, dive, {lap}]"), "laps: 2", "laps: 100")
    (found,) = findings_of(track)
    assert (found.key, found.message) == ("course.laps", "10800 passings are too many; at most 10000")


AIRCRAFT = load_inputs("half_cuban_eight").aircraft


def course(gate: str) -> Course:
    return inputs_from_documents(Document("t.yaml", TWO_GATES % gate), AIRCRAFT, None, ()).race.course


def second(gate: str) -> Gate:
    element = course(gate).passages[1].element
    assert isinstance(element, Gate)
    return element


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


def test_a_quad_may_be_given_by_the_pylons_between_which_it_is_entered() -> None:
    pylons = "[{north_m: 600, east_m: 73.5}, {north_m: 600, east_m: 86.5}]"
    first, other = course(f"quad, then: left, pylons: {pylons}").passages[1:]
    assert isinstance(first.element, Gate)
    assert isinstance(other.element, Gate)
    assert math.cos(first.element.heading) == pytest.approx(1.0)
    assert math.sin(other.element.heading) == pytest.approx(-1.0)
    assert first.element.place == other.element.place == pytest.approx((606.5, 80.0))
    corners = {(round(one.north, 6), round(one.east, 6)) for one in other.element.drawing().posts}
    assert corners == {(600.0, 73.5), (600.0, 86.5), (613.0, 73.5), (613.0, 86.5)}


def ends(*overrides: str) -> tuple[EndState, EndState]:
    course = understood(overrides=overrides).race.course
    return course.start_state, course.finish_state


def test_ends_are_what_the_file_says_or_a_settled_start_and_a_free_finish() -> None:
    assert ends() == (EndState.SETTLED, EndState.FREE)
    for start, finish in itertools.product(EndState, EndState):
        assert ends(f"course.start_state={start.value}", f"course.finish_state={finish.value}") == (start, finish)
    course = understood(overrides=("course.finish_state=settled",)).resolved["course"]
    assert isinstance(course, dict)
    assert (course["start_state"], course["finish_state"]) == ("settled", "settled")


TYPES = ["level", "knife-edge", "quad", "pylon", "manoeuvre", "high-turn", "vertical-roll"]


class Nothing(KindEntry):
    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        return CompositeElement(name, ())


def test_the_track_language_knows_every_kind() -> None:
    element = track_language().model_fields["gates"].annotation
    assert element is not None
    assert list(tags_of(element.__args__[1])) == TYPES
    assert len(kinds()) == len(TYPES)
    assert track_language() is track_language()


def test_a_kind_needs_a_type_of_its_own_by_which_files_name_it() -> None:
    with pytest.raises(ValueError, match="Nothing declares no `type"):
        register(Nothing)

    class Level(Nothing):
        type: Literal["level"]

    with pytest.raises(ValueError, match="a kind of element of the type level already"):
        register(Level)
    assert len(kinds()) == len(TYPES)
