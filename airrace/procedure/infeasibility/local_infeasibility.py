"""Limits that contradict each other, found out while the first flight is pieced together.

A phase that the homotopy cannot add is looked at with the legs around it, which may begin in any way that the gate
before them allows, and which nothing follows. A race that asks for legs that cannot be flown by themselves has no
flight either, so nothing else need be tried from which all of it would be solved in vain.
"""

import dataclasses
from collections.abc import Sequence

from airrace.optimal_control.problem import Iterate, Problem
from airrace.procedure.infeasibility.diagnosis import OPTIONS, window_around
from airrace.procedure.solver_session import SolverSession
from airrace.records import record

ITERATIONS_MAX = 300
"""The largest number of iterations in which a solver may make its claim; IPOPT took 90 to 260 where it made one."""


@record
class LocalInfeasibility:
    """The place of a contradiction: the phase `torn` of a problem, around which a guess leads to no flight.

    `worst` is the condition that the last solver violated most.
    """

    problem: Problem
    guess: Iterate
    torn: int
    worst: str


def contradiction(
    session: SolverSession, problem: Problem, torn: int, guesses: Sequence[Iterate], *, plain: bool = False
) -> LocalInfeasibility | None:
    """Return the contradiction around a phase; None unless all agree that there is one.

    The primary solver has to fail from every guess, and the fallback has to claim that there is no flight near. Finding
    none is not enough, and where both are one solver nobody can claim it.

    Args:
        bench: what solves.
        problem: of the race.
        torn: the phase that could not be added.
        guesses: of the race, flights of which that phase and those around it are used.
        plain: whether limits are known to have to give way along the plan; then the fallback is not asked.
    """
    primary, *others = session.solvers
    worst = ""
    if plain:
        others = []
    elif not others:
        return None
    for solver in (primary, *others):
        for guess in guesses:
            window, start, _ = window_around(problem, torn, guess)
            options = dataclasses.replace(OPTIONS, iterations_max=ITERATIONS_MAX)
            solution = session.attempt(window, start, "the legs around it alone", solver, options)
            if solution is None or solution.success or (solver != primary and not solution.infeasible):
                return None
            worst = solution.worst
    return LocalInfeasibility(problem, guesses[0], torn, worst)
