"""Ladders for the tests of the procedure: every stage of a race, flown once however many tests ask."""

import functools
from dataclasses import dataclass

import numpy as np
from kept import kept
from races import RACES, prepared, settings

from airrace.environment.atmosphere import g0
from airrace.frames import product, rotation
from airrace.optimal_control.replay import SAMPLES, interval_durations, replay
from airrace.planning.race import Race
from airrace.procedure.models import iterate_of
from airrace.procedure.progress import Silent
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.run import optimize
from airrace.procedure.settings import GuessKind, Settings
from airrace.procedure.stage_problem import mesh_of
from airrace.trajectory import Array

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


def climbed(race: Race, chosen: Settings = PLAN) -> tuple[StageResult, ...]:
    """All stages of a race, from the plan."""
    return _climbed(race, chosen)


@kept
def _climbed(race: Race, chosen: Settings) -> tuple[StageResult, ...]:
    return tuple(optimize(race, chosen, until=Stage.SIX_DOF, threads=1, progress=Silent()))


def rung(name: str, stage: Stage) -> StageResult:
    """One stage of a race known by name."""
    return next(result for result in climbed(RACES[name]) if result.stage is stage)


def seconds(name: str, stage: Stage) -> float:
    """The race time of one stage."""
    return rung(name, stage).trajectory.race_time


def assert_certified(race: Race, chosen: Settings = PLAN) -> StageResult:
    """All stages, each with a certificate that holds; returns the last."""
    results = climbed(race, chosen)
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
    race, result = RACES[name], rung(name, stage)
    flight = prepared(race, stage)
    problem, iterate = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
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
        trimmed = side.beta - side.zeta * aircraft.yaw.beta / aircraft.yaw.zeta
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
