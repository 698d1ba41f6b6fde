"""Which leg watches what, and that the same line is the same to all legs."""

import dataclasses

import pytest
from races import SMALL

from airrace.dynamics.point_mass import PointMassState
from airrace.optimal_control.problem import PathConstraint
from airrace.procedure.path_constraints import leg_watches
from airrace.quantities import Interval
from airrace.track.course import Course
from airrace.track.limits import Crowd, CrowdShape, Roll, SafetyLine
from airrace.track.polygons import Point

STATES = PointMassState.quantities()
BEACH = SafetyLine("beach", Point(0.0, 500.0), Point(900.0, 500.0), keep_right=False, margin=20.0)
SQUARE = (Point(-900.0, -900.0), Point(-900.0, 900.0), Point(900.0, 900.0), Point(900.0, -900.0))
STAND = Crowd("stand", CrowdShape.LINE, (Point(0.0, -400.0), Point(300.0, -420.0)), 90.0)


def watches(**changes: object) -> tuple[tuple[PathConstraint, ...], ...]:
    return leg_watches(dataclasses.replace(SMALL.course, **changes), STATES)


def with_passage(index: int, **changes: object) -> Course:
    passages = list(SMALL.course.passages)
    passages[index] = dataclasses.replace(passages[index], **changes)
    return dataclasses.replace(SMALL.course, passages=tuple(passages))


def seen(watch: PathConstraint, north: float, east: float) -> float:
    x = [north, east, -20.0, 80.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    return float((watch.exact or watch.observation).values(x, watch.values))


def test_course_without_surroundings_watches_nothing() -> None:
    assert watches() == ((), (), ())


def test_safety_line_is_watched_on_its_leg_alone() -> None:
    first, second, third = leg_watches(with_passage(2, safety_lines=(BEACH,)), STATES)
    assert (first, third) == ((), ())
    (line,) = second
    assert line.name == "safety line beach"
    assert line.bounds == {"beside": Interval(lower=20.0)}
    assert seen(line, 100.0, 480.0) == pytest.approx(20.0)
    assert seen(line, 100.0, 520.0) == pytest.approx(-20.0)


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1]])
def test_airspace_is_a_line_to_each_side_whichever_way_its_corners_run(corners: tuple[Point, ...]) -> None:
    for leg in watches(airspace=corners):
        assert len(leg) == 4
        assert all(seen(side, 0.0, 0.0) == pytest.approx(900.0) for side in leg)
        outside = [sum(seen(side, *place) < 0.0 for side in leg) for place in ((1000.0, 0.0), (1000.0, 1000.0))]
        assert outside == [1, 2]


def test_crowd_is_watched_on_every_leg_with_its_own_distance() -> None:
    for (watch,) in watches(crowd=(STAND,)):
        assert watch.bounds == {"distance": Interval(lower=90.0)}
        assert watch.exact is not None
        assert seen(watch, 0.0, -310.0) == pytest.approx((90.0**2 + 20.0**2) ** 0.5)


def test_like_crowds_share_their_equations() -> None:
    other = dataclasses.replace(STAND, name="other", corners=(Point(5.0, 5.0), Point(6.0, 9.0)), distance=30.0)
    (one, two), *_ = watches(crowd=(STAND, other))
    assert one.observation is two.observation
    assert one.exact is two.exact
    assert one.values != two.values


def test_climb_angle_is_watched_during_a_roll() -> None:
    allowed = Interval(1.3, 1.6)
    first, second, third = leg_watches(with_passage(1, roll=Roll(5.0, allowed)), STATES)
    assert (second, third) == ((), ())
    assert [watch.bounds for watch in first] == [{"climb": allowed}]
