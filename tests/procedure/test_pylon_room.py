"""The room beside pylons: what is predicted nearby is what a flight has when it is abeam of them."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from races import PLAN, ROOT, SHIPPED, SMALL, optimum
from scipy.integrate import solve_ivp

from airrace.files.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from airrace.files.checkpoint.checkpoint import StoredDocument, StoredInputs
from airrace.files.inputs import load_inputs
from airrace.model.dynamics.observations import PylonRoom, pylon_room_observation
from airrace.model.track.course import ClearanceRule
from airrace.model.track.gates import Passing
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.replay import replay
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.trajectory import Array
from airrace.procedure.certification import approaches, replayed_wing
from airrace.procedure.fidelity import iterate_of, stage_model
from airrace.procedure.mesh_loop import solve_certified
from airrace.procedure.planning.clearance import LEAST_CLEARANCE, PylonPost, closest_approaches, wing_distance
from airrace.procedure.pylon_conditions import MeasuredConditions, ReplayedFlight
from airrace.procedure.recomputation import recertify
from airrace.procedure.result import PylonSide, Silent, StageResult
from airrace.procedure.settings import SearchEffort
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import formulate, mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start
from airrace.race import Race

RACE = SHIPPED["rovinj_2014"]
TEXT = StoredDocument("course.yaml", "")
INPUTS = StoredInputs(TEXT, TEXT, None, (), "")


def rooms(stage: Stage, chi: float, bank: float, top: float = 25.0) -> dict[str, dict[str, float]]:
    """The room beside pylons 6.5 m to the west and to the east of the origin, which is crossed on a course."""
    model = stage_model(stage, RACE)
    x = {one.name: 0.0 for one in model.system.states}
    turn, roll = chi / 2, bank / 2
    x |= {"V_K": 90.0, "z": -15.0, "q0": math.cos(turn) * math.cos(roll), "q1": math.cos(turn) * math.sin(roll)}
    x |= {"q2": math.sin(turn) * math.sin(roll), "q3": math.sin(turn) * math.cos(roll)}
    if "n_z" in x:
        x["n_z"] = 1.0 if bank == 0.0 else 0.0
    observed = pylon_room_observation(model.system)
    found: dict[str, dict[str, float]] = {}
    for name, east in (("west", -6.5), ("east", 6.5)):
        b = np.concatenate([[0.0, east, top, 3.8, 0.0], model.parameter_values])
        values = np.asarray(observed.values(np.array(list(x.values())), b)).ravel()
        found[name] = dict(zip(PylonRoom.names(), values.tolist(), strict=True))
    return found


@pytest.mark.parametrize("chi", [-0.8, 0.0, 0.5])
@pytest.mark.parametrize("bank", [0.0, 0.7])
def test_straight_on_an_oblique_course_the_gate_is_narrower_by_the_cosine(chi: float, bank: float) -> None:
    half = 3.8 * math.cos(bank)
    found, tips = rooms(Stage.POINT_MASS, chi, bank), 6.5 * math.cos(chi)
    west, east = found["west"], found["east"]
    assert min(-west["left_tip"], -west["right_tip"]) == pytest.approx(tips - half, abs=0.05)
    assert min(east["left_tip"], east["right_tip"]) == pytest.approx(tips - half, abs=0.05)
    assert east["left_tip"] - east["right_tip"] == pytest.approx(2.0 * half, abs=0.05)


@pytest.mark.parametrize("bank", [0.0, 0.7, -0.7])
def test_above_a_low_pylon_the_lower_tip_is_the_nearer_one(bank: float) -> None:
    found = rooms(Stage.POINT_MASS, 0.0, bank, top=10.0)["east"]
    assert found["above_left"] == pytest.approx(5.0 + 3.8 * math.sin(bank), abs=0.05)
    assert found["above_right"] == pytest.approx(5.0 - 3.8 * math.sin(bank), abs=0.05)


def test_the_room_is_mirrored_with_the_course() -> None:
    one, other = rooms(Stage.POINT_MASS, 0.4, 0.0)["west"], rooms(Stage.POINT_MASS, -0.4, 0.0)["east"]
    assert one["left_tip"] == pytest.approx(-other["right_tip"], abs=1e-9)
    assert one["right_tip"] == pytest.approx(-other["left_tip"], abs=1e-9)
    assert one["above_left"] == pytest.approx(other["above_right"], abs=1e-9)


def test_the_room_is_the_distance_of_a_wing_that_is_abeam() -> None:
    e = np.array([math.cos(0.5), math.sin(0.5), 0.0])
    way = np.linspace(-10.0, 10.0, 40001)
    half = 3.8 * np.array([-math.sin(0.5), math.cos(0.5), 0.0])
    centre = np.array([0.0, 0.0, 15.0])[:, None] + e[:, None] * way
    away = wing_distance(PylonPost("g", 0.0, 6.5, 25.0, 0.5), centre, np.repeat(half[:, None], len(way), axis=1)).min()
    found = rooms(Stage.POINT_MASS, 0.5, 0.0)["east"]
    assert min(found["left_tip"], found["right_tip"]) == pytest.approx(away, abs=0.03)


def flown(start: Mapping[str, float], roll_acceleration: float, time: Array) -> Array:
    """The states of a point mass at times around that of a state, shape (n_x, n)."""
    model = stage_model(Stage.POINT_MASS, RACE)
    control = np.array([roll_acceleration if one.name == "p_Kbar_dot" else 0.0 for one in model.system.controls])
    numbers = np.array(model.parameter_values)
    halves = [
        solve_ivp(
            lambda _, y: np.asarray(model.system.rates(y, control, numbers)).ravel(),
            (0.0, end),
            np.array(list(start.values())),
            t_eval=np.sort(time[np.sign(time) == np.sign(end)])[:: int(np.sign(end))],
            rtol=1e-9,
        ).y
        for end in (float(time[0]), float(time[-1]))
    ]
    return np.hstack([halves[0][:, ::-1], halves[1]])


def in_a_dive(climb: float, bank: float, roll_rate: float) -> dict[str, float]:
    """The state of a point mass at the origin."""
    model = stage_model(Stage.POINT_MASS, RACE)
    c, s, m, n = math.cos(climb / 2), math.sin(climb / 2), math.cos(bank / 2), math.sin(bank / 2)
    x = {one.name: 0.0 for one in model.system.states} | {"V_K": 70.0, "z": -15.0, "n_z": 6.0, "p_Kbar": roll_rate}
    return x | {"q0": c * m, "q1": c * n, "q2": s * m, "q3": -s * n}


def tips_seen(state: Array, east: float, roll_acceleration: float) -> Array:
    """How far to the right of either wing tip a pylon to the east of the origin stands, m, shape (2,)."""
    model = stage_model(Stage.POINT_MASS, RACE)
    b = np.concatenate([[0.0, east, 40.0, 3.8, roll_acceleration], model.parameter_values])
    seen: Array = np.asarray(pylon_room_observation(model.system).values(state, b)).ravel()[:2]
    return seen


@pytest.mark.parametrize(
    ("climb", "bank", "roll_rate", "acceleration"),
    [
        (-0.9, 1.0, -7.0, 0.0),
        (-0.9, -1.0, 2.0, 0.0),
        (0.8, 0.6, 0.0, 0.0),
        (0.8, 0.6, 0.0, 40.0),
        (-0.9, 1.0, -7.0, 40.0),
    ],
)
def test_the_room_is_the_distance_of_a_wing_that_rolls_in_a_dive(
    climb: float, bank: float, roll_rate: float, acceleration: float
) -> None:
    """Its tips pass a pylon before and after its centre, and elsewhere than where they are when that does."""
    start = in_a_dive(climb, bank, roll_rate)
    states = dict(zip(start, flown(start, acceleration, np.linspace(-0.15, 0.15, 3001)), strict=True))
    q0, q1, q2, q3 = (states[name] for name in ("q0", "q1", "q2", "q3"))
    right = np.array([2 * (q1 * q2 - q0 * q3), q0**2 - q1**2 + q2**2 - q3**2, -2 * (q2 * q3 + q0 * q1)])
    centre = np.array([states["x"], states["y"], -states["z"]])
    for east in (-6.5, 6.5):
        away = wing_distance(PylonPost("g", 0.0, east, 40.0, 0.5), centre, 3.8 * right).min()
        seen = tips_seen(np.array(list(start.values())), east, acceleration)
        assert np.abs(seen).min() == pytest.approx(away, abs=0.08)


@pytest.mark.parametrize("acceleration", [-40.0, 40.0])
def test_a_roll_acceleration_that_is_known_does_not_change_the_room_along_a_flight(acceleration: float) -> None:
    """Else the Hamiltonian would jump at the node of a condition that keeps the wing away."""
    states = flown(in_a_dive(0.6, 1.2, 2.0), acceleration, np.array([-4e-3, -2e-3, 2e-3, 4e-3]))
    for east in (-6.5, 6.5):
        known, unknown = (
            np.ptp([tips_seen(state, east, one) for state in states.T], axis=0) for one in (acceleration, 0.0)
        )
        assert known.max() < 0.2 * unknown.max()


def by(rule: ClearanceRule, race: Race) -> Race:
    """The race by a rule on clearances."""
    rules = dataclasses.replace(race.course.rules, clearance=rule)
    return dataclasses.replace(race, course=dataclasses.replace(race.course, rules=rules))


def with_element(race: Race, number: int, **changed: object) -> Race:
    """The race with one element of its course changed."""
    passages = list(race.course.passages)
    passages[number] = dataclasses.replace(
        passages[number], element=dataclasses.replace(passages[number].element, **changed)
    )
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=tuple(passages)))


def nearest(race: Race, result: StageResult) -> dict[tuple[str, int], float]:
    """The least distances of the wing of a flight from the pylons of a race, by element and number."""
    stage_problem = formulate(Stage.POINT_MASS, race, PLAN, result.trajectory, result.pylon_conditions)
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    found: dict[tuple[str, int], float] = {}
    for one in approaches(stage_problem, problem, iterate, replay(problem, iterate)):
        key = one.pylon.name, one.pylon.post
        found[key] = min(found.get(key, math.inf), one.distance)
    return found


def planted_race() -> tuple[Race, StageResult]:
    """A race with a pylon on the way to the second element, and the flight that hits it.

    The finish is met in its middle alone, so its width does nothing but to plant that pylon.
    """
    exact = with_element(by(ClearanceRule.CROSSING, SMALL), 3, passing=Passing.POINT)
    free = optimum(exact, PLAN)
    finish = exact.course.passages[3].element
    assert finish.place is not None
    across = finish.axis + math.pi / 2
    north, east = free.trajectory["x"] - finish.place[0], free.trajectory["y"] - finish.place[1]
    along = north * math.cos(finish.axis) + east * math.sin(finish.axis)
    beside = north * math.cos(across) + east * math.sin(across)
    first_legs = slice(0, int(free.trajectory.first_node[2]))
    crossed = int(np.flatnonzero(np.diff(np.sign(along[first_legs])))[0])
    share = along[crossed] / (along[crossed] - along[crossed + 1])
    width = 2.0 * abs(float(beside[crossed] + share * (beside[crossed + 1] - beside[crossed])))
    return with_element(exact, 3, width=width), free


def test_a_pylon_planted_on_a_leg_is_kept_clear_of() -> None:
    planted, free = planted_race()
    hit = min(away for (name, _), away in nearest(planted, free).items() if name == "last")
    assert hit < 0.1
    clear = optimum(by(ClearanceRule.FLIGHT, planted), PLAN)
    assert clear.certified
    found = nearest(by(ClearanceRule.FLIGHT, planted), clear)
    assert (
        min(away for (name, _), away in found.items() if name == "last")
        >= LEAST_CLEARANCE - PLAN.certificate.gate_length
    )
    assert any(one.element == "last" and one.leg < 2 for one in clear.pylon_conditions)
    assert clear.trajectory.race_time > free.trajectory.race_time


def test_a_pylon_beside_a_leg_may_be_passed_on_its_other_side() -> None:
    race = by(ClearanceRule.FLIGHT, planted_race()[0])
    result = optimum(race, PLAN)
    stage_problem = formulate(Stage.POINT_MASS, race, PLAN, result.trajectory, result.pylon_conditions)
    assert stage_problem.clearance is not None
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    (conditions,) = stage_problem.clearance.on_other_sides(
        stage_problem.plan, problem, iterate
    )  # those of the passings stay
    (own,), (other,) = set(result.pylon_conditions) - set(conditions), set(conditions) - set(result.pylon_conditions)
    assert {own.side, other.side} == {PylonSide.LEFT, PylonSide.RIGHT}
    along = stage_problem.with_conditions(conditions)
    with SolverService() as service:
        session = SolverSession(service, PLAN, Silent())
        start = Start(along, along.problem(problem.mesh), iterate, InitialBarrier.PIECES)
        found = solve_certified(session, start, session.solvers[0])
    assert isinstance(found, StageResult)
    assert found.certified
    assert min(away for (name, _), away in nearest(race, found).items() if name == "last") >= LEAST_CLEARANCE - 0.01
    assert [one.side for one in found.pylon_conditions if one.element == "last" and one.leg < 2] == [other.side]


def with_last_heights(race: Race, lower: float) -> Race:
    """The race with the least height of its last gate, m, whose pylons are 25 m high."""
    element = race.course.passages[3].element
    tolerances = dataclasses.replace(element.tolerances, height=Interval(lower, lower + 10.0))
    return with_element(race, 3, height=lower + 1.0, tolerances=tolerances)


@pytest.mark.parametrize(("lower", "is_above"), [(24.0, False), (25.4, False), (25.6, True)])
def test_a_wing_that_is_level_above_the_pylons_of_its_gate_is_planned_to_pass_above_them(
    lower: float, is_above: bool
) -> None:
    stage_problem = formulate(Stage.POINT_MASS, with_last_heights(SMALL, lower), PLAN)
    assert stage_problem.clearance is not None
    sides = [one.side for one in stage_problem.clearance.conditions_on(stage_problem.plan) if one.element == "last"]
    assert sides == ([PylonSide.BELOW] * 2 if is_above else [PylonSide.LEFT, PylonSide.RIGHT])


def test_a_wing_on_edge_is_planned_to_pass_beside_pylons_that_its_centre_is_above() -> None:
    tolerances = dataclasses.replace(SMALL.course.passages[2].element.tolerances, height=Interval(27.0, 35.0))
    race = with_element(SMALL, 2, height=28.0, tolerances=tolerances)
    stage_problem = formulate(Stage.POINT_MASS, race, PLAN)
    assert stage_problem.clearance is not None
    sides = [one.side for one in stage_problem.clearance.conditions_on(stage_problem.plan) if one.element == "edge"]
    assert sides == [PylonSide.LEFT, PylonSide.RIGHT]


def test_a_pylon_of_a_gate_that_is_crossed_above_it_may_be_passed_beside_it_and_back() -> None:
    race = with_last_heights(SMALL, 25.6)
    result = optimum(race, PLAN)
    stage_problem = formulate(Stage.POINT_MASS, race, PLAN, result.trajectory, result.pylon_conditions)
    assert stage_problem.clearance is not None
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    (beside,) = stage_problem.clearance.on_other_sides(stage_problem.plan, problem, iterate)
    (before,), (after,) = set(result.pylon_conditions) - set(beside), set(beside) - set(result.pylon_conditions)
    assert (before.element, before.post, before.side) == ("last", 0, PylonSide.BELOW)
    assert (after.element, after.post, after.side) == ("last", 0, PylonSide.LEFT)
    # the flight passes above: with the condition that it does not fulfil it is to pass above again
    along = stage_problem.with_conditions(beside)
    assert along.clearance is not None
    above = list(along.clearance.on_other_sides(along.plan, problem, iterate))
    assert [{*sides} - {*beside} for sides in above] == [{dataclasses.replace(before, error=0.0)}]


@pytest.mark.slow
def test_of_two_pylons_that_stand_together_each_is_passed_on_the_side_that_is_faster() -> None:
    """By chance this course is flown 0.46 s slower, past two pylons that need not be passed there."""
    race = with_element(load_inputs(ROOT / "tracks" / "chiba_2015.yaml").race, 2, north=382.1, east=-300.5)
    found = optimum(race, dataclasses.replace(PLAN, search=SearchEffort.QUICK))
    assert found.certified
    assert found.trajectory.race_time < 47.0


def test_who_asks_for_more_clearance_gets_more() -> None:
    asked, kept, times = (3.5, 4.5, 6.0), [], []
    tolerances = SMALL.course.passages[1].element.tolerances
    for clearance in asked:
        race = with_element(SMALL, 1, tolerances=dataclasses.replace(tolerances, clearance=clearance))
        result = optimum(race, PLAN)
        assert result.certified
        kept.append(nearest(race, result)["pylon", 0])
        times.append(result.trajectory.race_time)
    assert kept == pytest.approx(asked, abs=PLAN.certificate.gate_length)
    assert times == sorted(times)


def test_a_condition_beside_its_moment_abeam_is_reported_by_how_much() -> None:
    result = optimum(SMALL, PLAN)
    (holds,) = (one for one in result.pylon_conditions if one.element == "pylon")

    def measure(earlier: float, error: float) -> MeasuredConditions:
        share = holds.share - earlier / float(result.trajectory.durations[holds.leg])
        conditions = [
            dataclasses.replace(one, share=share, error=one.error + error)
            if one is holds
            else dataclasses.replace(one, error=one.error - 1.0)
            for one in result.pylon_conditions
        ]
        stage_problem = formulate(Stage.POINT_MASS, SMALL, PLAN, result.trajectory, conditions)
        problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
        replayed = ReplayedFlight(problem, iterate.durations, replay(problem, iterate))
        assert stage_problem.clearance is not None
        return stage_problem.clearance.measure(
            stage_problem.plan, replayed, approaches(stage_problem, problem, iterate, replayed.replay)
        )

    assert measure(0.02, -1.0).offset == 0.0  # far from binding, it does not matter where it stands
    own, earlier = measure(0.0, 0.1), measure(0.02, 0.1)
    assert earlier.offset == pytest.approx(own.offset + 0.02, abs=2e-3)
    assert earlier.is_beside


def test_predictions_are_wrong_by_centimetres_also_where_a_pylon_is_abeam_behind_the_finish() -> None:
    assert all(abs(one.error) < 0.05 for one in optimum(SMALL, PLAN).pylon_conditions)


def test_a_correction_that_is_no_prediction_is_given_up() -> None:
    """As where a wing has flown above the top, or touches the pylon that a correction let it come nearer to."""
    result = optimum(SMALL, PLAN)
    (holds,) = (one for one in result.pylon_conditions if one.element == "pylon")
    stage_problem = formulate(Stage.POINT_MASS, SMALL, PLAN, result.trajectory, result.pylon_conditions)
    assert stage_problem.clearance is not None
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    replayed = ReplayedFlight(problem, iterate.durations, replay(problem, iterate))
    found = stage_problem.clearance.measure(
        stage_problem.plan, replayed, approaches(stage_problem, problem, iterate, replayed.replay)
    )
    wrong = tuple(dataclasses.replace(one, error=-0.8) if one.element == "pylon" else one for one in found.conditions)

    def error_after(distance: float) -> float:
        far = tuple(
            distance if one.element == "pylon" else away
            for one, away in zip(found.conditions, found.distances, strict=True)
        )
        measured = dataclasses.replace(found, conditions=wrong, distances=far)
        marks = np.ones(problem.intervals + 1, dtype=np.bool_)
        assert stage_problem.clearance is not None
        _, _, placed = stage_problem.clearance.place_on_mesh(
            measured, replayed, problem.mesh, iterate, marks, beside_passings=False
        )
        return next(one.error for one in placed if one.element == "pylon")

    own = next(away for one, away in zip(found.conditions, found.distances, strict=True) if one.element == "pylon")
    assert error_after(own) == pytest.approx(holds.error, abs=0.05)
    assert error_after(own + 1.5) == pytest.approx(holds.error - 1.5, abs=0.05)  # a wing that passes the top aslant
    assert error_after(0.0) == 1.0  # touched, where it was said to be 3.5 m away
    assert error_after(20.0) == 0.0  # another distance than that to the side
    assert math.isclose(error_after(math.nan), -0.8)  # not known


def test_a_stored_flight_states_the_problem_that_it_was_solved_with(tmp_path: Path) -> None:
    """Else its multipliers would belong to other limits, and another mesh would have another race time."""
    result = optimum(SMALL, PLAN)
    assert result.pylon_conditions
    assert result.certificate is not None
    write_checkpoint(tmp_path / "run.h5", Checkpoint(INPUTS, {}).with_stage(result))
    (stored,) = read_checkpoint(tmp_path / "run.h5").stages
    again = recertify(SMALL, PLAN, stored.result)
    for mine, its in zip(result.certificate.items, again.items, strict=True):
        assert its.value == pytest.approx(mine.value, abs=1e-4 + 1e-3 * abs(mine.value)), mine.name


@pytest.mark.slow
def test_by_the_rule_flight_no_wing_comes_nearer_than_its_clearance_and_it_costs_time() -> None:
    free, clear = (optimum(by(rule, RACE), PLAN) for rule in (ClearanceRule.CROSSING, ClearanceRule.FLIGHT))
    assert clear.certified
    assert clear.certificate is not None
    assert free.certificate is not None
    (own,) = (one for one in clear.certificate.items if one.name == "clearance")
    (its,) = (one for one in free.certificate.items if one.name == "clearance")
    assert own.value <= own.limit < its.value
    assert 0.0 < clear.trajectory.race_time - free.trajectory.race_time < 0.5


def test_a_pylon_whose_top_is_below_the_wing_does_not_keep_it_away_to_the_side() -> None:
    """What its condition asks for to the side is for a wing that may hit it."""
    result = optimum(SMALL, PLAN)
    stage_problem = formulate(Stage.POINT_MASS, SMALL, PLAN, result.trajectory, result.pylon_conditions)
    assert stage_problem.clearance is not None
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    replayed = ReplayedFlight(problem, iterate.durations, replay(problem, iterate))
    low = {
        key: dataclasses.replace(one, height=one.height - 20.0) for key, one in stage_problem.clearance.pylons.items()
    }
    rooms = dataclasses.replace(stage_problem.clearance, pylons=low)
    wing, legs = replayed_wing(stage_problem, problem, iterate, replayed.replay)
    measured = rooms.measure(stage_problem.plan, replayed, list(closest_approaches(wing, list(low.values()), legs)))
    (before,) = (one for one in result.pylon_conditions if one.element == "pylon")
    (after,) = (one for one in measured.conditions if one.element == "pylon")
    assert measured.is_excessive
    assert (before.side in (PylonSide.LEFT, PylonSide.RIGHT), after.side) == (True, PylonSide.BELOW)


@pytest.mark.parametrize("above", [True, False], ids=["above the top", "on the other side"])
def test_a_condition_on_a_side_where_a_wing_does_not_pass_gives_way_to_one_where_it_does(above: bool) -> None:
    """It cannot say how far away the wing is, and its error is that of another way past the pylon."""
    result = optimum(SMALL, PLAN)
    (own,) = (one for one in result.pylon_conditions if one.element == "pylon")
    opposite = PylonSide.LEFT if own.side is PylonSide.RIGHT else PylonSide.RIGHT
    wrong = dataclasses.replace(own, side=PylonSide.BELOW if above else opposite, error=-30.0)
    others = [one for one in result.pylon_conditions if one is not own]
    stage_problem = formulate(Stage.POINT_MASS, SMALL, PLAN, result.trajectory, [*others, wrong])
    assert stage_problem.clearance is not None
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    replayed = ReplayedFlight(problem, iterate.durations, replay(problem, iterate))
    more = {
        key: dataclasses.replace(one, required=one.required + 0.2)
        for key, one in stage_problem.clearance.pylons.items()
    }
    rooms = dataclasses.replace(stage_problem.clearance, pylons=more)
    wing, legs = replayed_wing(stage_problem, problem, iterate, replayed.replay)
    measured = rooms.measure(stage_problem.plan, replayed, list(closest_approaches(wing, list(more.values()), legs)))
    (after,) = (one for one in measured.conditions if one.element == "pylon")
    assert measured.violation > 0.1
    assert (after.side, after.error) == (own.side, 0.0)
