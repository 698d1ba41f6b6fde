"""Safety lines, crowd and airspace: what they become, and which ones leave a course no room."""

import pytest
from language_texts import RICH, edited, findings_of, understood

from airrace.track.course import Course
from airrace.track.limits import Crowd, CrowdShape, SafetyLine
from airrace.track.polygons import Point

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


def test_a_finish_can_name_a_line() -> None:
    track = edited(RICH, "finish: g0", "finish: {gate: g0, safety_lines: [beach]}")
    assert course(track=track).passages[-1].safety_lines


def test_a_line_keeps_the_side_it_says_seen_from_its_beginning_to_its_end() -> None:
    found = findings_of(overrides=("safety_lines.beach.keep=right",), track=RICH)
    assert [one.key for one in found] == ["course.lap.1.safety_lines.0"] * 2
    assert found[0].message.startswith("the leg to `g2` must stay right of `beach` and 10 m away, but `g1` stands ")
    assert found[0].message.endswith(" m beyond it")
    assert (found[0].line, found[0].column) == (37, 59)
    assert "`g2` stands" in found[1].message


def test_turning_a_line_round_and_its_side_with_it_changes_nothing() -> None:
    turned = course(
        "safety_lines.beach.keep=right",
        "safety_lines.beach.from.north_m=-479",
        "safety_lines.beach.from.east_m=-252",
        "safety_lines.beach.to.north_m=-557",
        "safety_lines.beach.to.east_m=-375",
    )
    assert [passage.name for passage in turned.passages] == [passage.name for passage in course().passages]


def test_a_gate_within_the_margin_of_a_line_is_refused() -> None:
    message = finding("safety_lines.beach.margin_m=200")
    assert message.startswith("t.yaml:37:59: course.lap.1.safety_lines.0: the leg to `g2` must stay left of `beach`")
    assert message.endswith("and 200 m away, but `g2` stands 139.8 m from it")


def test_a_leg_over_laps_is_checked_at_both_of_its_ends() -> None:
    """The first leg of the second lap comes from the last gate of the first."""
    track = edited(
        edited(RICH, "[g1, {gate", "[{gate: g1, safety_lines: [beach]}, {gate"), "q, dive]", "q, dive, south]"
    )
    south = "  south: {type: level, north_m: -700, east_m: -100, heading_deg: 0}\n  top:"
    message = finding(track=edited(track, "  top:", south))
    assert message.startswith("t.yaml:38:35: course.lap.0.safety_lines.0: the leg to `g1`")
    assert "`south` stands" in message


def test_a_line_of_no_length_is_refused() -> None:
    message = finding("safety_lines.beach.to.north_m=-557", "safety_lines.beach.to.east_m=-375")
    assert (
        message == "t.yaml:21:9: safety_lines.beach.to: is the same place as `from`; a line needs two different points"
    )


def test_a_line_that_no_passing_names_is_refused() -> None:
    assert finding("course.lap.1.safety_lines=null") == (
        "t.yaml:19:3: safety_lines.beach: no passing names this line, so it is without effect; name it in the "
        "`safety_lines` of a passing"
    )


def test_an_unknown_line_comes_with_a_suggestion() -> None:
    track = edited(RICH, "safety_lines: [beach]", "safety_lines: [beach, beech]")
    assert finding(track=track) == (
        "t.yaml:37:66: course.lap.1.safety_lines.1: unknown safety line `beech`; did you mean `beach`?"
    )


# Crowd


def test_crowds_are_points_lines_and_areas() -> None:
    stands, tower, village = course().crowd
    assert stands == Crowd("stands", CrowdShape.LINE, (Point(-500, 0), Point(-450, 200)), distance=100.0)
    assert (tower.shape, tower.distance, tower.slant, len(tower.corners)) == (CrowdShape.POINT, 50.0, False, 1)
    assert (village.shape, len(village.corners), village.slant) == (CrowdShape.AREA, 3, True)


def test_a_crowd_without_a_distance_takes_that_of_the_rules() -> None:
    message = finding("crowd.tower.distance_m=null")
    assert message.startswith("t.yaml:26:3: crowd.tower.distance_m: missing; say it here, or for every crowd as ")
    _, tower, village = course("crowd.tower.distance_m=null", "rules.crowd_distance_m=60").crowd
    assert (tower.distance, village.distance) == (60.0, 150.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "point: {latitude_deg: 45.07, longitude_deg: 13.63}, ",
            "",
            "t.yaml:26:3: crowd.tower: a crowd needs one of `point`, `line` and `polygon`",
        ),
        (
            "point: {latitude_deg: 45.07, longitude_deg: 13.63}, ",
            "point: {latitude_deg: 45.07, longitude_deg: 13.63}, line: [], ",
            "t.yaml:26:63: crowd.tower.line: not together with `point`; a crowd has one shape",
        ),
        (
            "line: [{north_m: -500, east_m: 0}, {north_m: -450, east_m: 200}]",
            "line: [{north_m: -500, east_m: 0}]",
            "t.yaml:25:18: crowd.stands.line: a line needs at least two corners; a single place is a `point`",
        ),
        (
            "{north_m: -450, east_m: 200}]",
            "{north_m: -500, east_m: 0}]",
            "t.yaml:25:47: crowd.stands.line.1: is the same place as the corner before; leave one of them out",
        ),
        (
            "measured: over-ground",
            "measured: ground",
            (
                "t.yaml:26:89: crowd.tower.measured: must be one of slant, over-ground, not the text `ground`; did you "
                "mean `over-ground`?"
            ),
        ),
    ],
)
def test_a_crowd_that_is_none_is_refused(old: str, new: str, message: str) -> None:
    assert finding(track=edited(RICH, old, new)) == message


def test_a_gate_too_close_to_people_is_refused() -> None:
    """g0 at the origin, 21 m high; the stands pass it 485.071 m away, to the south."""
    assert course("crowd.stands.distance_m=485.5")  # hypot(485.071, 21) = 485.526
    message = finding("crowd.stands.distance_m=485.6")
    assert message == "t.yaml:11:3: gates.g0: is 485.5 m from the crowd `stands`, measured in space; at least 485.6 m"
    message = finding("crowd.stands.distance_m=485.5", "crowd.stands.measured=over-ground")
    assert message.endswith("is 485.1 m from the crowd `stands`, measured over ground; at least 485.5 m")
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
