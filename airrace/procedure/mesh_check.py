"""The mesh check: the second mesh of a stage that was solved on a single one, and its certificate."""

from dataclasses import replace
from functools import partial

from airrace.optimal_control.mesh_refinement import restrict
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.procedure.certification import examine
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.refinement import MeshProposal, MeshSolution, bisect_all, bisect_coarse
from airrace.procedure.result import StageResult
from airrace.procedure.solve_and_refine import (
    Failure,
    RefinementState,
    carry_multipliers,
    certified_state,
    refine_from,
)
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import StageProblem, mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start


def check_mesh_convergence(flight: StageProblem, optimum: StageResult, session: SolverSession) -> StageResult | str:
    """Return a stage that was solved on one mesh, certified; or a clause that says why it could not be.

    It is solved on the coarser mesh from which its own was divided, and on its own with all intervals halved that both
    have in common, so that the check is the same as that of a stage which is certified at once. One that was solved
    roughly is solved closely, on its own mesh first.

    Args:
        flight: the model of the stage, planned as the optimum goes round.
        optimum: the stage as it was solved.
        session: what solves. Its attempts are added to those of the stage.
    """
    limits, nodes = session.settings.certificate, optimum.coarser_nodes
    mesh, iterate = mesh_of(optimum.trajectory), iterate_of(optimum.trajectory)
    problem = flight.problem(mesh)
    known = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
    measure = partial(examine, problem, iterate, optimum.constraint_multipliers, limits)
    good = MeshSolution(problem, iterate, MeshProposal(mesh, iterate, optimum.mesh.why, nodes), measure)

    def finer(draft: MeshProposal, coarser: MeshSolution) -> RefinementState:
        return certified_state(
            session,
            flight,
            draft,
            InitialBarrier.OTHER_MESH,
            session.solvers,
            carry_multipliers(known, problem, flight.problem(draft.mesh)),
            number=min(1, session.settings.mesh.refinements_max),
            before=coarser,
            coarser=coarser,
        )

    if optimum.is_rough:
        draft = MeshProposal.first(problem, iterate)
        first = certified_state(session, flight, draft, InitialBarrier.OTHER_MESH, session.solvers, known)
    elif nodes.all():
        first = finer(bisect_all(good, limits), good)
    else:
        coarse, guess = restrict(mesh, iterate, nodes)
        there = flight.problem(coarse)
        first = RefinementState(
            flight,
            MeshProposal.first(there, guess),
            InitialBarrier.OTHER_MESH,
            session.solvers,
            lambda refined: finer(bisect_coarse(good.draft, good.evidence.replay), refined.solved[0]),
            carry_multipliers(known, problem, there),
            number=-1,
            passing=True,
            purpose="the coarser mesh",
        )
    start = Start(flight, problem, iterate, InitialBarrier.OTHER_MESH, optimum.provenance)
    found = refine_from(session, start, first)
    if isinstance(found, Failure):
        return f"no optimum was found on the {'coarser' if found.coarser is None else 'finer'} mesh"
    return replace(found, search=optimum.search) if found.certified else found.message
