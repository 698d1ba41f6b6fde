"""The distance of a wing from pylons: laws of the geometry, pylons of courses, the item of the certificate."""

import dataclasses
import math

import numpy as np
import pytest
from races import OPTIMA, PLAN, SHIPPED, SMALL, blown, optimum, optimum_of

from airrace.files.inputs import load_inputs
from airrace.flights.results import Source
from airrace.flights.results.attitude import body_axes, path_axes
from airrace.flights.results.clearances import least_distances
from airrace.flights.results.derivation import flight_of
from airrace.model.dynamics.observations import CrossingParameters, crossing_values
from airrace.model.frames import quaternion
from airrace.model.track.course import ClearanceRule, Course
from airrace.model.track.gates import Passing
from airrace.optimal_control.certificate import Item
from airrace.optimal_control.replay import replay
from airrace.optimal_control.trajectory import Array
from airrace.procedure.certification import approaches, clearance_item
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.planning.clearance import (
    LEAST_CLEARANCE,
    PylonPost,
    Wing,
    closest_approaches,
    closest_in_steps,
    pylons_of,
    wing_distance,
    wing_position,
)
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import formulate, mesh_of
from airrace.race import Race

POST = PylonPost("g", 3.0, -2.0, 25.0, LEAST_CLEARANCE)


def wings(seed: int) -> tuple[Array, Array]:
    """Wings of 8 m about the top of a pylon, in any attitude."""
    random = np.random.default_rng(seed)
    half = random.normal(size=(3, 200))
    top = np.array([[3.0], [-2.0], [25.0]])
    return top + random.uniform(-8.0, 8.0, (3, 200)), 4.0 * half / np.linalg.norm(half, axis=0)


@pytest.mark.parametrize("seed", range(3))
def test_the_distance_is_the_least_of_all_points_of_the_wing_from_all_points_of_the_pylon(seed: int) -> None:
    centre, half = wings(seed)
    point = centre[:, :, None] + half[:, :, None] * np.linspace(-1.0, 1.0, 20001)
    above = np.maximum(point[2] - POST.height, 0.0)
    by_hand = np.sqrt((point[0] - POST.north) ** 2 + (point[1] - POST.east) ** 2 + above**2).min(axis=1)
    found = wing_distance(POST, centre, half)
    np.testing.assert_allclose(found, by_hand, atol=5e-4)
    assert (found <= by_hand + 1e-12).all()


def test_the_distance_does_not_know_left_from_right_nor_north_from_east() -> None:
    centre, half = wings(9)
    np.testing.assert_allclose(wing_distance(POST, centre, -half), wing_distance(POST, centre, half), atol=1e-12)
    turned = dataclasses.replace(POST, north=-POST.east, east=POST.north)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(wing_distance(turned, turn @ centre, turn @ half), wing_distance(POST, centre, half))


def test_a_wing_on_edge_and_a_wing_without_span_are_points_seen_from_above() -> None:
    centre = np.array([[3.0], [4.0], [10.0]])
    for half in (np.array([[0.0], [0.0], [4.0]]), np.zeros((3, 1))):
        assert wing_distance(POST, centre, half) == pytest.approx(6.0)


@pytest.mark.parametrize("step", [0.02, 0.013])
@pytest.mark.parametrize("roll_rate", [0.0, 3.0, 7.0])
def test_the_least_distance_of_a_rolling_wing_in_a_turn_is_found_between_samples(step: float, roll_rate: float) -> None:
    """A circle of 80 m at 90 m/s; samples lie up to 1.8 m apart, and the wing is thin."""

    def way(time: Array) -> tuple[Array, Array]:
        turned, bank = 90.0 / 80.0 * time, 0.3 + roll_rate * time
        centre = np.stack([80.0 * np.sin(turned), 80.0 * (1.0 - np.cos(turned)), 15.0 + 2.0 * time])
        right = np.stack([-np.sin(turned) * np.cos(bank), np.cos(turned) * np.cos(bank), -np.sin(bank)])
        return centre, 4.0 * right

    fine, time = np.arange(-0.3, 0.3, 1e-5), np.arange(-0.3, 0.3, step)
    for beside in (0.0, 0.3, 4.2, 5.0):
        post = PylonPost("g", 1.7, beside, 25.0, LEAST_CLEARANCE)
        truth = wing_distance(post, *way(fine))
        distance, when = closest_in_steps(Wing(time, *way(time)), post)
        assert distance.min() == pytest.approx(truth.min(), abs=2e-3)
        if truth.min() > 0.01:  # else it is hit for a while
            assert when[distance.argmin()] == pytest.approx(fine[truth.argmin()], abs=2e-3)


def test_approaches_are_those_of_every_passing_on_every_leg() -> None:
    time = np.linspace(0.0, 4.0, 201)
    centre = np.stack([100.0 * np.abs(time - 2.0) - 50.0, np.where(time < 2.0, 6.0, 5.0), np.full(201, 15.0)])
    half = np.stack([np.zeros(201), np.full(201, 4.0), np.zeros(201)])
    post, wing = PylonPost("g", 0.0, 0.0, 25.0, 1.5), Wing(time, centre, half)
    for legs, numbers in (([0, 100, 200], [0, 1]), ([0, 200], [0, 0])):  # passed on both of two legs, or twice on one
        found = list(closest_approaches(wing, [post], legs))
        assert [one.leg for one in found] == numbers
        assert [one.distance for one in found] == pytest.approx([2.0, 1.0], abs=1e-6)
        assert [one.time for one in found] == pytest.approx([1.5, 2.5], abs=1e-3)
        assert [one.shortfall for one in found] == pytest.approx([-0.5, 0.5], abs=1e-6)
    (far,) = closest_approaches(wing, [dataclasses.replace(post, east=-60.0)], [0, 200])
    assert far.distance == pytest.approx(61.0, abs=1e-6)


def test_pylons_ask_for_what_their_passing_asks_but_never_for_less_than_half_a_metre() -> None:
    course = SHIPPED["rovinj_2014"].course
    asked = {one.name: one.required for one in pylons_of(course)}
    for element in {one.element for one in course.passages}:
        assert asked[element.name] == max(LEAST_CLEARANCE, element.tolerances.clearance)
    exact = tuple(
        dataclasses.replace(one, element=dataclasses.replace(one.element, passing=Passing.POINT))
        for one in course.passages
    )
    assert {one.required for one in pylons_of(dataclasses.replace(course, passages=exact))} == {LEAST_CLEARANCE}


def test_keys_tell_the_height_of_pylons_and_when_the_wing_keeps_clear_of_them() -> None:
    course = load_inputs("rovinj_2014").race.course
    assert course.rules.clearance is ClearanceRule.FLIGHT
    assert {one.height for one in pylons_of(course)} == {25.0}
    overrides = ["gate_defaults.pylon_height_m=18", "gates.g3.pylon_height_m=12", "rules.clearance=crossing"]
    course = load_inputs("rovinj_2014", overrides=overrides).race.course
    assert {one.name: one.height for one in pylons_of(course)} == {f"g{i}": 12.0 if i == 3 else 18.0 for i in range(8)}
    assert course.rules.clearance is ClearanceRule.CROSSING


def test_a_flight_that_touches_a_pylon_is_certified_by_the_rule_crossing_alone() -> None:
    """A flight between pylons 13 m apart would hit those of a gate of one metre, and none of a wide gate."""
    result = optimum(SMALL, PLAN)
    stage_problem = formulate(Stage.POINT_MASS, SMALL, PLAN, result.trajectory, result.pylon_conditions)
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    flown_again = replay(problem, iterate)
    for rule in ClearanceRule:
        items: dict[float, Item] = {}
        for width in (40.0, 1.0):
            rules = dataclasses.replace(SMALL.course.rules, clearance=rule)
            course = dataclasses.replace(with_gates(width), rules=rules)
            other = dataclasses.replace(stage_problem, course=course)
            found = approaches(other, problem, iterate, flown_again)
            items[width] = clearance_item(other, problem, found, PLAN.certificate)
        assert items[40.0].value <= PLAN.certificate.gate_length  # which no gate's width changes
        assert 0.0 < items[1.0].value <= LEAST_CLEARANCE
        assert items[1.0].holds is (rule is ClearanceRule.CROSSING)
        assert "pylon of" in items[1.0].where


@pytest.mark.parametrize("stage", OPTIMA)
def test_what_is_shown_of_every_stage_is_the_distance_that_its_certificate_measures(stage: Stage) -> None:
    assert_shown_as_certified(SMALL, optimum_of("four_gates", stage))


def test_in_a_wind_the_wing_of_a_point_mass_is_that_of_its_path() -> None:
    """Its body points into the wind, by seven degrees, which would bring a wing tip near a pylon it clears."""
    race = blown(SMALL, 70.0, 10.0)
    assert_shown_as_certified(race, optimum(race, PLAN))


def assert_shown_as_certified(race: Race, result: StageResult) -> None:
    """Hold the least distances that tables show against those of the replay, to the millimetres between samples."""
    stage_problem = formulate(result.stage, race, PLAN, result.trajectory, result.pylon_conditions)
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    measured = approaches(stage_problem, problem, iterate, replay(problem, iterate))
    shown = [one for one in least_distances(flight_of(race, result, Source("flight"))) if one.kind == "pylon"]
    assert {one.name for one in shown} == {one.pylon.name for one in measured}
    for one in shown:
        nearest = min((each for each in measured if each.pylon.name == one.name), key=lambda each: each.distance)
        assert one.distance == pytest.approx(nearest.distance, abs=3e-3)
        assert one.required == nearest.pylon.required
        assert one.margin >= -PLAN.certificate.gate_length - 3e-3


def test_gates_and_pylons_see_the_same_wing_and_that_of_the_body_where_there_is_one() -> None:
    random = np.random.default_rng(4)
    for _ in range(20):
        chi, gamma, mu, alpha, beta, axis = random.uniform(-1.2, 1.2, 6).tolist()
        q, c, s = quaternion(chi, gamma, mu), math.cos(axis), math.sin(axis)
        place = CrossingParameters.split([3.0, -2.0, c, s, 1.0, 0.0, 1.0, 1.0, 4.0])
        seen = crossing_values(position=(1.0, 5.0, -20.0), V_K=80.0, q=q, place=place, beta_K=beta)
        rows = [np.array([one]) for one in (1.0, 5.0, -20.0, *q, beta)]
        named = dict(zip(("x", "y", "z", "q0", "q1", "q2", "q3", "beta_K"), rows, strict=True))
        centre, half = wing_position(named, 4.0)
        np.testing.assert_allclose(centre[:, 0], [1.0, 5.0, 20.0])
        assert seen.right_wing - seen.right == pytest.approx(float(c * half[1, 0] - s * half[0, 0]))
        body = body_axes(path_axes(rows[3:7]), np.array([alpha]), np.array([beta]))
        np.testing.assert_allclose(half[:, 0], 4.0 * body[:, 1, 0] * [1.0, 1.0, -1.0], atol=1e-12)
        without = {name: values for name, values in named.items() if name != "beta_K"}
        np.testing.assert_allclose(
            wing_position(without, 4.0)[1][:, 0], 4.0 * path_axes(rows[3:7])[:, 1, 0] * [1.0, 1.0, -1.0], atol=1e-12
        )


def with_gates(width: float) -> Course:
    """The small course with gates of some width."""
    passages = tuple(
        dataclasses.replace(one, element=dataclasses.replace(one.element, width=width))
        if hasattr(one.element, "width")
        else one
        for one in SMALL.course.passages
    )
    return dataclasses.replace(SMALL.course, passages=passages)
