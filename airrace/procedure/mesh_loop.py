"""The joint optimum of a stage over all phases, certified, on a mesh refined where it must be.

It can be started from several flights, and solved with several solvers. The first that leads to an optimum which holds
counts: the primary solver from all starts, then the fallback from those from which it found none.

There is one loop, `refine`: solve on a mesh, measure, and decide on the next mesh until none follows. Here that is
until a certificate holds, which takes a second mesh; in `single_mesh.py` until a single mesh is good, or until the next
stage can start from a rough optimum.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property, partial

from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Certificate, Item
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_proposals import (
    ADAPTATIONS_MAX,
    GROWTH_FROM,
    GROWTH_MAX,
    MeshProposal,
    MeshSolution,
    adapt,
    bisect_all,
    refine_changed,
    refine_flagged,
)
from airrace.optimal_control.mesh_refinement import Marks, restrict, transfer_multipliers
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.second_order import second_order
from airrace.optimal_control.solvers.interface import Ending, Multipliers
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.procedure.certification import (
    ROUGH_TOLERANCE,
    approaches,
    certify,
    certify_rough,
    clearance_item,
    conclude,
    examine,
    failures,
    rough_limits,
)
from airrace.procedure.planning.clearance import ClosestApproach
from airrace.procedure.pylon_conditions import (
    CLEARANCE_ROUNDS_MAX,
    CLEARANCE_SAFETY,
    EXCESS_LEFT_MAX,
    FAR_VIOLATION,
    MeasuredConditions,
    ReplayedFlight,
)
from airrace.procedure.result import MeshRecord, StageResult, Status
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import StageProblem, regularisation_share
from airrace.procedure.warm_start import InitialBarrier, Start


@dataclass(frozen=True)
class Failure:
    """A start without an optimum; `solution` is where the solver gave up, None if it never came back.

    `coarser` is the optimum on the mesh before, None if the first one led to none.
    """

    start: Start
    solution: ProgramSolution | None
    coarser: MeshSolution | None = None


MeshStrategy = Callable[[SolverSession, Start, str], StageResult | Failure]
"""A way from a start, with the solver of a name, to an optimum on a mesh that is good enough for what is wanted."""

Diagnosis = Callable[[SolverSession, Problem, Iterate, Iterate, str], str | None]
"""A function of the problem, where the solver gave up, where it started and the condition most violated, to a sentence
on the limits that contradict each other; None where none do."""


def solve_from_starts(
    session: SolverSession,
    starts: Sequence[Callable[[], Start | StageResult]],
    strategy: MeshStrategy,
    *,
    diagnose: Diagnosis | None = None,
) -> StageResult:
    """Return the optimum that holds; if there is none, an optimum that does not, or why there is none.

    Args:
        session: what solves.
        starts: in the order in which they are tried; each is made when its turn comes. One that finds out meanwhile
            that there is no flight is a result, and the end; one with the guess of an earlier one is left out.
        strategy: leads from a start to an optimum.
        diagnose: looks for what stands in the way where there is no flight.
    """
    made: list[Start] = []
    uncertified: dict[int, StageResult] = {}
    failures: list[Failure] = []
    for solver in session.solvers:
        for number, make_start in enumerate(starts):
            if number in uncertified:
                continue  # another solver would lead to the same optimum
            if number == len(made):
                if any(failure.solution is None for failure in failures):
                    break  # making a start takes solves, too: they would hang like the ones before
                start = make_start()
                if isinstance(start, StageResult):
                    return start
                made.append(start)
            if any(made[number].has_guess_of(earlier) for earlier in made[:number]):
                continue
            result = strategy(session, made[number], solver)
            if isinstance(result, Failure):
                failures.append(result)
            elif result.holds:
                return result
            else:
                uncertified[number] = result
    if uncertified:
        return next(iter(uncertified.values()))
    return _failure_result(session, failures, diagnose)


class MeshGoal(Enum):
    """What the optimum on a mesh is for, and so how closely it is solved and what its certificate claims.

    `CERTIFIED`: its race time is compared with that on a coarser mesh. `REFERENCE`: it is that coarser one, never
    certified itself. `SINGLE`: all is measured but that comparison. `ROUGH`: the next stage or mesh starts from it.
    """

    CERTIFIED = "certified"
    REFERENCE = "reference"
    SINGLE = "single"
    ROUGH = "rough"


@dataclass(frozen=True)
class MeshTask:
    """The mesh to be solved on next, and how.

    Attributes:
        stage_problem: whose problem is stated.
        proposal: the mesh, with a guess on it.
        barrier: the first value of the barrier parameter.
        solvers: the solvers that are asked, in this order.
        multipliers: a guess of them; None if nothing is known.
        number: how many meshes were solved on before; -1 for a mesh that is only compared with.
        before: the optimum that led here; None for a first mesh.
        coarser: the optimum whose race time its own will be compared with; None as long as there is none.
        goal: what its optimum is for.
        purpose: what is solved for, a clause; by default a refinement of all phases.
        clearance_rounds: how many solves for violated clearances were made on a mesh that was good already.
        nodes_beside_passings: whether moments abeam shortly before or after a passing have nodes of their own.
        violating_optimum: the optimum whose violated clearance from pylons this solve is to mend; else None.
        next_task: the finer mesh that follows whatever this one leads to, and is compared with it; else None.
    """

    stage_problem: StageProblem
    proposal: MeshProposal
    barrier: InitialBarrier
    solvers: tuple[str, ...]
    multipliers: Multipliers | None = None
    number: int = 0
    before: MeshSolution | None = None
    coarser: MeshSolution | None = None
    goal: MeshGoal = MeshGoal.CERTIFIED
    purpose: str = ""
    clearance_rounds: int = 0
    nodes_beside_passings: bool = False
    violating_optimum: "SolvedMesh | None" = None
    next_task: "MeshTask | None" = None


@dataclass(frozen=True)
class SolvedMesh:
    """A mesh that was solved on: the optimum on it, and the solution that it was made of."""

    session: SolverSession
    task: MeshTask
    solution: ProgramSolution
    optimum: MeshSolution

    @property
    def stage_problem(self) -> StageProblem:
        """Whose problem was stated."""
        return self.task.stage_problem

    @cached_property
    def approaches(self) -> list[ClosestApproach]:
        """The least distances of the wing from pylons."""
        return approaches(self.stage_problem, self.optimum.problem, self.optimum.iterate, self.optimum.evidence.replay)

    @cached_property
    def replayed_flight(self) -> ReplayedFlight:
        """The optimum as it was replayed."""
        return ReplayedFlight(self.optimum.problem, self.optimum.iterate.durations, self.optimum.evidence.replay)

    @cached_property
    def pylons(self) -> MeasuredConditions | None:
        """The conditions on pylons as the optimum measures them; None where the rules ask for none."""
        constraints = self.stage_problem.clearance
        return (
            None
            if constraints is None
            else constraints.measure(self.stage_problem.plan, self.replayed_flight, self.approaches)
        )

    def place_clearance_constraints(self, proposal: MeshProposal) -> tuple[StageProblem, MeshProposal]:
        """Return the problem with the conditions on pylons as the optimum measures them, and a mesh made for them."""
        constraints = self.stage_problem.clearance
        if constraints is None or self.pylons is None:
            return self.stage_problem, proposal
        mesh, guess, conditions = constraints.place_on_mesh(
            self.pylons,
            self.replayed_flight,
            proposal.mesh,
            proposal.guess,
            proposal.coarser,
            beside_passings=self.nodes_beside_passings,
        )
        return self.stage_problem.with_conditions(conditions), replace(proposal, mesh=mesh, guess=guess)

    def violates_clearance(self, share: float = 1.0) -> bool:
        """Tell whether a wing is too near to a pylon, or needlessly far away, and another solve may mend it.

        An excess that the last solve has not removed stays: it is that of a wing which passes a top aslant. Where the
        Hamiltonian drifts at a condition beside its moment abeam, that moment gets a node of its own, for no finer
        mesh mends it.

        Args:
            share: of the certificate's limit that is allowed.
        """
        limits, pylons = self.session.settings.certificate, self.pylons
        if pylons is None or self.task.clearance_rounds >= CLEARANCE_ROUNDS_MAX:
            return False
        before = self.task.violating_optimum and self.task.violating_optimum.pylons
        excess = pylons.is_excessive and (before is None or pylons.excess < EXCESS_LEFT_MAX * before.excess)
        drifts = self.nodes_beside_passings and not self.task.nodes_beside_passings
        return pylons.violation > share * limits.gate_length or excess or drifts

    @cached_property
    def nodes_beside_passings(self) -> bool:
        """Whether moments abeam beside passings get nodes: once conditions beside them make the Hamiltonian drift."""
        limit = self.session.settings.certificate.hamiltonian
        is_beside = self.pylons is not None and self.pylons.is_beside
        drifts = is_beside and float(self.optimum.evidence.drift.max()) > limit
        return self.task.nodes_beside_passings or drifts

    @property
    def barrier(self) -> InitialBarrier:
        """The first value of the barrier parameter for the next mesh, by how far wings are from what is asked."""
        far = self.pylons is not None and self.pylons.violation > FAR_VIOLATION
        return InitialBarrier.COARSE if far else InitialBarrier.OTHER_MESH

    @cached_property
    def coarser_race_time(self) -> float | None:
        """The race time on the coarser mesh, s; NaN without one, None where none is asked for.

        The optimum that led here is one of several where the problem is flat, 5 ms apart on a course of 184 s. Unless
        it is too far away already, the one is compared that is solved for from the optimum on this mesh, as it is
        whenever a stored flight is measured again: what is certified must not be refuted by that.
        """
        optimum, coarser, limits = self.optimum, self.task.coarser, self.session.settings.certificate
        if coarser is None:
            return None if self.task.goal is MeshGoal.SINGLE else math.nan
        if abs(optimum.value - coarser.value) > limits.change_of(optimum.value):
            return coarser.value
        multipliers, nodes = self.solution.multipliers, optimum.proposal.coarser
        return race_time_on_coarser_mesh(
            self.session, self.stage_problem, optimum.problem, optimum.iterate, multipliers, nodes
        )

    @cached_property
    def certificate(self) -> Certificate:
        """The certificate of the optimum; where it is the first to ask, the coarser optimum is solved for."""
        optimum, solution = self.optimum, self.solution
        claim, status = Item("solver", 0.0, 0.0, "", solution.status), f"{solution.solver}: {solution.status}"
        if self.task.goal is MeshGoal.ROUGH:
            return certify_rough(
                optimum.problem,
                optimum.iterate,
                optimum.evidence.check.items[0],
                rough_limits(self.session.settings.certificate),
                claim=claim,
                status=status,
                kkt_error=solution.kkt.largest,
            )
        return certify(
            optimum.problem,
            optimum.iterate,
            optimum.evidence,
            self.session.settings.certificate,
            claim=claim,
            status=status,
            kkt_error=solution.kkt.largest,
            second_order=solution.second_order,
            coarser_race_time=self.coarser_race_time,
            clearance=clearance_item(
                self.stage_problem, optimum.problem, self.approaches, self.session.settings.certificate
            ),
        )

    def carry(self, proposal: MeshProposal, stage_problem: StageProblem | None = None) -> Multipliers:
        """Return the multipliers on another mesh, by default of the same stage problem."""
        problem = (stage_problem or self.stage_problem).problem(proposal.mesh)
        return carry_multipliers(self.solution.multipliers, self.optimum.problem, problem)


MeshDecision = Callable[[SolvedMesh], MeshTask | None]
"""The decision on the mesh that follows another one; None where none does."""


def refine(
    session: SolverSession,
    start: Start,
    first: MeshTask,
    decide: MeshDecision,
    *,
    first_intervals: int | None = None,
) -> StageResult | Failure:
    """Solve on one mesh after another until none follows; return the stage, with the certificate that it has.

    Args:
        start: where the first mesh comes from.
        first: the first mesh.
        decide: on the mesh that follows.
        first_intervals: of a mesh before, from which the growth of meshes is counted.
    """
    intervals = first_intervals or first.proposal.intervals
    intervals_max = GROWTH_MAX * max(intervals, GROWTH_FROM)
    task, iterations_max = first, start.iterations_max
    while True:
        solved = solve_on_mesh(session, start, task, iterations_max)
        if isinstance(solved, Failure):
            if task.violating_optimum is None:
                return solved
            return _finish(start, _with_curvature(task.violating_optimum))
        if solved.optimum.value > start.race_time_max or task.number == session.settings.mesh.refinements_max:
            break
        following = decide(solved)
        if following is None:
            break
        # Where a limit is missed on every mesh, ever more intervals would be cut.
        if following.number > task.number and solved.optimum.problem.intervals > intervals_max:
            break
        task, iterations_max = following, None
    return _finish(start, solved)


def solve_on_mesh(
    session: SolverSession, start: Start, task: MeshTask, iterations_max: int | None = None
) -> SolvedMesh | Failure:
    """Solve on one mesh.

    Args:
        start: where the mesh comes from.
        task: the mesh.
        iterations_max: fewer iterations than the settings allow; None for as many.
    """
    problem, number = task.stage_problem.problem(task.proposal.mesh), max(task.number, 0)
    purpose = task.purpose or f"all {len(problem.phases)} phases" + (f", refinement {number}" if number else "")
    session.progress.activity(f"{purpose}, {problem.intervals} intervals", number, 0)
    solution = session.solve(
        problem,
        task.proposal.guess,
        purpose,
        barrier=task.barrier,
        solvers=task.solvers,
        iterations_max=iterations_max,
        loose_tolerance=ROUGH_TOLERANCE if task.goal is MeshGoal.ROUGH else 0.0,
        reference_only=task.goal is MeshGoal.REFERENCE,
        multipliers=task.multipliers,
    )
    if solution is None or not solution.success:
        return Failure(start, solution, task.before)
    measure = partial(
        examine, problem, solution.iterate, solution.multipliers.constraints, session.settings.certificate
    )
    race_time = float(solution.iterate.durations.sum())
    return SolvedMesh(
        session, task, solution, MeshSolution(problem, solution.iterate, task.proposal, race_time, measure)
    )


def race_time_on_coarser_mesh(
    session: SolverSession,
    stage_problem: StageProblem,
    problem: Problem,
    iterate: Iterate,
    multipliers: Multipliers,
    nodes: Marks,
) -> float:
    """Return the race time of the optimum on a coarser mesh, solved for from an optimum, s; NaN if there is none.

    Args:
        session: solves.
        stage_problem: the problem of the stage.
        problem, iterate, multipliers: of the optimum.
        nodes: which nodes the coarser mesh has; shape (N + 1,).
    """
    mesh, guess = restrict(problem.mesh, iterate, nodes)
    coarser = stage_problem.problem(mesh)
    solution = session.solve(
        coarser,
        guess,
        "half of the intervals",
        barrier=InitialBarrier.COARSER_MESH,
        reference_only=True,
        multipliers=carry_multipliers(multipliers, problem, coarser),
    )
    return float(solution.iterate.durations.sum()) if solution is not None and solution.success else math.nan


def _with_curvature(solved: SolvedMesh) -> SolvedMesh:
    """Return an optimum that was only compared with, with its curvature judged."""
    multipliers = solved.solution.multipliers.constraints
    judged = second_order(solved.optimum.problem, solved.optimum.iterate, multipliers)
    return replace(solved, solution=replace(solved.solution, second_order=None if judged is None else judged[0]))


def carry_multipliers(multipliers: Multipliers, source: Problem, target: Problem) -> Multipliers:
    """Return the multipliers of the limits of one problem for another one with as many phases."""
    return transfer_multipliers(multipliers, Layout(source), Layout(target))


def solve_certified(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly, measure, and solve again on other meshes until the certificate holds or there are enough."""
    first = MeshProposal.first(start.problem, start.guess)
    task = task_to_certify(session, start.stage_problem, first, start.barrier, (solver,), start.multipliers)
    return refine(session, start, task, next_until_certified)


def task_to_certify(
    session: SolverSession,
    stage_problem: StageProblem,
    proposal: MeshProposal,
    barrier: InitialBarrier,
    solvers: tuple[str, ...],
    multipliers: Multipliers | None,
    *,
    number: int = 0,
    before: MeshSolution | None = None,
    coarser: MeshSolution | None = None,
) -> MeshTask:
    """Return a mesh from which on refinement goes on until a certificate holds; arguments as of `MeshTask`."""
    # Where there is nothing to compare with, another mesh follows in any case.
    another_follows = coarser is None and number < session.settings.mesh.refinements_max
    return MeshTask(
        stage_problem,
        proposal,
        barrier,
        solvers,
        multipliers,
        number=number,
        before=before,
        coarser=coarser,
        goal=MeshGoal.REFERENCE if another_follows else MeshGoal.CERTIFIED,
    )


def next_until_certified(solved: SolvedMesh) -> MeshTask | None:
    """Return the next mesh; None if the certificate holds, or if none would help.

    Where the model bounds its intervals, so that none may be joined, a first mesh that is not wrong is halved at once:
    on the shipped courses that moved the race time by 2.6 ms at most.
    """
    optimum, task, session, stage_problem = solved.optimum, solved.task, solved.session, solved.stage_problem
    limits, coarser, same_mesh = session.settings.certificate, task.coarser, False
    if task.next_task is not None:
        return replace(task.next_task, before=optimum, coarser=optimum)
    if coarser is None:
        proposal = adapt_joining(solved)
        same_mesh = proposal is None and solved.violates_clearance(CLEARANCE_SAFETY)
        if proposal is not None or same_mesh:
            proposal = proposal or replace(task.proposal, guess=optimum.iterate)
            stage_problem, proposal = solved.place_clearance_constraints(proposal)
        else:
            proposal, coarser = bisect_all(optimum, limits), optimum
    elif solved.certificate.certified:
        return None
    elif solved.violates_clearance():
        return _both_meshes_again(solved)
    elif any(item.name == RACE_TIME_CHANGE for item in solved.certificate.failed):
        stage_problem, proposal = solved.place_clearance_constraints(refine_changed(optimum, coarser, limits))
        coarser = None
    else:
        proposal = refine_flagged(optimum, limits)
        if proposal is None:
            return None
    following = task_to_certify(
        session,
        stage_problem,
        proposal,
        solved.barrier,
        session.solvers,
        solved.carry(proposal, stage_problem),
        number=task.number + (not same_mesh),
        before=optimum,
        coarser=coarser,
    )
    return replace(
        following,
        clearance_rounds=task.clearance_rounds + same_mesh,
        nodes_beside_passings=solved.nodes_beside_passings,
        violating_optimum=solved if same_mesh else None,
    )


def _both_meshes_again(solved: SolvedMesh) -> MeshTask:
    """Return the coarser mesh, then the same one, with the conditions on pylons as they were measured on this.

    So both race times are those of the same conditions.
    """
    optimum, session = solved.optimum, solved.session
    stage_problem, fine = solved.place_clearance_constraints(replace(optimum.proposal, guess=optimum.iterate))
    mesh, guess = restrict(fine.mesh, fine.guess, fine.coarser)
    coarse = MeshProposal.first(stage_problem.problem(mesh), guess)
    again = MeshTask(
        stage_problem,
        fine,
        InitialBarrier.OTHER_MESH,
        session.solvers,
        solved.carry(fine, stage_problem),
        number=solved.task.number,
        clearance_rounds=solved.task.clearance_rounds + 1,
        nodes_beside_passings=solved.nodes_beside_passings,
        violating_optimum=solved,
    )
    return MeshTask(
        stage_problem,
        coarse,
        InitialBarrier.OTHER_MESH,
        session.solvers,
        solved.carry(coarse, stage_problem),
        number=-1,
        goal=MeshGoal.REFERENCE,
        purpose="the coarser mesh",
        violating_optimum=solved,
        next_task=again,
    )


def adapt_joining(solved: SolvedMesh) -> MeshProposal | None:
    """Return a better first mesh, or None; where intervals may not be joined only for an optimum made of errors."""
    early = solved.task.number < ADAPTATIONS_MAX and math.isinf(solved.stage_problem.longest_interval)
    return adapt(solved.optimum, solved.session.settings.certificate, early=early, joining=early)


def _finish(start: Start, solved: SolvedMesh) -> StageResult:
    """Return the result of a stage: solved if all holds that its certificate measures."""
    optimum, solution, certificate = solved.optimum, solved.solution, solved.certificate
    failed = failures(certificate.failed)
    regularisation = regularisation_share(optimum.problem, optimum.iterate, solution.objective)
    return conclude(
        solved.stage_problem,
        solved.session,
        optimum.problem,
        optimum.iterate,
        outcome=Status.SOLVED if certificate.holds else Status.NOT_CERTIFIED,
        message=f"solved but not certified: {failed}" if failed else "",
        multipliers=solution.multipliers,
        certificate=certificate,
        provenance=replace(start.provenance, regularisation=regularisation),
        mesh=MeshRecord(
            why=optimum.proposal.why,
            coarser=optimum.proposal.coarser,
            defect=optimum.evidence.check.defect,
            drift=optimum.evidence.drift,
        ),
    )


def _failure_result(session: SolverSession, failures: Sequence[Failure], diagnose: Diagnosis | None) -> StageResult:
    """Return a result without an optimum, which says what stands in the way."""
    returned = [f for f in failures if f.solution and f.solution.ending is not Ending.BUDGET_EXHAUSTED]
    infeasible = [f for f in returned if f.solution and f.solution.infeasible]
    failure = (infeasible or returned or list(failures))[0]
    start, solution, last = failure.start, failure.solution, failure.start.guess
    outcome = Status.NOT_CONVERGED
    if solution is None:
        outcome, message = Status.TIMEOUT, f"no solver came back: {session.attempts[-1].status}"
    else:
        if solution.iterate.state.shape == last.state.shape:  # else it gave up on a finer mesh
            last = solution.iterate
        spent = f"; {Ending.BUDGET_EXHAUSTED.value}" if session.budget.exhausted else ""
        message = (
            f"not converged: {solution.solver} gave up ({solution.status}), most violated: {solution.worst}{spent}"
        )
        if diagnose is not None:
            conflict = diagnose(session, start.problem, last, start.guess, solution.worst)
            if conflict is None:
                message = f"{message}; the legs around it are feasible by themselves"
            elif solution.infeasible:
                outcome, message = Status.INFEASIBLE, conflict
            else:  # nobody claims it
                message = f"{message}; perhaps {conflict}"
        if outcome is Status.NOT_CONVERGED:
            message = f"{message}; try the other --guess, a finer settings.mesh.interval_s, or milder rules"
    return conclude(start.stage_problem, session, start.problem, last, outcome=outcome, message=message)
