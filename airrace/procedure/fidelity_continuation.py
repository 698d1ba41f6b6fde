"""The ladder: the flight of every stage, and the starts of its joint problem."""

import dataclasses
import functools
import logging
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from airrace.control.simulation import TrackingSimulator, pilot
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.process.deferred_signals import defer_signals
from airrace.optimal_control.solvers.process.pool import SolverPool
from airrace.planning.decisions_from_solution import plan_from_solution
from airrace.planning.plan import Plan, plan
from airrace.planning.race import Race
from airrace.planning.route_decisions import MIRRORED_TIES
from airrace.procedure.certification import conclude
from airrace.procedure.fidelity import fidelity_of, iterate_of
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.homotopy import InfeasibilityTest, solve_homotopy
from airrace.procedure.infeasibility.conflicts import RelaxedRoutes, conflict_location
from airrace.procedure.infeasibility.diagnose import diagnose_infeasibility
from airrace.procedure.infeasibility.local_infeasibility import (
    LocalInfeasibility,
    binding_limit,
    diagnose_window,
    find_local_infeasibility,
)
from airrace.procedure.multistart.coarse_solution import InitialGuess
from airrace.procedure.multistart.local_search import find_faster_route
from airrace.procedure.multistart.multistart import FoundRoutes, search_routes
from airrace.procedure.multistart.search import BUDGETS, SearchBudget
from airrace.procedure.result import Note, NoteKind, SearchReport, Stage, StageResult, Status
from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort, Settings
from airrace.procedure.solve_and_refine import check_mesh_convergence, solve_single_mesh, solve_with_refinement
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import STAGES
from airrace.procedure.stage_problem import StageProblem, formulate, mesh_of
from airrace.procedure.start import InitialBarrier, Start
from airrace.procedure.warm_start import followed, recorded, settled

logger = logging.getLogger(__name__)

CLOSE = 4.0
"""The multiple of the limit of the certificate's `race_time_change` (1) that settles which of two flights is faster.

Flights that were solved on one mesh each, and whose race times differ by less, are proved before the faster one is
chosen. Each mesh may err by about that limit.
"""

LOST = 0.1
"""The time by which an optimum may be slower than the rough one that it started from, s.

On its finer mesh it should be the faster one: by 0.04 s on Rovinj and Air Race X, 0.07 s on San Diego. More means that
another way was proved than the one that was found.
"""


def wanted_stages(settings: Settings, until: Stage) -> list[Stage]:
    """Return the stages of a run; with a guess from the plan there is no homotopy."""
    first = STAGES.index(Stage.HOMOTOPY if settings.guess is GuessKind.HOMOTOPY else Stage.POINT_MASS)
    return list(STAGES[first : STAGES.index(until) + 1])


class FidelityContinuation:
    """The stages of one race, climbed one after the other; `done` holds those that are finished.

    Args:
        first: the stage whose model is made at once.
        last: the stage that a run ends with, which is always proved; None to prove every stage that is climbed.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """

    def __init__(
        self,
        race: Race,
        settings: Settings,
        finished: Sequence[StageResult],
        first: Stage = Stage.POINT_MASS,
        last: Stage | None = None,
    ) -> None:
        self._race = race
        self._settings = settings
        self._last = last
        self._flights: dict[Stage, StageProblem] = {}
        self._pilots: dict[Stage, TrackingSimulator] = {}
        self._pieces: StageResult | None = None
        self._local_infeasibility: LocalInfeasibility | None = None
        self._relaxed: RelaxedRoutes | None = None
        self.done = {result.stage: result for result in finished}
        self.flight(first)  # inputs that contradict each other are told before anything is solved

    def flight(self, stage: Stage) -> StageProblem:
        """Return the model of a stage, made when it is first asked for.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        fidelity = fidelity_of(stage)
        if fidelity.guess:
            return dataclasses.replace(self.flight(Stage.POINT_MASS), fidelity=fidelity)
        if stage not in self._flights:
            with defer_signals():
                self._flights[stage] = formulate(stage, self._race, self._settings)
        return self._flights[stage]

    def make_ready(self, stage: Stage) -> None:
        """Make what a stage needs that does not depend on the stage below it."""
        fidelity = fidelity_of(stage)
        self.flight(stage)
        if fidelity.inner_controller is not None and fidelity.warm_start.same_dynamics_as is None:
            self._pilot(stage)

    def _pilot(self, stage: Stage) -> TrackingSimulator:
        if stage not in self._pilots:
            with defer_signals():
                self._pilots[stage] = pilot(self.flight(stage).model, fidelity_of(stage).controller())
        return self._pilots[stage]

    def climb(self, stage: Stage, session: SolverSession) -> StageResult:
        """Run one stage and return its result; those before it are done."""
        fidelity = fidelity_of(stage)
        if fidelity.guess:
            result = self._homotopy(session)
        elif fidelity.inner_controller is None:
            result = diagnose_infeasibility(
                self._first_optimum(session), self._race, self.flight(stage), session, self._relaxed
            )
        else:
            below = self.done[STAGES[STAGES.index(stage) - 1]]
            climbing = (below, *below.alternatives)
            results = [self._optimum(stage, list(self._handovers(stage, one, session)), session) for one in climbing]
            result = _on_record(_fastest(self._resolve_near_ties(results, session)), session)
        self.done[stage] = result
        return result

    def explores(self, stage: Stage) -> bool:
        """Tell whether other routes are tried in a stage."""
        return stage is Stage.POINT_MASS and self._settings.search is not SearchEffort.OFF

    def proves(self, stage: Stage) -> bool:
        """Tell whether a stage is checked on a second mesh."""
        return proves(self._settings, stage, self._last)

    def complete(self, stage: Stage, session: SolverSession) -> StageResult:
        """Complete the proof of a stage that was solved on one mesh, and of its alternatives.

        Returns:
            The stage, certified; as it was, with a message that says why, where that fails.
        """
        solved = self.done[stage]
        session.restore_log(solved.attempts, solved.timings)
        main, *alternatives = (self._proved(one, session) for one in (solved, *solved.alternatives))
        result = dataclasses.replace(_on_record(main, session), alternatives=tuple(alternatives))
        self.done[stage] = result
        return result

    def _proved(self, optimum: StageResult, session: SolverSession) -> StageResult:
        """Return an optimum with its proof; the optimum itself where there is nothing to prove, or where that fails."""
        if optimum.certified or not optimum.holds:
            return optimum
        found = check_mesh_convergence(self.as_flown(optimum.stage, optimum), optimum, session)
        notes = tuple(note for note in optimum.notes if note.kind is not NoteKind.MESH_CHECK)
        if isinstance(found, StageResult):
            return dataclasses.replace(found, notes=notes)
        failure = Note(NoteKind.MESH_CHECK, f"its race time could not be confirmed on a second mesh: {found}")
        return dataclasses.replace(optimum, notes=(*notes, failure))

    def _optimum(
        self, stage: Stage, starts: Sequence[Callable[[], Start | StageResult]], session: SolverSession
    ) -> StageResult:
        """Return the optimum of a stage, proved where that is wanted, else on one good mesh."""
        refine = None if self.proves(stage) else solve_single_mesh
        # Of the point mass all conflicts are analysed, see `diagnose_infeasibility`.
        diagnose = None if stage is Stage.POINT_MASS else diagnose_window
        return solve_with_refinement(session, starts, refine, diagnose=diagnose)

    def _resolve_near_ties(self, results: Sequence[StageResult], session: SolverSession) -> Sequence[StageResult]:
        """Optima of one stage, proved where their meshes may hide which of them is the fastest.

        Of those, only optima whose proof succeeds still hold, unless none does.
        """
        times = [one.trajectory.race_time if one.holds else math.inf for one in results]
        closest = min(times) + CLOSE * self._settings.certificate.race_time_of(min(times))
        close = [time <= closest < math.inf for time in times]
        if sum(close) < 2:
            return results
        after = [self._proved(one, session) if near else one for one, near in zip(results, close, strict=True)]
        if not any(one.certified for one in after):
            return after
        return [
            dataclasses.replace(one, outcome=Status.NOT_CERTIFIED) if near and not one.certified else one
            for one, near in zip(after, close, strict=True)
        ]

    def find_faster_route(self, optimum: StageResult) -> Callable[[SolverPool], str]:
        """Return the search for a route that is faster than that of another run's optimum.

        It finds words; none where there is no such way, or where none is looked for. What is searched does not depend
        on what is solved meanwhile: the optimum is flown again by the point mass under this race's numbers.
        """
        if self._settings.search is SearchEffort.OFF:
            return _nothing
        flight, source = self.flight(Stage.POINT_MASS), self.as_flown(optimum.stage, optimum)
        if source.model.system.states != optimum.trajectory.states:
            return _nothing  # it flies other equations, and is no start either
        return functools.partial(find_faster_route, flight, source, optimum, self._race.course)

    def _first_optimum(self, session: SolverSession) -> StageResult:
        """Optimise the point mass from what the search found, then from the homotopy and the plan.

        The one that the user prefers comes first.
        """
        if self._local_infeasibility is not None:
            return self._infeasible(self._local_infeasibility, session)
        known = self._first_starts(session)
        budget = BUDGETS.get(self._settings.search)
        if budget is None:
            return self._optimum(Stage.POINT_MASS, known, session)
        found = self._search_routes(budget, session)
        best = found.report(0)
        results: list[StageResult] = []
        for number, start in enumerate(found.starts):
            if number >= self._settings.alternatives and any(_kept(one, best) for one in results):
                break
            results.append(
                self._optimum(Stage.POINT_MASS, [functools.partial(_made, start)], session)
            )  # by all solvers
        if not any(one.holds for one in results):
            results.append(self._optimum(Stage.POINT_MASS, known, session))
        results = list(self._resolve_near_ties(results, session))
        result = _fastest(results)
        winner = _winner(results)
        explored = found.report(winner) if winner < len(found.starts) else best
        _warn(result, explored, best)
        return dataclasses.replace(_on_record(result, session), search=explored)

    def _search_routes(self, budget: SearchBudget, session: SolverSession) -> FoundRoutes:
        """Search routes, with the starts without a search among the starts, so that nothing is lost by it."""
        flight, course, starts = self.flight(Stage.POINT_MASS), self._race.course, list[InitialGuess]()
        if budget.homotopy or Stage.HOMOTOPY in self.done:
            pieces = self._homotopy(session)
            if pieces.outcome is Status.SOLVED:
                starts.append(_initial_guess(flight, pieces))
        mirrored = plan(course, flight.plan.cruise, MIRRORED_TIES)
        own, other = (_planned(flight, way, session) for way in (flight.plan, mirrored))
        starts.append(own)
        if not np.array_equal(own.guess.state, other.guess.state):
            starts.append(other)
        return search_routes(flight, course, session, budget, starts, self._settings.alternatives)

    def _first_starts(self, session: SolverSession) -> Sequence[Callable[[], Start | StageResult]]:
        """Return the homotopy and the plan as starts, the one that the user prefers first."""
        flight, flown = self.flight(Stage.POINT_MASS), self.done.get(Stage.HOMOTOPY)

        def planned() -> Start:
            mesh = first_mesh(flight.plan, session.settings.mesh)
            return Start(flight, flight.problem(mesh), guess(flight.plan, mesh), InitialBarrier.COLD)

        def concatenate_phases() -> Start | StageResult:
            where = ""
            if flown is None:  # nor has the plan led anywhere
                self._relaxed = RelaxedRoutes(self._race, flight, session)
                where = conflict_location(self._relaxed)
            first = self._homotopy(session, plain=bool(where))
            if where and first.notes:  # phases could not be added
                return self._conflicting(where, session)
            if self._local_infeasibility is not None:
                return self._infeasible(self._local_infeasibility, session)
            pieces = first.trajectory
            return Start(flight, flight.problem(mesh_of(pieces)), iterate_of(pieces), InitialBarrier.PIECES)

        return (concatenate_phases, planned) if flown else (planned, concatenate_phases)

    def _homotopy(self, session: SolverSession, *, plain: bool = False) -> StageResult:
        """Return the pieces of the homotopy, which is flown once; `plain` as of `primary_only`."""
        if self._pieces is None:
            flown = self.done.get(Stage.HOMOTOPY)
            infeasible = self._infeasibility_test(session, plain=plain)
            self._pieces = flown or solve_homotopy(self.flight(Stage.HOMOTOPY), session, infeasible)
        return self._pieces

    def _infeasibility_test(self, session: SolverSession, *, plain: bool) -> InfeasibilityTest:
        """Return the question whether a phase contradicts itself, whose answer is kept."""

        def window_is_infeasible(problem: Problem, phase: int, guesses: Sequence[Iterate]) -> bool:
            self._local_infeasibility = find_local_infeasibility(session, problem, phase, guesses, primary_only=plain)
            return self._local_infeasibility is not None

        return window_is_infeasible

    def _conflicting(self, where: str, session: SolverSession) -> StageResult:
        """Return the result of a race whose limits contradict each other at a place."""
        flight = self.flight(Stage.POINT_MASS)
        mesh = first_mesh(flight.plan, session.settings.mesh)
        problem, message = flight.problem(mesh), f"the limits contradict each other at {where}"
        return conclude(flight, session, problem, guess(flight.plan, mesh), outcome=Status.INFEASIBLE, message=message)

    def _infeasible(self, found: LocalInfeasibility, session: SolverSession) -> StageResult:
        """Return the result of a race that cannot be flown, which says what stands in the way."""
        message = binding_limit(session, found)
        flight = self.flight(Stage.POINT_MASS)
        return conclude(flight, session, found.problem, found.guess, outcome=Status.INFEASIBLE, message=message)

    def _handovers(self, stage: Stage, below: StageResult, session: SolverSession) -> Iterator[Callable[[], Start]]:
        """Yield the starts of a higher fidelity: along the stage below, at rest in it, at rest in the point mass."""
        yield functools.partial(self._handed_over, stage, below, session)
        yield functools.partial(self._at_rest, stage, below)
        point_mass = self.done.get(Stage.POINT_MASS)  # a run started from another may lack it
        is_rival = below is not self.done[below.stage]  # which goes another way than the point mass
        if point_mass is not None and below is not point_mass and not is_rival:
            yield functools.partial(self._at_rest, stage, point_mass)

    def _at_rest(self, stage: Stage, optimum: StageResult) -> Start:
        with defer_signals():
            return settled(self.as_flown(stage, optimum), self.as_flown(optimum.stage, optimum), optimum)

    def _handed_over(self, stage: Stage, optimum: StageResult, session: SolverSession) -> Start:
        flight, below = self.as_flown(stage, optimum), self.as_flown(optimum.stage, optimum)
        if flight.fidelity.warm_start.same_dynamics_as is optimum.stage:
            return recorded(flight, below, optimum)
        session.progress.activity(f"flying along the optimum of {optimum.stage.value} by error feedback", 0, 0)
        with defer_signals():
            return followed(flight, self._pilot(stage), below, optimum)

    def as_flown(self, stage: Stage, optimum: StageResult) -> StageProblem:
        """Return a stage's model, planned as an optimum goes round."""
        flight = self.flight(stage)
        way = plan_from_solution(self._race.course, flight.plan.cruise, optimum.trajectory)
        return dataclasses.replace(flight, plan=way)


def proves(settings: Settings, stage: Stage, last: Stage | None) -> bool:
    """Tell whether a stage of a run up to `last` is checked on a second mesh; `last` is None where every stage is."""
    return settings.mesh_check is MeshCheck.ALL or last is None or stage is last


def _fastest(results: Sequence[StageResult]) -> StageResult:
    """Return the fastest of the results that hold, the others its alternatives; the first if none holds."""
    fastest = results[_winner(results)]
    others = [one for one in results if one.holds and one is not fastest]
    return dataclasses.replace(fastest, alternatives=tuple(sorted(others, key=lambda one: one.trajectory.race_time)))


def _winner(results: Sequence[StageResult]) -> int:
    """Return the number of the fastest of the results that hold; 0 if none does."""
    times = [one.trajectory.race_time if one.holds else math.inf for one in results]
    return times.index(min(times))


def _on_record(result: StageResult, session: SolverSession) -> StageResult:
    """Return a result with the record of all that was solved for its stage, before it and after it."""
    return dataclasses.replace(result, attempts=tuple(session.attempts), timings=session.timings())


def _warn(result: StageResult, explored: SearchReport, best: SearchReport) -> None:
    """Warn of what a user should look at: loops that are left, and a better way that could not be confirmed."""
    for loop in explored.loops:
        logger.warning("the flight may hold a needless loop: %s", loop)
    if result.holds and not _kept(result, best):
        logger.warning(
            "the best route took %.2f s when solved coarsely but failed the final check; the %s flight, another one, "
            "takes %.2f s",
            *(best.routes[0].race_time, result.status.value, result.trajectory.race_time),
        )


def _kept(result: StageResult, explored: SearchReport) -> bool:
    """Tell whether a flight holds and is about as fast as the best way was when it was solved coarsely."""
    if not result.holds or not explored.routes:
        return result.holds
    return result.trajectory.race_time <= explored.routes[0].race_time + LOST


def _made(start: Start) -> Start:
    return start


def _nothing(_: SolverPool) -> str:
    return ""


def _planned(flight: StageProblem, way: Plan, session: SolverSession) -> InitialGuess:
    """Return a plan as an initial guess, on the mesh on which the race's own is solved without a search."""
    mesh = first_mesh(way, session.settings.mesh)
    return InitialGuess(
        dataclasses.replace(flight, plan=way), mesh, guess(way, mesh), InitialBarrier.COLD, is_baseline=True
    )


def _initial_guess(flight: StageProblem, pieces: StageResult) -> InitialGuess:
    """Return the pieces of a homotopy as an initial guess."""
    return InitialGuess(
        flight, mesh_of(pieces.trajectory), iterate_of(pieces.trajectory), InitialBarrier.PIECES, is_baseline=True
    )
