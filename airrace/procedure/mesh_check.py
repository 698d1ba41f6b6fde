"""The mesh check: the second mesh of a stage that was solved on a single one, and its certificate."""

from dataclasses import replace
from functools import partial

from airrace.optimal_control.mesh_proposals import MeshProposal, MeshSolution, bisect_all, bisect_coarse
from airrace.optimal_control.mesh_refinement import restrict
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.procedure.certification import examine
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.mesh_loop import (
    Failure,
    MeshGoal,
    MeshTask,
    carry_multipliers,
    next_until_certified,
    refine,
    solve_on_mesh,
    task_to_certify,
)
from airrace.procedure.result import Note, NoteKind, StageResult
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_models import StageModels
from airrace.procedure.stage_problem import StageProblem, mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start


def solve_on_second_mesh(
    stage_problem: StageProblem, optimum: StageResult, session: SolverSession
) -> StageResult | str:
    """Return a stage that was solved on one mesh, certified; or a clause that says why it could not be.

    It is solved on the coarser mesh from which its own was divided, and on its own with all intervals halved that both
    have in common, so that the check is the same as that of a stage which is certified at once. One that was solved
    roughly is solved closely, on its own mesh first.

    Args:
        stage_problem: the model of the stage, planned as the optimum goes round.
        optimum: the stage as it was solved.
        session: what solves. Its attempts are added to those of the stage.
    """
    limits, nodes = session.settings.certificate, optimum.coarser_nodes
    mesh, iterate = mesh_of(optimum.trajectory), iterate_of(optimum.trajectory)
    problem = stage_problem.problem(mesh)
    multipliers = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
    measure = partial(examine, problem, iterate, optimum.constraint_multipliers, limits)
    proposal = MeshProposal(mesh, iterate, optimum.mesh.why, nodes)
    good = MeshSolution(problem, iterate, proposal, float(iterate.durations.sum()), measure)
    start = Start(stage_problem, problem, iterate, InitialBarrier.OTHER_MESH, optimum.provenance)

    first_intervals, coarser = None, None
    if optimum.is_rough:
        proposal = MeshProposal.first(problem, iterate)
    elif nodes.all():
        proposal, coarser = bisect_all(good, limits), good
    else:
        coarse_mesh, guess = restrict(mesh, iterate, nodes)
        coarse_problem = stage_problem.problem(coarse_mesh)
        reference = MeshTask(
            stage_problem,
            MeshProposal.first(coarse_problem, guess),
            InitialBarrier.OTHER_MESH,
            session.solvers,
            carry_multipliers(multipliers, problem, coarse_problem),
            number=-1,
            goal=MeshGoal.REFERENCE,
            purpose="the coarser mesh",
        )
        coarse = solve_on_mesh(session, start, reference)
        if isinstance(coarse, Failure):
            return "no optimum was found on the coarser mesh"
        first_intervals = coarse_problem.intervals
        proposal, coarser = bisect_coarse(good.proposal, good.evidence.replay), coarse.optimum
    if coarser is not None:
        multipliers = carry_multipliers(multipliers, problem, stage_problem.problem(proposal.mesh))
    first = task_to_certify(
        session,
        stage_problem,
        proposal,
        InitialBarrier.OTHER_MESH,
        session.solvers,
        multipliers,
        number=0 if coarser is None else min(1, session.settings.mesh.refinements_max),
        before=coarser,
        coarser=coarser,
    )
    result = refine(session, start, first, next_until_certified, first_intervals=first_intervals)
    if isinstance(result, Failure):
        return f"no optimum was found on the {'coarser' if result.coarser is None else 'finer'} mesh"
    return replace(result, search=optimum.search) if result.certified else result.message


def check_mesh(models: StageModels, optimum: StageResult, session: SolverSession) -> StageResult:
    """Return an optimum with its mesh checked; the optimum itself where there is nothing to check or that fails."""
    if optimum.certified or not optimum.holds:
        return optimum
    checked = solve_on_second_mesh(models.problem_along(optimum.stage, optimum), optimum, session)
    notes = tuple(note for note in optimum.notes if note.kind is not NoteKind.MESH_CHECK)
    if isinstance(checked, StageResult):
        return replace(checked, notes=notes)
    failure = Note(NoteKind.MESH_CHECK, f"its race time could not be confirmed on a second mesh: {checked}")
    return replace(optimum, notes=(*notes, failure))
