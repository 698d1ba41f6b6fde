"""What the elements of the track language become, and how they are flown."""

import math

import pytest
from language_texts import RICH, edited, findings_of, understood

from airrace.inputs.track_schema import PASSAGES_MAX
from airrace.quantities import Interval
from airrace.track.course import Direction, Passage
from airrace.track.gates import KNIFE_EDGE_LEFT, KNIFE_EDGE_RIGHT, LEVEL, Gate, Manoeuvre
from airrace.track.limits import Roll, Turning

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
    key, message = finding("gates.q.crossing_max_deg=45")
    assert key == "gates.q.crossing_max_deg"
    assert "at most 40" in message


def test_a_quad_that_depends_on_its_first_passing_cannot_be_planned() -> None:
    key, message = finding("course.lap.4.direction=planned")
    assert key == "course.lap.4.direction"
    assert "then: either" in message


def test_a_quad_too_narrow_for_the_wing_is_reported_once() -> None:
    key, message = finding("gates.q.width_m=8")
    assert key == "gates.q.width_m"
    assert "spans 7.43 m" in message


def test_a_race_does_not_start_at_a_quad() -> None:
    key, message = finding("course.start=q")
    assert key == "course.start"
    assert "two passings" in message


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
    key, message = finding("gates.roll.climb_deg=-85")
    assert key == "gates.roll.height_gain_m"
    assert "leave it out" in message


def test_a_roll_needs_a_steep_line() -> None:
    assert finding("gates.roll.climb_deg=44")[0] == "gates.roll.climb_deg"
    assert passages("gates.roll.climb_deg=45")


@pytest.mark.parametrize(
    ("override", "key", "words"),
    [
        (
            "gates.top.height_min_m=200",
            "gates.top.height_min_m",
            "lies at 200 m or above, outside",
        ),
        ("gates.roll.height_min_m=200", "gates.roll.height_min_m", "10 to 170 m"),
        ("gates.roll.height_gain_m=170", "gates.roll.height_gain_m", "between floor and ceiling, 160 m"),
        ("gates.dive.height_max_m=5", "gates.dive.height_max_m", "lies at 5 m or below"),
    ],
)
def test_heights_above_the_ceiling_or_below_the_floor_are_refused(override: str, key: str, words: str) -> None:
    found = finding("rules.ceiling_m=170", "gates.roll.height_min_m=150", override)
    assert found[0] == key
    assert words in found[1]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("gates.roll.roll_deg=30", "must be at least 45 and at most 1080, not 30"),
        ("gates.roll.climb_tolerance_deg=0", "must be at least 0.5 and at most 30, not 0"),
        ("gates.roll.turning=up", "must be one of right, left, either, not the text `up`"),
        ("gates.q.then=lefft", "must be one of right, left, either, not the text `lefft`; did you mean `left`?"),
        ("gates.q.second_bank=flat", "must be one of level, right, left, either, not the text `flat`"),
        ("gates.top.height_max_m=100", "must not exceed `height_max_m`, 100, but is 152.4"),
    ],
)
def test_a_value_out_of_range_says_the_range(override: str, message: str) -> None:
    assert finding(override)[1] == message


def test_an_empty_range_is_reported_where_it_begins() -> None:
    (found,) = findings_of(edited(RICH, "height_min_m: 152.4}", "height_min_m: 152.4, height_max_m: 100}"))
    assert (found.line, found.column, found.key) == (15, 40, "gates.top.height_min_m")


# Laps


def test_laps_can_differ_from_one_another() -> None:
    track = edited(RICH, "  lap: [g1, {gate", "  each_lap: [[g1, {gate")
    track = edited(track, "roll, q, dive]\n  laps: 2\n", "roll], [q, {gate: g2}, dive, g1, q]]\n")
    found = passages(track=track)
    assert list(found)[:6] == ["0:g0", "1:g1", "1:g2", "1:top", "1:roll/begin", "1:roll"]
    assert list(found)[6:] == ["2:q/1", "2:q/2", "2:g2", "2:dive", "2:g1", "2:q/1#2", "2:q/2#2", "2:g0"]
    assert [passage.lap for passage in found.values()] == [1] * 6 + [2] * 8


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("laps: 2", "each_lap: [[g1]]", "course.lap", "not together with `each_lap`"),
        ("  lap: [g1,", "  each_lap: [[g1], [g2]]\n  lap: [g1,", "course.lap", "not together with `each_lap`"),
        ("  laps: 2", "  laps: 100000", "course.laps", "at most 100"),
        ("roll, q, dive]", "roll, g1, roll, roll]", "course.lap.6", "twice in a row"),
        ("finish: g0", "finish: dive", "course.finish", "twice in a row"),
        ("start: g0", "start: g1", "course.lap.0", "twice in a row"),
        ("q, dive]", "q, dive, g1]", "course.lap.0", "twice in a row"),
    ],
)
def test_an_order_that_makes_no_sense_is_refused(old: str, new: str, key: str, words: str) -> None:
    (found,) = findings_of(edited(RICH, old, new))
    assert found.key == key
    assert words in found.message


def test_laps_are_not_counted_beside_an_order_per_lap() -> None:
    track = edited(RICH, "  lap: [g1, {gate", "  each_lap: [[g1, {gate")
    (found,) = findings_of(edited(track, "q, dive]\n", "q, dive]]\n"))
    assert (found.key, found.line) == ("course.laps", 38)


def test_a_course_without_laps_says_what_it_needs() -> None:
    track = edited(RICH, "  lap: [g1, {gate: g2, direction: reverse, safety_lines: [beach]}, top, roll, q, dive]\n", "")
    (found,) = findings_of(track)
    assert (found.key, found.line, found.column) == ("course.lap", 35, 1)
    assert "missing; a course needs `lap`" in found.message


def test_more_passings_than_can_be_flown_are_refused() -> None:
    lap = ", ".join(["g1, g2"] * (PASSAGES_MAX // 200 + 1))
    track = edited(edited(RICH, "q, dive]", f"q, dive, {lap}]"), "laps: 2", "laps: 100")
    (found,) = findings_of(track)
    assert (found.key, found.message) == ("course.laps", "10800 passings are too many; at most 10000")
