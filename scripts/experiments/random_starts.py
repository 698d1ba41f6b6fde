"""Random starts: the yardstick that exploring is held against. They share no choice with it.

A start is drawn by its number and the course's name: the radius at which turns are planned, 0.3 to 1 times the usual
one, and the planning speed, 0.8 to 1.05 times, both uniform; and every long turn of that plan is lifted by 0, 40, 80 or
140 m with even odds. A long turn is a planned leg whose course changes by more than 120 degrees, or that has a single
arc as long. The lift grows and falls with the course: by the square of a sine of the share of the turning that is done.
The attitude is pitched along with the lifted path; speed, load factor and bank stay as planned.
"""

import dataclasses
import itertools
import math
import random
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from airrace.dynamics.point_mass import PointMassState
from airrace.environment.atmosphere import g0
from airrace.frames import angles, quaternion, rotation
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import Solution
from airrace.planning.plan import Leg, plan
from airrace.planning.planning_model import PlanningModel, cruise
from airrace.planning.race import Race
from airrace.procedure.attitudes import align_quaternions
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.progress import Silent
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.solve_and_refine import solve_with_refinement
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight, stage_flight
from airrace.procedure.start import InitialBarrier, Start
from airrace.trajectory import Array

RADIUS = (0.3, 1.0)  # of the usual plan's
SPEED = (0.8, 1.05)
LIFTS = (0.0, 40.0, 80.0, 140.0)  # m
LONG = math.radians(120.0)
INTERVAL = 0.25  # s
TOLERANCE, ITERATIONS = 1e-5, 200


def pace(usual: PlanningModel, radius: float, speed: float) -> PlanningModel:
    """A pace with another radius and another speed, both as factors."""
    V = speed * usual.V
    across = V**2 / (g0 * radius * usual.radius)
    return PlanningModel(V, math.hypot(1.0, across), usual.p)


def is_long(leg: Leg) -> bool:
    """Whether a leg is a long turn."""
    if leg.path is None:
        return False
    turns = [length * curvature for length, curvature in zip(leg.path.lengths, leg.path.curvatures, strict=True)]
    return max(abs(sum(turns)), *(abs(turn) for turn in turns)) > LONG


def drawn(flight: Flight, race: Race, settings: Settings, name: str) -> tuple[Flight, Problem, Iterate]:
    """A random start: the flight along its own plan, the problem on a coarse mesh, the lifted guess.

    Args:
        name: of the course and the start; the same name draws the same start.
    """
    rng = random.Random(name)
    chosen = pace(cruise(race.aircraft, race.course.rules), rng.uniform(*RADIUS), rng.uniform(*SPEED))
    planned = dataclasses.replace(flight, plan=plan(race.course, chosen))
    mesh = first_mesh(planned.plan, dataclasses.replace(settings.mesh, interval=INTERVAL))
    start = guess(planned.plan, mesh)
    nodes = np.concatenate([[0], np.cumsum([len(fractions) for fractions in mesh])]).tolist()
    for leg, (first, last) in zip(planned.plan.legs, itertools.pairwise(nodes), strict=True):
        if is_long(leg):
            lift(start.state[:, first : last + 1], leg, rng.choice(LIFTS))
    align_quaternions(start.state)
    return planned, planned.problem(mesh), start


def lift(state: Array, leg: Leg, height: float) -> None:
    """Lift the states of a long turn in the middle of its turning, in place; (n_x, N) at even shares of the leg."""
    path = leg.path
    assert path is not None  # it is a long turn
    if height == 0.0:
        return
    s = np.linspace(0.0, path.length, state.shape[1])
    edges = np.concatenate([[0.0], np.cumsum(path.lengths)])
    rate = np.abs(path.curvatures)
    done = np.interp(s, edges, np.concatenate([[0.0], np.cumsum(np.asarray(path.lengths) * rate)]))
    total = float((np.asarray(path.lengths) * rate).sum())
    rise = height * math.pi * np.sin(2.0 * math.pi * done / total) * np.abs(path.curvature(s)) / total
    rows = {name: row for row, name in enumerate(PointMassState.names())}
    state[rows["z"]] -= height * np.sin(math.pi * done / total) ** 2
    attitude = [rows[name] for name in ("q0", "q1", "q2", "q3")]
    for node in range(state.shape[1]):
        course, climb, bank = angles(rotation(state[attitude, node].tolist()))
        state[attitude, node] = quaternion(course, climb + math.atan(float(rise[node])), bank)


@contextmanager
def bench_of(settings: Settings, threads: int) -> Iterator[SolverSession]:
    """A solver session with a solver process of its own."""
    solver = settings.solver
    with SolverService(threads=threads, stall_seconds=solver.stall_seconds) as service:
        yield SolverSession(service, settings, Silent())


def rough(session: SolverSession, problem: Problem, start: Iterate) -> Solution | None:
    """The coarse problem solved; None where no optimum was found."""
    options = SolverOptions(TOLERANCE, ITERATIONS, InitialBarrier.COLD)
    solution = session.attempt(problem, start, "a random start", session.settings.solver.primary, options)
    return solution if solution is not None and solution.success else None


def solved_roughly(
    race: Race, settings: Settings, course: str, numbers: Sequence[int], *, threads: int
) -> list[dict[str, float | None]]:
    """Race time (s, None where no optimum was found) and seconds of random starts."""
    flight = stage_flight(Stage.POINT_MASS, race, settings)
    rows: list[dict[str, float | None]] = []
    with bench_of(settings, threads) as session:
        for number in numbers:
            started = time.perf_counter()
            _, problem, start = drawn(flight, race, settings, f"{course} {number}")
            solution = rough(session, problem, start)
            seconds = time.perf_counter() - started
            race_time = None if solution is None else float(np.sum(solution.iterate.durations))
            rows.append({"number": number, "race_time_s": race_time, "seconds": seconds})
    return rows


def refined(race: Race, settings: Settings, course: str, number: int, *, threads: int) -> StageResult:
    """The rough optimum of a random start, optimised on finer meshes until it is certified."""
    flight = stage_flight(Stage.POINT_MASS, race, settings)
    with bench_of(settings, threads) as session:
        flight, problem, start = drawn(flight, race, settings, f"{course} {number}")
        solution = rough(session, problem, start)
        begin = Start(flight, problem, start, InitialBarrier.COLD)
        if solution is not None:
            begin = Start(flight, problem, solution.iterate, InitialBarrier.COARSER_MESH)
        return solve_with_refinement(session, [lambda: begin])
