"""The search among routes: which of the many local optima is the fastest flight.

The joint problem has many local optima: a turn flat or over the top, to the left or to the right, a pylon rounded one
way or the other, a reversal before or behind its gate. Several plans are solved coarsely, the best of them is changed
segment by segment where another route is proposed, and by what plans that fail as a whole lead to in windows between
priced gates; what is faster is solved as a whole again.

A flight that was started from another run is searched around likewise, for a route that has become faster.
"""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from airrace.model.track.course import Course
from airrace.optimal_control.mesh_refinement import resample
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.solvers.service import SolverPool
from airrace.procedure.multistart.coarse_solution import (
    CoarseSolution,
    InitialGuess,
    finer_guess,
    intervals,
    solve_coarse,
    solve_finer,
)
from airrace.procedure.multistart.lower_bound import EvaluatedWindow, PriceSearch
from airrace.procedure.multistart.plans import own_plans
from airrace.procedure.multistart.priced_moves import priced_moves
from airrace.procedure.multistart.priced_window import LEGS_MAX, RaceGuess
from airrace.procedure.multistart.search import LOCAL, SAVED_MIN, Search, SearchBudget, SearchResult, planned_starts
from airrace.procedure.multistart.segments import (
    Segment,
    describe_route,
    describe_segments,
    differing,
    inside_window,
    same_route,
    segment_name,
    segments_of,
    shape_of,
)
from airrace.procedure.planning.plan import plan, plan_from_solution
from airrace.procedure.planning.planning_model import PlanningModel
from airrace.procedure.result import NOT_SEARCHED, LowerBound, Route, SearchReport, StageResult
from airrace.procedure.settings import MeshSettings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import StageProblem, load_factors_along, mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start

COMPARED_LAG = 0.4
"""Largest lag behind the best flight with which a flight is compared again, s."""
NEAR_LAG = 0.1
"""Largest lag with which the rolls of a flight are tried the other way, and with which it is refined and certified
before one is chosen, s. Race times on the mesh of the comparison err by 50 to 90 ms."""
JOINED_GAIN = 0.05
"""The time that a flight joined by prices must save on the mesh of the comparison to be refined where its route has
been a start, s. Of 3 to 17 ms there at most 0.2 ms were left once both were refined."""
PRICED_FLIGHTS_MAX = 5
"""The largest number of flights on different routes from which windows between priced gates are solved."""
ROUTES_MAX = 40
"""Number of routes that are reported."""
NEEDLESS_TURN = math.radians(150.0)
"""Turn beyond what the gates ask for that makes a segment a needless loop, rad. The loops of wrong routes are a full
circle or more."""
NEEDLESS_LENGTH, SPARE_LENGTH = 2.0, 200.0
"""Length that makes a segment a needless loop: a factor on the plan's length (1), and a length on top (m), because
short legs swing out."""


@dataclass(frozen=True)
class FoundRoutes:
    """The outcome of a search.

    Attributes:
        starts: flights to be refined and checked, the best first; empty if no start converged.
        search_report: returns the report on the search, compared with the start of that number.
        near_count: number of the first starts among which the fastest may be, as far as their rough race times tell.
        by_prices: the outcome of every round of a price search, which is made as it is asked for. Empty without one.
    """

    starts: tuple[Start, ...]
    search_report: Callable[[int], SearchReport]
    near_count: int = 1
    by_prices: Iterable["PricedRound"] = ()


@dataclass(frozen=True)
class PricedRound:
    """The outcome of a round of a price search.

    Attributes:
        further_start: the flight that prices have led to, to be refined and checked as the next start; None if there is
            none, or if a flight on its route that takes hardly longer was refined before.
        search_report: as of the routes, compared with any start so far.
    """

    further_start: Start | None
    search_report: Callable[[int], SearchReport]


def search_routes(
    stage_problem: StageProblem,
    course: Course,
    session: SolverSession,
    budget: SearchBudget,
    starts: Sequence[InitialGuess] | None = None,
    alternatives: int = 1,
    *,
    solved: Sequence[CoarseSolution] = (),
    failed: Sequence[InitialGuess] = (),
    gap: float | None = None,
) -> FoundRoutes:
    """Look for the fastest route.

    Args:
        stage_problem: the point mass, with the race's own plan.
        course: the course.
        session: solves, and reports progress.
        budget: how much is tried.
        starts: flights to begin with; None for the plans of the budget.
        alternatives: least number of flights.
        solved, failed: flights that further starts have led to before, and further ones that have led to none.
        gap: the share of the race time within which a lower bound is sought, and faster routes with it; None for none.
    """
    began = time.perf_counter()

    def report_progress(text: str) -> None:
        session.progress.activity(text, 0, 0)

    with session.pool() as pool:
        search = Search(stage_problem, course, budget, pool, report_progress)
        starts = planned_starts(stage_problem, course, budget) if starts is None else starts
        search.run(starts, solved, failed)
        _improve_by_prices(search, course, pool)
        fastest = _fastest(search.result().flights, course, max(budget.compared_max, alternatives))
        if fastest:
            report_progress(f"{len(fastest)} route{'s' * (len(fastest) > 1)} compared on a finer mesh")
        compared = _distinct(_refine(pool, session, fastest), course)
        compared = _distinct(_with_best_rolls(search, compared), course)
        result = search.result()
    seconds = time.perf_counter() - began
    pace = budget.planning_radius.scale(stage_problem.plan.cruise)
    near = [number for number, flight in enumerate(compared) if _is_near(flight, compared[0])]
    starts_of_routes, near_count = tuple(map(_start_from, compared)), max(near, default=0) + 1
    record = _SearchRecord(result, compared, course, pace, seconds)
    if gap is None or not compared or not math.isfinite(compared[0].race_time):
        return FoundRoutes(starts_of_routes, record.report, near_count)
    unknown = LowerBound(0.0, compared[0].race_time, LEGS_MAX, 0, 0, 0, (), stopped=True)
    rounds = _search_by_prices(record, stage_problem, session, budget, gap, report_progress)
    return FoundRoutes(starts_of_routes, replace(record, bound=unknown).report, near_count, rounds)


def _improve_by_prices(search: Search, course: Course, pool: SolverPool) -> None:
    """Improve the best flight by what starts that have failed lead to in windows between priced gates.

    A plan that fails as a whole may be the better route for a few legs.
    """
    guesses = [RaceGuess.of(start) for start in search.failed_starts]
    flights = search.result().flights[:1]
    if guesses and flights and math.isfinite(flights[0].race_time):
        propose = partial(priced_moves, guesses=guesses, course=course, pool=pool)
        search.improve_by(flights[0], "routes between gates", propose)


def _search_by_prices(
    record: "_SearchRecord",
    stage_problem: StageProblem,
    session: SolverSession,
    budget: SearchBudget,
    gap: float,
    report: Callable[[str], None],
) -> Iterator[PricedRound]:
    """Go on with a search by prices; yield the outcome of every round."""
    course, cruise = record.course, stage_problem.plan.cruise
    segments = segments_of(course)
    plans = [*own_plans(stage_problem), *planned_starts(stage_problem, course, budget)]
    routes = [*_distinct(record.result.flights, course, PRICED_FLIGHTS_MAX), *plans]
    counts = [len(phase) for phase in record.flights[0].problem.mesh]
    others = [RaceGuess.of(finer_guess(route, session.settings.mesh, counts)) for route in routes]
    flights, start_times = [*record.flights], [flight.race_time for flight in record.flights]
    best, seconds, began = flights[0], record.seconds, time.perf_counter()
    with session.pool() as pool:
        prices = PriceSearch(best, others, course, cruise, session.settings.mesh, pool, report)
        for bound in prices.rounds(gap):
            further_start: Start | None = None
            if prices.best is not best:
                best = prices.best
                (finer,) = _refine(pool, session, [best])
                same = [number for number, flight in enumerate(flights) if not differing(flight, finer, segments)]
                fastest = min(same, key=lambda number: start_times[number], default=None)
                if fastest is None or finer.race_time <= start_times[fastest] - JOINED_GAIN:
                    flights.append(finer)
                    start_times.append(finer.race_time)
                    further_start = _start_from(finer)
                elif finer.race_time < flights[fastest].race_time:
                    flights[fastest] = finer
            seconds += time.perf_counter() - began
            known, joined, windows = [*flights], flights[len(record.flights) :], prices.evaluated()
            priced = replace(record, flights=known, seconds=seconds, joined=joined, bound=bound, windows=windows)
            yield PricedRound(further_start, priced.report)
            began = time.perf_counter()


def _start_from(flight: CoarseSolution) -> Start:
    barrier, multipliers = InitialBarrier.COARSE, flight.multipliers
    return Start(flight.stage_problem, flight.problem, flight.iterate, barrier, multipliers=multipliers)


@dataclass(frozen=True, eq=False)
class _SearchRecord:
    """What a search has evaluated in so many seconds: flights on the mesh of the comparison, windows, a bound.

    `joined` are those of the flights that prices have led to.
    """

    result: SearchResult
    flights: Sequence[CoarseSolution]
    course: Course
    pace: PlanningModel
    seconds: float
    joined: Sequence[CoarseSolution] = ()
    bound: LowerBound | None = None
    windows: Sequence[EvaluatedWindow] = ()

    def report(self, number: int) -> SearchReport:
        """Return the report, compared with one of the flights."""
        if not self.flights:
            return SearchReport((), 0, 0, self.result.failed, self.seconds, ())
        flight = self.flights[number]
        report = _report(self.result, flight, self.course, self.pace, self.seconds, self.joined, self.windows)
        if self.bound is None:
            return report
        # the flight may be slower than the best, which has failed its check or is harder to fly
        return replace(report, bound=replace(self.bound, race_time=max(self.bound.race_time, flight.race_time)))


def _is_near(flight: CoarseSolution, best: CoarseSolution) -> bool:
    """Return whether a flight may be the faster one, as far as rough race times tell."""
    error = max(NEAR_LAG, *(float(np.abs(coarse.errors).sum()) for coarse in (flight, best)))
    return flight.race_time <= best.race_time + error


def _fastest(flights: Sequence[CoarseSolution], course: Course, most: int) -> list[CoarseSolution]:
    """Return the fastest flights that differ from one another, none of them far behind the best."""
    near = [flight for flight in flights if flight.race_time <= flights[0].race_time + COMPARED_LAG]
    return _distinct(near, course, most)


def _distinct(flights: Sequence[CoarseSolution], course: Course, most: int | None = None) -> list[CoarseSolution]:
    """Return so many flights, the fastest first, without those that take the route of a faster one."""
    chosen: list[CoarseSolution] = []
    segments = segments_of(course)
    for flight in flights:
        if len(chosen) == most:
            break
        if all(differing(faster, flight, segments) for faster in chosen):
            chosen.append(flight)
    return chosen


def _refine(pool: SolverPool, session: SolverSession, fastest: list[CoarseSolution]) -> list[CoarseSolution]:
    """Return the flights on the mesh with which their mesh check begins, the fastest first."""
    finer = pool.work(fastest, partial(solve_finer, mesh=session.settings.mesh))
    return sorted(finer, key=lambda flight: flight.race_time)


def _with_best_rolls(search: Search, compared: list[CoarseSolution]) -> list[CoarseSolution]:
    """Return the flights, the fastest first, after the rolls of those near the best were tried the other way."""
    if not compared:
        return compared
    best, *slower = compared
    improved = [search.improve_rolls(best)]
    for flight in slower:
        improved.append(search.improve_rolls(flight, unlike=best) if _is_near(flight, best) else flight)
    return sorted(improved, key=lambda flight: flight.race_time)


def _report(
    result: SearchResult,
    best: CoarseSolution,
    course: Course,
    pace: PlanningModel,
    seconds: float,
    joined: Sequence[CoarseSolution] = (),
    windows: Sequence[EvaluatedWindow] = (),
) -> SearchReport:
    """Return the report on a search; the flight that was checked comes first.

    Of priced windows it has the routes that are pruned: through these no race is as fast.
    """
    segments, converged, routes = segments_of(course), 0, list[Route]()
    for flight in (*result.flights, *joined):
        if different := differing(best, flight, segments):
            text, race_time = describe_segments(course, flight, different), flight.race_time
            rolls = all(shape_of(flight, segment).rolls for segment in different)
            routes.append(Route(text, race_time, race_time - best.race_time, "joint", rolls))
        elif flight in result.flights:  # from a start
            converged += 1
    for move in result.moves:
        window, race_time = move.as_solution, move.move.base.race_time - move.saved
        routes += _window_routes(best, window, move.inside(segments), course, race_time, "window")
    for evaluated in windows:
        if evaluated.race_time <= best.race_time:
            continue
        window, inside = evaluated.as_solution(best), inside_window(segments, *evaluated.window)
        routes += _window_routes(best, window, inside, course, evaluated.race_time, "priced")
    # Of those with the same words the fastest is reported, and a flight optimised jointly before a window.
    unique = {
        route.text: route
        for route in sorted(routes, key=lambda route: (route.evaluated_by == "joint", -route.race_time))
    }
    ranked = sorted(unique.values(), key=lambda route: route.race_time)
    first = Route(describe_route(course, best, segments), best.race_time, 0.0, "joint")
    loops = tuple(_needless_loops(best, course, pace, segments))
    reported = (first, *ranked[: ROUTES_MAX - 1])
    return SearchReport(reported, converged, len(result.flights) - converged, result.failed, seconds, loops)


def _window_routes(
    best: CoarseSolution,
    window: CoarseSolution,
    inside: Sequence[tuple[Segment, Segment]],
    course: Course,
    race_time: float,
    evaluated_by: str,
) -> list[Route]:
    """Return the route through a window, if it is another one; segments are numbered there and in the race."""
    apart = [pair for pair in inside if not same_route(window, pair[0], best, pair[1])]
    if not apart:
        return []
    shapes = [shape_of(window, within) for within, _ in apart]
    places = [segment_name(course, place) for _, place in apart]
    text = "; ".join(f"{place}: {shape.describe()}" for place, shape in zip(places, shapes, strict=True))
    rolls = all(shape.rolls for shape in shapes)
    return [Route(text, race_time, race_time - best.race_time, evaluated_by, rolls)]


def _needless_loops(
    best: CoarseSolution, course: Course, pace: PlanningModel, segments: Sequence[Segment]
) -> Iterator[str]:
    """Yield the segments on which the best flight turns, or flies, far more than its gates ask for, as sentences."""
    planned = plan(course, pace)
    for segment in segments:
        paths = [leg.path for leg in planned.legs[segment.first : segment.last]]
        planar = [path for path in paths if path is not None]
        if len(planar) < len(paths):
            continue
        turn, length = sum(path.turning for path in planar), sum(path.length for path in planar)
        shape = shape_of(best, segment)
        longest = NEEDLESS_LENGTH * length + SPARE_LENGTH
        if abs(shape.turn) > turn + NEEDLESS_TURN or shape.length > longest:
            yield (
                f"{segment_name(course, segment)}: turns {abs(math.degrees(shape.turn)):.0f} degrees on "
                f"{shape.length:.0f} m, where the gates ask for {math.degrees(turn):.0f} degrees on {length:.0f} m"
            )


@dataclass(frozen=True)
class RoutesAround:
    """The outcome of a search around a flight, solved roughly by the point mass.

    Attributes:
        best: the fastest flight; the flight itself where nothing near it is faster.
        phases: the numbers of the phases that it takes on another route.
        text: which route that is and what it saves, in words; empty where it is the same.
        report: on the search, the fastest flight first.
        report_on_stored: the same, the flight itself first.
    """

    best: CoarseSolution
    phases: frozenset[int] = frozenset()
    text: str = ""
    report: SearchReport = NOT_SEARCHED
    report_on_stored: SearchReport = NOT_SEARCHED


def search_around(
    point_mass: StageProblem,
    source: StageProblem,
    optimum: StageResult,
    course: Course,
    mesh: MeshSettings,
    pool: SolverPool,
) -> RoutesAround | None:
    """Return the fastest flight that moves lead to from an optimum; None if the point mass cannot fly as it does.

    Args:
        point_mass: the point mass on the same course.
        source: the model that flew the optimum, planned as it goes round.
        optimum: the flight, of a race whose numbers may have been a little different.
        course: the course.
        mesh: the settings of meshes.
        pool: what solves.
    """
    began = time.perf_counter()
    flight = replace(point_mass, plan=plan_from_solution(course, point_mass.plan.cruise, optimum.trajectory))
    counts = [intervals(seconds) for seconds in optimum.trajectory.durations.tolist()]
    coarse, iterate = resample(mesh_of(optimum.trajectory), _as_point_mass(flight, source, optimum), counts)
    (base,) = pool.work([InitialGuess(flight, coarse, iterate, InitialBarrier.OTHER_PROBLEM)], solve_coarse)
    if base is None:
        return None
    search = Search(point_mass, course, LOCAL, pool, lambda _: None)
    best = search.improve(base)
    base, *faster = pool.work([base] if best is base else [base, best], partial(solve_finer, mesh=mesh))
    best = search.improve_rolls(*faster or [base])
    segments = differing(base, best, segments_of(course))
    saved = base.race_time - best.race_time
    result, pace = search.result(), LOCAL.planning_radius.scale(point_mass.plan.cruise)
    result = replace(result, flights=(*result.flights, base))
    seconds = time.perf_counter() - began
    reports = [_report(result, first, course, pace, seconds) for first in (best, base)]
    if not segments or saved <= SAVED_MIN:
        return RoutesAround(best, frozenset(), "", *reports)
    phases = frozenset(phase for segment in segments for phase in range(segment.first, segment.last))
    text = f"{describe_segments(course, best, segments)}, saves about {saved:.2f} s"
    return RoutesAround(best, phases, text, *reports)


def _as_point_mass(point_mass: StageProblem, source: StageProblem, optimum: StageResult) -> Iterate:
    """Return the states and controls of the point mass that flies as an optimum does."""
    trajectory = optimum.trajectory
    load = load_factors_along(source, trajectory)
    states = {quantity.name: row for quantity, row in zip(trajectory.states, trajectory.state, strict=True)}
    states |= {"n_y": load.n_y, "n_z": load.n_z, "p_Kbar": load.p_Kbar}
    controls = {quantity.name: row for quantity, row in zip(trajectory.controls, trajectory.control, strict=True)}
    system = point_mass.model.system
    state = np.array([states[quantity.name] for quantity in system.states], dtype=np.float64)
    steps = np.diff(trajectory.time)
    rates = {quantity.name: np.diff(row) / steps for quantity, row in zip(system.states, state, strict=True)}
    controls |= {control.name: rates[control.rate_of] for control in system.controls if control.rate_of}
    rows = [np.clip(controls[control.name], control.lower, control.upper) for control in system.controls]
    return Iterate(trajectory.durations, state, np.array(rows, dtype=np.float64))
