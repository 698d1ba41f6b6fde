"""The optimisation procedure, section 4 of the paper: the stages in order, each started from the one before.

1. Homotopy: a first flight of the point mass, phase by phase. Plans of the search are solved coarsely meanwhile.
2. Search: the joint problem has many local optima, so flights on other routes are looked for on coarse meshes.
3. Point mass: the best of these routes are solved over all phases jointly, and the fastest ones are carried on. A
   thorough search goes on by prices from there.
4. Transfer functions, state space with inversion and without, six degrees of freedom: each stage starts from the
   flights of the stage before, followed by its own model, or trimmed in them.
5. Mesh check: the race time of the stage that is the answer is confirmed on a second mesh.
"""

import functools
import logging
import math
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace

from airrace.model.dynamics import handling
from airrace.optimal_control.native.library import MISSING, library_path
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure.certification import conclude
from airrace.procedure.choice import (
    SAME_FLIGHT,
    fastest_of,
    index_of,
    is_same_flight,
    mesh_resolution,
    simplest_of,
    with_note_on_faster,
)
from airrace.procedure.fidelity import fidelity_of, iterate_of, stage_model
from airrace.procedure.first_solutions import (
    FirstSolutions,
    relaxed_race,
    solve_homotopy_and_plans,
    solve_homotopy_pieces,
)
from airrace.procedure.homotopy import HomotopyOutcome
from airrace.procedure.infeasibility.conflicts import RelaxedRace, conflict_location
from airrace.procedure.infeasibility.diagnose import diagnose_infeasibility
from airrace.procedure.infeasibility.local_infeasibility import (
    binding_limit,
    diagnose_window,
)
from airrace.procedure.mesh_check import check_mesh
from airrace.procedure.mesh_loop import Failure, MeshStrategy, solve_certified, solve_from_starts
from airrace.procedure.multistart.coarse_solution import InitialGuess
from airrace.procedure.multistart.multistart import search_routes
from airrace.procedure.multistart.plans import guess_of_optimum, plans_to_search, plans_with_room, replanned_with_room
from airrace.procedure.multistart.search import QUICK
from airrace.procedure.planning.plan import plan_race
from airrace.procedure.pylon_sides import with_other_sides
from airrace.procedure.recomputation import recertify, recompute
from airrace.procedure.restart import SourceRun, start_from
from airrace.procedure.result import Note, NoteKind, Progress, PylonCondition, SearchReport, StageResult, Status
from airrace.procedure.schedule import Schedule, checks_mesh, schedule, stages_of_run
from airrace.procedure.settings import SearchEffort, Settings
from airrace.procedure.single_mesh import solve_roughly, solve_single_mesh
from airrace.procedure.solver_session import Budget, SolverSession
from airrace.procedure.stage import STAGES, Stage
from airrace.procedure.stage_models import StageModels, start_along, start_trimmed
from airrace.procedure.stage_problem import StageProblem, mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start, planned_start
from airrace.race import Race

logger = logging.getLogger(__name__)

__all__ = ["STAGES", "optimize", "recertify", "recompute"]

CARRIED_MAX = 2
"""How many routes go through all stages where the settings do not say.

The order of routes at six-dof is another one than at the point mass on two of four courses, where rolls differ.
"""
CARRIED_LAG = 0.05
"""The largest lag of a route that is carried on, s."""
LOSS_MAX = 0.1
"""The time by which an optimum may be slower than the coarse one that it started from, s: it is the faster one by 0.04
s on Rovinj and Air Race X, 0.07 s on San Diego. More means that another route was certified."""


def mesh_strategy(settings: Settings, stage: Stage, last: Stage | None) -> MeshStrategy:
    """Return how closely a stage of a run up to `last` is solved: certified, on one good mesh, or roughly."""
    if checks_mesh(settings, stage, last):
        return solve_certified
    # Routes are chosen among by the point mass's race times; the other stages only lead to the next one.
    return solve_single_mesh if stage is Stage.POINT_MASS else solve_roughly


def optimize(
    race: Race,
    settings: Settings,
    *,
    until: Stage,
    threads: int,
    finished: Sequence[StageResult] = (),
    start: Sequence[StageResult] = (),
    start_name: str = "another run",
    timeout: float | None = None,
    progress: Progress,
) -> Iterator[StageResult]:
    """Run the stages up to `until` that are not in `finished`; yield each result as it is finished.

    A stage that fails is yielded, too, and is the last. The point mass of a thorough search is yielded several times,
    each in place of the one before: ahead of the prices, and after every round of them. Finished stages that were
    solved on one mesh, and whose mesh is to be checked, are yielded first, each as soon as its check has succeeded or
    failed.

    Args:
        race: the course, the aircraft and the air.
        settings: how it is solved.
        until: the last stage.
        threads: threads that evaluate derivatives.
        finished: stages of this very race that need not be run again.
        start: stages of another run, of a race with the same passings. The highest of them that holds is the
            start; lower stages are left out. Where it leads to no certified optimum the next lower one is the start,
            and where none does, all stages are run; the first result then has a note that says so. Without effect
            where stages are finished.
        start_name: what users call that other run.
        timeout: the longest wall time of all stages together, s; None for none. No result depends on it: what is not
            finished by then is not there, and a bound that prices would still have changed says so.
        progress: who watches.

    Raises:
        OutOfTime: the stage under way is not finished within `timeout`.
        InputError: aircraft and rules contradict each other.
        UsageError: `start` has no certified or solved stage up to `until`, or flies other passings.
        SolverCrash: the solver process died.
    """
    deadline = math.inf if timeout is None else time.monotonic() + timeout
    source, source_stage = SourceRun(start_name, start), None
    if start and not finished:
        source_stage = source.usable_optima(STAGES[: STAGES.index(until) + 1])[0].stage
    todo = schedule(settings, until, {result.stage: result for result in finished}, source_stage)
    _ensure_consistent(race, settings, source_stage or Stage.POINT_MASS, until)
    if not (todo.mesh_checks or todo.stages):
        return
    own_plan = plan_race(race)
    service = SolverService(
        threads=threads,
        stall_seconds=settings.solver.stall_seconds,
        deadline=deadline,
        on_notice=lambda text: progress.activity(text, 0, 0),
    )
    session = SolverSession(service, settings, progress, threads, deadline, Budget.from_plan(own_plan, settings.mesh))
    with service, closing(session), _model_maker() as maker:
        models = StageModels.request(maker, race, settings, own_plan, todo.models)
        if library_path() is None:
            progress.activity(MISSING, 0, 0)
        yield from _run(models, session, todo, source, {result.stage: result for result in finished}, until)


def _ensure_consistent(race: Race, settings: Settings, first: Stage, until: Stage) -> None:
    """Refuse inputs that contradict each other before anything is solved, and warn of an aircraft hard to control.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    for stage in STAGES[STAGES.index(first) : STAGES.index(until) + 1]:
        stage_model(stage, race)
    if any(fidelity_of(stage).inner_controller for stage in stages_of_run(settings, until)):
        for remark in handling.remarks(race.aircraft):
            logger.warning("%s: %s", race.aircraft.name, remark)


def _run(
    models: StageModels,
    session: SolverSession,
    todo: Schedule,
    source: SourceRun,
    finished: Mapping[Stage, StageResult],
    until: Stage,
) -> Iterator[StageResult]:
    """Check the meshes of finished stages, start from another run, and solve the stages that are left."""
    done, stages, remark = dict(finished), todo.stages, ""
    for stage in todo.mesh_checks:
        session.progress.stage_started(stage)
        done[stage] = check_stage_mesh(models, done[stage], session)
        yield done[stage]
    if todo.source is not None:
        up_to_last = STAGES[: STAGES.index(until) + 1]
        strategy = mesh_strategy(session.settings, Stage.POINT_MASS, until)
        result, remark = start_from(source, up_to_last, models, session, strategy)
        if result is not None:
            result, remark = _with_note(result, remark), ""
            done[result.stage] = result
            stages = up_to_last[up_to_last.index(result.stage) + 1 :]
            yield result
    yield from _solve_stages(models, session, stages, done, until, remark)


@contextmanager
def _model_maker() -> Generator[ThreadPoolExecutor]:
    """Yield what makes the models of stages in a thread, one after the other, until the run ends."""
    maker = ThreadPoolExecutor(1, thread_name_prefix="stage models")
    try:
        yield maker
    finally:
        maker.shutdown(cancel_futures=True)


def _solve_stages(
    models: StageModels,
    session: SolverSession,
    stages: Sequence[Stage],
    finished: Mapping[Stage, StageResult],
    last: Stage,
    remark: str,
) -> Iterator[StageResult]:
    """Solve stages in order until one fails; yield each as it is finished."""
    done = dict(finished)
    first_solutions = None
    if Stage.HOMOTOPY in done:
        first_solutions = FirstSolutions(HomotopyOutcome(done[Stage.HOMOTOPY]), relaxed_race(models, session))
    if stages:
        models.preload(stages[0], session.service, _pylon_conditions(done))
    for number, stage in enumerate(stages):
        session.progress.stage_started(stage)
        if not remark:
            session.reset_log()  # failed starts stay in the log of the stage that replaces them
        strategy = mesh_strategy(session.settings, stage, last)
        if fidelity_of(stage).is_guess:
            first_solutions = solve_homotopy_and_plans(models, session, searches=last is not stage)
            results = iter([first_solutions.homotopy.result])
        elif stage is Stage.POINT_MASS:
            results = solve_point_mass(models, session, strategy, first_solutions)
        else:
            results = iter([solve_stage_above(models, session, strategy, stage, done)])
        for result in results:
            done[stage] = result
            if result.outcome is Status.SOLVED and not result.search.goes_on:
                for following in stages[number + 1 : number + 2]:  # while the result is stored and flown along
                    models.preload(following, session.service, _pylon_conditions(done))
            yield _with_note(result, remark)
        if done[stage].outcome is not Status.SOLVED:
            return
        remark = ""


# Search and point mass


def solve_point_mass(
    models: StageModels, session: SolverSession, strategy: MeshStrategy, first_solutions: FirstSolutions | None
) -> Iterator[StageResult]:
    """Yield the point mass's optimum, with alternatives; where there is none, what stands in the way.

    A thorough search yields it before its prices and after every round of them: what is stored by then is not lost.

    Args:
        models: of the race.
        session: solves.
        strategy: how closely it is solved.
        first_solutions: the homotopy; None where the plan is the guess.
    """
    relaxed = relaxed_race(models, session) if first_solutions is None else first_solutions.relaxed
    for result in _search_and_solve(models, session, strategy, first_solutions, relaxed):
        yield diagnose_infeasibility(result, models.race, models.problem(Stage.POINT_MASS), session, relaxed)


def _search_and_solve(
    models: StageModels,
    session: SolverSession,
    strategy: MeshStrategy,
    first_solutions: FirstSolutions | None,
    relaxed: RelaxedRace,
) -> Iterator[StageResult]:
    """Solve from what the search found, then from the homotopy and the plan, the one that the user prefers first.

    Where there is a flight, those that prices lead to are solved as they are found.
    """
    settings = session.settings

    @functools.cache
    def homotopy() -> HomotopyOutcome:  # where the plan is the guess it is solved only where it is asked for
        if first_solutions is not None:
            return first_solutions.homotopy
        return solve_homotopy_pieces(models, relaxed, session)

    replanned = replanned_with_room(models.problem(Stage.POINT_MASS))
    starts = _first_starts(models, session, first_solutions, homotopy, replanned, relaxed)
    locally_infeasible = first_solutions is not None and first_solutions.homotopy.infeasibility is not None
    flights = () if first_solutions is None else first_solutions.flights or ()
    failed_plans = () if first_solutions is None else first_solutions.failed_plans
    if settings.search is SearchEffort.OFF or (locally_infeasible and not flights and replanned is None):
        yield solve_from_starts(session, starts, strategy)
        return

    search = functools.partial(
        search_routes,
        models.problem(Stage.POINT_MASS),
        models.race.course,
        session,
        QUICK,
        alternatives=settings.alternatives or 1,
        gap=settings.gap if settings.search is SearchEffort.THOROUGH else None,
    )
    guesses = _search_starts(models, session, first_solutions)
    routes = search(guesses, solved=flights, failed=failed_plans)
    without_search: StageResult | None = None
    if not routes.starts and settings.search is SearchEffort.THOROUGH:
        without_search = solve_from_starts(session, starts, strategy)
        if without_search.holds:  # a flight to search around
            routes = search([guess_of_optimum(models.problem(Stage.POINT_MASS), without_search)])
    best = routes.search_report(0)
    # All routes that may be the fastest are solved; further ones, one by one, until one is as fast as was expected.
    jobs = [functools.partial(_solve_from, start, strategy) for start in routes.starts]
    count = max(routes.near_count, settings.alternatives or 1)
    results = session.side_by_side(jobs[:count])
    for job in jobs[count:]:
        if any(_is_as_fast_as_expected(result, best) for result in results):
            break
        results.append(job(session))
    numbers = list(range(len(results)))
    if without_search is not None:
        results.append(without_search)
    elif not any(result.holds for result in results):
        results.append(solve_from_starts(session, starts, strategy))
    numbers += [0] * (len(results) - len(numbers))  # whatever was started from no route is compared with the first

    choice = _choose_route(models, session, results, numbers)
    report = routes.search_report(choice.route)
    _warn_of_search(choice.result, report, best)
    if not choice.result.is_flight:  # what could be faster than that?
        yield replace(_with_log(choice.result, session), search=replace(report, bound=None))
        return
    yield replace(_with_log(choice.result, session), search=report)
    route_count = len(routes.starts)
    for priced in routes.by_prices:
        if priced.further_start is not None:
            route_count += 1
            before, faster = choice.result.trajectory, _solve_from(priced.further_start, strategy, session)
            if faster.holds:
                choice = _choose_route(models, session, [*choice.results, faster], [*choice.numbers, route_count - 1])
            if choice.result.trajectory is not before or not faster.holds:
                expected = priced.search_report(route_count - 1)
                _warn_of_search(choice.result, priced.search_report(choice.route), expected)
        yield replace(_with_log(choice.result, session), search=priced.search_report(choice.route))


@dataclass(frozen=True)
class _Choice:
    """The result that is chosen, the number of its route, and all results, with those of theirs."""

    result: StageResult
    route: int
    results: list[StageResult]
    numbers: list[int]


def _choose_route(
    models: StageModels, session: SolverSession, results: Sequence[StageResult], numbers: Sequence[int]
) -> _Choice:
    """Return the result that is chosen of those on routes of some numbers, also past pylons on their other sides."""
    fastest_route = numbers[index_of(fastest_of(results), results)]
    results = with_other_sides(models, results, session)
    numbers = [*numbers, *[fastest_route] * (len(results) - len(numbers))]
    results = resolve_near_ties(models, results, session)
    result = choose_and_carry(models, results, session.settings)
    return _Choice(result, numbers[index_of(result, results)], results, numbers)


def _search_starts(
    models: StageModels, session: SolverSession, first_solutions: FirstSolutions | None
) -> list[InitialGuess]:
    """Return the starts of a search, those of a run without a search among them, so that none is lost by it."""
    stage_problem, starts = models.problem(Stage.POINT_MASS), list[InitialGuess]()
    if first_solutions is not None and first_solutions.homotopy.infeasibility is None:
        pieces = first_solutions.homotopy.result
        if pieces.outcome is Status.SOLVED:
            mesh, iterate = mesh_of(pieces.trajectory), iterate_of(pieces.trajectory)
            starts.append(InitialGuess(stage_problem, mesh, iterate, InitialBarrier.PIECES, is_baseline=True))
    flights = None if first_solutions is None else first_solutions.flights
    if flights is None:
        return [*starts, *plans_to_search(models.problem(Stage.POINT_MASS), session.settings.mesh, QUICK)]
    return starts if flights else [*starts, *plans_with_room(models.problem(Stage.POINT_MASS), QUICK)]


def _first_starts(
    models: StageModels,
    session: SolverSession,
    first_solutions: FirstSolutions | None,
    homotopy: Callable[[], HomotopyOutcome],
    replanned: StageProblem | None,
    relaxed: RelaxedRace,
) -> list[Callable[[], Start | StageResult]]:
    """Return the homotopy and plans as starts, the one that the user prefers first.

    A homotopy that is infeasible comes last, for it ends the stage.
    """
    stage_problem, mesh = models.problem(Stage.POINT_MASS), session.settings.mesh

    def concatenate_phases() -> Start | StageResult:
        if first_solutions is None:  # nor has the plan led anywhere: the relaxed race is solved while there is time
            conflict_location(relaxed.solve(session))
        outcome = homotopy()
        pieces = outcome.result
        if any(note.kind is NoteKind.PLANNED_PHASES for note in pieces.notes):
            where = conflict_location(relaxed.solve(session))
            if where:
                start = planned_start(stage_problem, mesh)
                message = f"the limits contradict each other at {where}"
                return _infeasible(stage_problem, session, start.problem, start.guess, message)
        if outcome.infeasibility is not None:
            local = outcome.infeasibility
            return _infeasible(stage_problem, session, local.problem, local.guess, binding_limit(session, local))
        problem = stage_problem.problem(mesh_of(pieces.trajectory))
        return Start(stage_problem, problem, iterate_of(pieces.trajectory), InitialBarrier.PIECES)

    longer = [] if replanned is None else [functools.partial(planned_start, replanned, mesh)]
    if first_solutions is None:
        return [functools.partial(planned_start, stage_problem, mesh), *longer, concatenate_phases]
    if first_solutions.homotopy.infeasibility is not None:
        return [*longer, concatenate_phases]
    return [concatenate_phases, functools.partial(planned_start, stage_problem, mesh), *longer]


def _infeasible(
    stage_problem: StageProblem, session: SolverSession, problem: Problem, iterate: Iterate, message: str
) -> StageResult:
    return conclude(stage_problem, session, problem, iterate, outcome=Status.INFEASIBLE, message=message)


def _solve_from(start: Start, strategy: MeshStrategy, session: SolverSession) -> StageResult:
    return solve_from_starts(session, [lambda: start], strategy)


def _is_as_fast_as_expected(result: StageResult, report: SearchReport) -> bool:
    """Tell whether a flight holds and is about as fast as the best route was when it was solved coarsely."""
    if not result.holds or not report.routes:
        return result.holds
    return result.trajectory.race_time <= report.routes[0].race_time + LOSS_MAX


def _warn_of_search(result: StageResult, report: SearchReport, best: SearchReport) -> None:
    for loop in report.loops:
        logger.warning("the flight may hold a needless loop: %s", loop)
    if result.holds and not _is_as_fast_as_expected(result, best):
        logger.warning(
            "the best route took %.2f s when solved coarsely but failed the final check; the %s flight, another "
            "one, takes %.2f s",
            *(best.routes[0].race_time, result.status.value, result.trajectory.race_time),
        )


# Each stage from the one before


def solve_stage_above(
    models: StageModels,
    session: SolverSession,
    strategy: MeshStrategy,
    stage: Stage,
    done: Mapping[Stage, StageResult],
) -> StageResult:
    """Return a stage's optimum, from that of the stage below and from its alternatives, with alternatives.

    Args:
        models: of the race.
        session: solves.
        strategy: how closely it is solved.
        stage: which one.
        done: the stages below.
    """
    below = done[STAGES[STAGES.index(stage) - 1]]
    conditions = _pylon_conditions(done)
    # A run that was started from another one may lack the point mass.
    point_mass = done.get(Stage.POINT_MASS)

    def solve_main(session: SolverSession) -> StageResult | Failure:
        models.preload(stage, session.service, conditions)
        starts = _warm_starts(models, session, stage, below, point_mass)
        return solve_from_starts(session, starts, strategy, diagnose=diagnose_window)

    def solve_alternative(alternative: StageResult, session: SolverSession) -> StageResult | Failure:
        """There is the main route as well: the primary solver alone is asked, and the first optimum counts."""
        models.preload(stage, session.service, conditions)
        result: StageResult | Failure | None = None
        for start in _warm_starts(models, session, stage, alternative, None):
            result = strategy(session, start(), session.solvers[0])
            if isinstance(result, StageResult):
                return result
        assert result is not None  # there are starts
        return result

    jobs = [solve_main, *(functools.partial(solve_alternative, alternative) for alternative in below.alternatives)]
    results = [result for result in session.side_by_side(jobs) if isinstance(result, StageResult)]
    return _with_log(choose_and_carry(models, results, session.settings), session)


def _warm_starts(
    models: StageModels, session: SolverSession, stage: Stage, below: StageResult, point_mass: StageResult | None
) -> list[Callable[[], Start]]:
    """Return the starts of a stage: along the stage below, trimmed in it, trimmed in the point mass."""
    starts: list[Callable[[], Start]] = [
        functools.partial(start_along, models, session, stage, below),
        functools.partial(start_trimmed, models, stage, below),
    ]
    if point_mass is not None and below is not point_mass:
        starts.append(functools.partial(start_trimmed, models, stage, point_mass))
    return starts


# Mesh check


def check_stage_mesh(models: StageModels, solved: StageResult, session: SolverSession) -> StageResult:
    """Check the mesh of a stage that was solved on a single one, and those of its alternatives.

    Of routes that were solved roughly one is chosen anew: their race times could not tell.

    Returns:
        The stage, certified; as it was, with a note that says why, where that fails.
    """
    session.restore_log(solved.attempts, solved.timings)
    routes = solved, *solved.alternatives
    main, *alternatives = session.side_by_side([functools.partial(check_mesh, models, route) for route in routes])
    if any(route.is_rough for route in routes):
        result = choose_and_carry(models, [main, *alternatives], session.settings)
    else:
        result = replace(main, alternatives=tuple(alternatives))
    return _with_log(result, session)


# Alternatives


def choose_and_carry(models: StageModels, results: Sequence[StageResult], settings: Settings) -> StageResult:
    """Return the result that is chosen, with others that are to be carried on.

    Those are as many as the settings say, else those that are hardly slower. Race times of rough optima are too
    long by different amounts: what they may be off by leaves no route out, nor makes two routes one.
    """
    stage_problem = models.problem(results[0].stage)
    chosen = simplest_of(stage_problem, results)
    is_rough = any(result.is_rough for result in results)
    longest = chosen.trajectory.race_time + CARRIED_LAG
    if is_rough:
        longest += mesh_resolution(settings, chosen.trajectory.race_time)
    else:
        chosen = with_note_on_faster(stage_problem, chosen, results)
    if settings.alternatives:
        longest = math.inf
    carried: list[StageResult] = []
    for result in sorted(results, key=lambda result: result.trajectory.race_time):
        time = result.trajectory.race_time
        if not result.holds or time > longest or result.trajectory is chosen.trajectory:
            continue
        kept = [flight.trajectory for flight in (chosen, *carried)]
        if any(is_same_flight(result.trajectory, flight) for flight in kept):
            continue
        if settings.alternatives or is_rough or all(abs(time - flight.race_time) > SAME_FLIGHT for flight in kept):
            carried.append(result)
    return replace(chosen, alternatives=tuple(carried[: (settings.alternatives or CARRIED_MAX) - 1]))


def resolve_near_ties(models: StageModels, results: Sequence[StageResult], session: SolverSession) -> list[StageResult]:
    """Check the meshes of optima of one stage where they may hide which of them are the fastest.

    Of those, only optima whose check succeeds still hold, unless none does.
    """
    times = [result.trajectory.race_time if result.holds else math.inf for result in results]
    longest = min(times) + mesh_resolution(session.settings, min(times))
    close = [number for number, time in enumerate(times) if time <= longest < math.inf]
    if len(close) <= (session.settings.alternatives or CARRIED_MAX):  # all of them are carried on
        return list(results)
    checks = [functools.partial(check_mesh, models, results[number]) for number in close]
    checked = list(results)
    for number, result in zip(close, session.side_by_side(checks), strict=True):
        checked[number] = result
    if any(result.certified for result in checked):
        for number in close:
            if not checked[number].certified:
                checked[number] = replace(checked[number], outcome=Status.NOT_CERTIFIED)
    return checked


def _pylon_conditions(done: Mapping[Stage, StageResult]) -> list[PylonCondition]:
    """Return the conditions on pylons of all stages that are solved."""
    return [condition for result in done.values() for condition in result.pylon_conditions]


def _with_log(result: StageResult, session: SolverSession) -> StageResult:
    """Return a result with the record of all that was solved for its stage, before it and after it."""
    return replace(result, attempts=tuple(session.attempts), timings=session.timings())


def _with_note(result: StageResult, remark: str) -> StageResult:
    """Return a result with a note on its start; the result itself where there is none."""
    return replace(result, notes=(Note(NoteKind.START, remark), *result.notes)) if remark else result
