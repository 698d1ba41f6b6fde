"""The search around a flight that was started from another run, for a route that has become faster."""

from dataclasses import replace

import numpy as np

from airrace.dynamics.outer_loop import LoadFactors, load_factors
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.refinement import resample
from airrace.optimal_control.solvers.process.pool import SolverPool
from airrace.planning.decisions_from_solution import plan_from_solution
from airrace.points import at_points
from airrace.procedure.multistart.coarse_solution import InitialGuess, intervals, solve_coarse
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.search import QUICK
from airrace.procedure.multistart.segments import segment_name, shape_of
from airrace.procedure.multistart.window import evaluate
from airrace.procedure.result import StageResult
from airrace.procedure.stage_problem import StageProblem, mesh_of
from airrace.procedure.start import InitialBarrier
from airrace.track.course import Course
from airrace.trajectory import Array

SAVED_MIN = 0.02
"""The time that a move has to save in its window, solved by the point mass, before all is solved again, s.

Windows whose ends are fixed save up to 0.01 s where nothing but the mesh differs.
"""
PLAN_PENALTY_MAX = 1.0
"""The largest extra time of a move's plan with which it is tried, s.

Routes whose plan takes even longer were never the faster ones after a change of a few per cent.
"""


def find_faster_route(
    point_mass: StageProblem, source: StageProblem, optimum: StageResult, course: Course, pool: SolverPool
) -> str:
    """Return another route through a segment of an optimum that the point mass flies faster, in words.

    It is empty if none is found.

    Args:
        point_mass: the point mass on the same course.
        source: the model that flew the optimum, planned as it goes round.
        optimum: the flight, of a race whose numbers may have been a little different.
        course: the course.
        pool: what solves.
    """
    pace = point_mass.plan.cruise
    flight = replace(point_mass, plan=plan_from_solution(course, pace, optimum.trajectory))
    counts = [intervals(seconds) for seconds in optimum.trajectory.durations.tolist()]
    mesh, iterate = resample(mesh_of(optimum.trajectory), _as_point_mass(flight, source, optimum), counts)
    (base,) = pool.work([InitialGuess(flight, mesh, iterate, InitialBarrier.OTHER_STAGE)], solve_coarse)
    if base is None:
        return ""
    generator = MoveGenerator(base, course, QUICK.planning_radius.scale(pace), PLAN_PENALTY_MAX)
    phases = set(range(len(base.problem.phases)))
    # What is faster at a place in one lap is so in the others, too, as far as their routes are the same.
    moves = list(generator.moves(phases, shapes=False, segments=generator.distinct_segments()))
    found = pool.work(moves, lambda service, move: evaluate(service, move, InitialBarrier.PIECES))
    best = max((one for one in found if one is not None), key=lambda one: one.saved, default=None)
    if best is None or best.saved <= SAVED_MIN:
        return ""
    ((inside, segment),) = best.inside([best.move.segment])
    route = shape_of(best.as_solution, inside).describe()
    return f"{segment_name(course, segment)} {route} saves about {best.saved:.2f} s"


def _as_point_mass(point_mass: StageProblem, source: StageProblem, optimum: StageResult) -> Iterate:
    """Return the states and controls of the point mass that flies as an optimum does."""
    trajectory, system = optimum.trajectory, source.model.system
    control = np.hstack([trajectory.control, trajectory.control[:, -1:]])
    load = LoadFactors[Array].split(
        at_points(load_factors(system), trajectory.state, control, source.model.parameter_values)
    )
    known = {one.name: row for one, row in zip(trajectory.states, trajectory.state, strict=True)}
    known |= {"n_y": load.n_y, "n_z": load.n_z, "p_Kbar": load.p_Kbar}
    controls = {one.name: row for one, row in zip(trajectory.controls, trajectory.control, strict=True)}
    own = point_mass.model.system
    state = np.array([known[one.name] for one in own.states], dtype=np.float64)
    steps = np.diff(trajectory.time)
    rates = {one.name: np.diff(row) / steps for one, row in zip(own.states, state, strict=True)}
    controls |= {one.name: rates[one.rate_of] for one in own.controls if one.rate_of}
    rows = [np.clip(controls[one.name], one.lower, one.upper) for one in own.controls]
    return Iterate(trajectory.durations, state, np.array(rows, dtype=np.float64))
