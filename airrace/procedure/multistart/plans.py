"""Plans that flights on other routes start from: ties decided either way, several radii of turns, more room."""

from dataclasses import replace

import numpy as np

from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.multistart.coarse_solution import InitialGuess, planned_guess
from airrace.procedure.multistart.search import SearchBudget, planned_starts
from airrace.procedure.planning.plan import plan, plan_from_solution, plan_with_room
from airrace.procedure.planning.route_decisions import MIRRORED_TIES
from airrace.procedure.result import StageResult
from airrace.procedure.settings import MeshSettings
from airrace.procedure.stage_problem import StageProblem, mesh_of
from airrace.procedure.warm_start import InitialBarrier


def plans_to_search(stage_problem: StageProblem, settings: MeshSettings, budget: SearchBudget) -> list[InitialGuess]:
    """Return the plan that a run without a search starts from, with ties decided either way, and the budget's."""
    course, starts = stage_problem.course, list[InitialGuess]()
    for route in (stage_problem.plan, plan(course, stage_problem.plan.cruise, MIRRORED_TIES)):
        mesh = first_mesh(route, settings)
        start = InitialGuess(
            replace(stage_problem, plan=route), mesh, guess(route, mesh), InitialBarrier.COLD, is_baseline=True
        )
        if not starts or not np.array_equal(starts[-1].guess.state, start.guess.state):
            starts.append(start)
    return [*starts, *planned_starts(stage_problem, course, budget)]


def own_plans(stage_problem: StageProblem) -> list[InitialGuess]:
    """Return the race's own plan and, if it is another, the one that decides ties the other way; on a coarse mesh."""
    routes = [stage_problem.plan, plan(stage_problem.course, stage_problem.plan.cruise, MIRRORED_TIES)]
    own, mirrored = (planned_guess(stage_problem, route, InitialBarrier.COLD) for route in routes)
    return [own] if np.array_equal(own.guess.state, mirrored.guess.state) else [own, mirrored]


def guess_of_optimum(stage_problem: StageProblem, optimum: StageResult) -> InitialGuess:
    """Return the point mass's optimum as a start of a search."""
    trajectory = optimum.trajectory
    route = plan_from_solution(stage_problem.course, stage_problem.plan.cruise, trajectory)
    barrier = InitialBarrier.OTHER_PROBLEM
    return InitialGuess(replace(stage_problem, plan=route), mesh_of(trajectory), iterate_of(trajectory), barrier)


def plans_with_room(stage_problem: StageProblem, budget: SearchBudget) -> list[InitialGuess]:
    """Return plans with room of the race's own radius and those of the budget."""
    course, starts = stage_problem.course, list[InitialGuess]()
    own = stage_problem.plan.cruise
    for pace in (own, *(radius.scale(own) for radius in budget.radii)):
        replanned = plan_with_room(course, plan(course, pace))
        if replanned is not None:
            start = planned_guess(stage_problem, replanned, InitialBarrier.COLD)
            starts.append(replace(start, is_baseline=pace is own))  # a run without a search starts from it, too
    return starts


def replanned_with_room(stage_problem: StageProblem) -> StageProblem | None:
    """Return the point mass along a plan with room; None where its own plan has it.

    A flight rises over a line that its plan crosses: where a ceiling forbids that, it has to turn the other way.
    Where it would rise too steeply, a solve from a longer way finds how to; likewise where it would pass gates too
    aslant for its wing.
    """
    replanned = plan_with_room(stage_problem.course, stage_problem.plan)
    return None if replanned is None else replace(stage_problem, plan=replanned)
