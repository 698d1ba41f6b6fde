"""The joint optimum of a stage on a single mesh: with all that a certificate measures but the second mesh, or rough.

The loop is that of `mesh_loop.py`; what decides on the next mesh stands here.
"""

import math
from dataclasses import replace

import numpy as np

from airrace.optimal_control.mesh_proposals import (
    MeshProposal,
    bisect_all,
    refine_flagged,
    refine_predicted,
)
from airrace.procedure.mesh_loop import Failure, MeshGoal, MeshTask, SolvedMesh, adapt_joining, refine
from airrace.procedure.result import StageResult
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.warm_start import InitialBarrier, Start

BISECT_ALL_ABOVE = 1 / 3
"""Share of the point mass's intervals to be cut from which on all are halved. If one interval still misses a limit,
another solve is needed: on Rovinj that was so in three stages of three when only those were cut that seemed to need it,
43 to 82 % of them, and in none when all were halved."""


def solve_single_mesh(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly, measure, and solve again on better meshes until one is good; no other is compared with it.

    Its first meshes only show where the good one has its nodes, so they
    are solved roughly, unless the start is an optimum on a good mesh; on that the optimum is solved as closely as any
    that is certified.
    """
    goal = MeshGoal.SINGLE if start.barrier.near_optimum else _goal(session, 0)
    return refine(session, start, _first_task(start, solver, goal), next_until_good)


def solve_roughly(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly on one mesh, as closely as the next stage needs that starts from it.

    Where that optimum is made of the integrator's errors, or does not keep what is asked of a rough one, others follow
    as in `solve_single_mesh`. A wing too near to a pylon is left to the next stage, whose attitudes differ anyway.
    """
    return refine(session, start, _first_task(start, solver, MeshGoal.ROUGH), next_until_usable)


def _first_task(start: Start, solver: str, goal: MeshGoal) -> MeshTask:
    return MeshTask(
        start.stage_problem,
        MeshProposal.first(start.problem, start.guess),
        start.barrier,
        (solver,),
        start.multipliers,
        goal=goal,
    )


def next_until_usable(solved: SolvedMesh) -> MeshTask | None:
    """Return the next mesh; None if the next stage can start from the present optimum."""
    if solved.task.goal is MeshGoal.ROUGH and solved.certificate.holds:
        return None
    return next_until_good(solved)


def _goal(session: SolverSession, number: int) -> MeshGoal:
    """Return the goal of a mesh after which another one is expected: rough, unless it is the last that is allowed."""
    return MeshGoal.ROUGH if number < session.settings.mesh.refinements_max else MeshGoal.SINGLE


def next_until_good(solved: SolvedMesh) -> MeshTask | None:
    """Return the next mesh; None if the present one is good and its optimum is not a rough one."""
    optimum, task, session = solved.optimum, solved.task, solved.session
    is_rough = task.goal is MeshGoal.ROUGH
    better = adapt_joining(solved) if is_rough else None
    good = better or _good_mesh(solved)
    same_mesh = not good and solved.violates_clearance()
    if not (is_rough or good or same_mesh):
        return None
    # Where the mesh was good already, it is solved on closely.
    proposal = good or replace(task.proposal, guess=optimum.iterate)
    stage_problem, proposal = solved.place_clearance_constraints(proposal)
    return replace(
        task,
        stage_problem=stage_problem,
        proposal=proposal,
        barrier=InitialBarrier.COARSER_MESH if better and not solved.violates_clearance() else solved.barrier,
        solvers=session.solvers,
        multipliers=solved.carry(proposal, stage_problem),
        number=task.number + (not same_mesh),
        clearance_rounds=task.clearance_rounds + same_mesh,
        nodes_beside_passings=solved.nodes_beside_passings,
        violating_optimum=solved if same_mesh else None,
        before=optimum,
        goal=_goal(session, task.number + 1) if better else MeshGoal.SINGLE,
    )


def _good_mesh(solved: SolvedMesh) -> MeshProposal | None:
    """Return the good mesh, as far as can be predicted from an optimum on another one; None if that is good itself.

    Where the model bounds its intervals, what misses a limit is the integrator's error in some of them, which can be
    predicted.
    """
    optimum, limits = solved.optimum, solved.session.settings.certificate
    if not optimum.proposal.coarser.all():
        return refine_flagged(optimum, limits)
    if not math.isinf(solved.stage_problem.longest_interval):
        return refine_predicted(optimum, limits)
    proposal = refine_flagged(optimum, limits)
    if proposal is None:
        return None
    cut = np.diff(np.flatnonzero(proposal.coarser)) > 1
    return bisect_all(optimum, limits) if cut.mean() > BISECT_ALL_ABOVE else proposal
