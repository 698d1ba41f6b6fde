"""Surroundings and rules of a track file."""

import math
from importlib import resources

import pytest
from language_texts import OBSTACLES, RICH, TRACK, edited, findings_of, understood

from airrace.files.inputs.rules import preset_names, read_preset
from airrace.model.track.course import Course, Crowd, CrowdShape, Direction, Obstacle, Rules, SafetyLine
from airrace.model.track.gates import KNIFE_EDGE_LEFT, LEVEL, Gate, Pylon
from airrace.model.track.polygons import Point, area, distance, edges, inside
from airrace.optimal_control.quantities import Interval

AIRSPACE = """\
airspace:
  - {north_m: -2000, east_m: -2000}
  - {north_m: 2000, east_m: -2000}
  - {north_m: 2000, east_m: 2000}
  - {north_m: -2000, east_m: 2000}
"""
VILLAGE = "[{north_m: 900, east_m: -900}, {north_m: 900, east_m: -600}, {north_m: 1200, east_m: -600}]"


def course(*overrides: str, track: str = RICH) -> Course:
    return understood(track, overrides=overrides).race.course


def finding(*overrides: str, track: str = RICH) -> str:
    (found,) = findings_of(track, overrides=overrides)
    return str(found)


def places(*corners: tuple[float, float]) -> str:
    return "[" + ", ".join(f"{{north_m: {north}, east_m: {east}}}" for north, east in corners) + "]"


def with_airspace(*corners: tuple[float, float]) -> str:
    return edited(RICH, AIRSPACE, f"airspace: {places(*corners)}\n")


def with_village(*corners: tuple[float, float]) -> str:
    return edited(RICH, VILLAGE, places(*corners))


# Safety lines


def test_a_safety_line_holds_on_the_legs_that_name_it() -> None:
    beach = SafetyLine("beach", Point(-557, -375), Point(-479, -252), keep_right=False, margin=10.0)
    held = {passage.name: passage.safety_lines for passage in course().passages if passage.safety_lines}
    assert held == {"1:g2": (beach,), "2:g2": (beach,)}


@pytest.mark.parametrize(("item", "names"), [("roll", ("roll/begin", "roll")), ("q", ("q/1", "q/2"))])
def test_a_line_holds_on_both_legs_of_a_figure_of_two_passings(item: str, names: tuple[str, str]) -> None:
    track = edited(RICH, f" {item}, ", f" {{gate: {item}, safety_lines: [beach]}}, ")
    held = [passage.name for passage in course(track=track).passages if passage.safety_lines]
    assert [name for name in held if name.startswith("1:")] == ["1:g2", *(f"1:{name}" for name in names)]
    finish = edited(RICH, "finish: g0", "finish: {gate: g0, safety_lines: [beach]}")
    assert course(track=finish).passages[-1].safety_lines


def test_turning_a_line_round_and_its_side_with_it_changes_nothing() -> None:
    turned = course(
        "safety_lines.beach.keep=right",
        "safety_lines.beach.from.north_m=-479",
        "safety_lines.beach.from.east_m=-252",
        "safety_lines.beach.to.north_m=-557",
        "safety_lines.beach.to.east_m=-375",
    )
    assert [passage.name for passage in turned.passages] == [passage.name for passage in course().passages]


def test_a_line_that_no_passing_names_holds_on_every_leg() -> None:
    unnamed = edited(RICH, ", safety_lines: [beach]", "")
    start, *others = understood(unnamed).race.course.passages
    assert not start.safety_lines
    assert {line.name for one in others for line in one.safety_lines} == {"beach"}
    assert all(one.safety_lines == others[0].safety_lines for one in others)


# Obstacles


def obstacles(*overrides: str) -> tuple[Obstacle, ...]:
    return course(*overrides, track=RICH + OBSTACLES).obstacles


def test_obstacles_are_masts_cylinders_and_boxes() -> None:
    crane, silo, hall = obstacles()
    assert crane == Obstacle("crane", (Point(700, -300),), radius=0.0, height=80.0, clearance=10.0)
    assert (silo.radius, silo.clearance, silo.corners) == (6.0, 20.0, ())
    assert silo.places[0].north == pytest.approx(1111.3, abs=0.5)
    assert area(hall.corners) == pytest.approx(65.0 * 28.0)


@pytest.mark.parametrize(
    ("length", "width"),
    [(65.0, 28.0), (10.0, 10.0), (3.0, 300.0), (2000.0, 2.0), (90.0, 90.0), (16.9, 10.0), (999.0, 6.0)],
)
def test_cylinders_hold_all_of_a_box_and_little_more(length: float, width: float) -> None:
    *_, hall = obstacles(f"obstacles.hall.length_m={length}", f"obstacles.hall.width_m={width}")
    for a, b in edges(hall.corners, closed=True):  # a way into the box leads over its border
        for share in [number / 500.0 for number in range(501)]:
            place = Point(a.north + share * (b.north - a.north), a.east + share * (b.east - a.east))
            assert min(math.hypot(place.north - one.north, place.east - one.east) for one in hall.places) <= (
                hall.radius + 1e-9
            )
    beyond = max(hall.radius + distance(one, hall.corners, closed=False) * inward(one, hall) for one in hall.places)
    assert beyond <= max(5.0, 0.006 * max(length, width))
    assert len(hall.places) < 400


def inward(place: Point, hall: Obstacle) -> float:
    return -1.0 if inside(place, hall.corners) else 1.0


def test_the_size_of_a_box_may_change_a_little_without_another_number_of_cylinders() -> None:
    for length in (10, 20, 25, 30, 50, 60, 75, 100):
        counts = {len(obstacles(f"obstacles.hall.length_m={length + change}")[2].places) for change in (-0.1, 0, 0.1)}
        assert len(counts) == 1


# Crowd


def test_crowds_are_points_lines_and_areas() -> None:
    stands, tower, village = course().crowd
    assert stands == Crowd("stands", CrowdShape.LINE, (Point(-500, 0), Point(-450, 200)), distance=100.0)
    assert (tower.shape, tower.distance, tower.slant, len(tower.corners)) == (CrowdShape.POINT, 50.0, False, 1)
    assert (village.shape, len(village.corners), village.slant) == (CrowdShape.AREA, 3, True)


def test_a_crowd_without_a_distance_takes_that_of_the_rules() -> None:
    _, tower, village = course("crowd.tower.distance_m=null", "rules.crowd_distance_m=60").crowd
    assert (tower.distance, village.distance) == (60.0, 150.0)


def test_a_gate_may_stand_as_close_to_people_as_the_distance_says() -> None:
    """g0 at the origin, 21 m high; the stands pass it 485.071 m away, to the south."""
    assert course("crowd.stands.distance_m=485.5")  # hypot(485.071, 21) = 485.526
    assert course("crowd.stands.distance_m=495", "crowd.stands.height_m=120")  # hypot(485.071, 99) = 495.07


def test_a_gate_amid_people_is_refused() -> None:
    message = finding(
        "crowd.village.distance_m=22", track=with_village((-300, -300), (-300, 300), (20, 300), (20, -300))
    )
    assert message.startswith("t.yaml:11:3: gates.g0: is 21 m from the crowd `village`")


# Airspace


def test_an_airspace_is_its_corners() -> None:
    assert course().airspace == (Point(-2000, -2000), Point(2000, -2000), Point(2000, 2000), Point(-2000, 2000))
    assert course(track=edited(RICH, AIRSPACE, "")).airspace == ()


def test_an_element_outside_of_the_airspace_is_refused() -> None:
    """The second gate stands 100 m north, the first at the origin, the quad and g1 farther north."""
    track = with_airspace((50, -2000), (2000, -2000), (2000, 2000), (50, 2000))
    assert finding(track=track) == "t.yaml:11:3: gates.g0: stands 50 m outside of the `airspace`"
    assert course(track=with_airspace((0, -2000), (2000, -2000), (2000, 2000), (0, 2000)))  # on the border


@pytest.mark.parametrize(
    ("corners", "place", "words"),
    [
        (((-2000, -2000), (2000, 2000)), "30:11: airspace", "needs at least three corners, not 2"),
        ((), "30:11: airspace", "needs at least three corners, not 0"),
        (((0, 0), (1000, 1000), (500, 500)), "30:11: airspace", "all corners lie on one line"),
        (
            ((-2000, -2000), (3000, -2000), (2000, -2000), (2000, 2000), (-2000, 2000)),
            "30:45: airspace.1",
            "the border turns back on itself at this corner",
        ),
        (
            ((-2000, -2000), (2000, 2000), (2000, -2000), (-2000, 2000)),
            "30:11: airspace",
            "the border crosses itself: from corner 0 to corner 1 and from corner 2 to corner 3",
        ),
        (
            ((-2000, -2000), (2000, -2000), (500, 0), (2000, 2000), (-2000, 2000)),
            "30:77: airspace.2",
            "is dented inwards at this corner and must be convex; leave the corner out and keep the notch free with",
        ),
        (
            ((-2000, -2000), (2000, -2000), (2000, 2000), (-2000, 2000), (-2000, -2000)),
            "30:140: airspace.4",
            "is the first corner again",
        ),
        (
            ((-2000, -2000), (2000, -2000), (2000, -2000), (-2000, 2000)),
            "30:77: airspace.2",
            "is the same place as the corner before",
        ),
    ],
)
def test_an_airspace_that_is_no_convex_area_is_refused(
    corners: tuple[tuple[float, float], ...], place: str, words: str
) -> None:
    message = finding(track=with_airspace(*corners))
    assert message.startswith(f"t.yaml:{place}: ")
    assert words in message


def test_a_crowd_may_be_dented_but_not_cross_itself() -> None:
    assert course(track=with_village((900, -900), (1500, -900), (1000, -850), (1500, -600), (900, -600)))
    message = finding(track=with_village((900, -900), (1500, -600), (1500, -900), (900, -600)))
    assert "t.yaml:28:14: crowd.village.polygon: the border crosses itself" in message


KNOT = 1852.0 / 3600.0
BY_HAND = "rules:\n  n_z_max: 10\n  start_speed_max_kt: 200\n"
SEASONS = ("rbar-2010", "rbar-2014", "rbar-2015", "rbar-2016", "rbar-2017", "rbar-2018", "rbar-2019", "air-race-x-2024")
TWELVE_G = ("rbar-2010", "air-race-x-2024")


def with_rules(rules: str) -> str:
    return edited(TRACK, BY_HAND, f"rules: {rules}\n")


def course_with(rules: str, *overrides: str) -> Course:
    return understood(with_rules(rules), overrides=overrides).race.course


def start(found: Course) -> Gate:
    element = found.passages[0].element
    assert isinstance(element, Gate)
    return element


def test_there_is_a_preset_for_every_season() -> None:
    assert preset_names() == tuple(sorted(SEASONS))


@pytest.mark.parametrize("name", SEASONS)
def test_every_number_of_a_preset_has_its_source_beside_it(name: str) -> None:
    text = (resources.files("airrace.files.inputs") / "presets" / f"{name}.yaml").read_text(encoding="utf-8")
    numbers = [line for line in text.splitlines() if line.startswith("  ")]
    bare = [line for line in numbers if "#" not in line]
    # The upper end of the heights stands below the lower one, with the same source.
    assert [line.split(":")[0].strip() for line in bare] == ["passing", "height_max_m"]
    assert read_preset(name).source


@pytest.mark.parametrize(("name", "n_z"), [(name, 12.0 if name in TWELVE_G else 10.0) for name in SEASONS])
def test_a_preset_alone_makes_a_rule_book(name: str, n_z: float) -> None:
    found = course_with(name)
    assert found.rules == Rules(n_z=Interval(-2.0, n_z), height=Interval(lower=10.0))
    assert found.passages[0].speed == Interval(upper=200 * KNOT)
    assert start(found).tolerances.height == Interval(15.0, 25.0)
    assert start(found).tolerances.bank == math.radians(10.0)


@pytest.mark.parametrize("name", SEASONS)
def test_every_season_asks_for_nearly_level_flight_at_gates_of_all_kinds_and_at_pylons(name: str) -> None:
    """Air Race X publishes these angles; the other seasons take them from there."""
    passages = course_with(name).passages
    standing = [one.element for one in passages if isinstance(one.element, Gate | Pylon)]
    assert {type(one) for one in standing} == {Gate, Pylon}
    assert {one.bank for one in standing if isinstance(one, Gate)} == {LEVEL, KNIFE_EDGE_LEFT}
    assert {one.tolerances.climb for one in standing} == {Interval(math.radians(-5.0), math.radians(10.0))}


def test_without_a_season_a_course_limits_the_climb_at_its_gates_to_45_degrees() -> None:
    assert start(understood().race.course).tolerances.climb == Interval(math.radians(-45.0), math.radians(45.0))


def test_own_keys_override_the_presets_one_by_one() -> None:
    preset, own = course_with("rbar-2010"), course_with("{preset: rbar-2010, n_z_max: 9, ceiling_m: 300}")
    assert own.rules == Rules(n_z=Interval(-2.0, 9.0), height=Interval(10.0, 300.0))
    assert own.passages[0] == preset.passages[0]


def test_a_default_written_out_overrides_a_preset_too() -> None:
    """What counts is that the file says it, not that it differs from the language's default."""
    rules = course_with("{preset: rbar-2016, n_z_min: -2.0, floor_m: 0}").rules
    assert (rules.n_z.lower, rules.height.lower) == (-2.0, 0.0)


def test_own_gate_defaults_override_the_presets_one_by_one() -> None:
    track = with_rules("air-race-x-2024") + "gate_defaults: {climb_max_deg: 20, width_m: 12}\n"
    gate = start(understood(track).race.course)
    assert gate.tolerances.climb == Interval(math.radians(-5.0), math.radians(20.0))
    assert (gate.width, gate.tolerances.clearance) == (12.0, 0.5)


def test_a_preset_is_the_same_as_its_keys_by_hand() -> None:
    preset = read_preset("rbar-2016")
    rules = preset.rules.model_dump_json(exclude_unset=True)
    defaults = preset.gate_defaults.model_dump_json(exclude_unset=True)
    by_hand = understood(with_rules(rules) + f"gate_defaults: {defaults}\n").race
    assert by_hand == understood(with_rules("rbar-2016")).race


@pytest.mark.parametrize("rules", ["rbar-2016", "{preset: rbar-2016}", "{preset: rbar-2016, n_z_max: 8}"])
def test_one_rule_can_be_set_on_the_command_line_however_the_file_says_the_rest(rules: str) -> None:
    assert course_with(rules, "rules.n_z_max=12").rules.n_z.upper == 12.0
    assert course_with(rules, "rules.n_z_max=12").rules.height == course_with(rules).rules.height


def test_the_season_can_be_set_on_the_command_line() -> None:
    assert course_with("rbar-2016", "rules=rbar-2010").rules.n_z.upper == 12.0
    assert course_with("rbar-2016", "rules.preset=rbar-2010").rules.n_z.upper == 12.0
    assert course_with("rbar-2016", "rules=rbar-2010", "rules.n_z_max=11").rules.n_z.upper == 11.0


# Bare names of gates


def test_bare_names_and_gates_that_were_set_can_be_reached_into() -> None:
    flown = understood(overrides=("course.lap.3.direction=reverse",)).race.course.passages
    assert {passage.name: passage.direction for passage in flown}["1:g0"] is Direction.REVERSE
    flown = understood(overrides=("course.lap.0=g2", "course.lap.0.direction=reverse", "course.lap.1=g1")).race.course
    assert [(passage.name, passage.direction) for passage in flown.passages[1:3]] == [
        ("1:g2", Direction.REVERSE),
        ("1:g1", Direction.FORWARD),
    ]
    finished = understood(overrides=("course.finish=g2", "course.finish.direction=reverse")).race.course.passages[-1]
    assert (finished.name, finished.direction) == ("2:g2#2", Direction.REVERSE)
