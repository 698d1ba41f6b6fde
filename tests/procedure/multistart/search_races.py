"""Small races for the tests of the search over routes, their optima and coarse solutions, and a solver session."""

import dataclasses
import functools
from collections.abc import Iterator
from contextlib import closing, contextmanager

from disk_cache import cached_across_workers
from races import DEGREE, EDGE_540, RULES, course, level, prepared, pylon, settings
from races import optimum as without_search

from airrace.model.environment import Air
from airrace.model.track.gates import Gate, Pylon
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure.multistart.coarse_solution import CoarseSolution, planned_guess, solve_coarse
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.settings import GuessKind, SearchEffort, Settings
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.warm_start import InitialBarrier
from airrace.race import Race

PLAN = settings(GuessKind.PLAN)
OFF = dataclasses.replace(PLAN, search=SearchEffort.OFF)
QUICK = dataclasses.replace(PLAN, search=SearchEffort.QUICK)


def narrow(element: Gate | Pylon) -> Gate | Pylon:
    """An element to be crossed about level and within 10 degrees of its axis."""
    climb = Interval(-5 * DEGREE, 10 * DEGREE)
    return dataclasses.replace(
        element, tolerances=dataclasses.replace(element.tolerances, climb=climb, crossing=10 * DEGREE)
    )


def slalom(n_z: float) -> Race:
    """A slalom past two pylons. Planned with wide turns, as a low limit of the load factor (g) makes them, the flight
    winds itself around them."""
    elements = (
        narrow(level("first", -433.2, -233.9, 60.0)),
        narrow(pylon("left", -339.7, -94.0, 320.0)),
        narrow(pylon("right", -285.9, 55.2, 145.0)),
        narrow(level("last", -75.1, 266.1, 350.0)),
    )
    rules = dataclasses.replace(RULES, n_z=Interval(-2.0, n_z), p=200 * DEGREE)
    return Race(course("slalom", *elements, rules=rules), EDGE_540, Air())


SLALOM = slalom(6.0)


def optimum(race: Race, chosen: Settings = QUICK) -> StageResult:
    """The point mass of a race."""
    return search_point_mass(race, chosen, 1) if chosen.search is not SearchEffort.OFF else without_search(race, chosen)


@cached_across_workers
def search_point_mass(race: Race, chosen: Settings, threads: int) -> StageResult:
    """The point mass of a race, found by so many solvers at once."""
    return list(optimize(race, chosen, until=Stage.POINT_MASS, threads=threads, progress=Silent()))[-1]


@contextmanager
def open_session(settings: Settings = PLAN, threads: int = 1) -> Iterator[SolverSession]:
    """A solver process of its own, ended afterwards."""
    with SolverService() as service, closing(SolverSession(service, settings, Silent(), threads)) as session:
        yield session


@functools.cache
def planned_coarse_solution(race: Race) -> CoarseSolution:
    """A race solved coarsely from its own plan, as without a search; done once however many tests ask."""
    stage_problem = prepared(race)
    start = planned_guess(stage_problem, stage_problem.plan, InitialBarrier.COLD)
    with open_session() as session:
        found = solve_coarse(session.service, dataclasses.replace(start, is_baseline=True))
    assert found is not None
    return found
