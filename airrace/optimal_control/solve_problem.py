"""The solution of a problem: on its own mesh, on a second one, or on as many as its certificate needs.

The meshes follow one another as those of a race do, see `mesh_proposals.py`, but nodes are never dropped: what is a
calm stretch of a problem nobody knows beforehand is for its author to say.
"""

from dataclasses import replace
from functools import partial

from airrace.optimal_control.certificate import OBJECTIVE_CHANGE
from airrace.optimal_control.first_guess import initial_guess
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_proposals import (
    ADAPTATIONS_MAX,
    COARSEN_WORTHWHILE,
    GROWTH_FROM,
    GROWTH_MAX,
    MeshProposal,
    MeshSolution,
    adapt,
    bisect_all,
    refine_changed,
    refine_flagged,
)
from airrace.optimal_control.mesh_refinement import Mesh, transfer_multipliers
from airrace.optimal_control.own_certificate import Accuracy, certify_own, examine_own
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.program_call import solve_program
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solution import Solution
from airrace.optimal_control.solvers import INTERIOR_POINT
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.service import STALL_SECONDS
from airrace.optimal_control.solvers.solver import SOLVERS, ProgramSolution

TOLERANCE_OF_CHANGE = 1e-3
"""The solver's tolerance as a share of the change between meshes that is allowed. What an interior point is away from
the bounds adds up over the intervals: with 1e-7 the height of Goddard's rocket falls by 4e-5 on 3,200 intervals."""
BARRIER_OF_OTHER_MESH = 1e-5
"""The first value of the barrier parameter of a solve from an optimum on another mesh, as of a race."""


def solve(
    problem: Problem,
    guess: Iterate | None = None,
    *,
    refine: bool = False,
    second_mesh: bool = False,
    accuracy: Accuracy | None = None,
    refinements_max: int = 10,
    scheme: RungeKutta | None = None,
    solver: str = INTERIOR_POINT,
    tolerance: float | None = None,
    iterations_max: int | None = None,
    options: SolverOptions | None = None,
    stall_seconds: float = STALL_SECONDS,
) -> Solution:
    """Solve a problem.

    Args:
        problem: what is to be optimised.
        guess: where the solver begins, in SI; by default `initial_guess(problem)`.
        refine: whether the mesh is refined, and the problem solved again, until the certificate holds.
        second_mesh: whether the problem is solved once more with all intervals halved, so that the certificate tells
            what that does to the objective; `refine` implies it.
        accuracy: what the certificate allows; by default `Accuracy()`.
        refinements_max: the largest number of meshes after the first.
        scheme: integrates an interval; by default the problem's own.
        solver: `"interior-point"` or `"ipopt"`.
        tolerance: on the scaled conditions of optimality; by default what the accuracy of a second mesh asks for.
        iterations_max: of one solve.
        options: of the solver in full; the two before it go over them.
        stall_seconds: longest wait for the next iteration, s.

    Returns:
        The last optimum that was found, or what the solver says where it found none on the first mesh: a solve that
        fails is a value, too. `Solution.verdict` says in a sentence what it is.

    Raises:
        ValueError: the problem does not say what it seems to say, see `require_valid`, the guess has other shapes, or
            there is no such solver.
        SolverCrash: the solver process died, or could not work on the problem.
    """
    if solver not in SOLVERS:
        raise ValueError(f"there is no solver {solver!r}; there are {', '.join(SOLVERS)}")
    if scheme is not None:
        problem = replace(problem, scheme=scheme)
    options, accuracy = options or SolverOptions(), accuracy or Accuracy()
    if tolerance is not None:
        options = replace(options, tolerance=tolerance)
    elif refine or second_mesh:
        options = replace(options, tolerance=min(options.tolerance, TOLERANCE_OF_CHANGE * accuracy.change))
    if iterations_max is not None:
        options = replace(options, iterations_max=iterations_max)
    call = partial(solve_program, solver=solver, stall_seconds=stall_seconds)
    guess = initial_guess(problem) if guess is None else guess
    proposal = MeshProposal.first(problem, guess)
    program = call(problem, guess, options=options)
    if not program.success:
        return Solution.of_program(problem, program)
    solution, optimum = _measure(problem, program, proposal, accuracy)
    options = replace(options, barrier=min(options.barrier, BARRIER_OF_OTHER_MESH))
    coarser: MeshSolution | None = None
    meshes_more = refinements_max if refine else int(second_mesh)
    for number in range(meshes_more):
        if not refine:
            proposal, coarser = bisect_all(optimum, accuracy), optimum
        else:
            proposal, coarser = _next_mesh(solution, optimum, coarser, accuracy, early=number < ADAPTATIONS_MAX)
        if proposal is None or (coarser is None and number + 1 == meshes_more):
            break  # an optimum that is compared with nothing says less than the one before
        if number > 0 and solution.problem.intervals > GROWTH_MAX * max(problem.intervals, GROWTH_FROM):
            return replace(solution, remark=f"no more than {solution.problem.intervals} intervals were tried")
        finer = on_mesh(problem, proposal.mesh)
        multipliers = transfer_multipliers(solution.multipliers, Layout(solution.problem), Layout(finer))
        program = call(finer, proposal.guess, options=options, multipliers=multipliers)
        if not program.success:
            return replace(solution, remark=f"no optimum was found on {finer.intervals} intervals: {program.status}")
        meshes = solution.meshes
        solution, optimum = _measure(finer, program, proposal, accuracy, coarser)
        solution = replace(solution, meshes=(*meshes, *solution.meshes))
    return solution


def on_mesh(problem: Problem, mesh: Mesh) -> Problem:
    """Return the same problem on another mesh."""
    phases = [replace(phase, fractions=fractions) for phase, fractions in zip(problem.phases, mesh, strict=True)]
    return replace(problem, phases=tuple(phases))


def _measure(
    problem: Problem,
    program: ProgramSolution,
    proposal: MeshProposal,
    accuracy: Accuracy,
    coarser: MeshSolution | None = None,
) -> tuple[Solution, MeshSolution]:
    """Return an optimum with its certificate, and the same as the next mesh is chosen from it."""
    evidence = examine_own(problem, program, accuracy)
    value = None if coarser is None else coarser.value
    certificate = certify_own(problem, program, evidence, accuracy, coarser=value)
    program = replace(program, replay_error=float(evidence.check.defect.max()))
    return (
        Solution.of_program(problem, program, certificate),
        MeshSolution(problem, program.iterate, proposal, program.objective, lambda: evidence),
    )


def _next_mesh(
    solution: Solution, optimum: MeshSolution, coarser: MeshSolution | None, accuracy: Accuracy, *, early: bool
) -> tuple[MeshProposal | None, MeshSolution | None]:
    """Return the next mesh, None if none would help, and the optimum that its own will be compared with."""
    if coarser is None:
        better = adapt(optimum, accuracy, early=early, joining=False)
        return (bisect_all(optimum, accuracy), optimum) if better is None else (better, None)
    failed = [] if solution.certificate is None else [item.name for item in solution.certificate.failed]
    if not failed:
        return None, coarser
    if OBJECTIVE_CHANGE in failed:
        fewer = refine_changed(optimum, coarser, accuracy)
        if fewer.intervals < COARSEN_WORTHWHILE * optimum.proposal.intervals:
            return fewer, None
        return bisect_all(optimum, accuracy), optimum
    return refine_flagged(optimum, accuracy), coarser
