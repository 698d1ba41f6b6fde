"""The proof of a stage that was solved on one mesh, completed later.

What a mesh does to a race time is told by a second one. Behind the mesh that a stage was solved on lies the coarser one
from which it was cut. The stored flight is solved on that, and on its own mesh with all intervals halved that both have
in common, so that the proof is the same as that of a stage which is proved at once.
"""

from dataclasses import replace

from airrace.optimal_control.refinement import restrict
from airrace.optimal_control.solvers.solver import Multipliers
from airrace.procedure.certification import examine
from airrace.procedure.models import iterate_of
from airrace.procedure.refinement import MeshProposal, MeshSolution, bisect_all, doubled
from airrace.procedure.result import StageResult
from airrace.procedure.solve_and_refine import (
    CARRIED_BARRIER,
    CoarseReference,
    Failure,
    RefinementState,
    Start,
    carried_over,
    refined_from,
)
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight, mesh_of
from airrace.procedure.warm_start import coarser_nodes


def proved(flight: Flight, optimum: StageResult, session: SolverSession) -> StageResult | str:
    """Return a stage that was solved on one mesh, certified; or a clause that says why it could not be.

    Args:
        flight: the model of the stage, planned as the optimum goes round.
        optimum: the stage as it was solved.
        session: what solves. Its attempts are added to those of the stage.
    """
    limits = session.settings.certificate
    mesh, iterate, kept = mesh_of(optimum.trajectory), iterate_of(optimum.trajectory), coarser_nodes(optimum)
    problem = flight.problem(mesh)
    known = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
    evidence = examine(problem, iterate, optimum.constraint_multipliers, limits)
    good = MeshSolution(problem, iterate, MeshProposal(mesh, iterate, optimum.mesh.why, kept), evidence)
    if kept.all():
        draft, compared = bisect_all(good, limits), CoarseReference.measured(good)
    else:
        coarser = _coarser(flight, good, known, session)
        if coarser is None:
            return "no optimum was found on the coarser mesh"
        draft, compared = doubled(good.draft, evidence.flown), CoarseReference.measured(coarser)
    most = min(1, session.settings.mesh.refinements_max)
    multipliers = carried_over(known, problem, flight.problem(draft.mesh))
    upcoming = RefinementState(draft, compared, most, CARRIED_BARRIER, session.solvers, multipliers)
    found = refined_from(session, Start(flight, problem, iterate, CARRIED_BARRIER, optimum.provenance), upcoming)
    if isinstance(found, Failure):
        return "no optimum was found on the finer mesh"
    return replace(found, search=optimum.search) if found.certified else found.message


def _coarser(flight: Flight, good: MeshSolution, known: Multipliers, session: SolverSession) -> MeshSolution | None:
    """Return the optimum on the coarser mesh behind that of another one; None if there is none."""
    limits = session.settings.certificate
    mesh, guess = restrict(good.problem.mesh, good.iterate, good.draft.coarser)
    problem = flight.problem(mesh)
    multipliers = carried_over(known, good.problem, problem)
    session.progress.activity(f"the coarser mesh, {problem.intervals} intervals", 0, 0)
    purpose = "the coarser mesh"
    solution = session.solve(problem, guess, purpose, barrier=CARRIED_BARRIER, passing=True, multipliers=multipliers)
    if solution is None or not solution.success:
        return None
    evidence = examine(problem, solution.iterate, solution.multipliers.constraints, limits)
    return MeshSolution(problem, solution.iterate, MeshProposal.first(problem, solution.iterate), evidence)
