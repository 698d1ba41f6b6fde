"""The routes on which a race is relaxed, and whether limits have to give way on all of them.

A race whose limits have to give way is asked about as soon as its plan has led to no flight. It may still have one,
another route: where a crowd stands between two gates, the plan's relaxed flight goes through it. So the homotopy
has to fail as well.
"""

import dataclasses
from collections.abc import Iterable, Iterator

import numpy as np

from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.infeasibility.elastic_solver import ElasticSolver, Relaxed
from airrace.procedure.infeasibility.parameters import relaxables
from airrace.procedure.perturbed import with_passages
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight
from airrace.records import record

MILDER = 4.0
"""The usual steps by which all relaxable parameters give way in the race whose plan is a second route.

Where an angle of crossing is too small, the plan loops; with a larger one it goes straight.
"""
CLEAR = 0.1
"""The usual steps by which all limits have to give way together before it is plain that there is no flight."""


@record
class Relaxation:
    """A race whose limits give way together, and what relaxed it along one route."""

    relaxer: ElasticSolver
    relaxed: Relaxed


def _ways(race: Race, flight: Flight, session: SolverSession) -> Iterator[tuple[ElasticSolver, Iterate]]:
    """Yield the routes on which the race is relaxed: as it is planned, and as a milder race would be planned."""
    milder = race
    for relaxable in relaxables(race):
        milder = relaxable.changed(milder, relaxable.at_steps(min(MILDER, 0.9 * relaxable.steps_max)))
    plans = [flight.plan, with_passages(milder.plan, race.course)]
    before: Iterate | None = None
    for plan in plans:
        mesh = first_mesh(plan, session.settings.mesh)
        start = guess(plan, mesh)
        if before is None or not np.array_equal(before.state, start.state):
            yield ElasticSolver(session, race, dataclasses.replace(flight, plan=plan), mesh), start
        before = start


def relaxation(race: Race, relaxer: ElasticSolver, start: Iterate) -> Relaxation | None:
    """Return a race with all its limits relaxed, from a flight to begin with; None if that is not found."""
    relaxed = relaxer.together(race, relaxables(race), start)
    return None if relaxed is None else Relaxation(relaxer, relaxed)


class Relaxations:
    """A race relaxed as it is planned, and as a milder race would be planned; None where that is not found.

    Each of them is found when it is first asked for, and kept.
    """

    def __init__(self, race: Race, flight: Flight, session: SolverSession) -> None:
        self._race = race
        self._ways = _ways(race, flight, session)
        self._found: list[Relaxation | None] = []

    def __iter__(self) -> Iterator[Relaxation | None]:
        yield from tuple(self._found)
        for relaxer, start in self._ways:
            self._found.append(relaxation(self._race, relaxer, start))
            yield self._found[-1]


def torn(found: Iterable[Relaxation | None]) -> str:
    """Return the place at which limits clearly contradict each other on all routes; empty where they may not."""
    where = ""
    for one in found:
        if one is None or one.relaxed.steps < CLEAR:
            return ""
        where = where or one.relaxed.where
    return where
