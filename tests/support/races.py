"""Races for the tests of the procedure, each with the stages that are solved once however many tests ask."""

import dataclasses
import functools
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from disk_cache import cached_across_workers

from airrace.files.inputs import load_inputs
from airrace.model.environment import Air, StaticWind, g0
from airrace.model.frames import product, rotation
from airrace.model.track.course import Course, Passage, Rules
from airrace.model.track.gates import Element, Gate, Passing, Pylon, Tolerances
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.replay import SAMPLES, interval_durations, replay
from airrace.optimal_control.trajectory import Array
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.planning.plan import Plan, plan, plan_race
from airrace.procedure.planning.planning_model import cruise
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort, Settings
from airrace.procedure.stage import Stage
from airrace.procedure.stage_models import StageModels
from airrace.procedure.stage_problem import StageProblem, formulate, mesh_of
from airrace.race import Race

ROOT = Path(__file__).parents[2]
COURSES = ("half_cuban_eight", "rovinj_2014", "sixteen_phases")
SHIPPED = {name: load_inputs(ROOT / "tracks" / f"{name}.yaml").race for name in COURSES}
SIXTEEN = SHIPPED["sixteen_phases"]
EDGE_540 = SHIPPED["rovinj_2014"].aircraft
DEGREE = math.pi / 180.0
KNOT = 1852.0 / 3600.0
RULES = Rules(n_z=Interval(-2.0, 10.0), height=Interval(lower=10.0))
WINDOW = Tolerances(
    clearance=0.5,
    height=Interval(15.0, 25.0),
    bank=10 * DEGREE,
    climb=Interval(-45 * DEGREE, 45 * DEGREE),
    crossing=60 * DEGREE,
)
BESIDE = dataclasses.replace(WINDOW, clearance=3.5, bank=math.pi)


def level(name: str, north: float, east: float, heading: float, passing: Passing = Passing.WINDOW) -> Gate:
    """A level gate 13 m wide; `heading` in degrees."""
    return Gate(name, north, east, 20.0, heading * DEGREE, 13.0, passing, WINDOW)


def knife_edge(name: str, north: float, east: float, heading: float, *, right: bool, either: bool = False) -> Gate:
    """A gate to be flown exactly, on the right or the left wing; `heading` in degrees."""
    bank = math.pi / 2 if right else -math.pi / 2
    return Gate(name, north, east, 20.0, heading * DEGREE, 13.0, Passing.POINT, WINDOW, bank, either)


def pylon(name: str, north: float, east: float, side: float) -> Pylon:
    """A single pylon; `side` in degrees."""
    return Pylon(name, north, east, 20.0, side * DEGREE, 100.0, Passing.WINDOW, BESIDE)


def course(name: str, *elements: Element, rules: Rules = RULES) -> Course:
    """The elements in order, started at 200 knots at most."""
    passages = [Passage(element.name, 1, element) for element in elements]
    passages[0] = dataclasses.replace(passages[0], speed=Interval(upper=200 * KNOT))
    return Course(name, tuple(passages), rules)


SMALL = Race(
    course(
        "four gates",
        level("first", 0.0, 0.0, 20.0),
        pylon("pylon", 300.0, 60.0, 110.0),
        knife_edge("edge", 480.0, -120.0, 270.0, right=False),
        level("last", 250.0, -300.0, 170.0),
    ),
    EDGE_540,
    Air(),
)

RACES = {**SHIPPED, "four_gates": SMALL}
DIVING_EIGHT = load_inputs("half_cuban_eight", overrides=["rules.floor_m=10", "rules.pilot=none"]).race
"""The Half Cuban Eight without its floor and a pilot's limits: it is pushed, rolls and dives for speed."""


def one_lap(race: Race) -> Race:
    """The sixteen phases without the second of their two laps."""
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=race.course.passages[:9]))


def blown(race: Race, origin: float, speed: float) -> Race:
    """The race in a constant wind from `origin` (degrees) with `speed` (m/s)."""
    air = dataclasses.replace(race.air, wind=StaticWind(origin * DEGREE, speed) if speed else None)
    return dataclasses.replace(race, air=air)


@functools.cache
def planned(race: Race) -> Plan:
    """The plan of a race."""
    return plan(race.course, cruise(race.aircraft, race.course.rules))


def prepared(race: Race, stage: Stage = Stage.POINT_MASS) -> StageProblem:
    """A race made ready for optimisation with the default settings."""
    return formulate(stage, race, Settings())


def settings(guess: GuessKind, *, search: SearchEffort = SearchEffort.OFF) -> Settings:
    """Default settings but for the guess, all stages are proved.

    Other routes are explored where that is asked for.
    """
    silent = Settings(mesh_check=MeshCheck.ALL)
    return dataclasses.replace(silent, guess=guess, search=search)


def models_of(race: Race, chosen: Settings, *stages: Stage) -> StageModels:
    """The models of some stages of a race."""
    with ThreadPoolExecutor(1) as maker:
        return StageModels.request(maker, race, chosen, plan_race(race), stages)


@cached_across_workers
def solve_point_mass(race: Race, chosen: Settings) -> tuple[StageResult, ...]:
    """All stages of a race; flown once however many tests ask."""
    return tuple(optimize(race, chosen, until=Stage.POINT_MASS, threads=1, progress=Silent()))


def optimum(race: Race, chosen: Settings) -> StageResult:
    """The point-mass stage, which must have been reached."""
    result = solve_point_mass(race, chosen)[-1]
    assert result.stage is Stage.POINT_MASS
    return result


PLAN = settings(GuessKind.PLAN)
OPTIMA = (
    Stage.POINT_MASS,
    Stage.TRANSFER_FUNCTION,
    Stage.STATE_SPACE_INVERSION,
    Stage.STATE_SPACE,
    Stage.SIX_DOF,
)
"""The stages that are optima, in order."""
WITHOUT_ANGLES = (Stage.POINT_MASS, Stage.TRANSFER_FUNCTION)
QUICK = ("four_gates", "half_cuban_eight")


def solve_stages(race: Race, chosen: Settings = PLAN) -> tuple[StageResult, ...]:
    """All stages of a race, from the plan."""
    return _solve_stages(race, chosen)


@cached_across_workers
def _solve_stages(race: Race, chosen: Settings) -> tuple[StageResult, ...]:
    return tuple(optimize(race, chosen, until=Stage.SIX_DOF, threads=1, progress=Silent()))


def optimum_of(name: str, stage: Stage) -> StageResult:
    """One stage of a race known by name."""
    return next(result for result in solve_stages(RACES[name]) if result.stage is stage)


def seconds(name: str, stage: Stage) -> float:
    """The race time of one stage."""
    return optimum_of(name, stage).trajectory.race_time


def assert_certified(race: Race, chosen: Settings = PLAN) -> StageResult:
    """All stages, each with a certificate that holds; returns the last."""
    results = solve_stages(race, chosen)
    for result in results:
        assert result.certified, f"{result.stage.value}: {result.message}"
    assert [result.stage for result in results] == list(OPTIMA)
    return results[-1]


@dataclass(frozen=True)
class Motion:
    """What a flight through still air does, seen from outside: from where it is and how it lies, sample by sample.

    Each of shape (N, SAMPLES + 1). Load factors in g; `C_L` and `beta_A` (rad) are what the air must do for them.
    """

    V_K: Array
    n_x: Array
    n_y: Array
    n_z: Array
    p_Kbar: Array
    C_L: Array
    beta_A: Array


@functools.cache
def motion(name: str, stage: Stage) -> Motion:
    """One stage of a race flown again, and differentiated with respect to time."""
    race, result = RACES[name], optimum_of(name, stage)
    stage_problem = prepared(race, stage)
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    steps = interval_durations(problem, iterate.durations)[:, None]
    rows = replay(problem, iterate).state
    x = {one.name: rows[index] for index, one in enumerate(problem.system.states)}
    q = [x[name] for name in ("q0", "q1", "q2", "q3")]
    R = rotation(q)
    velocity = [x["V_K"] * R[row][0] for row in range(3)]
    force = [differentiated(one, steps) / g0 for one in velocity]
    force[2] = force[2] - 1.0  # gravity is no load
    n_x, n_y, down = (sum(R[row][column] * force[row] for row in range(3)) for column in range(3))
    conjugate = (q[0], -q[1], -q[2], -q[3])
    _, p_Kbar, _, _ = (2.0 * one for one in product(conjugate, tuple(differentiated(one, steps) for one in q)))
    return Motion(x["V_K"], n_x, n_y, -down, p_Kbar, *_coefficients(race, stage, x, n_y, -down))


def _coefficients(race: Race, stage: Stage, x: dict[str, Array], n_y: Array, n_z: Array) -> tuple[Array, Array]:
    """`(C_L, beta_A)`: lift is what of the load the propeller does not carry; without angles it carries nothing."""
    aircraft, V = race.aircraft, x["V_K"]
    airframe, side, engine = aircraft.airframe, aircraft.side_force, aircraft.propulsion
    temperature = 288.15 + 0.0065 * x["z"]
    rho = 1.225 * (temperature / 288.15) ** (g0 / (287.05287 * 0.0065) - 1.0)
    qbar_S, weight = 0.5 * rho * V**2 * airframe.S, airframe.m * g0
    if stage in WITHOUT_ANGLES:
        trimmed = side.C_Ybeta - side.C_Yzeta * aircraft.yaw.C_nbeta / aircraft.yaw.C_nzeta
        return weight * n_z / qbar_S, weight * n_y / (qbar_S * trimmed)
    P = engine.eta_p * engine.P_max
    T = x["delta_T"] * P * (1.132 * rho / 1.225 - 0.132) / np.hypot(V, P / engine.T_static)
    tilt = np.sin(x["alpha_K"]) if stage is Stage.SIX_DOF else x["alpha_K"]
    return (weight * n_z - T * tilt) / qbar_S, x["beta_K"]


def differentiated(samples: Array, steps: Array) -> Array:
    """Time derivative of the polynomial through the samples of each interval; shapes (N, SAMPLES + 1), (N, 1)."""
    share = np.linspace(-1.0, 1.0, SAMPLES + 1)
    powers = np.arange(SAMPLES + 1)
    basis = share[:, None] ** powers
    slopes = powers * share[:, None] ** np.maximum(powers - 1, 0)
    return samples @ np.linalg.solve(basis.T, slopes.T) * 2.0 / steps
