"""The limits of a pilot: they hold on the flights that are certified, cost time, and know no side."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from races import OPTIMA, PLAN, RACES, SMALL, differentiated, motion, optimum, prepared
from transformations import mirrored

from airrace.files.inputs.rules import PILOT_PRESETS
from airrace.model.dynamics.pilot_observation import RELIEF_SLOPE
from airrace.model.frames import angles, quaternion, rotation
from airrace.model.track.course import PilotLimits
from airrace.optimal_control.problem import Problem
from airrace.procedure.formulation import NEAR_GROUND, PILOT_NAMES
from airrace.procedure.guess import first_mesh
from airrace.procedure.infeasibility.local_infeasibility import without_one_limit
from airrace.procedure.result import Status
from airrace.procedure.settings import MeshSettings
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import history
from airrace.race import Race

MAGNITUDES = "beta_A", "n_y"
"""The path quantities of models with angles whose magnitude is limited at gates, start and finish."""
MESH = 1e-3
"""The time by which races on meshes of their own may differ, s."""
RACE_PILOT, DISPLAY = (PILOT_PRESETS[name].build() for name in ("race", "display"))


def flown_by(pilot: PilotLimits, race: Race = SMALL) -> Race:
    """The race with a pilot of limits."""
    rules = dataclasses.replace(race.course.rules, pilot=pilot)
    return dataclasses.replace(race, course=dataclasses.replace(race.course, rules=rules))


def problem_of(race: Race, stage: Stage = Stage.POINT_MASS) -> Problem:
    stage_problem = prepared(race, stage)
    return stage_problem.problem(first_mesh(stage_problem.plan, MeshSettings()))


def race_time(race: Race) -> float:
    result = optimum(race, PLAN)
    assert result.certified
    return result.trajectory.race_time


def observed(stage: Stage, heading: float, climb: float, bank: float, **given: float) -> dict[str, float]:
    """What is seen of a pilot's limits at an attitude (rad) and 80 m/s, with a tolerance of half a g."""
    stage_problem = prepared(flown_by(RACE_PILOT), stage)
    assert stage_problem.pilot is not None
    x = {one.name: 0.0 for one in stage_problem.model.system.states} | {"V_K": 80.0, "z": -20.0, **given}
    x |= dict(zip(("q0", "q1", "q2", "q3"), quaternion(heading, climb, bank), strict=True))
    seen = stage_problem.pilot.crossing
    values = seen.values(np.array(list(x.values())), np.array([0.5, *stage_problem.pilot.values]))
    return dict(zip((one.name for one in seen.quantities), np.asarray(values).ravel().tolist(), strict=True))


@pytest.mark.parametrize("climb", [-0.3, 0.0, 0.2])
@pytest.mark.parametrize("bank", [-1.2, 0.0, 0.7])
def test_in_a_steady_turn_the_climb_angle_stays(climb: float, bank: float) -> None:
    """What is seen is zero half a g beside the load factor at which a step of the flight climbs no steeper."""
    steady = math.cos(climb) / math.cos(bank)
    for beside, name in ((0.5, "turn_excess"), (-0.5, "turn_lack")):
        assert observed(Stage.POINT_MASS, 0.4, climb, bank, n_z=steady + beside)[name] == pytest.approx(0.0, abs=1e-12)
    system = prepared(SMALL).model.system
    x = {one.name: 0.0 for one in system.states} | {"V_K": 80.0, "z": -20.0, "n_z": steady}
    x |= dict(zip(("q0", "q1", "q2", "q3"), quaternion(0.4, climb, bank), strict=True))
    state = np.array(list(x.values()))
    rates = np.asarray(system.rates(state, np.zeros(len(system.controls)), prepared(SMALL).model.parameter_values))
    later = dict(zip(x, (state + 1e-4 * rates.ravel()).tolist(), strict=True))
    assert angles(rotation([later[f"q{i}"] for i in range(4)]))[1] == pytest.approx(climb, abs=1e-6)


def test_the_roll_rate_is_that_of_the_model_and_the_onset_that_of_its_load_factor() -> None:
    assert observed(Stage.POINT_MASS, 0.4, 0.1, 1.0, p_Kbar=1.7, n_z=5.0)["roll_rate"] == pytest.approx(1.7)
    assert "onset" not in observed(Stage.POINT_MASS, 0.0, 0.0, 0.0)
    found = observed(Stage.TRANSFER_FUNCTION, 0.4, 0.1, 1.0, p_Kbar=-0.6, n_z=3.0, n_z_dot=8.0)
    assert (found["roll_rate"], found["onset"]) == (pytest.approx(-0.6), pytest.approx(8.0))


@pytest.mark.parametrize("stage", OPTIMA, ids=lambda stage: stage.value)
def test_every_stage_has_the_limits_and_without_a_preset_none_has_any(stage: Stage) -> None:
    plain, limited = problem_of(SMALL, stage), problem_of(flown_by(DISPLAY), stage)
    assert all(not PILOT_NAMES & one.bounds.keys() for one in plain.boundaries)
    along = [
        [[one.name for one in leg.path_constraints if one.at is None] for leg in race.phases]
        for race in (plain, limited)
    ]
    assert along == [[[]] * len(plain.phases), [[NEAR_GROUND]] * len(limited.phases)]
    gates = {"roll_rate", "lateral_load_factor", "sideslip"}
    if stage is not Stage.POINT_MASS:
        gates.add("onset")
    ends = {"load_factor", "turn_excess", "turn_lack"}
    expected = [gates | ends, gates, gates, gates | ends]
    assert [PILOT_NAMES & one.bounds.keys() for one in limited.boundaries] == expected
    assert [one.bounds["roll_rate"].upper for one in limited.boundaries] == [0.0, *2 * [DISPLAY.roll_rate], 0.0]


def test_no_steady_turn_is_asked_for_on_edge() -> None:
    first, *between, last = SMALL.course.passages
    edge = dataclasses.replace(SMALL.course.passages[2], speed=first.speed)
    race = dataclasses.replace(SMALL, course=dataclasses.replace(SMALL.course, passages=(edge, between[0], last)))
    problem = problem_of(flown_by(DISPLAY, race))
    without_turn = {"roll_rate", "load_factor", "lateral_load_factor", "sideslip"}
    assert PILOT_NAMES & problem.start.bounds.keys() == without_turn


@pytest.mark.parametrize("pilot", [RACE_PILOT, DISPLAY], ids=["race", "display"])
def test_limits_hold_on_the_certified_flight_as_seen_from_outside(pilot: PilotLimits) -> None:
    race = flown_by(pilot)
    result = optimum(race, PLAN)
    assert result.certified
    x = {one.name: row for one, row in zip(result.trajectory.states, result.trajectory.state, strict=True)}
    gates = result.trajectory.first_node
    assert np.abs(x["p_Kbar"][gates]).max() <= pilot.roll_rate + 1e-6
    assert (x["n_z"] + RELIEF_SLOPE * np.maximum(-x["z"] - pilot.low_height, 0.0)).min() >= pilot.n_z_low - 1e-6
    for node, steady in ((0, pilot.steady_start), (-1, pilot.steady_finish)):
        assert x["n_z"][node] >= pilot.n_z_ends - 1e-6
        if steady:
            _, climb, bank = angles(rotation([float(x[f"q{i}"][node]) for i in range(4)]))
            assert abs(x["n_z"][node] - math.cos(climb) / math.cos(bank)) <= pilot.turn_tolerance + 1e-6
            assert x["p_Kbar"][node] == pytest.approx(0.0, abs=1e-6)


def test_tighter_limits_never_make_a_race_faster_and_a_mirror_changes_nothing() -> None:
    free, raced, displayed = (race_time(flown_by(one)) for one in (PilotLimits(), RACE_PILOT, DISPLAY))
    rolling = [race_time(flown_by(PilotLimits(roll_rate=rate))) for rate in (8.0, 3.0, 2.0, 1.0)]
    for times in ((free, raced, displayed), (free, *rolling)):
        assert all(before <= after + MESH for before, after in pairwise(times)), times
    assert displayed > free + 1e-4
    assert race_time(mirrored(flown_by(RACE_PILOT))) == pytest.approx(raced, abs=1e-4)


def test_limits_without_an_effect_change_no_bit() -> None:
    without, plain = problem_of(flown_by(PilotLimits())), problem_of(SMALL)
    assert [one.bounds for one in without.boundaries] == [one.bounds for one in plain.boundaries]
    assert prepared(flown_by(PilotLimits())).pilot is None


def test_an_infeasible_race_names_the_pilot() -> None:
    named = dict(without_one_limit(problem_of(flown_by(RACE_PILOT)), 1))
    assert {NEAR_GROUND, "the pilot's limits at gates"} <= named.keys()
    free = named["the pilot's limits at gates"]
    assert all(not PILOT_NAMES & one.bounds.keys() for one in free.boundaries)
    assert "the pilot's limits at gates" not in dict(without_one_limit(problem_of(SMALL), 1))
    start_alone = problem_of(flown_by(PilotLimits(steady_start=True, turn_tolerance=0.5)))
    assert not PILOT_NAMES & dict(without_one_limit(start_alone, 1))["the pilot's limits at gates"].start.bounds.keys()


def test_where_the_pilot_s_limits_leave_no_flight_the_answer_names_them_and_offers_none() -> None:
    """No steady turn with level wings has 3 g."""
    hard = dataclasses.replace(RACE_PILOT, n_z_ends=3.0)
    result = optimum(flown_by(hard), PLAN)
    assert result.outcome is Status.INFEASIBLE
    assert any(change.key.startswith("rules.pilot.") for change in result.suggested_changes)
    assert result.message.endswith("or without the pilot's limits (rules.pilot=none), which was not tried")


@pytest.mark.slow
def test_onset_and_roll_rate_hold_at_every_gate_of_the_last_stage() -> None:
    RACES["raced"] = flown_by(RACE_PILOT)
    from races import optimum_of

    assert optimum_of("raced", Stage.SIX_DOF).certified
    seen, result = motion("raced", Stage.SIX_DOF), optimum_of("raced", Stage.SIX_DOF)
    steps = np.diff(result.trajectory.time)[:, None]
    onset = differentiated(seen.n_z, steps)
    gates = result.trajectory.first_node
    sideslip, n_y = (history(prepared(RACES["raced"], Stage.SIX_DOF), result.trajectory, name) for name in MAGNITUDES)
    assert np.abs(sideslip[gates]).max() <= RACE_PILOT.sideslip + math.radians(0.1)
    assert np.abs(n_y[gates]).max() <= RACE_PILOT.n_y + 1e-3
    assert abs(n_y[-1]) <= 1e-6  # the finish is settled
    for node in result.trajectory.first_node[1:].tolist():
        assert abs(seen.p_Kbar[node - 1, -1]) <= RACE_PILOT.roll_rate + 0.02
        assert abs(onset[node - 1, -1]) <= RACE_PILOT.onset + 8.0  # the elevator's own lift as it moves
