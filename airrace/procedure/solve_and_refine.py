"""The joint optimum of a stage over all phases, certified, on a mesh refined where it must be.

It can be started from several flights, and solved with several solvers. The first that leads to an optimum which holds
counts: the primary solver from all starts, then the fallback from those from which it found none.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Self

from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.multiplier_transfer import transfer_multipliers
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.solver import Multipliers, Solution
from airrace.procedure.budget import BUDGET_EXHAUSTED
from airrace.procedure.certification import certify, examine, failures
from airrace.procedure.conclusion import conclude
from airrace.procedure.infeasibility.diagnosis import diagnose
from airrace.procedure.refinement import MeshProposal, MeshSolution, adapted, bisect_all, reconsidered, refine_flagged
from airrace.procedure.result import NO_PROVENANCE, MeshRecord, Outcome, StageProvenance, StageResult
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight
from airrace.records import record

ADAPTATIONS_MAX = 2
"""The number of adaptations of a first mesh that is not wrong, before its intervals are halved."""
COLD_BARRIER = 0.1
"""The first value of the barrier parameter of a solve from a guess that may be far off."""
PIECED_BARRIER = 1e-2
"""The first value of the barrier parameter of a solve that starts from assembled pieces."""
HANDOVER_BARRIER = 1e-4
"""The first value of the barrier parameter of a solve that starts from another stage.

A larger one leads astray and back, in twice the iterations.
"""
REFINED_BARRIER = 1e-6
"""The first value of the barrier parameter of a solve that starts from an optimum on a coarser mesh.

When it fell from 1e-3 to 1e-6 and `HANDOVER_BARRIER` from 1e-2 to 1e-4, the ladder took a third fewer iterations.
"""
CARRIED_BARRIER = 1e-5
"""The first value of the barrier parameter of a solve from an optimum on another mesh, with its multipliers."""


@record
class Start:
    """A flight to start from: on the mesh of its problem, with the first value of the barrier parameter.

    `flight` is planned as the start goes round; `provenance` says where it comes from; `multipliers` are
    those of the limits as far as they are known, None if nothing is.
    """

    flight: Flight
    problem: Problem
    guess: Iterate
    barrier: float
    provenance: StageProvenance = NO_PROVENANCE
    multipliers: Multipliers | None = None


@record
class Failure:
    """A start without an optimum; `solution` is where the solver gave up, None if it never came back.

    `coarser` is the optimum on the mesh before, None if the first one led to none.
    """

    start: Start
    solution: Solution | None
    coarser: MeshSolution | None = None


def solve_with_refinement(
    session: SolverSession,
    starts: Sequence[Callable[[], Start | StageResult]],
    refine: "Refinement | None" = None,
    *,
    diagnosing: bool = True,
) -> StageResult:
    """Return the optimum that holds; if none is found, the optimum that does not, or why there is none.

    Args:
        bench: what solves.
        starts: in the order in which they are tried; each is made when its turn comes. One that finds out meanwhile
            that there is no flight is a result, and the end.
        refine: leads from a start to an optimum; None for `refined`, which certifies it.
        diagnosing: whether it is looked for what stands in the way where there is no flight.
    """
    refine = refine or refined
    made: list[Start] = []
    uncertified: dict[int, StageResult] = {}
    failures: list[Failure] = []
    for solver in session.solvers:
        for number, make in enumerate(starts):
            if number in uncertified:
                continue  # another solver would find the same optimum
            if number == len(made):
                if any(failure.solution is None for failure in failures):
                    break  # making a start takes solves, too: they would hang like the ones before
                begun = make()
                if isinstance(begun, StageResult):
                    return begun
                made.append(begun)
            found = refine(session, made[number], solver)
            if isinstance(found, Failure):
                failures.append(found)
            elif found.holds:
                return found
            else:
                uncertified[number] = found
    return next(iter(uncertified.values())) if uncertified else _unsolved(session, failures, diagnosing=diagnosing)


Refinement = Callable[[SolverSession, Start, str], StageResult | Failure]
"""A way from a start, with the solver of a name, to an optimum on a mesh that is good enough for what is wanted."""


@record
class CoarseReference:
    """The optimum on a coarser mesh, whose race time a finer one's is compared with; `solved` measures all of it."""

    race_time: float
    solved: Callable[[], MeshSolution]

    @classmethod
    def measured(cls, optimum: MeshSolution) -> Self:
        """Return an optimum of which everything is measured already."""
        return cls(optimum.race_time, lambda: optimum)


@record
class RefinementState:
    """The mesh to be solved on next.

    Attributes:
        draft: the mesh, with a guess on it.
        coarser: the optimum whose race time its own will be compared with; None as long as there is none.
        refinement: how many meshes were solved on before.
        barrier: the first value of the barrier parameter.
        solvers: the solvers that are asked, in this order.
        multipliers: a guess of them; None if nothing is known.
    """

    draft: MeshProposal
    coarser: CoarseReference | None
    refinement: int
    barrier: float
    solvers: tuple[str, ...]
    multipliers: Multipliers | None = None


def refined(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly, measure, and solve again on other meshes until the certificate holds or there are enough."""
    return refined_from(session, start, first_upcoming(start, solver))


def first_upcoming(start: Start, solver: str) -> RefinementState:
    """Return the mesh that a start is on, to be solved on first."""
    return RefinementState(
        MeshProposal.first(start.problem, start.guess), None, 0, start.barrier, (solver,), start.multipliers
    )


def refined_from(session: SolverSession, start: Start, first: RefinementState) -> StageResult | Failure:
    """Continue refining, from the mesh that comes next.

    Args:
        bench: what it is solved with.
        start: where the stage was started from.
        first: the mesh that is solved on first.
    """
    limits, total = session.settings.certificate, session.settings.mesh.refinements_max
    flight = start.flight
    draft, coarser, barrier, solvers = first.draft, first.coarser, first.barrier, first.solvers
    multipliers = first.multipliers
    optimum: MeshSolution | None = None
    for refinement in range(first.refinement, total + 1):
        problem = flight.problem(draft.mesh)
        purpose = announced(session, problem, refinement)
        passing = coarser is None and refinement < total  # another mesh follows in any case
        solution = session.solve(
            problem, draft.guess, purpose, barrier=barrier, solvers=solvers, passing=passing, multipliers=multipliers
        )
        if solution is None or not solution.success:
            return Failure(start, solution, optimum)
        evidence = examine(problem, solution.iterate, solution.multipliers.constraints, limits)
        optimum = MeshSolution(problem, solution.iterate, draft, evidence)
        certificate = None if coarser is None else certificate_of(optimum, solution, coarser.race_time, limits)
        following = None
        if refinement < total and (certificate is None or not certificate.certified):
            following, coarser = _following(optimum, coarser, refinement, limits, flight.longest_interval)
        if following is None:
            certificate = certificate or certificate_of(optimum, solution, math.nan, limits)
            return finished(start, session, optimum, solution, certificate)
        draft, barrier, solvers = following, CARRIED_BARRIER, session.solvers
        multipliers = carried_over(solution.multipliers, problem, flight.problem(draft.mesh))
    raise AssertionError("the last refinement returns")


def carried_over(multipliers: Multipliers, there: Problem, here: Problem) -> Multipliers:
    """Return the multipliers of the limits of one problem for another one with as many phases."""
    return transfer_multipliers(multipliers, Layout(there), Layout(here))


def announced(session: SolverSession, problem: Problem, refinement: int) -> str:
    """Return what the solve on a mesh is for, a clause; whoever watches is told."""
    purpose = f"all {len(problem.phases)} phases" + (f", refinement {refinement}" if refinement else "")
    session.progress.activity(f"{purpose}, {problem.intervals} intervals", refinement, 0)
    return purpose


def _following(
    optimum: MeshSolution, coarser: CoarseReference | None, refinement: int, limits: CertificateLimits, longest: float
) -> tuple[MeshProposal | None, CoarseReference | None]:
    """Return the next mesh, and the optimum whose race time the next one is compared with.

    The mesh is None if none would help. Where intervals may not be joined (`longest`, s, is finite), a first mesh that
    is not wrong is halved at once: on the shipped courses that moved the race time by 2.6 ms at most.
    """
    if coarser is None:
        early = refinement < ADAPTATIONS_MAX and math.isinf(longest)
        better = adapted(optimum, limits, early=early, joining=early)
        return (bisect_all(optimum, limits), CoarseReference.measured(optimum)) if better is None else (better, None)
    if abs(optimum.race_time - coarser.race_time) > limits.race_time_of(optimum.race_time):
        return reconsidered(optimum, coarser.solved(), limits), None
    return refine_flagged(optimum, limits), coarser


def certificate_of(
    optimum: MeshSolution, solution: Solution, coarser_race_time: float | None, limits: CertificateLimits
) -> Certificate:
    """Return the certificate of an optimum that a solver has found; `coarser_race_time` as of `certify`."""
    return certify(
        optimum.problem,
        optimum.iterate,
        optimum.evidence,
        limits,
        claim=Item("solver", 0.0 if solution.success else 1.0, 0.0, "", solution.status),
        status=f"{solution.solver}: {solution.status}",
        kkt_error=solution.kkt.largest,
        coarser_race_time=coarser_race_time,
    )


def finished(
    start: Start, session: SolverSession, optimum: MeshSolution, solution: Solution, certificate: Certificate
) -> StageResult:
    """Return the result of a stage: solved if all holds that its certificate measures."""
    failed = failures(certificate.failed)
    return conclude(
        start.flight,
        session,
        optimum.problem,
        optimum.iterate,
        outcome=Outcome.SOLVED if certificate.holds else Outcome.NOT_CERTIFIED,
        message=f"solved but not certified: {failed}" if failed else "",
        multipliers=solution.multipliers,
        certificate=certificate,
        provenance=replace(start.provenance, regularisation=solution.objective - optimum.race_time),
        mesh=MeshRecord(
            why=optimum.draft.why,
            coarser=optimum.draft.coarser,
            defect=optimum.evidence.check.defect,
            drift=optimum.evidence.drift,
        ),
    )


def _unsolved(session: SolverSession, failures: Sequence[Failure], *, diagnosing: bool) -> StageResult:
    """Return a result without an optimum, which says what stands in the way."""
    returned = [one for one in failures if one.solution is not None and one.solution.status != BUDGET_EXHAUSTED]
    claimed = [one for one in returned if one.solution is not None and one.solution.infeasible]
    failure = (claimed or returned or list(failures))[0]
    outcome, message = _explained(session, failure, diagnosing=diagnosing)
    solution = failure.solution
    return conclude(
        failure.start.flight,
        session,
        failure.start.problem,
        failure.start.guess if solution is None else _last_flight(failure.start, solution),
        outcome=outcome,
        message=message,
    )


def _last_flight(start: Start, solution: Solution) -> Iterate:
    """Return where the solver gave up; the start itself if that was on a finer mesh."""
    same_mesh = solution.iterate.state.shape == start.guess.state.shape
    return solution.iterate if same_mesh else start.guess


def _explained(session: SolverSession, failure: Failure, *, diagnosing: bool) -> tuple[Outcome, str]:
    start, solution = failure.start, failure.solution
    if solution is None:
        return Outcome.TIMEOUT, "the solver finished no iteration for too long and was stopped"
    spent = f"; {BUDGET_EXHAUSTED}" if session.budget.exhausted else ""
    gave_up = f"not converged: {solution.solver} gave up ({solution.status}), most violated: {solution.worst}{spent}"
    advice = "try the other --guess, a finer settings.mesh.interval_s, or milder rules"
    if solution.infeasible and diagnosing:
        conflict = diagnose(session, start.problem, _last_flight(start, solution), start.guess, solution.worst)
        if conflict is not None:
            return Outcome.INFEASIBLE, conflict
        return Outcome.NOT_CONVERGED, f"{gave_up}; the legs around it can be flown by themselves; {advice}"
    return Outcome.NOT_CONVERGED, f"{gave_up}; {advice}"
