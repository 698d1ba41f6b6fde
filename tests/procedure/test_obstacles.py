"""Obstacles: what stands in the way is passed at its clearance, at any time and by any rule for pylons."""

import dataclasses
import math

import numpy as np
import pytest
from races import EDGE_540, PLAN, RULES, course, level, optimum

from airrace.flights.results.clearances import distances, least_of_all
from airrace.flights.results.derivation import flight_of
from airrace.flights.results.flight import Flight, Source
from airrace.flights.results.planned import planned_flight, remarks_on_line
from airrace.model.environment import Air
from airrace.model.track.course import ClearanceRule, Obstacle
from airrace.model.track.polygons import Point
from airrace.optimal_control.trajectory import Array
from airrace.procedure.certification import clearance_item
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.planning.clearance import ClosestApproach, Wing, cleared_pylons, closest_approaches, pylons_of
from airrace.procedure.result import PylonSide, Status
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import formulate, mesh_of
from airrace.race import Race

MAST = Obstacle("mast", (Point(300.0, 1.0),), 0.0, 60.0, 10.0)
TANK = Obstacle("tank", (Point(300.0, 1.0),), 20.0, 60.0, 10.0)
LOW = Obstacle("low", (Point(300.0, 1.0),), 5.0, 12.0, 5.0)
WALL = Obstacle("wall", tuple(Point(300.0, east) for east in range(-30, 61, 10)), 5.0, 200.0, 10.0)
"""A wall of 100 m, more of which stands to the right of the way."""


def race(*obstacles: Obstacle, clearance: ClearanceRule = ClearanceRule.FLIGHT) -> Race:
    rules = dataclasses.replace(RULES, clearance=clearance)
    straight = course("straight", level("a", 0.0, 0.0, 0.0), level("b", 600.0, 0.0, 0.0), rules=rules)
    return Race(dataclasses.replace(straight, obstacles=obstacles), EDGE_540, Air())


def flown(what: Race) -> Flight:
    result = optimum(what, PLAN)
    assert result.status is Status.CERTIFIED
    return flight_of(what, result, Source("optimum"))


def from_axis(flight: Flight, obstacle: Obstacle) -> float:
    """The least distance of the wing from the axes up to their tops, by points along the wing at fine times."""
    time: Array = np.linspace(0.0, flight.race_time, 8001)

    def at_times(name: str) -> Array:
        return np.asarray(np.interp(time, flight.time, flight[name]), np.float64)

    centre = np.stack([at_times(name) for name in ("x", "y", "height")])
    q0, q1, q2, q3 = (at_times(name) for name in ("b0", "b1", "b2", "b3"))
    right = np.stack([2 * (q1 * q2 - q0 * q3), 1 - 2 * (q1**2 + q3**2), -2 * (q2 * q3 + q0 * q1)])
    least = math.inf
    for s in np.linspace(-1.0, 1.0, 41).tolist():
        n, e, h = centre + 0.5 * s * flight.aircraft.airframe.b * right
        for at in obstacle.places:
            above = np.maximum(h - obstacle.height, 0.0)
            least = min(least, float(np.sqrt((n - at.north) ** 2 + (e - at.east) ** 2 + above**2).min()))
    return least


@pytest.mark.parametrize("obstacle", [MAST, TANK, LOW, WALL], ids=lambda one: one.name)
def test_an_obstacle_in_the_way_is_passed_at_its_clearance(obstacle: Obstacle) -> None:
    flight = flown(race(obstacle))
    away = from_axis(flight, obstacle) - obstacle.radius
    assert away == pytest.approx(obstacle.clearance, abs=0.03)  # no nearer, and as it costs time no farther away
    (told,) = (one for one in least_of_all(flight, distances(flight)) if one.kind == "obstacle")
    assert told.distance == pytest.approx(away, abs=0.02)
    assert flight.race_time > flown(race()).race_time


def test_a_wall_is_passed_on_its_shorter_side() -> None:
    flight = flown(race(WALL))
    assert float(np.interp(300.0, flight["x"], flight["y"])) < -45.0


def test_obstacles_are_kept_clear_of_by_the_rule_of_crossings_too() -> None:
    flight = flown(race(MAST, clearance=ClearanceRule.CROSSING))
    assert from_axis(flight, MAST) == pytest.approx(MAST.clearance, abs=0.03)
    assert [one.name for one in cleared_pylons(flight.course)] == ["mast"]
    assert len(pylons_of(flight.course)) == 5


@pytest.mark.parametrize(("radius", "beside"), [(0.0, 12.0), (8.0, 30.0)])
def test_a_level_wing_is_nearest_by_its_tip(radius: float, beside: float) -> None:
    """Straight and level past a cylinder: the way's distance, less half of the span; more by height above the top."""
    time: Array = np.linspace(0.0, 4.0, 401)
    post = dataclasses.replace(MAST, places=(Point(200.0, beside),), radius=radius)
    (pylon,) = (one for one in pylons_of(race(post).course) if one.is_obstacle)
    for height, above in ((20.0, 0.0), (70.0, 10.0)):
        centre = np.stack([100.0 * time, 0.0 * time, 0.0 * time + height])
        wing = Wing(time, centre, np.tile([[0.0], [3.7], [0.0]], (1, len(time))))
        (approach,) = closest_approaches(wing, [pylon], [0, 400])
        assert approach.distance == pytest.approx(math.hypot(beside - 3.7, above), abs=1e-9)
        assert approach.time == pytest.approx(2.0, abs=1e-6)
        assert approach.shortfall == pytest.approx(10.0 + radius - approach.distance)


def test_the_planned_line_is_remarked_on() -> None:
    (remark,) = remarks_on_line(planned_flight(race(TANK)))
    assert remark.kind.value == "obstacle"
    assert "leads the wing through the obstacle `tank`; 10 m are required" in remark.text


def test_an_obstacle_is_tried_on_its_other_side_as_a_whole() -> None:
    what = race(WALL)
    result = optimum(what, PLAN)
    stage_problem = formulate(Stage.POINT_MASS, what, PLAN, result.trajectory, result.pylon_conditions)
    assert stage_problem.clearance is not None
    own = [one for one in result.pylon_conditions if one.element == "wall"]
    (side,) = {one.side for one in own}
    far = dataclasses.replace(own[0], error=-50.0)  # the first of them has room to spare
    rooms = stage_problem.clearance.with_conditions([far, *result.pylon_conditions])
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    (conditions,) = rooms.on_other_sides(stage_problem.plan, problem, iterate)
    turned = [one.side for one in conditions if one.element == "wall"]
    assert len(turned) == len(own) + 1
    assert set(turned) == {PylonSide.LEFT, PylonSide.RIGHT} - {side}


def test_an_obstacle_that_is_all_but_kept_clear_of_hides_no_pylon_that_is_hit() -> None:
    what = race(MAST, clearance=ClearanceRule.CROSSING)
    result = optimum(what, PLAN)
    stage_problem = formulate(Stage.POINT_MASS, what, PLAN, result.trajectory)
    problem = stage_problem.problem(mesh_of(result.trajectory))
    mast, gate = (next(one for one in pylons_of(what.course) if one.is_obstacle is kind) for kind in (True, False))
    near = [ClosestApproach(one, 0, one.required - by, 1.0, 1.0, 0.0, 0.0) for one, by in ((mast, 1e-3), (gate, 0.4))]
    item = clearance_item(stage_problem, problem, near, PLAN.certificate)
    assert item.value == pytest.approx(0.4)
    assert math.isinf(item.limit)  # by the rule of crossings it is told, and decides nothing
    worse = [dataclasses.replace(near[0], distance=mast.required - 0.5), near[1]]
    assert clearance_item(stage_problem, problem, worse, PLAN.certificate).limit == PLAN.certificate.gate_length
