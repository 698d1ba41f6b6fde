"""A problem stated anew for a race with other inputs is the one that is stated for it from scratch."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from short_course import AIRCRAFT

from airrace.files.inputs import Document, Inputs, inputs_from_documents
from airrace.files.inputs.variation import Variation
from airrace.optimal_control.problem import Boundary, PathConstraint, Problem
from airrace.procedure.settings import Settings
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import OtherStructureError, PerturbedProblem, formulate
from airrace.race import Race

COURSE = """
schema: airrace/track/1
name: everything that a course may have
origin: {latitude_deg: 45, longitude_deg: 13, elevation_m: 100}
rules:
  {n_z_max: 10, floor_m: 5, ceiling_m: 400, start_speed_max_kt: 190, start_speed: indicated_airspeed, C_L_max: 1.2,
  alpha_max_deg: 14, alpha_min_deg: -10, roll_rate_max_deg_s: 300, sideslip_max_deg: 9, crowd_distance_m: 60,
  pilot: display}
environment:
  temperature_offset_K: 5
  pressure_offset_hPa: 3
  wind: {from_deg: 250, speed_m_s: 6, profile: log}
  thermals: [{north_m: 200, east_m: 300, w_star_m_s: 2, mixing_height_m: 900}]
gate_defaults: {height_min_m: 15, height_max_m: 30}
gates:
  first: {type: level, north_m: 0, east_m: 0, heading_deg: 20}
  side: {type: pylon, north_m: 300, east_m: 60, pass_side_deg: 110}
  edge: {type: knife-edge, north_m: 700, east_m: 60, heading_deg: 350, bank: either}
  square: {type: quad, north_m: 900, east_m: -260, heading_deg: 270, then: either}
  top: {type: high-turn, height_min_m: 120}
  roll: {type: vertical-roll, roll_deg: 315, height_min_m: 150}
  figure: {type: manoeuvre, climb_deg: 0, height_min_m: 100, bank_deg: 10, heading_deg: 200}
  last: {type: level, north_m: 420, east_m: -660, heading_deg: 180, passing: point, height_m: 21}
safety_lines:
  shore: {from: {north_m: -558, east_m: 376}, to: {north_m: 1480, east_m: 453}, keep: left, margin_m: 10}
crowd:
  stand: {line: [{north_m: 480, east_m: 320}, {north_m: 520, east_m: 300}]}
  tent: {point: {north_m: 480, east_m: 320}, distance_m: 50, measured: over-ground}
obstacles:
  crane: {north_m: 300, east_m: 250, height_m: 60, radius_m: 5}
airspace:
  - {north_m: -900, east_m: -1500}
  - {north_m: 1820, east_m: -1520}
  - {north_m: 1820, east_m: 470}
  - {north_m: -900, east_m: 470}
course:
  start: first
  lap: [{gate: side, safety_lines: [shore]}, edge, square, top, roll, figure, {gate: last, direction: planned}]
"""
CHOICES = (
    *("course.start_state=free", "course.finish_state=settled", "course.start_direction=reverse"),
    *(f"course.lap.6.direction={one}" for one in ("forward", "reverse")),
    *("rules.clearance=crossing", "rules.start_speed=ground_speed", "rules.start_speed=true_airspeed"),
    *("rules.pilot=none", "rules.pilot=race", "rules.pilot.gate_onset_max_g_s=null", "rules.pilot.n_z_min_low=0.2"),
    *(f"rules.{one}=null" for one in ("ceiling_m", "start_speed_max_kt", "C_L_max", "alpha_max_deg", "pilot")),
    *(f"environment.{one}" for one in ("wind.profile=power", "wind.profile=constant", "wind=null", "thermals=null")),
    *(f"gates.edge.bank={one}" for one in ("left", "right")),
    *(f"gates.square.{one}" for one in ("then=left", "then=right", "bank=left", "second_bank=right", "bank=either")),
    *(f"gates.roll.{one}" for one in ("turning=left", "turning=right", "climb_deg=-90")),
    *(f"gates.figure.{one}" for one in ("bank_deg=null", "heading_deg=null", "bank_deg=170", "climb_deg=null")),
    *("gates.last.passing=window", "gates.first.passing=point", "gates.side.pass_side_deg=290"),
    *("gates.first.heading_deg=200", "gates.edge.heading_deg=170"),
    *("crowd.tent.measured=slant", "crowd.tent=null", "airspace=null"),
    *("obstacles.crane=null", "aircraft.propeller.turns=left", "aircraft.propeller=null", "origin=null"),
)
"""Everything that is no number, or takes one away."""
Statement = dict[tuple[object, ...], object]


@cache
def inputs(*overrides: str) -> Inputs:
    return inputs_from_documents(Document("course.yaml", COURSE), AIRCRAFT, None, overrides)


def statement(problem: Problem) -> Statement:
    """Return all that a problem says but for the planned durations, at some state where functions depend on it."""
    system, numbers = problem.system, np.random.default_rng(1)
    x = np.array([one.scale * numbers.uniform(-0.1, 0.1) for one in system.states])
    names = [one.name for one in system.states]
    x[names.index("V_K")], x[names.index("z")] = 90.0, -40.0
    u = np.array([one.scale * numbers.uniform(-0.1, 0.1) for one in system.controls])

    def observed(place: str, seen: Boundary | PathConstraint) -> Iterator[tuple[tuple[object, ...], object]]:
        for name, bounds in seen.bounds.items():
            yield (place, name, "bounds"), (bounds.lower, bounds.upper)
        for kind in (seen.observation, getattr(seen, "exact", None)):
            if kind is not None:
                values = _at(kind.values, x, np.array(seen.values))
                for quantity, value in zip(kind.quantities, values, strict=True):
                    yield (place, quantity.name, kind.name), value

    told: Statement = {("weight", name): weight for name, weight in problem.objective.regularisation.items()}
    told |= {(one.name, "range"): (one.lower, one.upper) for one in (*system.states, *system.controls, *system.path)}
    told["rates",] = _at(system.rates, x, u, np.array(problem.parameters))
    assert system.path_values is not None
    told["path values",] = _at(system.path_values, x, u, np.array(problem.parameters))
    told |= observed("start", problem.start)
    for phase in problem.phases:
        told |= observed(phase.name, phase.end)
        told |= {(phase.name, name): (bounds.lower, bounds.upper) for name, bounds in phase.bounds.items()}
        for number, constraint in enumerate(phase.path_constraints):
            told |= observed(f"{phase.name}, {number}: {constraint.name}", constraint)
    return told


def _at(function: ca.Function, *arguments: np.ndarray) -> tuple[float, ...]:
    return tuple(float(f"{value:.9e}") for value in np.array(function(*arguments)).ravel())


@cache
def known(stage: Stage) -> PerturbedProblem:
    stage_problem = formulate(stage, inputs().race, Settings())
    return PerturbedProblem(inputs().race, stage_problem, [(0.5, 0.5)] * len(stage_problem.path_constraints))


def differences(race: Race, stage: Stage) -> list[tuple[object, ...]] | None:
    """Return what a restated problem says otherwise than one from scratch along its plan; None where it is refused.

    The weights of the regularisation stay those of the known race.
    """
    try:
        flight = known(stage).formulation(race)
    except OtherStructureError:
        return None
    mesh = [(0.5, 0.5)] * len(flight.path_constraints)
    scratch = replace(formulate(stage, race, Settings()), plan=flight.plan, weights=flight.weights)
    told, wanted = statement(flight.problem(mesh)), statement(scratch.problem(mesh))
    return [key for key in {**told, **wanted} if told.get(key) != wanted.get(key)]


def moved(value: float) -> float:
    return 0.99 * value if value else 0.01


@cache
def groups() -> dict[str, list[str]]:
    """Return all numbers of course and aircraft, moved, by the parts of the files in which they stand."""
    found: dict[str, list[str]] = {}
    for key, parameter in Variation(inputs()).parameters.items():
        depth = 2 if key.startswith(("aircraft.", "gates.")) else 1
        found.setdefault(".".join(key.split(".")[:depth]), []).append(f"{key}={moved(parameter.value)!r}")
    return found


@pytest.mark.parametrize("stage", [Stage.POINT_MASS, Stage.SIX_DOF])
def test_other_numbers_are_stated_as_from_scratch(stage: Stage) -> None:
    assert sum(map(len, groups().values())) > 200
    different = {group: differences(inputs(*texts).race, stage) for group, texts in groups().items()}
    assert {group: keys[:3] for group, keys in different.items() if keys} == {}


@pytest.mark.slow
@pytest.mark.parametrize("stage", [Stage.POINT_MASS, Stage.TRANSFER_FUNCTION, Stage.STATE_SPACE, Stage.SIX_DOF])
def test_another_number_is_stated_as_from_scratch(stage: Stage) -> None:
    variation = Variation(inputs())
    for key, parameter in variation.parameters.items():
        assert differences(variation.race(key, moved(parameter.value)), stage) == [], key


def test_another_choice_is_stated_as_from_scratch_or_not_restated_at_all() -> None:
    found = {choice: differences(inputs(choice).race, Stage.POINT_MASS) for choice in CHOICES}
    assert {choice: keys[:3] for choice, keys in found.items() if keys} == {}
    assert sum(keys is not None for keys in found.values()) > 10


@pytest.mark.parametrize(
    "choice",
    [
        *("course.lap.6.direction=reverse", "course.start_direction=reverse", "gates.roll.turning=left"),
        *("gates.edge.bank=left", "gates.square.then=right", "environment.wind.profile=power"),
    ],
)
def test_a_choice_that_the_known_route_does_not_answer_is_not_restated(choice: str) -> None:
    """Its plan would go on to cross a gate, roll or bank as before, and the model would keep its wind."""
    assert differences(inputs(choice).race, Stage.POINT_MASS) is None
