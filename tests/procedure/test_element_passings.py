"""Elements and surroundings bind: the optimum keeps them, and the optimum of the same race without them does not.

The flights are measured by plane geometry and by turning quaternions, not by the equations the optimiser was given.
"""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from races import EDGE_540, ROOT, RULES, SIXTEEN, WINDOW, course, level, one_lap, optimum, settings

from airrace.files.inputs import load_inputs
from airrace.model.environment import Air
from airrace.model.frames import product, rotation
from airrace.model.track.course import Crowd, CrowdShape, Passage, Roll, Rules, SafetyLine, Turning
from airrace.model.track.gates import Gate, Manoeuvre
from airrace.model.track.polygons import Point, distance, inside, to_right
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Array
from airrace.procedure.result import StageResult
from airrace.procedure.settings import GuessKind
from airrace.procedure.stored_stages import sampler
from airrace.race import Race

PLAN = settings(GuessKind.PLAN)
LENGTH = 0.1  # m, as certified between nodes
ANGLE = math.radians(0.2)  # rad, likewise
STRAIGHT = dataclasses.replace(WINDOW, crossing=math.radians(15.0))
U_TURN = tuple(
    dataclasses.replace(level(name, north, east, heading), tolerances=STRAIGHT)
    for name, north, east, heading in (("a", 0.0, 0.0, 0.0), ("b", 300.0, 0.0, 0.0), ("c", 150.0, 120.0, 180.0))
)


def u_turn(**changes: object) -> Race:
    """Out and back again on the right, 120 m beside."""
    return Race(dataclasses.replace(course("u-turn", *U_TURN), **changes), EDGE_540, Air())


def on_leg(race: Race, index: int, **changes: object) -> Race:
    """The race with something changed in the passage at the end of a leg."""
    passages = list(race.course.passages)
    passages[index] = dataclasses.replace(passages[index], **changes)
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=tuple(passages)))


def certified(race: Race) -> StageResult:
    result = optimum(race, PLAN)
    assert result.certified, result.message
    return result


def histories(race: Race, first: int = 0, last: int = -1) -> dict[str, Array]:
    """The optimum between two passages, every 5 ms."""
    result = certified(race)
    splits = [split.time for split in result.splits]
    times = np.append(np.arange(splits[first], splits[last], 0.005), splits[last])
    return dict(sampler(race, result)(times))


def places(flown: dict[str, Array]) -> list[Point]:
    return [Point(float(north), float(east)) for north, east in zip(flown["x"], flown["y"], strict=True)]


# safety lines, airspace, crowd


def test_safety_line_is_not_crossed_on_its_leg() -> None:
    line = SafetyLine("line", Point(348.0, -100.0), Point(348.0, 300.0), keep_right=False, margin=5.0)
    assert max(-to_right(line.start, line.end, place) for place in places(histories(u_turn()))) > 4.0
    # left of a line that runs eastward lies the north
    southern = dataclasses.replace(line, keep_right=True)
    bound = places(histories(on_leg(u_turn(), 2, safety_lines=(southern,))))
    assert min(to_right(line.start, line.end, place) for place in bound) > 5.0 - LENGTH


def test_safety_line_does_not_act_on_other_legs() -> None:
    line = SafetyLine("line", Point(348.0, -100.0), Point(348.0, 300.0), keep_right=True, margin=5.0)
    free, elsewhere = (certified(race) for race in (u_turn(), on_leg(u_turn(), 1, safety_lines=(line,))))
    assert elsewhere.trajectory.race_time == pytest.approx(free.trajectory.race_time, abs=1e-4)


@pytest.mark.slow
def test_race_stays_within_its_airspace() -> None:
    corners = (Point(-50.0, -60.0), Point(345.0, -60.0), Point(335.0, 200.0), Point(-50.0, 200.0))
    assert not all(inside(place, corners) for place in places(histories(u_turn())))
    for place in places(histories(u_turn(airspace=corners))):
        assert inside(place, corners) or distance(place, corners, closed=True) < LENGTH


@pytest.mark.parametrize(
    ("shape", "corners"),
    [
        (CrowdShape.POINT, ((400.0, 60.0),)),
        pytest.param(CrowdShape.LINE, ((425.0, -60.0), (415.0, 60.0), (405.0, 200.0)), marks=pytest.mark.slow),
        pytest.param(
            CrowdShape.AREA,
            ((425.0, -60.0), (405.0, 160.0), (600.0, 160.0), (600.0, -60.0)),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_crowd_keeps_its_distance(shape: CrowdShape, corners: tuple[tuple[float, float], ...]) -> None:
    crowd = Crowd("crowd", shape, tuple(Point(*corner) for corner in corners), 70.0, slant=False)
    free, kept = (histories(race) for race in (u_turn(), u_turn(crowd=(crowd,))))
    closed = shape is CrowdShape.AREA
    assert min(distance(place, crowd.corners, closed=closed) for place in places(free)) < 65.0
    assert min(distance(place, crowd.corners, closed=closed) for place in places(kept)) > 70.0 - LENGTH


def test_crowd_may_be_flown_over_where_its_distance_is_one_in_space() -> None:
    crowd = Crowd("crowd", CrowdShape.POINT, (Point(400.0, 60.0),), 70.0)
    flown = histories(u_turn(crowd=(crowd,)))
    ground = np.hypot(flown["x"] - 400.0, flown["y"] - 60.0)
    assert np.hypot(ground, flown["z"]).min() > 70.0 - LENGTH


# figures


@pytest.mark.slow
def test_high_turn_of_air_race_x_reaches_its_height_only_because_it_must() -> None:
    race = load_inputs(ROOT / "tracks" / "air_race_x_2024.yaml").race
    names = [passage.name for passage in race.course.passages]
    top = names.index("2:top")
    assert -histories(race, top - 1, top + 1)["z"].min() > 152.4 - LENGTH
    ignored = [passage for passage in race.course.passages if passage.name != "2:top"]
    without = dataclasses.replace(race, course=dataclasses.replace(race.course, passages=tuple(ignored)))
    assert -histories(without, top - 1, top)["z"].min() < 140.0


ROLL = Roll(math.radians(315.0), Interval(math.radians(80.0), math.pi / 2), gain=90.0)


def roll_race(roll: Roll | None) -> Race:
    """Up after two gates, a roll on the vertical, and back; without one, just back."""
    begin = Manoeuvre("roll/begin", climb=math.pi / 2, climb_tolerance=math.radians(10.0), kind="vertical-roll")
    elements = [*U_TURN[:2], begin, dataclasses.replace(begin, name="roll"), U_TURN[2]]
    if roll is None:
        return u_turn()
    return on_leg(Race(course("roll", *elements), EDGE_540, Air()), 3, roll=roll)


def rolled(flown: dict[str, Array]) -> float:
    """Angle turned about the velocity, rad: the turns from one sample to the next, added up."""
    q = np.array([flown[name] for name in ("q0", "q1", "q2", "q3")]).T
    steps = (product([a[0], -a[1], -a[2], -a[3]], b) for a, b in itertools.pairwise(q.tolist()))
    return sum(2.0 * math.atan2(step[1], step[0]) for step in steps)


def climbs(flown: dict[str, Array]) -> Array:
    """Climb angles, rad."""
    R = rotation([flown[name] for name in ("q0", "q1", "q2", "q3")])
    return np.arctan2(-R[2][0], np.hypot(R[0][0], R[1][0]))


def assert_rolls_on_its_line(flown: dict[str, Array], turning: Turning) -> None:
    turned = rolled(flown)
    assert abs(turned) > ROLL.angle - ANGLE
    assert turning is Turning.EITHER or (turned > 0.0) is (turning is Turning.RIGHT)
    assert climbs(flown).min() > ROLL.climb.lower - ANGLE
    assert flown["z"][0] - flown["z"][-1] > ROLL.gain - LENGTH


@pytest.mark.slow
@pytest.mark.parametrize("turning", Turning)
def test_vertical_roll_turns_rises_and_stays_on_its_line(turning: Turning) -> None:
    assert_rolls_on_its_line(histories(roll_race(dataclasses.replace(ROLL, turning=turning)), 2, 3), turning)


def test_nobody_rolls_on_the_vertical_who_need_not() -> None:
    assert climbs(histories(roll_race(None))).max() < ROLL.climb.lower


def moved_east(passage: Passage, distance: float) -> Passage:
    """The passage with its gate elsewhere; a roll has no place."""
    element = passage.element
    if isinstance(element, Gate):
        element = dataclasses.replace(element, east=element.east + distance)
    return dataclasses.replace(passage, element=element)


@pytest.mark.parametrize("beside", [pytest.param(0.0, marks=pytest.mark.slow), 240.0])
def test_every_roll_of_a_race_is_counted_from_its_own_beginning(beside: float) -> None:
    """A second lap over the same gates is hard to find; one beside the first lap, turn joining turn, is not."""
    once = roll_race(dataclasses.replace(ROLL, turning=Turning.LEFT))
    start, *lap = once.course.passages
    again = [dataclasses.replace(passage, name=f"2:{passage.name}", lap=2) for passage in (start, *lap)]
    again[0] = dataclasses.replace(again[0], speed=Interval())
    again = [moved_east(passage, beside) for passage in again]
    twice = dataclasses.replace(once, course=dataclasses.replace(once.course, passages=(start, *lap, *again)))
    for end in (3, 8):
        assert_rolls_on_its_line(histories(twice, end - 1, end), Turning.LEFT)


def test_quad_is_passed_twice_from_perpendicular_directions_only_because_it_must() -> None:
    race = one_lap(SIXTEEN)
    quad = [index for index, one in enumerate(race.course.passages) if "/" in one.element.name and one.lap == 1]
    assert len(quad) == 2
    gates = [race.course.passages[index].element for index in quad]
    splits = certified(race).splits
    first, second = (splits[index] for index in quad)
    assert abs(math.cos(first.heading - second.heading)) < math.sin(math.radians(40.0))  # 20 degrees off at most, each
    ignored = tuple(one for index, one in enumerate(race.course.passages) if index not in quad)
    without = dataclasses.replace(race, course=dataclasses.replace(race.course, passages=ignored))
    lap = histories(without)
    near = np.hypot(lap["x"] - gates[0].north, lap["y"] - gates[0].east) < gates[0].width
    assert np.count_nonzero(near[1:] > near[:-1]) < 2  # left to itself, it comes by once at most


def test_start_speed_limit_binds() -> None:
    slow = on_leg(u_turn(), 0, speed=Interval(upper=70.0))
    assert pytest.approx(70.0, abs=1e-3) == certified(slow).splits[0].V_K
    assert certified(u_turn()).splits[0].V_K > 71.0


def test_ceiling_binds() -> None:
    low = u_turn(rules=Rules(n_z=RULES.n_z, height=Interval(10.0, 40.0)))
    assert -histories(u_turn())["z"].min() > 50.0
    assert -histories(low)["z"].min() < 40.0 + LENGTH
