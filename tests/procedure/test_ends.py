"""How races begin and end: settled or free, the same for every stage."""

import dataclasses

import numpy as np
import pytest
from races import DIVING_EIGHT, OPTIMA, PLAN, RACES, SMALL, blown, optimum, optimum_of, prepared, solve_stages
from transformations import mirrored

from airrace.flights.results.derivation import indicated_airspeed
from airrace.model.dynamics.observations import settled_observation
from airrace.model.frames import rotation
from airrace.model.track.course import EndState, StartSpeed
from airrace.optimal_control.certificate import Item
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Problem
from airrace.procedure.certification import examine
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import first_mesh
from airrace.procedure.homotopy import fixed_state
from airrace.procedure.infeasibility.local_infeasibility import without_one_limit
from airrace.procedure.result import StageResult
from airrace.procedure.settings import MeshSettings, Settings
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import mesh_of
from airrace.race import Race

SETTLED, FREE = EndState.SETTLED, EndState.FREE
every_stage = pytest.mark.parametrize("stage", OPTIMA, ids=lambda stage: stage.value)


def ended(race: Race, start: EndState, finish: EndState) -> Race:
    """The race with other ends."""
    return dataclasses.replace(race, course=dataclasses.replace(race.course, start_state=start, finish_state=finish))


def problem_of(race: Race, stage: Stage = Stage.POINT_MASS) -> Problem:
    stage_problem = prepared(race, stage)
    return stage_problem.problem(first_mesh(stage_problem.plan, MeshSettings()))


def asked(boundary: Boundary, problem: Problem, stage: Stage = Stage.POINT_MASS) -> set[str]:
    """What of a settled flight a boundary asks."""
    model = prepared(SMALL, stage).model
    assert problem.system.name == model.system.name
    return boundary.bounds.keys() & {one.name for one in settled_observation(model).quantities}


def left(result: StageResult, race: Race, node: int) -> np.ndarray:
    """How far a flight is from settled at a node: side acceleration and rates, SI."""
    model = prepared(race, result.stage).model
    return np.asarray(settled_observation(model).values(result.trajectory.state[:, node], model.parameter_values))


@every_stage
def test_start_is_settled_and_finish_free_unless_the_course_says_otherwise(stage: Stage) -> None:
    problem = problem_of(SMALL, stage)
    every = {one.name for one in settled_observation(prepared(SMALL, stage).model).quantities}
    assert asked(problem.start, problem, stage) == every
    assert all(asked(phase.end, problem, stage) == set() for phase in problem.phases)
    problem = problem_of(ended(SMALL, FREE, SETTLED), stage)
    assert asked(problem.start, problem, stage) == set()
    assert asked(problem.phases[-1].end, problem, stage) == every
    assert all(asked(phase.end, problem, stage) == set() for phase in problem.phases[:-1])


@every_stage
def test_all_limits_along_the_path_hold_at_the_finish(stage: Stage) -> None:
    problem = problem_of(SMALL, stage)
    limited = {one.name for one in problem.system.path if np.isfinite([one.lower, one.upper]).any()}
    rows = Layout(problem).flat_rows
    last = [row for row in rows if row.node == problem.intervals and row.source < 0]
    assert {row.quantity.name for row in last} == limited
    assert "beta_A" in limited


def test_piece_of_a_homotopy_that_begins_in_mid_race_is_not_settled() -> None:
    stage_problem = prepared(SMALL)
    assert (
        asked(fixed_state(stage_problem, np.ones(len(stage_problem.model.system.states))), problem_of(SMALL)) == set()
    )


@every_stage
def test_every_stage_starts_settled(stage: Stage) -> None:
    assert np.abs(left(optimum_of("four_gates", stage), SMALL, 0)).max() < 1e-6


def test_point_mass_finishes_settled_where_the_course_asks_it() -> None:
    race = ended(SMALL, SETTLED, SETTLED)
    result = optimum(race, PLAN)
    assert result.certified, result.message
    assert np.abs(left(result, race, -1)).max() < 1e-6


def certificate_items(race: Race, result: StageResult, slip: float) -> dict[str, Item]:
    """What is measured of a flight that starts with a little side load factor (g)."""
    problem = prepared(race).problem(mesh_of(result.trajectory))
    iterate = iterate_of(result.trajectory)
    state = iterate.state.copy()
    state[[one.name for one in problem.system.states].index("n_y"), 0] += slip
    moved = dataclasses.replace(iterate, state=state)
    evidence = examine(problem, moved, result.constraint_multipliers, Settings().certificate)
    return {item.name: item for item in evidence.check.items}


def test_certificate_tells_a_start_that_is_not_settled() -> None:
    result = optimum_of("four_gates", Stage.POINT_MASS)
    assert certificate_items(SMALL, result, 0.0)["gate_acceleration"].holds
    found = certificate_items(SMALL, result, 1e-6)["gate_acceleration"]
    assert not found.holds
    assert (found.limit, found.unit, found.where) == (1e-6, "m/s2", "first, side_acceleration")


def test_settled_end_is_named_among_what_may_stand_in_the_way() -> None:
    problem = problem_of(ended(SMALL, SETTLED, SETTLED))
    named = dict(without_one_limit(problem, 0))
    assert asked(named["a settled start"].start, problem) == set()
    assert asked(named["a settled finish"].phases[-1].end, problem) == set()
    assert named["a settled start"].start.bounds.keys() == problem_of(ended(SMALL, FREE, FREE)).start.bounds.keys()
    free = dict(without_one_limit(problem_of(ended(SMALL, FREE, FREE)), 0))
    assert not any("settled" in what for what in free)


@pytest.mark.slow
@pytest.mark.parametrize(
    "race", [pytest.param(SMALL, id="four_gates"), pytest.param(DIVING_EIGHT, id="half_cuban_eight")]
)
def test_free_start_is_in_mid_manoeuvre_and_no_slower(race: Race) -> None:
    free, settled = (solve_stages(one)[-1] for one in (ended(race, FREE, FREE), race))
    assert free.certified
    assert settled.stage is free.stage is Stage.SIX_DOF
    assert free.trajectory.race_time < settled.trajectory.race_time + 1e-3
    assert np.abs(left(settled, race, 0)).max() < 1e-6
    assert np.abs(left(free, race, 0)).max() > 1.0


@pytest.mark.slow
def test_a_race_pilot_s_start_is_settled_even_where_the_course_leaves_it_free() -> None:
    free = solve_stages(ended(RACES["half_cuban_eight"], FREE, FREE))[-1]
    assert free.certified
    assert np.abs(left(free, RACES["half_cuban_eight"], 0)).max() < 1e-6


@pytest.mark.slow
def test_settled_ends_hold_in_wind_and_in_a_mirror() -> None:
    race = ended(blown(SMALL, 320.0, 6.0), SETTLED, SETTLED)
    for one in (race, mirrored(race)):
        for result in solve_stages(one):
            assert result.certified, result.message
            assert max(np.abs(left(result, one, node)).max() for node in (0, -1)) < 1e-6
    times = [solve_stages(one)[-1].trajectory.race_time for one in (race, mirrored(race))]
    assert times[0] == pytest.approx(times[1], abs=5e-3)


@pytest.mark.parametrize("kind", [StartSpeed.TRUE, StartSpeed.INDICATED], ids=lambda kind: kind.value)
@pytest.mark.parametrize("wind", [-8.0, 0.0, 8.0])
def test_the_speed_at_the_start_is_limited_in_the_air_where_the_rules_say_so(kind: StartSpeed, wind: float) -> None:
    """The start is passed at 20 deg: a wind from there adds to the airspeed all of its own speed."""
    rules = dataclasses.replace(SMALL.course.rules, start_speed=kind)
    race = dataclasses.replace(SMALL, course=dataclasses.replace(SMALL.course, rules=rules))
    race = blown(race, 20.0 if wind > 0.0 else 200.0, abs(wind))
    result = optimum(race, PLAN)
    assert result.certified, result.message
    x = {one.name: row[0] for one, row in zip(result.trajectory.states, result.trajectory.state, strict=True)}
    R = np.array(rotation([float(x[f"q{i}"]) for i in range(4)]))
    air = np.array([float(x["V_K"]), 0.0, 0.0]) @ R.T + wind * np.array([np.cos(0.349066), np.sin(0.349066), 0.0])
    speed = np.array([float(np.linalg.norm(air))])
    if kind is StartSpeed.INDICATED:
        speed = indicated_airspeed(speed, np.array([x["z"]]), race.air)
    assert speed[0] == pytest.approx(200.0 * 1852.0 / 3600.0, abs=1e-4)


def test_the_start_speed_over_ground_adds_nothing_to_the_problem() -> None:
    assert prepared(SMALL).start_airspeed is None
    assert problem_of(SMALL).start.bounds["V_K"].upper == pytest.approx(200.0 * 1852.0 / 3600.0)
