"""The joint optimum of a stage below the last, on one good mesh: all that a certificate measures but the second mesh.

Such a stage is where the next one starts from. Its first meshes only tell where the good one has its nodes, so they are
solved roughly. On the good one the optimum is solved as closely as any that is certified.
"""

import math
from dataclasses import replace

import numpy as np

from airrace.procedure.certification import examine
from airrace.procedure.refinement import (
    MeshProposal,
    MeshSolution,
    adapted,
    bisect_all,
    refine_flagged,
    refine_predicted,
)
from airrace.procedure.result import StageResult
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.solve_and_refine import (
    ADAPTATIONS_MAX,
    CARRIED_BARRIER,
    REFINED_BARRIER,
    Failure,
    Start,
    announced,
    carried_over,
    certificate_of,
    finished,
)
from airrace.procedure.solver_session import SolverSession

ROUGH = 1e-4
"""The solver's tolerance on a mesh that is only a step to the good one. On Rovinj such a solve takes 23 to 31
iterations instead of 29 to 38."""

MANY = 1 / 3
"""The share of the intervals of the point mass that are to be cut from which on all are halved (1).

If one interval still misses a limit, another solve is needed: on Rovinj that was so in three stages of three when only
those were cut that seemed to need it, 43 to 82 % of them, and in none when all were halved.
"""


def solve_single_mesh(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly, measure, and solve again on better meshes until one is good; no other is compared with it."""
    limits, total = session.settings.certificate, session.settings.mesh.refinements_max
    flight, draft = start.flight, MeshProposal.first(start.problem, start.guess)
    barrier, solvers, rough, multipliers = start.barrier, (solver,), ROUGH, start.multipliers
    for refinement in range(total + 1):
        problem = flight.problem(draft.mesh)
        purpose = announced(session, problem, refinement)
        rough = rough if refinement < total else 0.0
        solution = session.solve(
            problem, draft.guess, purpose, barrier=barrier, solvers=solvers, rough=rough, multipliers=multipliers
        )
        if solution is None or not solution.success:
            return Failure(start, solution)
        evidence = examine(problem, solution.iterate, solution.multipliers.constraints, limits)
        optimum = MeshSolution(problem, solution.iterate, draft, evidence)
        better = _adapted(optimum, limits, refinement, flight.longest_interval) if rough else None
        good = better or _good(optimum, limits, flight.longest_interval)
        if refinement == total or not (rough or good):
            return finished(start, session, optimum, solution, certificate_of(optimum, solution, None, limits))
        rough = ROUGH if better else 0.0
        draft = good or replace(draft, guess=solution.iterate)  # the mesh was good already: solve closely on it
        barrier, solvers = REFINED_BARRIER if rough else CARRIED_BARRIER, session.solvers
        multipliers = carried_over(solution.multipliers, problem, flight.problem(draft.mesh))
    raise AssertionError("the last refinement returns")


def _good(optimum: MeshSolution, limits: CertificateLimits, longest: float) -> MeshProposal | None:
    """Return the good mesh, as far as can be foreseen from an optimum on another one; None if that is good itself.

    Where the model bounds its intervals (`longest`, s), what misses a limit is the integrator's error in some of them,
    and that can be foreseen.
    """
    if not optimum.draft.coarser.all():
        return refine_flagged(optimum, limits)
    if not math.isinf(longest):
        return refine_predicted(optimum, limits)
    draft = refine_flagged(optimum, limits)
    if draft is None:
        return None
    cut = np.diff(np.flatnonzero(draft.coarser)) > 1
    return bisect_all(optimum, limits) if cut.mean() > MANY else draft


def _adapted(optimum: MeshSolution, limits: CertificateLimits, refinement: int, longest: float) -> MeshProposal | None:
    """Return a better first mesh; None if the one there is will do, with what is wrong on it mended.

    Where intervals may not be joined, nothing but an optimum that is made of errors is worth another first mesh.
    """
    early = refinement < ADAPTATIONS_MAX and math.isinf(longest)
    return adapted(optimum, limits, early=early, joining=early)
