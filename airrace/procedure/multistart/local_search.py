"""The search around a flight that was started from another run, for a route that has become faster."""

from dataclasses import replace
from functools import partial

import numpy as np

from airrace.dynamics.outer_loop import LoadFactors, load_factors
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.refinement import resample
from airrace.optimal_control.solvers.process.pool import SolverPool
from airrace.planning.decisions_from_solution import plan_from_solution
from airrace.points import at_points
from airrace.procedure.multistart.coarse_solution import CoarseSolution, InitialGuess, intervals, solve_coarse
from airrace.procedure.multistart.multistart import solve_finer
from airrace.procedure.multistart.search import LOCAL, SAVED_MIN, Search
from airrace.procedure.multistart.segments import describe_segments, differing, segments_of
from airrace.procedure.result import StageResult
from airrace.procedure.settings import MeshSettings
from airrace.procedure.stage_problem import StageProblem, mesh_of
from airrace.procedure.start import InitialBarrier
from airrace.records import record
from airrace.track.course import Course
from airrace.trajectory import Array


@record
class RoutesAround:
    """What was found around a flight, solved roughly by the point mass.

    Attributes:
        best: the fastest flight found; the flight itself where nothing near it is faster.
        phases: the numbers of the phases that it takes on another route.
        text: which route that is and what it saves, in words; empty where it is the same.
    """

    best: CoarseSolution
    phases: frozenset[int] = frozenset()
    text: str = ""


def search_around(
    point_mass: StageProblem,
    source: StageProblem,
    optimum: StageResult,
    course: Course,
    mesh: MeshSettings,
    pool: SolverPool,
) -> RoutesAround | None:
    """Return the fastest flight that moves lead to from an optimum; None if the point mass cannot fly as it does.

    Args:
        point_mass: the point mass on the same course.
        source: the model that flew the optimum, planned as it goes round.
        optimum: the flight, of a race whose numbers may have been a little different.
        course: the course.
        mesh: the settings of meshes.
        pool: what solves.
    """
    flight = replace(point_mass, plan=plan_from_solution(course, point_mass.plan.cruise, optimum.trajectory))
    counts = [intervals(seconds) for seconds in optimum.trajectory.durations.tolist()]
    coarse, iterate = resample(mesh_of(optimum.trajectory), _as_point_mass(flight, source, optimum), counts)
    (base,) = pool.work([InitialGuess(flight, coarse, iterate, InitialBarrier.OTHER_STAGE)], solve_coarse)
    if base is None:
        return None
    search = Search(point_mass, course, LOCAL, pool, lambda _: None)
    best = search.improve(base)
    base, *others = pool.work([base] if best is base else [base, best], partial(solve_finer, mesh=mesh))
    best = search.improve_rolls(*others or [base])
    segments = differing(base, best, segments_of(course))
    saved = base.race_time - best.race_time
    if not segments or saved <= SAVED_MIN:
        return RoutesAround(best)
    phases = frozenset(phase for one in segments for phase in range(one.first, one.last))
    return RoutesAround(best, phases, f"{describe_segments(course, best, segments)}, saves about {saved:.2f} s")


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
