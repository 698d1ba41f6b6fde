"""The joint optimum of a stage over all phases, certified, on a mesh refined where it must be.

It can be started from several flights, and solved with several solvers. The first that leads to an optimum which holds
counts: the primary solver from all starts, then the fallback from those from which it found none.

There is one loop: solve on a mesh, measure, and choose the next mesh until none follows. What follows is a function of
the state, of which there are four: until a certificate holds, which takes a second mesh; on a single good mesh, all
that a certificate measures but the second mesh; roughly on a single mesh, for the next stage to start from; and the
second mesh of a stage that was solved on a single one.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import restrict, transfer_multipliers
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.second_order import second_order
from airrace.optimal_control.solvers.interface import Ending, Multipliers
from airrace.optimal_control.solvers.solver import Solution
from airrace.planning.clearance import ClosestApproach
from airrace.procedure.certification import (
    approaches,
    certify,
    certify_rough,
    clearance_item,
    conclude,
    examine,
    failures,
)
from airrace.procedure.pylon_conditions import MeasuredConditions, ReplayedFlight
from airrace.procedure.refinement import (
    SETTINGS,
    MeshProposal,
    MeshSolution,
    adapt,
    bisect_all,
    iterate_meshes,
    refine_changed,
    refine_flagged,
    refine_predicted,
    rough_limits,
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
    solution: Solution | None
    coarser: MeshSolution | None = None


Refinement = Callable[[SolverSession, Start, str], StageResult | Failure]
"""A way from a start, with the solver of a name, to an optimum on a mesh that is good enough for what is wanted."""

Diagnosis = Callable[[SolverSession, Problem, Iterate, Iterate, str], str | None]
"""A function of the problem, where the solver gave up, where it started and the condition most violated, to a sentence
on the limits that contradict each other; None where none do."""


def solve_with_refinement(
    session: SolverSession,
    starts: Sequence[Callable[[], Start | StageResult]],
    refine: Refinement | None = None,
    *,
    diagnose: Diagnosis | None = None,
) -> StageResult:
    """Return the optimum that holds; if none is found, the optimum that does not, or why there is none.

    Args:
        session: what solves.
        starts: in the order in which they are tried; each is made when its turn comes. One that finds out meanwhile
            that there is no flight is a result, and the end; one with the guess of an earlier one is left out.
        refine: leads from a start to an optimum; None for `solve_certified`.
        diagnose: looks for what stands in the way where there is no flight.
    """
    refine = refine or solve_certified
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
            if any(made[number].has_guess_of(before) for before in made[:number]):
                continue
            found = refine(session, made[number], solver)
            if isinstance(found, Failure):
                failures.append(found)
            elif found.holds:
                return found
            else:
                uncertified[number] = found
    return next(iter(uncertified.values())) if uncertified else _failure_result(session, failures, diagnose)


@dataclass(frozen=True)
class RefinementState:
    """The mesh to be solved on next, and how.

    Attributes:
        flight: whose problem is stated.
        draft: the mesh, with a guess on it.
        barrier: the first value of the barrier parameter.
        solvers: the solvers that are asked, in this order; without any, all that there are.
        following: the state after this one; None to terminate.
        multipliers: a guess of them; None if nothing is known.
        number: how many meshes were solved on before; -1 for a mesh that is only compared with.
        before: the optimum that led here; None for a first mesh.
        coarser: the optimum whose race time its own will be compared with; None as long as there is none.
        compares: whether the certificate asks for that comparison.
        rough: a looser tolerance, see `SolverSession.solve`.
        passing: likewise.
        purpose: what is solved for, a clause; by default a refinement of all phases.
        clearance_rounds: how many solves for wings too near to pylons were made on a mesh that was good already.
        nodes_beside_passings: whether moments abeam shortly before or after a passing have nodes of their own.
        too_near: the optimum that keeps to all but the clearance from pylons, for which this is solved; else None.
    """

    flight: StageProblem
    draft: MeshProposal
    barrier: InitialBarrier
    solvers: tuple[str, ...]
    following: "Callable[[Refined], RefinementState | None]"
    multipliers: Multipliers | None = None
    number: int = 0
    before: MeshSolution | None = None
    coarser: MeshSolution | None = None
    compares: bool = True
    rough: float = 0.0
    passing: bool = False
    purpose: str = ""
    clearance_rounds: int = 0
    nodes_beside_passings: bool = False
    too_near: "Refined | None" = None


@dataclass(frozen=True)
class Refined:
    """A mesh that was solved on, and the optimum on it; None where there is none."""

    session: SolverSession
    state: RefinementState
    solution: Solution | None
    optimum: MeshSolution | None

    @property
    def solved(self) -> tuple[MeshSolution, Solution]:
        """The optimum, and the solution that it was made of."""
        assert self.optimum is not None  # asked for where there is one
        assert self.solution is not None
        return self.optimum, self.solution

    @property
    def flight(self) -> StageProblem:
        """Whose problem was stated."""
        return self.state.flight

    @cached_property
    def approaches(self) -> list[ClosestApproach]:
        """The least distances of the wing from pylons."""
        optimum, _ = self.solved
        return approaches(self.flight, optimum.problem, optimum.iterate, optimum.evidence.replay)

    @cached_property
    def replayed_flight(self) -> ReplayedFlight:
        """The optimum as it was replayed."""
        optimum, _ = self.solved
        return ReplayedFlight(optimum.problem, optimum.iterate.durations, optimum.evidence.replay)

    @cached_property
    def pylons(self) -> MeasuredConditions | None:
        """The conditions on pylons as the optimum measures them; None where the rules ask for none."""
        rooms = self.flight.rooms
        return None if rooms is None else rooms.measure(self.flight.plan, self.replayed_flight, self.approaches)

    def keep_clear(self, draft: MeshProposal) -> tuple[StageProblem, MeshProposal]:
        """Return the flight with the conditions on pylons as the optimum measures them, and a mesh made for them."""
        rooms = self.flight.rooms
        if rooms is None or self.pylons is None:
            return self.flight, draft
        mesh, guess, conditions = rooms.place(
            self.pylons,
            self.replayed_flight,
            draft.mesh,
            draft.guess,
            draft.coarser,
            beside_passings=self.nodes_beside_passings,
        )
        return self.flight.with_conditions(conditions), replace(draft, mesh=mesh, guess=guess)

    def too_near(self, share: float = 1.0) -> bool:
        """Tell whether a wing is too near to a pylon, or needlessly far away, and another solve may cure it.

        A needless distance that the last solve has not cured stays: it is that of a wing which passes a top aslant.
        Likewise where the Hamiltonian drifts at a condition beside its moment abeam, which no finer mesh cures.

        Args:
            share: of the certificate's limit that is allowed.
        """
        limits, pylons = self.session.settings.certificate, self.pylons
        if pylons is None or self.state.clearance_rounds >= SETTINGS.clearance_rounds_max:
            return False
        before = self.state.too_near and self.state.too_near.pylons
        needless = pylons.is_needless and (before is None or pylons.needless < SETTINGS.cured * before.needless)
        drifts = self.nodes_beside_passings and not self.state.nodes_beside_passings
        return pylons.missed > share * limits.gate_length or needless or drifts

    @cached_property
    def nodes_beside_passings(self) -> bool:
        """Whether moments abeam beside passings get nodes: once conditions beside them make the Hamiltonian drift."""
        limit = self.session.settings.certificate.hamiltonian
        is_beside = self.pylons is not None and self.pylons.is_beside
        drifts = is_beside and float(self.solved[0].evidence.drift.max()) > limit
        return self.state.nodes_beside_passings or drifts

    @property
    def barrier(self) -> InitialBarrier:
        """The first value of the barrier parameter for the next mesh, by how far wings are from what is asked."""
        far = self.pylons is not None and self.pylons.missed > SETTINGS.far
        return InitialBarrier.COARSE if far else InitialBarrier.OTHER_MESH

    @cached_property
    def certificate(self) -> Certificate:
        """The certificate of the optimum."""
        (optimum, solution), coarser = self.solved, self.state.coarser
        claim, status = Item("solver", 0.0, 0.0, "", solution.status), f"{solution.solver}: {solution.status}"
        if self.state.rough:
            return certify_rough(
                optimum.problem,
                optimum.iterate,
                optimum.evidence.check.items[0],
                rough_limits(self.session.settings.certificate),
                claim=claim,
                status=status,
                kkt_error=solution.kkt.largest,
            )
        without = math.nan if self.state.compares else None
        return certify(
            optimum.problem,
            optimum.iterate,
            optimum.evidence,
            self.session.settings.certificate,
            claim=claim,
            status=status,
            kkt_error=solution.kkt.largest,
            second_order=solution.second_order,
            coarser_race_time=without if coarser is None else coarser.race_time,
            clearance=clearance_item(self.flight, optimum.problem, self.approaches, self.session.settings.certificate),
        )

    def carry(self, draft: MeshProposal, flight: StageProblem | None = None) -> Multipliers:
        """Return the multipliers on another mesh, by default of the same flight."""
        optimum, solution = self.solved
        return carry_multipliers(solution.multipliers, optimum.problem, (flight or self.flight).problem(draft.mesh))


def refine_from(session: SolverSession, start: Start, first: RefinementState) -> StageResult | Failure:
    """Solve on one mesh after another, from the first one on; return the stage, with the certificate that it has."""
    limits, total = session.settings.certificate, session.settings.mesh.refinements_max
    intervals = sum(len(fractions) for fractions in first.draft.mesh)
    largest = SETTINGS.growth_max * max(intervals, SETTINGS.growth_from)

    def step(state: RefinementState) -> Refined:
        problem, number = state.flight.problem(state.draft.mesh), max(state.number, 0)
        purpose = state.purpose or f"all {len(problem.phases)} phases" + (f", refinement {number}" if number else "")
        session.progress.activity(f"{purpose}, {problem.intervals} intervals", number, 0)
        solution = session.solve(
            problem,
            state.draft.guess,
            purpose,
            barrier=state.barrier,
            solvers=state.solvers,
            iterations_max=start.iterations_max if state is first else None,
            loose_tolerance=state.rough,
            reference_only=state.passing,
            multipliers=state.multipliers,
        )
        if solution is None or not solution.success:
            return Refined(session, state, solution, None)
        measure = partial(examine, problem, solution.iterate, solution.multipliers.constraints, limits)
        optimum = MeshSolution(problem, solution.iterate, state.draft, measure)
        return Refined(session, state, solution, optimum)

    def following(state: RefinementState, refined: Refined) -> RefinementState | None:
        if refined.optimum is None or refined.optimum.race_time > start.race_time_max or state.number == total:
            return None
        after, fine = state.following(refined), refined.optimum.problem.intervals > largest
        return None if fine and after is not None and after.number > state.number else after

    last = iterate_meshes(first, step, following)
    if last.optimum is None and last.state.too_near is not None:
        last = _with_curvature(last.state.too_near)
    return Failure(start, last.solution, last.state.before) if last.optimum is None else _finish(start, last)


def _with_curvature(refined: Refined) -> Refined:
    """Return an optimum that was only passed by, with its curvature judged."""
    optimum, solution = refined.solved
    judged = second_order(optimum.problem, optimum.iterate, solution.multipliers.constraints)
    return replace(refined, solution=replace(solution, second_order=None if judged is None else judged[0]))


def carry_multipliers(multipliers: Multipliers, there: Problem, here: Problem) -> Multipliers:
    """Return the multipliers of the limits of one problem for another one with as many phases."""
    return transfer_multipliers(multipliers, Layout(there), Layout(here))


def solve_certified(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly, measure, and solve again on other meshes until the certificate holds or there are enough."""
    first = MeshProposal.first(start.problem, start.guess)
    state = certified_state(session, start.flight, first, start.barrier, (solver,), start.multipliers)
    return refine_from(session, start, state)


def certified_state(
    session: SolverSession,
    flight: StageProblem,
    draft: MeshProposal,
    barrier: InitialBarrier,
    solvers: tuple[str, ...],
    multipliers: Multipliers | None,
    *,
    number: int = 0,
    before: MeshSolution | None = None,
    coarser: MeshSolution | None = None,
) -> RefinementState:
    """Return a mesh from which on refinement goes on until a certificate holds; arguments as of `RefinementState`."""
    # Where there is nothing to compare with, another mesh follows in any case.
    passing = coarser is None and number < session.settings.mesh.refinements_max
    state = RefinementState(flight, draft, barrier, solvers, _until_certified, multipliers, number, before, coarser)
    return replace(state, passing=passing)


def _until_certified(refined: Refined) -> RefinementState | None:
    """Return the next mesh; None if the certificate holds, or if none would help.

    Where the model bounds its intervals, so that none may be joined, a first mesh that is not wrong is halved at once:
    on the shipped courses that moved the race time by 2.6 ms at most.
    """
    (optimum, _), state, session = refined.solved, refined.state, refined.session
    limits, coarser, flight = session.settings.certificate, state.coarser, refined.flight
    same_mesh = False
    if coarser is None:
        draft = _adapt(refined)
        same_mesh = draft is None and refined.too_near(SETTINGS.clearance_safety)
        if draft or same_mesh:
            flight, draft = refined.keep_clear(draft or replace(state.draft, guess=optimum.iterate))
        else:
            draft, coarser = bisect_all(optimum, limits), optimum
    elif refined.certificate.certified:
        return None
    elif refined.too_near():
        return _again_on_both_meshes(refined)
    elif abs(optimum.race_time - coarser.race_time) > limits.race_time_of(optimum.race_time):
        flight, draft = refined.keep_clear(refine_changed(optimum, coarser, limits))
        coarser = None
    else:
        draft = refine_flagged(optimum, limits)
    if draft is None:
        return None
    following = certified_state(
        session,
        flight,
        draft,
        refined.barrier,
        session.solvers,
        refined.carry(draft, flight),
        number=state.number + (not same_mesh),
        before=optimum,
        coarser=coarser,
    )
    rounds = state.clearance_rounds + same_mesh
    return replace(
        following,
        clearance_rounds=rounds,
        nodes_beside_passings=refined.nodes_beside_passings,
        too_near=refined if same_mesh else None,
    )


def _again_on_both_meshes(refined: Refined) -> RefinementState:
    """Return the coarser mesh, which the same one follows, with the conditions on pylons as they were measured on this.

    So both race times are those of the same conditions.
    """
    (optimum, _), state, session = refined.solved, refined.state, refined.session
    flight, fine = refined.keep_clear(replace(optimum.draft, guess=optimum.iterate))
    rounds = state.clearance_rounds + 1
    mesh, guess = restrict(fine.mesh, fine.guess, fine.coarser)
    coarse = MeshProposal.first(flight.problem(mesh), guess)

    def finer(coarser: Refined) -> RefinementState:
        following = certified_state(
            session,
            flight,
            fine,
            InitialBarrier.OTHER_MESH,
            session.solvers,
            refined.carry(fine, flight),
            number=state.number,
            before=coarser.solved[0],
            coarser=coarser.solved[0],
        )
        return replace(
            following,
            clearance_rounds=rounds,
            nodes_beside_passings=refined.nodes_beside_passings,
            too_near=refined,
        )

    return RefinementState(
        flight,
        coarse,
        InitialBarrier.OTHER_MESH,
        session.solvers,
        finer,
        refined.carry(coarse, flight),
        number=-1,
        passing=True,
        purpose="the coarser mesh",
        too_near=refined,
    )


def _adapt(refined: Refined) -> MeshProposal | None:
    """Return a better first mesh, or None; where intervals may not be joined only for an optimum made of errors."""
    early = refined.state.number < SETTINGS.adaptations_max and math.isinf(refined.flight.longest_interval)
    return adapt(refined.solved[0], refined.session.settings.certificate, early=early, joining=early)


def solve_single_mesh(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly, measure, and solve again on better meshes until one is good; no other is compared with it.

    Its first meshes only show where the good one has its nodes, so they
    are solved roughly, unless the start is an optimum on a good mesh; on that the optimum is solved as closely as any
    that is certified.
    """
    first = MeshProposal.first(start.problem, start.guess)
    rough = 0.0 if start.barrier.near_optimum else _rough_tolerance(session, 0)
    state = RefinementState(
        start.flight, first, start.barrier, (solver,), _until_good, start.multipliers, compares=False
    )
    return refine_from(session, start, replace(state, rough=rough))


def solve_roughly(session: SolverSession, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly on one mesh, as closely as the next stage needs that starts from it.

    Where that optimum is made of the integrator's errors, or does not keep what is asked of a rough one, others follow
    as in `solve_single_mesh`. A wing too near to a pylon is left to the next stage, whose attitudes differ anyway.
    """
    first = MeshProposal.first(start.problem, start.guess)
    state = RefinementState(
        start.flight, first, start.barrier, (solver,), _until_usable, start.multipliers, compares=False
    )
    return refine_from(session, start, replace(state, rough=SETTINGS.rough_tolerance))


def _until_usable(refined: Refined) -> RefinementState | None:
    """Return the next mesh; None if the next stage can start from the present optimum."""
    return None if refined.state.rough and refined.certificate.holds else _until_good(refined)


def _rough_tolerance(session: SolverSession, number: int) -> float:
    return SETTINGS.rough_tolerance if number < session.settings.mesh.refinements_max else 0.0


def _until_good(refined: Refined) -> RefinementState | None:
    """Return the next mesh; None if the present one is good and its optimum is not a rough one."""
    (optimum, _), state, session = refined.solved, refined.state, refined.session
    better = _adapt(refined) if state.rough else None
    good = better or _good_mesh(refined)
    same_mesh = not good and refined.too_near()
    if not (state.rough or good or same_mesh):
        return None
    # Where the mesh was good already, it is solved on closely.
    flight, draft = refined.keep_clear(good or replace(state.draft, guess=optimum.iterate))
    return replace(
        state,
        flight=flight,
        draft=draft,
        barrier=InitialBarrier.COARSER_MESH if better and not refined.too_near() else refined.barrier,
        solvers=session.solvers,
        multipliers=refined.carry(draft, flight),
        number=state.number + (not same_mesh),
        clearance_rounds=state.clearance_rounds + same_mesh,
        nodes_beside_passings=refined.nodes_beside_passings,
        too_near=refined if same_mesh else None,
        before=optimum,
        rough=_rough_tolerance(session, state.number + 1) if better else 0.0,
    )


def _good_mesh(refined: Refined) -> MeshProposal | None:
    """Return the good mesh, as far as can be predicted from an optimum on another one; None if that is good itself.

    Where the model bounds its intervals, what misses a limit is the integrator's error in some of them, which can be
    predicted.
    """
    optimum, limits = refined.solved[0], refined.session.settings.certificate
    if not optimum.draft.coarser.all():
        return refine_flagged(optimum, limits)
    if not math.isinf(refined.flight.longest_interval):
        return refine_predicted(optimum, limits)
    draft = refine_flagged(optimum, limits)
    if draft is None:
        return None
    cut = np.diff(np.flatnonzero(draft.coarser)) > 1
    return bisect_all(optimum, limits) if cut.mean() > SETTINGS.bisect_all_above else draft


def _finish(start: Start, refined: Refined) -> StageResult:
    """Return the result of a stage: solved if all holds that its certificate measures."""
    (optimum, solution), certificate = refined.solved, refined.certificate
    failed = failures(certificate.failed)
    regularisation = regularisation_share(optimum.problem, optimum.iterate, solution.objective)
    return conclude(
        refined.flight,
        refined.session,
        optimum.problem,
        optimum.iterate,
        outcome=Status.SOLVED if certificate.holds else Status.NOT_CERTIFIED,
        message=f"solved but not certified: {failed}" if failed else "",
        multipliers=solution.multipliers,
        certificate=certificate,
        provenance=replace(start.provenance, regularisation=regularisation),
        mesh=MeshRecord(
            why=optimum.draft.why,
            coarser=optimum.draft.coarser,
            defect=optimum.evidence.check.defect,
            drift=optimum.evidence.drift,
        ),
    )


def _failure_result(session: SolverSession, failures: Sequence[Failure], diagnose: Diagnosis | None) -> StageResult:
    """Return a result without an optimum, which says what stands in the way."""
    solutions = [one for one in failures if one.solution is not None]
    returned = [one for one in solutions if one.solution and one.solution.ending is not Ending.BUDGET_EXHAUSTED]
    claimed = [one for one in returned if one.solution is not None and one.solution.infeasible]
    failure = (claimed or returned or list(failures))[0]
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
    return conclude(start.flight, session, start.problem, last, outcome=outcome, message=message)
