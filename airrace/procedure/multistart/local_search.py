"""The search around a flight that was started from another run, for a route that has become faster."""

from dataclasses import replace

import numpy as np

from airrace.dynamics.outer_loop import LoadFactors, load_factors
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.refinement import resample
from airrace.planning.decisions_from_solution import plan_as_flown
from airrace.points import at_points
from airrace.procedure.multistart.budget import QUICK, scaled
from airrace.procedure.multistart.coarse_solution import InitialGuess, intervals, solve_coarse
from airrace.procedure.multistart.description import named, shape_in_words
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.search import EvaluatedWindow
from airrace.procedure.multistart.segments import shape
from airrace.procedure.multistart.solver_pool import SolverPool
from airrace.procedure.multistart.window import priced
from airrace.procedure.result import StageResult
from airrace.procedure.stage_problem import Flight, mesh_of
from airrace.procedure.start import InitialBarrier
from airrace.track.course import Course
from airrace.trajectory import Array

WORTH = 0.02
"""The time that another way through a window has to save, flown by the point mass, before all is flown again, s.

Windows whose ends are held save up to 0.01 s where nothing but the mesh differs.
"""
MAX_PLAN_PENALTY = 1.0
"""The largest extra time of a way's plan with which it is tried, s.

Ways whose plan takes even longer were never the faster ones after a change of a few per cent.
"""


def find_faster_route(
    point_mass: Flight, source: Flight, optimum: StageResult, course: Course, pool: SolverPool
) -> str:
    """Return another way through a stretch of an optimum that the point mass flies faster, in words.

    It is empty if none is found.

    Args:
        point_mass: the point mass on the same course.
        source: the model that flew the optimum, planned as it goes round.
        optimum: the flight, of a race whose numbers may have been a little different.
        course: the course.
        pool: what solves.
    """
    way = plan_as_flown(course, point_mass.plan.cruise, optimum.trajectory)
    (base,) = pool.work([_initial_guess(replace(point_mass, plan=way), source, optimum)], solve_coarse)
    if base is None:
        return ""
    move_generator = MoveGenerator(base, course, scaled(point_mass.plan.cruise, QUICK.thinking), MAX_PLAN_PENALTY)
    phases = set(range(len(base.problem.phases)))
    # What wins at a place in one lap wins there in the others, too, as far as they are flown alike.
    moves = list(move_generator.moves(phases, shapes=False, places=move_generator.places()))
    found = pool.work([one.window for one in moves], lambda service, one: priced(service, one, InitialBarrier.PIECES))
    wins = [
        EvaluatedWindow(move, win)
        for move, win in zip(moves, found, strict=True)
        if win is not None and win.saved > WORTH
    ]
    if not wins:
        return ""
    best = max(wins, key=lambda one: one.found.saved)
    ((inside, stretch),) = best.found.inside([best.move.stretch])
    way = shape_in_words(shape(best.found.shown, inside))
    return f"{named(course, stretch)} {way} saves about {best.found.saved:.2f} s"


def _initial_guess(point_mass: Flight, source: Flight, optimum: StageResult) -> InitialGuess:
    """Return an optimum of any fidelity as a flight of the point mass, on a rough mesh."""
    flown = optimum.trajectory
    mesh, iterate = mesh_of(flown), _as_point_mass(point_mass, source, optimum)
    counts = [intervals(seconds) for seconds in flown.durations.tolist()]
    mesh, iterate = resample(mesh, iterate, counts)
    return InitialGuess(point_mass, mesh, iterate, InitialBarrier.OTHER_STAGE)


def _as_point_mass(point_mass: Flight, source: Flight, optimum: StageResult) -> Iterate:
    """Return the states and controls of the point mass that flies as an optimum does."""
    flown, system = optimum.trajectory, source.model.system
    held = np.hstack([flown.control, flown.control[:, -1:]])
    seen = at_points(load_factors(system), flown.state, held, source.model.parameter_values)
    load = LoadFactors[Array].split(seen)
    known = {one.name: row for one, row in zip(flown.states, flown.state, strict=True)}
    known |= {"n_y": load.n_y, "n_z": load.n_z, "p_Kbar": load.p_Kbar}
    moved = {one.name: row for one, row in zip(flown.controls, flown.control, strict=True)}
    own = point_mass.model.system
    state = np.array([known[one.name] for one in own.states], dtype=np.float64)
    steps = np.diff(flown.time)
    rates = {one.name: np.diff(row) / steps for one, row in zip(own.states, state, strict=True)}
    moved |= {one.name: rates[one.rate_of] for one in own.controls if one.rate_of}
    control = np.array([np.clip(moved[one.name], one.lower, one.upper) for one in own.controls], dtype=np.float64)
    return Iterate(flown.durations, state, control)
