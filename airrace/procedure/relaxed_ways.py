"""The ways round on which a race is relaxed, and whether limits have to give way on all of them.

A race whose limits have to give way is asked about as soon as its plan has led to no flight: what else it could be
started from is then solved in vain.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np

from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.flight import Flight
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.levers import levers
from airrace.procedure.relaxation import Relaxer
from airrace.procedure.solving import Workbench
from airrace.procedure.varied import with_passages

MILDER = 4.0
"""The usual steps by which all levers give way in the race whose plan is a second way round.

Where an angle of crossing is too small, the plan loops; with a larger one it goes straight.
"""
CLEAR = 0.1
"""The usual steps by which all limits have to give way together before it is plain that there is no flight."""


def relaxed_ways(race: Race, flight: Flight, bench: Workbench) -> Iterator[tuple[Relaxer, Iterate]]:
    """Yield the ways round on which the race is relaxed: as it is planned, and as a milder race would be planned."""
    milder = race
    for lever in levers(race):
        milder = lever.changed(milder, lever.at_steps(min(MILDER, 0.9 * lever.steps_max)))
    plans = [flight.plan, with_passages(milder.plan, race.course)]
    before: Iterate | None = None
    for plan in plans:
        mesh = first_mesh(plan, bench.settings.mesh)
        start = guess(plan, mesh)
        if before is None or not np.array_equal(before.state, start.state):
            yield Relaxer(bench, race, dataclasses.replace(flight, plan=plan), mesh), start
        before = start


def torn_without_doubt(race: Race, flight: Flight, bench: Workbench) -> str:
    """Return the place at which limits clearly contradict each other on all ways round; empty where they may not."""
    where = ""
    for relaxer, start in relaxed_ways(race, flight, bench):
        relaxed = relaxer.together(race, levers(race), start)
        if relaxed is None or relaxed.steps < CLEAR:
            return ""
        where = where or relaxed.where
    return where
