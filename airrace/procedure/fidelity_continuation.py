"""The fidelity continuation: the stages of one race in order, each started from the one before."""

import dataclasses
import functools
import logging
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from airrace.control.simulation import TrackingSimulator, tracking_simulator
from airrace.interrupts import defer_signals
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.service import SolverPool, SolverService
from airrace.planning.plan import plan, plan_from_solution, plan_with_room
from airrace.planning.route_decisions import MIRRORED_TIES
from airrace.procedure.certification import conclude
from airrace.procedure.choice import SAME_FLIGHT, fastest_of, place_of, simplest_of, with_note_on_faster
from airrace.procedure.complexity import FlightComplexity, complexity_of
from airrace.procedure.fidelity import fidelity_of, iterate_of, stage_model
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.homotopy import solve_homotopy
from airrace.procedure.infeasibility.conflicts import RelaxedRoutes, conflict_location
from airrace.procedure.infeasibility.diagnose import diagnose_infeasibility
from airrace.procedure.infeasibility.local_infeasibility import (
    LocalInfeasibility,
    binding_limit,
    diagnose_window,
    find_local_infeasibility,
)
from airrace.procedure.mesh_check import check_mesh_convergence
from airrace.procedure.multistart.coarse_solution import CoarseSolution, InitialGuess, planned_guess, solve_coarse
from airrace.procedure.multistart.multistart import FoundRoutes, RoutesAround, search_around, search_routes
from airrace.procedure.multistart.search import BUDGETS, SearchBudget, planned_starts
from airrace.procedure.result import Note, NoteKind, PylonCondition, PylonSide, SearchReport, StageResult, Status
from airrace.procedure.settings import GuessKind, MeshCheck, MeshSettings, SearchEffort, Settings
from airrace.procedure.solve_and_refine import (
    Failure,
    Refinement,
    solve_certified,
    solve_roughly,
    solve_single_mesh,
    solve_with_refinement,
)
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import STAGES, Stage
from airrace.procedure.stage_problem import StageProblem, coarse_mesh, formulate, mesh_of, without_pilot_limits
from airrace.procedure.warm_start import InitialBarrier, Start, map_controls, track, trimmed_start
from airrace.race import Race
from airrace.system import SYMBOLS

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True)
class ChoiceThresholds:
    """The numbers by which one of several flights is chosen.

    Attributes:
        near_tie: the multiple of the limit of the certificate's `race_time_change` (1) that settles which of
            two flights is faster. The meshes of flights that were solved on one mesh each, and whose race times
            differ by less, are checked before the faster one is chosen. Each mesh may err by about that limit.
        loss_max: the time by which an optimum may be slower than the rough one that it started from, s. On its
            finer mesh it should be the faster one: by 0.04 s on Rovinj and Air Race X, 0.07 s on San Diego.
            More means that another route was certified than the one that was found.
        other_sides_max: how often at most the pylons beside the fastest flight are passed on their other sides,
            one at a time.
        other_side_iterations_max: the largest number of iterations of the first solve on another side. Some that
            led to a flight took 9 to 19; two that led to none took 900 together, three times as long as from scratch.
    """

    near_tie: float = 4.0
    loss_max: float = 0.1
    other_sides_max: int = 3
    other_side_iterations_max: int = 60


CHOICE = ChoiceThresholds()


CARRIED_MAX, CARRIED_LAG = 2, 0.05
"""How many routes go through all stages where the settings do not say, and their largest lag, s.

The order of routes at six-dof is another one than at the point mass on two of four courses, where rolls differ.
"""
Side = tuple[str, int, int, PylonSide]
"""Element and number of a pylon, the leg, and where it stands as the pilot passes it there."""


def wanted_stages(settings: Settings, until: Stage) -> list[Stage]:
    """Return the stages of a run; with a guess from the plan there is no homotopy."""
    first = STAGES.index(Stage.HOMOTOPY if settings.guess is GuessKind.HOMOTOPY else Stage.POINT_MASS)
    return list(STAGES[first : STAGES.index(until) + 1])


def checks_mesh(settings: Settings, stage: Stage, last: Stage | None) -> bool:
    """Tell whether a stage of a run up to `last` is checked on a second mesh; `last` is None where every stage is."""
    return settings.mesh_check is MeshCheck.ALL or last is None or stage is last


class FidelityContinuation:
    """The stages of one race, solved one after the other; `done` holds those that are finished.

    Args:
        first: the stage that a run begins with.
        last: the stage that a run ends with, whose mesh is always checked; None to check that of every stage. The
            equations from the first stage to the last, or of the first alone, are made at once.

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
        self._simulators: dict[Stage, TrackingSimulator] = {}
        self._pieces: StageResult | None = None
        self._local_infeasibility: LocalInfeasibility | None = None
        self._relaxed: RelaxedRoutes | None = None  # made when it is first asked for
        self._coarse_plans: list[CoarseSolution | None] | None = None
        self.done = {result.stage: result for result in finished}
        for stage in STAGES[STAGES.index(first) : STAGES.index(last or first) + 1]:
            stage_model(stage, race)  # inputs that contradict each other are reported before anything is solved

    def flight(self, stage: Stage) -> StageProblem:
        """Return the model of a stage, made when it is first asked for.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        fidelity = fidelity_of(stage)
        if stage not in self._flights:
            with SYMBOLS, defer_signals():
                if fidelity.guess:
                    flight = without_pilot_limits(self.flight(Stage.POINT_MASS), self._race)
                    self._flights[stage] = dataclasses.replace(flight, fidelity=fidelity)
                else:
                    self._flights[stage] = formulate(stage, self._race, self._settings)
        return self._flights[stage]

    def along(self, stage: Stage, optimum: StageResult) -> StageProblem:
        """Return a stage's model, planned as an optimum goes round."""
        flight = self.flight(stage)
        route = plan_from_solution(self._race.course, flight.plan.cruise, optimum.trajectory)
        return dataclasses.replace(flight, plan=route).with_conditions(optimum.pylon_conditions)

    def preload(self, stage: Stage, service: SolverService) -> None:
        """Let a solver process load the equations of a stage, the scheme that integrates them, and what is observed."""
        conditions = [one for result in self.done.values() for one in result.pylon_conditions]
        flight = self.flight(stage).with_conditions(conditions)
        problem = flight.problem([(1.0,)] * (len(flight.plan.waypoints) - 1))
        service.preload(problem.system, problem.scheme, problem.observations)

    def prepare(self, stage: Stage) -> None:
        """Make what a stage needs that does not depend on the stage below it."""
        fidelity = fidelity_of(stage)
        self.flight(stage)
        if fidelity.inner_controller is not None and fidelity.warm_start.same_dynamics_as is None:
            self._simulator(stage)

    def _simulator(self, stage: Stage) -> TrackingSimulator:
        if stage not in self._simulators:
            with SYMBOLS, defer_signals():
                self._simulators[stage] = tracking_simulator(self.flight(stage).model, fidelity_of(stage).controller())
        return self._simulators[stage]

    def solve_stage(self, stage: Stage, session: SolverSession) -> StageResult:
        """Run one stage and return its result; those before it are done."""
        fidelity = fidelity_of(stage)
        if fidelity.guess:
            result = self._homotopy_beside_plans(session)
        elif fidelity.inner_controller is None:
            result = self._point_mass(session)
            # By then it is known whether the limits were relaxed before anything was solved.
            result = diagnose_infeasibility(result, self._race, self.flight(stage), session, self._relaxed)
        else:
            below = self.done[STAGES[STAGES.index(stage) - 1]]
            self.prepare(stage)
            jobs: list[Callable[[SolverSession], StageResult | Failure]]
            jobs = [functools.partial(self._optimum_above, stage, below)]
            jobs += [functools.partial(self._alternative_above, stage, one) for one in below.alternatives]
            found = [one for one in session.side_by_side(jobs) if isinstance(one, StageResult)]
            result = _with_log(self._chosen(found), session)
        self.done[stage] = result
        return result

    def searches(self, stage: Stage) -> bool:
        """Tell whether other routes are tried in a stage."""
        return stage is Stage.POINT_MASS and self._settings.search is not SearchEffort.OFF

    def checks_mesh(self, stage: Stage) -> bool:
        """Tell whether a stage is checked on a second mesh."""
        return checks_mesh(self._settings, stage, self._last)

    def check_mesh(self, stage: Stage, session: SolverSession) -> StageResult:
        """Check the mesh of a stage that was solved on a single one, and those of its alternatives.

        Of routes that were solved roughly one is chosen anew: their race times could not tell.

        Returns:
            The stage, certified; as it was, with a note that says why, where that fails.
        """
        solved = self.done[stage]
        session.restore_log(solved.attempts, solved.timings)
        routes = solved, *solved.alternatives
        main, *alternatives = session.side_by_side([functools.partial(self.confirm_mesh, one) for one in routes])
        if any(one.is_rough for one in routes):
            result = self._chosen([main, *alternatives])
        else:
            result = dataclasses.replace(main, alternatives=tuple(alternatives))
        self.done[stage] = _with_log(result, session)
        return self.done[stage]

    def confirm_mesh(self, optimum: StageResult, session: SolverSession) -> StageResult:
        """Return an optimum with its mesh checked; the optimum itself where there is nothing to check or that fails."""
        if optimum.certified or not optimum.holds:
            return optimum
        found = check_mesh_convergence(self.along(optimum.stage, optimum), optimum, session)
        notes = tuple(note for note in optimum.notes if note.kind is not NoteKind.MESH_CHECK)
        if isinstance(found, StageResult):
            return dataclasses.replace(found, notes=notes)
        failure = Note(NoteKind.MESH_CHECK, f"its race time could not be confirmed on a second mesh: {found}")
        return dataclasses.replace(optimum, notes=(*notes, failure))

    def _optimum(
        self, stage: Stage, starts: Sequence[Callable[[], Start | StageResult]], session: SolverSession
    ) -> StageResult:
        """Return the optimum of a stage, certified where that is wanted, else on a single mesh."""
        # Of the point mass all conflicts are analysed, see `diagnose_infeasibility`.
        diagnose = None if stage is Stage.POINT_MASS else diagnose_window
        return solve_with_refinement(session, starts, self._refinement(stage), diagnose=diagnose)

    def _refinement(self, stage: Stage) -> Refinement:
        if self.checks_mesh(stage):
            return solve_certified
        # Routes are chosen among by the point mass's race times; the other stages only lead to the next one.
        return solve_single_mesh if stage is Stage.POINT_MASS else solve_roughly

    def _optimum_above(self, stage: Stage, below: StageResult, session: SolverSession) -> StageResult:
        """Return the optimum of a stage from that of the stage below."""
        self.preload(stage, session.service)
        return self._optimum(stage, list(self._warm_starts(stage, below, session)), session)

    def _alternative_above(self, stage: Stage, below: StageResult, session: SolverSession) -> StageResult | Failure:
        """Return the first optimum of a stage that the primary solver finds, for a route beside the fastest.

        There is that route as well, so nothing else is tried where this optimum does not hold.
        """
        found, refine = None, self._refinement(stage)
        self.preload(stage, session.service)
        for make in self._warm_starts(stage, below, session):
            found = refine(session, make(), session.solvers[0])
            if isinstance(found, StageResult):
                break
        assert found is not None  # every stage has starts
        return found

    def _resolve_near_ties(self, results: Sequence[StageResult], session: SolverSession) -> Sequence[StageResult]:
        """Check the meshes of optima of one stage where they may hide which of them are the fastest.

        Of those, only optima whose check succeeds still hold, unless none does.
        """
        times = [one.trajectory.race_time if one.holds else math.inf for one in results]
        closest = min(times) + self._resolution(min(times))
        close = [time <= closest < math.inf for time in times]
        if sum(close) <= (self._settings.alternatives or CARRIED_MAX):  # all of them are carried on
            return results
        checks = [functools.partial(self.confirm_mesh, one) for one, near in zip(results, close, strict=True) if near]
        checked = iter(session.side_by_side(checks))
        after = [next(checked) if near else one for one, near in zip(results, close, strict=True)]
        if not any(one.certified for one in after):
            return after
        return [
            dataclasses.replace(one, outcome=Status.NOT_CERTIFIED) if near and not one.certified else one
            for one, near in zip(after, close, strict=True)
        ]

    def _resolution(self, race_time: float) -> float:
        """Return the difference of race times that two flights solved on one mesh each may owe to their meshes, s."""
        return CHOICE.near_tie * self._settings.certificate.race_time_of(race_time)

    def _chosen(self, results: Sequence[StageResult]) -> StageResult:
        """Return the result that is chosen, with others that are to be carried on.

        Those are as many as the settings say, else those that are hardly slower. Race times of rough optima are too
        long by different amounts: what they may be off by leaves no route out, nor makes two routes one.
        """
        chosen, wanted, rough = self.choice(results), self._settings.alternatives, any(one.is_rough for one in results)
        error = self._resolution(chosen.trajectory.race_time) if rough else 0.0
        chosen = chosen if rough else self.with_note_on_faster(chosen, results)
        others, longest = list[StageResult](), math.inf if wanted else chosen.trajectory.race_time + CARRIED_LAG + error
        for one in sorted(results, key=lambda one: one.trajectory.race_time):
            known = [each.trajectory.race_time for each in (chosen, *others)]
            differs = wanted or rough or min(abs(one.trajectory.race_time - each) for each in known) > SAME_FLIGHT
            is_chosen = one.trajectory is chosen.trajectory
            if one.holds and not is_chosen and differs and one.trajectory.race_time <= longest:
                others.append(one)
        return dataclasses.replace(chosen, alternatives=tuple(others[: (wanted or CARRIED_MAX) - 1]))

    def choice(self, results: Sequence[StageResult]) -> StageResult:
        """Return the simplest to fly of the fastest results that hold, see `simplest_of`."""
        return simplest_of(results, self._complexity)

    def with_note_on_faster(self, chosen: StageResult, results: Sequence[StageResult]) -> StageResult:
        """Return a result that was chosen with a note on what the fastest would have saved, if it is another one."""
        return with_note_on_faster(chosen, results, self._complexity)

    def _complexity(self, result: StageResult) -> FlightComplexity:
        return complexity_of(self.flight(result.stage), result.trajectory)

    def search_around(self, optimum: StageResult) -> Callable[[SolverPool], RoutesAround | None]:
        """Return the search around another run's optimum for a faster route; it finds None where none is looked for.

        What is searched does not depend on what is solved meanwhile: the optimum is solved by the point mass under this
        race's numbers.
        """
        if self._settings.search is SearchEffort.OFF:
            return lambda _: None
        flight, source = self.flight(Stage.POINT_MASS), self.along(optimum.stage, optimum)
        return functools.partial(search_around, flight, source, optimum, self._race.course, self._settings.mesh)

    def refine_route(self, found: CoarseSolution, session: SolverSession) -> StageResult:
        """Return the point mass's optimum from a rough one."""
        barrier = InitialBarrier.COARSE
        start = Start(found.flight, found.problem, found.iterate, barrier, multipliers=found.multipliers)
        return self._optimum_from(start, session)

    def _optimum_from(self, start: Start, session: SolverSession) -> StageResult:
        """Return the point mass's optimum from a start."""
        return self._optimum(Stage.POINT_MASS, [lambda: start], session)

    def _point_mass(self, session: SolverSession) -> StageResult:
        """Optimise the point mass from what the search found, then from the homotopy and the plan.

        The one that the user prefers comes first.
        """
        known, budget = self._first_starts(session), BUDGETS.get(self._settings.search)
        hopeless = self._local_infeasibility is not None and not any(self._coarse_plans or ())
        if hopeless and self._flight_with_room() is None:
            return self._optimum(Stage.POINT_MASS, known, session)
        if budget is None:
            return self._optimum(Stage.POINT_MASS, known, session)
        found = self._search_routes(budget, session)
        best = found.report(0)
        wanted = max(found.near, self._settings.alternatives or 1)
        jobs = [functools.partial(self._optimum_from, one) for one in found.starts]
        results = session.side_by_side(jobs[:wanted])
        for job in jobs[wanted:]:
            if any(_confirms(one, best) for one in results):
                break
            results.append(job(session))
        if not any(one.holds for one in results):
            results.append(self._optimum(Stage.POINT_MASS, known, session))
        started, origin = len(results), place_of(fastest_of(results), results)
        results = list(self._resolve_near_ties(self.with_other_sides(results, session), session))
        result = self._chosen(results)
        winner = place_of(result, results)
        if winner >= started:  # past a pylon on its other side, on the route of the fastest before
            winner = origin
        report = found.report(winner) if winner < len(found.starts) else best
        for loop in report.loops:
            logger.warning("the flight may hold a needless loop: %s", loop)
        if result.holds and not _confirms(result, best):
            logger.warning(
                "the best route took %.2f s when solved coarsely but failed the final check; the %s flight, another "
                "one, takes %.2f s",
                *(best.routes[0].race_time, result.status.value, result.trajectory.race_time),
            )
        return dataclasses.replace(_with_log(result, session), search=report)

    def with_other_sides(self, results: Sequence[StageResult], session: SolverSession) -> list[StageResult]:
        """Return results of a stage, and faster ones that pass pylons on other sides than the fastest of them.

        On which side a flight comes by a pylon that it need not pass is chance, and may cost tenths of a second.
        What is tried takes nothing from the budget.
        """
        found, tried, spent = list(results), set[frozenset[Side]](), session.budget.spent
        for _ in range(CHOICE.other_sides_max):
            fastest = fastest_of(found)
            tried.add(_sides(fastest.pylon_conditions))
            solved = session.side_by_side(self._on_other_sides(fastest, tried))
            least = fastest.trajectory.race_time - SAME_FLIGHT
            faster = [one for one in solved if isinstance(one, StageResult) and one.trajectory.race_time < least]
            faster = [one for one in faster if one.certified or (one.holds and not fastest.certified)]
            if not faster:
                break
            found += faster
        session.budget.spent = spent
        return found

    def _on_other_sides(
        self, optimum: StageResult, tried: set[frozenset[Side]]
    ) -> list[Callable[[SolverSession], StageResult | Failure]]:
        """Return solves that start from an optimum and pass one pylon each on its other side, as was not tried yet."""
        if not optimum.holds:
            return []
        flight, (mesh, iterate) = self.along(optimum.stage, optimum), coarse_mesh(optimum)
        if flight.rooms is None:
            return []
        refine, race_time = solve_certified if optimum.certified else solve_single_mesh, optimum.trajectory.race_time
        slowest = race_time + self._resolution(race_time)

        def solve(session: SolverSession, conditions: tuple[PylonCondition, ...]) -> StageResult | Failure:
            other = flight.with_conditions(conditions)
            start = Start(
                other,
                other.problem(mesh),
                iterate,
                InitialBarrier.PIECES,
                optimum.provenance,
                iterations_max=CHOICE.other_side_iterations_max,
                race_time_max=slowest,
            )
            return refine(session, start, session.solvers[0])

        jobs: list[Callable[[SolverSession], StageResult | Failure]] = []
        for conditions in flight.rooms.on_other_sides(flight.plan, flight.problem(mesh), iterate):
            if (sides := _sides(conditions)) not in tried:
                tried.add(sides)
                jobs.append(functools.partial(solve, conditions=conditions))
        return jobs

    def _search_routes(self, budget: SearchBudget, session: SolverSession) -> FoundRoutes:
        """Search routes, with the starts of a run without a search among the starts, so that none is lost by it."""
        flight, course, starts = self.flight(Stage.POINT_MASS), self._race.course, list[InitialGuess]()
        if self._local_infeasibility is None and (budget.homotopy or Stage.HOMOTOPY in self.done):
            pieces = self._homotopy(session)
            if pieces.outcome is Status.SOLVED:
                mesh, iterate = mesh_of(pieces.trajectory), iterate_of(pieces.trajectory)
                starts.append(InitialGuess(flight, mesh, iterate, InitialBarrier.PIECES, is_baseline=True))
        solved = self._coarse_plans
        if solved is None:
            starts += self._plans(budget, session.settings.mesh)
        elif not any(solved):
            starts += self._starts_with_room(budget)
        return search_routes(
            flight, course, session, budget, starts, self._settings.alternatives or 1, solved=solved or ()
        )

    def _plans(self, budget: SearchBudget, mesh_settings: MeshSettings) -> list[InitialGuess]:
        """Return the plan that a run without a search starts from, with ties decided either way, and the budget's."""
        flight, course, starts = self.flight(Stage.POINT_MASS), self._race.course, list[InitialGuess]()
        for route in (flight.plan, plan(course, flight.plan.cruise, MIRRORED_TIES)):
            along, mesh = dataclasses.replace(flight, plan=route), first_mesh(route, mesh_settings)
            start = InitialGuess(along, mesh, guess(route, mesh), InitialBarrier.COLD, is_baseline=True)
            if not starts or not np.array_equal(starts[-1].guess.state, start.guess.state):
                starts.append(start)
        return [*starts, *planned_starts(flight, course, budget)]

    def _flight_with_room(self) -> StageProblem | None:
        """Return the point mass along a plan with room; None where its own plan has it.

        A flight rises over a line that its plan crosses: where a ceiling forbids that, it has to turn the other way.
        Where it would rise too steeply, a solve from a longer way finds how to; likewise where it would pass gates too
        aslant for its wing.
        """
        flight = self.flight(Stage.POINT_MASS)
        other = plan_with_room(self._race.course, flight.plan)
        return None if other is None else dataclasses.replace(flight, plan=other)

    def _starts_with_room(self, budget: SearchBudget) -> list[InitialGuess]:
        """Return plans with room of the race's own radius and those of the budget."""
        flight, course = self.flight(Stage.POINT_MASS), self._race.course
        paces = (flight.plan.cruise, *(one.scale(flight.plan.cruise) for one in budget.radii))
        roomy = ((pace, plan_with_room(course, plan(course, pace))) for pace in paces)
        # A run without a search starts from the first of them, too.
        return [
            dataclasses.replace(planned_guess(flight, one, InitialBarrier.COLD), is_baseline=pace is paces[0])
            for pace, one in roomy
            if one is not None
        ]

    def _homotopy_beside_plans(self, session: SolverSession) -> StageResult:
        """Return the pieces of the homotopy, and solve the plans of the search meanwhile: they do not depend on it."""
        budget = BUDGETS.get(self._settings.search)
        if budget is None or self._last is Stage.HOMOTOPY:
            return self._homotopy(session)
        plans = self._plans(budget, session.settings.mesh)
        jobs: list[Callable[[SolverSession], StageResult | CoarseSolution | None]] = [self._homotopy]
        jobs += [functools.partial(_solve_plan, one) for one in plans]
        pieces, *solved = session.side_by_side(jobs)
        assert isinstance(pieces, StageResult)
        self._coarse_plans = [one for one in solved if not isinstance(one, StageResult)]
        return pieces

    def _first_starts(self, session: SolverSession) -> Sequence[Callable[[], Start | StageResult]]:
        """Return the homotopy and plans as starts, the one that the user prefers first.

        A homotopy that is infeasible comes last, for it ends the stage.
        """
        flight, pieces = self.flight(Stage.POINT_MASS), self.done.get(Stage.HOMOTOPY)

        def planned_start(along: StageProblem) -> Start:
            return Start(along, *self._plan_guess(along, session), InitialBarrier.COLD)

        def concatenate_phases() -> Start | StageResult:
            if pieces is None:  # nor has the plan led anywhere
                self._conflict(session)
            first = self._homotopy(session)
            has_failed = any(one.kind is NoteKind.PLANNED_PHASES for one in first.notes)
            if has_failed and (where := self._conflict(session)):
                message = f"the limits contradict each other at {where}"
                return self._infeasible(session, *self._plan_guess(flight, session), message)
            if self._local_infeasibility is not None:
                return self._locally_infeasible(self._local_infeasibility, session)
            problem = flight.problem(mesh_of(first.trajectory))
            return Start(flight, problem, iterate_of(first.trajectory), InitialBarrier.PIECES)

        roomy = self._flight_with_room()
        planned, other = ([] if one is None else [functools.partial(planned_start, one)] for one in (flight, roomy))
        if self._local_infeasibility is not None:
            return [*other, concatenate_phases]
        return [concatenate_phases, *planned, *other] if pieces else [*planned, *other, concatenate_phases]

    def _plan_guess(self, flight: StageProblem, session: SolverSession) -> tuple[Problem, Iterate]:
        """Return the problem of a flight on its first mesh, and its guess from the plan."""
        mesh = first_mesh(flight.plan, session.settings.mesh)
        return flight.problem(mesh), guess(flight.plan, mesh)

    def _conflict(self, session: SolverSession) -> str:
        """Return the place at which limits have to give way along every plan; empty if there is none."""
        if self._relaxed is None:
            self._relaxed = RelaxedRoutes(self._race, self.flight(Stage.POINT_MASS), session.settings.mesh)
        return conflict_location(self._relaxed.solve(session))

    def _homotopy(self, session: SolverSession) -> StageResult:
        """Return the pieces of the homotopy, which is solved once."""

        def is_in_conflict() -> bool:
            return bool(self._conflict(session))

        def window_is_infeasible(problem: Problem, phase: int, guesses: Sequence[Iterate]) -> bool:
            self._local_infeasibility = find_local_infeasibility(session, problem, phase, guesses, is_in_conflict)
            return self._local_infeasibility is not None

        if self._pieces is None:
            solved = self.done.get(Stage.HOMOTOPY)
            self._pieces = solved or solve_homotopy(self.flight(Stage.HOMOTOPY), session, window_is_infeasible)
        return self._pieces

    def _locally_infeasible(self, found: LocalInfeasibility, session: SolverSession) -> StageResult:
        """Return the result of a race that is infeasible around a phase, which says what stands in the way."""
        return self._infeasible(session, found.problem, found.guess, binding_limit(session, found))

    def _infeasible(self, session: SolverSession, problem: Problem, iterate: Iterate, message: str) -> StageResult:
        flight = self.flight(Stage.POINT_MASS)
        return conclude(flight, session, problem, iterate, outcome=Status.INFEASIBLE, message=message)

    def start_along(self, stage: Stage, below: StageResult, session: SolverSession) -> Start:
        """Return the start of a higher fidelity along the optimum of a lower one."""
        flight, source = self.along(stage, below), self.along(below.stage, below)
        if flight.fidelity.warm_start.same_dynamics_as is below.stage:
            return map_controls(flight, source, below)
        session.progress.activity(f"flying along the optimum of {below.stage.value} by error feedback", 0, 0)
        with defer_signals():
            return track(flight, self._simulator(stage), source, below)

    def _warm_starts(self, stage: Stage, below: StageResult, session: SolverSession) -> Iterator[Callable[[], Start]]:
        """Yield the starts of a higher fidelity: along the stage below, trimmed in it, trimmed in the point mass."""

        def trimmed_in(optimum: StageResult) -> Start:
            with SYMBOLS, defer_signals():
                return trimmed_start(self.along(stage, optimum), self.along(optimum.stage, optimum), optimum)

        yield functools.partial(self.start_along, stage, below, session)
        yield functools.partial(trimmed_in, below)
        point_mass = self.done.get(Stage.POINT_MASS)  # a run started from another may lack it
        is_alternative = below is not self.done[below.stage]  # which goes another route than the point mass
        if point_mass is not None and below is not point_mass and not is_alternative:
            yield functools.partial(trimmed_in, point_mass)


def _with_log(result: StageResult, session: SolverSession) -> StageResult:
    """Return a result with the record of all that was solved for its stage, before it and after it."""
    return dataclasses.replace(result, attempts=tuple(session.attempts), timings=session.timings())


def _confirms(result: StageResult, report: SearchReport) -> bool:
    """Tell whether a flight holds and is about as fast as the best route was when it was solved coarsely."""
    if not result.holds or not report.routes:
        return result.holds
    return result.trajectory.race_time <= report.routes[0].race_time + CHOICE.loss_max


def _sides(conditions: Sequence[PylonCondition]) -> frozenset[Side]:
    """Return on which side every pylon is passed on every leg."""
    return frozenset((one.element, one.post, one.leg, one.side) for one in conditions)


def _solve_plan(start: InitialGuess, session: SolverSession) -> CoarseSolution | None:
    return solve_coarse(session.service, start)
