"""The search for routes and its lower bound held against the best of many random starts, which share no choice with it.

    python scripts/experiments/random_starts.py COURSE... [--count 60] [--refine 10] [--threads 2]

A start is drawn by its number and the course's name: the radius at which turns are planned, 0.3 to 1 times the usual
one, and the planning speed, 0.8 to 1.05 times, both uniform; and every long turn of that plan is lifted by 0, 40, 80 or
140 m with even odds. A long turn is a planned leg whose course changes by more than 120 degrees, or that has a single
arc as long. The lift grows and falls with the course: by the square of a sine of the share of the turning that is done.
The attitude is pitched along with the lifted path; speed, load factor and bank stay as planned.
"""

import argparse
import dataclasses
import itertools
import math
import random
from pathlib import Path

import numpy as np

import airrace
from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.environment import g0
from airrace.model.frames import angles, quaternion, rotation
from airrace.files.inputs import load_inputs
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.race import Race
from airrace.procedure.planning.plan import (PlannedLeg, plan)
from airrace.procedure.planning.planning_model import PlanningModel, cruise
from airrace.procedure.guess import align_quaternions, first_mesh, guess
from airrace.procedure.result import Silent
from airrace.procedure.settings import Settings
from airrace.procedure.stage import Stage
from airrace.procedure.mesh_loop import solve_certified, solve_from_starts
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import StageProblem, formulate
from airrace.procedure.warm_start import InitialBarrier, Start
from airrace.optimal_control.trajectory import Array

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


def is_long(leg: PlannedLeg) -> bool:
    """Whether a leg is a long turn."""
    if leg.path is None:
        return False
    turns = [length * curvature for length, curvature in zip(leg.path.lengths, leg.path.curvatures, strict=True)]
    return max(abs(sum(turns)), *(abs(turn) for turn in turns)) > LONG


def drawn(flight: StageProblem, race: Race, settings: Settings, name: str) -> tuple[StageProblem, Problem, Iterate]:
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


def lift(state: Array, leg: PlannedLeg, height: float) -> None:
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


def rough(session: SolverSession, problem: Problem, start: Iterate) -> ProgramSolution | None:
    """The coarse problem solved; None where no optimum was found."""
    options = SolverOptions(TOLERANCE, ITERATIONS, InitialBarrier.COLD.value, curvature=False)
    solution = session.attempt(problem, start, "a random start", session.settings.solver.primary, options)
    return solution if solution is not None and solution.success else None


def best_of(course: str, count: int, refine: int, threads: int) -> float:
    """The least race time (s) of the best of many random starts, refined; infinite where none is certified."""
    inputs = load_inputs(course)
    race, settings = inputs.race, inputs.settings
    flight = formulate(Stage.POINT_MASS, race, settings)
    starts: list[tuple[float, Start]] = []
    with SolverService(threads=threads, stall_seconds=settings.solver.stall_seconds) as service:
        session = SolverSession(service, settings, Silent())
        for number in range(count):
            planned, problem, start = drawn(flight, race, settings, f"{race.course.name} {number}")
            if (solution := rough(session, problem, start)) is not None:
                begin = Start(planned, problem, solution.iterate, InitialBarrier.COARSER_MESH)
                starts.append((float(np.sum(solution.iterate.durations)), begin))
        starts.sort(key=lambda one: one[0])
        results = [solve_from_starts(session, [lambda begin=begin: begin], solve_certified) for _, begin in starts[:refine]]
    return min((one.trajectory.race_time for one in results if one.certified), default=math.inf)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="+", metavar="COURSE")
    parser.add_argument("--count", type=int, default=60, help="random starts")
    parser.add_argument("--refine", type=int, default=10, help="of the best of them")
    parser.add_argument("--threads", type=int, default=2)
    chosen = parser.parse_args()
    print("| course | random starts | off | quick | thorough | gap, % | bound | seconds of the thorough search |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|")
    for course in chosen.courses:
        best = best_of(course, chosen.count, chosen.refine, chosen.threads)
        options = {"until": "point-mass", "guess": "plan", "threads": chosen.threads}
        times: list[float] = []
        for effort in ("off", "quick"):
            times.append(airrace.optimize(course, search=effort, **options).race_time)
        thorough = airrace.optimize(course, search="thorough", **options).stage("point-mass").result
        bound = thorough.search.bound
        times.append(thorough.trajectory.race_time)
        cells = [f"{value:.3f}" for value in (best, *times)]
        if bound is not None:
            least = (1.0 - bound.gap) * thorough.trajectory.race_time  # the bound's own mesh makes all flights slower
            cells += [f"{100 * bound.gap:.2f}", f"{least:.3f}", f"{thorough.search.seconds:.1f}"]
        print("| " + " | ".join([Path(course).stem, *cells]) + " |", flush=True)


if __name__ == "__main__":
    main()
