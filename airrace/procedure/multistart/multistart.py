"""The exploration, from a planned race to the flights that are worth a mesh check."""

import math
import time
from collections.abc import Callable, Sequence

from airrace.optimal_control.refinement import resample
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.planning.plan import plan
from airrace.planning.planning_model import PlanningModel
from airrace.procedure.guess import counts_of
from airrace.procedure.multistart.budget import SearchBudget, scaled
from airrace.procedure.multistart.coarse_solution import CoarseSolution, InitialGuess, solve_coarse
from airrace.procedure.multistart.description import describe_route, named, shape_in_words, way_in_words
from airrace.procedure.multistart.search import EvaluatedWindow, Found, Search, Tried
from airrace.procedure.multistart.segments import Segment, differing, same_way, shape, stretches
from airrace.procedure.multistart.solver_pool import SolverPool
from airrace.procedure.result import Route, SearchReport
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight
from airrace.procedure.start import InitialBarrier, Start
from airrace.records import record
from airrace.track.course import Course

CLOSE = 0.4
"""The largest lag behind the best flight with which a flight is compared again, s."""
MOST_WAYS = 40
"""The largest number of ways that are reported."""
NEEDLESS_TURN = math.radians(150.0)
"""The turn beyond what the gates ask for that makes a stretch a needless loop, rad.

The loops of wrong routes are a full circle or more.
"""
NEEDLESS_LENGTH, SPARE_LENGTH = 2.0, 200.0
"""The length that makes a stretch a needless loop: a factor on the plan's length (1), and a length on top (m).

The latter is there because short legs swing out.
"""


@record
class Exploration:
    """The outcome of exploring.

    Attributes:
        starts: flights to be refined and proved, the best first; empty if nothing could be flown.
        search: what was tried, for people, seen from the start with that number, which was proved.
    """

    starts: tuple[Start, ...]
    search: Callable[[int], SearchReport]


def explore(
    flight: Flight,
    course: Course,
    session: SolverSession,
    effort: SearchBudget,
    starts: Sequence[tuple[str, InitialGuess]] = (),
) -> Exploration:
    """Look for the fastest route.

    Args:
        flight: the point mass, with the race's own plan.
        course: the course.
        bench: what solves, and whom to tell.
        effort: how much is tried.
        starts: flights to begin with besides the plans, and what they are called.
    """
    began = time.perf_counter()
    pace = flight.plan.cruise
    with session.pool() as pool:
        watch = _watching(session)
        found = Search(flight, course, pace, effort, pool, watch).run(starts)
        finalists = _finalists(found.flights, course, effort.finalists)
        if finalists:
            watch(f"{len(finalists)} routes compared on a finer mesh")
        finals = _finals(pool, session, finalists)
    seconds = time.perf_counter() - began

    def explored(number: int) -> SearchReport:
        if not finals:
            return SearchReport((), 0, 0, found.lost, seconds, ())
        return _told(found, finals[number], course, scaled(pace, effort.thinking), seconds)

    return Exploration(tuple(_start(one) for one in finals), explored)


def _watching(session: SolverSession) -> Callable[[str], None]:
    return lambda text: session.progress.activity(text, 0, 0)


def _finalists(flights: Sequence[Tried], course: Course, most: int) -> list[CoarseSolution]:
    """Return the fastest flights that differ from one another, none of them far behind the best."""
    chosen: list[CoarseSolution] = []
    for tried in flights:
        if tried.coarse.race_time > flights[0].coarse.race_time + CLOSE:
            break
        if len(chosen) < most and all(differing(one, tried.coarse, stretches(course)) for one in chosen):
            chosen.append(tried.coarse)
    return chosen


def _finals(pool: SolverPool, session: SolverSession, finalists: Sequence[CoarseSolution]) -> list[CoarseSolution]:
    """Return the finalists on the mesh with which their proof begins, the fastest first."""

    def finer(service: SolverService, coarse: CoarseSolution) -> CoarseSolution:
        wanted = counts_of(coarse.iterate.durations.tolist(), session.settings.mesh)
        counts = [max(count, len(phase)) for count, phase in zip(wanted, coarse.problem.mesh, strict=True)]
        mesh, iterate = resample(coarse.problem.mesh, coarse.iterate, counts)
        return solve_coarse(service, InitialGuess(coarse.flight, mesh, iterate, InitialBarrier.COARSE)) or coarse

    if len(finalists) < 2:
        return list(finalists)
    return sorted(pool.work(finalists, finer), key=lambda one: one.race_time)


def _start(coarse: CoarseSolution) -> Start:
    return Start(coarse.flight, coarse.problem, coarse.iterate, InitialBarrier.OTHER_STAGE)


def _told(found: Found, best: CoarseSolution, course: Course, pace: PlanningModel, seconds: float) -> SearchReport:
    """Return what was tried, in words, the one that was proved first."""
    places = stretches(course)
    led = [one for one in found.flights if not differing(best, one.coarse, places)]
    ways = [
        Route(describe_route(course, best, places), best.race_time, 0.0, "joint"),
        *(_told_flight(one, best, course, places) for one in found.flights if one not in led),
        *(way for one in found.windows if (way := _told_window(one, best, course, places)) is not None),
    ]
    first, *others = ways
    # Of those with the same words the fastest is told, and a flight optimised jointly before a price.
    unique = {way.text: way for way in sorted(others, key=lambda way: (way.evaluated_by == "joint", -way.race_time))}
    ranked = sorted(unique.values(), key=lambda way: way.race_time)
    loops = tuple(_loops(best, course, pace, places))
    return SearchReport(
        (first, *ranked[: MOST_WAYS - 1]), len(led), len(found.flights) - len(led), found.lost, seconds, loops
    )


def _told_flight(tried: Tried, best: CoarseSolution, course: Course, places: Sequence[Segment]) -> Route:
    apart = differing(best, tried.coarse, list(places))
    text = way_in_words(course, tried.coarse, apart)
    return Route(text, tried.coarse.race_time, tried.coarse.race_time - best.race_time, "joint")


def _told_window(
    tried: EvaluatedWindow, best: CoarseSolution, course: Course, places: Sequence[Segment]
) -> Route | None:
    """Return a way through a window; None if it is the best flight's own."""
    shown = tried.found.shown
    apart = [(one, place) for one, place in tried.found.inside(places) if not same_way(shown, one, best, place)]
    if not apart:
        return None
    race_time = tried.found.window.base.race_time - tried.found.saved
    text = "; ".join(f"{named(course, place)}: {shape_in_words(shape(shown, one))}" for one, place in apart)
    return Route(text, race_time, race_time - best.race_time, "window")


def _loops(best: CoarseSolution, course: Course, pace: PlanningModel, places: Sequence[Segment]) -> list[str]:
    """Return the stretches on which the best flight turns, or flies, far more than its gates ask for, as sentences."""
    planned = plan(course, pace)
    told: list[str] = []
    for stretch in places:
        paths = [planned.legs[index].path for index in range(stretch.first, stretch.last)]
        known = [path for path in paths if path is not None]
        if len(known) < len(paths):
            continue
        asked = sum(path.turning for path in known)
        flown = shape(best, stretch)
        length = sum(path.length for path in known)
        if abs(flown.turn) > asked + NEEDLESS_TURN or flown.length > NEEDLESS_LENGTH * length + SPARE_LENGTH:
            told.append(
                f"{named(course, stretch)}: turns {abs(math.degrees(flown.turn)):.0f} degrees on {flown.length:.0f} m, "
                f"where the gates ask for {math.degrees(asked):.0f} degrees on {length:.0f} m"
            )
    return told
