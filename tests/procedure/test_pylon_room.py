"""The room beside pylons: what is predicted at the crossing is what a flight has when it is abeam of them."""

import dataclasses
import math

import numpy as np
import pytest
from races import PLAN, SHIPPED, optimum

from airrace.dynamics.pylon_room import PylonRoom, pylon_room_observation
from airrace.planning.wing_clearance import PylonPost, wing_distance
from airrace.procedure.fidelity import stage_model
from airrace.procedure.result import Stage
from airrace.track.course import ClearanceRule

RACE = SHIPPED["rovinj_2014"]


def rooms(stage: Stage, chi: float, bank: float) -> dict[str, float]:
    """The room between pylons 6.5 m to the west and to the east of the origin, which is crossed on a course."""
    model = stage_model(stage, RACE)
    x = {one.name: 0.0 for one in model.system.states}
    turn, roll = chi / 2, bank / 2
    x |= {"V_K": 90.0, "z": -15.0, "q0": math.cos(turn) * math.cos(roll), "q1": math.cos(turn) * math.sin(roll)}
    x |= {"q2": math.sin(turn) * math.sin(roll), "q3": math.sin(turn) * math.cos(roll)}
    if "n_z" in x:
        x["n_z"] = 1.0 if bank == 0.0 else 0.0
    observed = pylon_room_observation(model)
    b = np.concatenate([[0.0, -6.5, 0.0, 6.5, 3.8], model.parameter_values])
    values = np.asarray(observed.values(np.array(list(x.values())), b)).ravel()
    return dict(zip(PylonRoom.names(), values.tolist(), strict=True))


@pytest.mark.parametrize("chi", [-0.8, 0.0, 0.5])
@pytest.mark.parametrize("bank", [0.0, 0.7])
def test_straight_on_an_oblique_course_the_gate_is_narrower_by_the_cosine(chi: float, bank: float) -> None:
    half = 3.8 * math.cos(bank)
    found, tips = rooms(Stage.POINT_MASS, chi, bank), 6.5 * math.cos(chi)
    assert min(found["left_of_left"], found["right_of_left"]) == pytest.approx(tips - half, abs=0.05)
    assert min(found["left_of_right"], found["right_of_right"]) == pytest.approx(tips - half, abs=0.05)
    assert found["right_of_left"] - found["left_of_left"] == pytest.approx(2.0 * half, abs=0.05)


def test_the_room_is_mirrored_with_the_course() -> None:
    one, other = rooms(Stage.POINT_MASS, 0.4, 0.0), rooms(Stage.POINT_MASS, -0.4, 0.0)
    assert one["left_of_left"] == pytest.approx(other["right_of_right"], abs=1e-9)
    assert one["right_of_left"] == pytest.approx(other["left_of_right"], abs=1e-9)


def test_the_room_is_the_distance_of_a_wing_that_is_abeam() -> None:
    e = np.array([math.cos(0.5), math.sin(0.5), 0.0])
    way = np.linspace(-10.0, 10.0, 40001)
    half = 3.8 * np.array([-math.sin(0.5), math.cos(0.5), 0.0])
    centre = np.array([0.0, 0.0, 15.0])[:, None] + e[:, None] * way
    away = wing_distance(PylonPost("g", 0.0, 6.5, 25.0, 0.5), centre, np.repeat(half[:, None], len(way), axis=1)).min()
    found = rooms(Stage.POINT_MASS, 0.5, 0.0)
    assert min(found["left_of_right"], found["right_of_right"]) == pytest.approx(away, abs=0.03)


@pytest.mark.slow
def test_by_the_rule_flight_no_wing_comes_nearer_than_its_clearance_and_it_costs_time() -> None:
    rules = dataclasses.replace(RACE.course.rules, clearance=ClearanceRule.FLIGHT)
    race = dataclasses.replace(RACE, course=dataclasses.replace(RACE.course, rules=rules))
    free, clear = optimum(RACE, PLAN), optimum(race, PLAN)
    assert clear.certified
    assert clear.certificate is not None
    assert free.certificate is not None
    (own,) = (one for one in clear.certificate.items if one.name == "clearance")
    (its,) = (one for one in free.certificate.items if one.name == "clearance")
    assert own.value <= own.limit < its.value
    assert 0.0 < clear.trajectory.race_time - free.trajectory.race_time < 0.5
