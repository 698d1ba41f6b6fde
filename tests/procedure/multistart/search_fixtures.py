"""A solver session for the tests of exploring, and flights sketched on it."""

import functools
from collections.abc import Iterator
from contextlib import contextmanager

from explored_races import PLAN
from races import prepared

from airrace.optimal_control.solvers.process.service import SolverService
from airrace.planning.race import Race
from airrace.procedure.multistart.coarse_solution import CoarseSolution, planned_guess, solve_coarse
from airrace.procedure.multistart.window import COLD_BARRIER
from airrace.procedure.progress import Silent
from airrace.procedure.settings import Settings
from airrace.procedure.solver_session import SolverSession


@contextmanager
def open_session(settings: Settings = PLAN, threads: int = 1) -> Iterator[SolverSession]:
    """A solver process of its own, ended afterwards."""
    with SolverService() as service:
        yield SolverSession(service, settings, Silent(), threads)


@functools.cache
def planned_coarse_solution(race: Race) -> CoarseSolution:
    """A race sketched from its own plan; done once however many tests ask."""
    flight = prepared(race)
    with open_session() as session:
        found = solve_coarse(session.service, planned_guess(flight, flight.plan, COLD_BARRIER))
    assert found is not None
    return found
