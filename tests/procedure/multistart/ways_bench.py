"""A workbench for the tests of exploring, and flights sketched on it."""

import functools
from collections.abc import Iterator
from contextlib import contextmanager

from explored_races import PLAN
from races import prepared

from airrace.optimal_control.solvers.process.service import SolverService
from airrace.planning.race import Race
from airrace.procedure.progress import Silent
from airrace.procedure.settings import Settings
from airrace.procedure.solving import Workbench
from airrace.procedure.multistart.sketch import Sketch, planned_draught, sketched
from airrace.procedure.multistart.window import COLD_BARRIER


@contextmanager
def workbench(settings: Settings = PLAN, threads: int = 1) -> Iterator[Workbench]:
    """A solver process of its own, ended afterwards."""
    with SolverService() as service:
        yield Workbench(service, settings, Silent(), threads)


@functools.cache
def planned_sketch(race: Race) -> Sketch:
    """A race sketched from its own plan; done once however many tests ask."""
    flight = prepared(race)
    with workbench() as bench:
        found = sketched(bench.service, planned_draught(flight, flight.plan, COLD_BARRIER))
    assert found is not None
    return found
