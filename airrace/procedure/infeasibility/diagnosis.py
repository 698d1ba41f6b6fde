"""The diagnosis of a course that cannot be flown: which limit stands in the way, and where.

Only the legs around the place where the solver gave up are looked at: as they are, and without one limit at a time.
"""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np

from airrace.optimal_control.problem import Iterate, Phase, Problem
from airrace.optimal_control.replay import replay
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.procedure.boundary_conditions import unsettled
from airrace.procedure.phase_segments import joined, phase_piece
from airrace.procedure.solver_session import SolverSession
from airrace.quantities import Interval, Quantity
from airrace.system import System

OPTIONS = SolverOptions(tolerance=1e-3, iterations_max=200, barrier=0.1)
"""The options of a diagnosing solve, for which a feasible flight is enough."""
REACH = 2
"""The number of legs before and after the torn one that are looked at."""
POSITION = ("along", "right", "height", "x", "y", "z")
"""The names of the conditions on the position."""

# Limits a user knows, in the order in which they are doubted: (name, text, unit, factor from SI)
LIMITS = (
    ("z", "height between floor and ceiling", "m", -1.0),
    ("n_z", "load factor", "g", 1.0),
    ("C_L", "lift coefficient", "", 1.0),
    ("p_Kbar", "roll rate", "deg/s", 180.0 / math.pi),
    ("V_K", "speed", "m/s", 1.0),
)


def diagnose(session: SolverSession, problem: Problem, stuck: Iterate, guess: Iterate, worst: str) -> str | None:
    """Return a sentence that names the phase and, where one is found, the limit that stands in the way.

    None if the legs around the place can be flown as they are: then nothing there contradicts.

    Args:
        problem: without a solution.
        stuck: where the solver gave up.
        guess: where it started.
        worst: the condition that the solver violates most there; empty where that is not known. It is told only where
            no limit is found: the solver spreads a contradiction over whatever gives way most easily, which need not be
            what is asked too much.
    """
    torn = worst_phase(problem, stuck)
    window, start, _ = window_around(problem, torn, guess)
    if _can_be_flown(session, window, start, "the legs around it alone"):
        return None
    return attribution(session, problem, torn, guess, worst)


def attribution(session: SolverSession, problem: Problem, torn: int, guess: Iterate, worst: str) -> str:
    """Return the sentence of `diagnose` where it is known that the legs around a phase cannot be flown as they are."""
    window, start, first = window_around(problem, torn, guess)
    where = f"the limits contradict each other at {problem.phases[torn].name}"
    for what, relaxed in relaxations(window, torn - first):
        session.progress.activity(f"no flight found; trying without the limit of {what}", 0, 0)
        if _can_be_flown(session, relaxed, start, f"without {what}"):
            return f"{where}; without the limit of {what} there is a flight"
    return f"{where}; no single limit is to blame" + (f"; most violated: {worst}" if worst else "")


def window_around(problem: Problem, torn: int, guess: Iterate) -> tuple[Problem, Iterate, int]:
    """Return the legs around a phase, what a guess has there, and the index of the first of them."""
    first, last = max(0, torn - REACH), min(len(problem.phases), torn + REACH + 1)
    start = joined([phase_piece(guess, problem, index) for index in range(first, last)])
    return windowed(problem, first, last), start, first


def _can_be_flown(session: SolverSession, problem: Problem, guess: Iterate, purpose: str) -> bool:
    solution = session.attempt(problem, guess, purpose, session.settings.solver.primary, OPTIONS, beyond_budget=True)
    return solution is not None and solution.success


def worst_phase(problem: Problem, stuck: Iterate) -> int:
    """Return the index of the phase in which the flight is torn apart most."""
    torn = np.abs(replay(problem, stuck).defect).max(axis=0)
    interval = int(np.nanargmax(torn)) if np.isfinite(torn).any() else 0
    return int(np.searchsorted(problem.first_node, interval, side="right")) - 1


def windowed(problem: Problem, first: int, last: int) -> Problem:
    """Return the problem of phases `first ... last - 1` alone.

    It begins at the gate before them in any way that this gate allows.
    """
    if first == 0:
        start = problem.start
    else:
        before = problem.phases[first - 1].end
        start = dataclasses.replace(before, bounds={**before.bounds, "attitude_norm": Interval.exactly(1.0)})
    return dataclasses.replace(problem, start=start, phases=problem.phases[first:last])


def relaxations(problem: Problem, phase: int) -> Iterator[tuple[str, Problem]]:
    """Yield the problem without one of its limits, and what that limit is.

    Lines and crowd come first, then the limits along the path, those of the ends, those of gates.
    """
    names = dict.fromkeys(watch.name for one in problem.phases for watch in one.watches)
    for name in names:
        yield name, _unwatched(problem, name)
    for name, text, unit, factor in LIMITS:
        found = [one for one in (*problem.system.states, *problem.system.path) if one.name == name]
        for quantity in found:
            allowed = sorted((factor * quantity.lower, factor * quantity.upper))
            yield f"{text} ({_range(allowed[0], allowed[1], unit)})", _freed(problem, name)
    yield from _free_ends(problem)
    for index in (phase, phase - 1):
        if index >= 0:
            name = problem.phases[index].end.name
            yield f"attitude and course at gate {name}", _free_gate(problem, index)


def _range(lower: float, upper: float, unit: str) -> str:
    suffix = f" {unit}" if unit else ""
    if not math.isfinite(upper):
        return f"at least {lower:.4g}{suffix}"
    return f"{lower:.4g} to {upper:.4g}{suffix}"


def _unwatched(problem: Problem, name: str) -> Problem:
    phases = (
        dataclasses.replace(phase, watches=tuple(watch for watch in phase.watches if watch.name != name))
        for phase in problem.phases
    )
    return dataclasses.replace(problem, phases=tuple(phases))


def _freed(problem: Problem, name: str) -> Problem:
    return dataclasses.replace(problem, system=_without(problem.system, name))


def _without(system: System, name: str) -> System:
    def free(declared: tuple[Quantity, ...]) -> tuple[Quantity, ...]:
        return tuple(
            dataclasses.replace(one, lower=_lowest(one), upper=math.inf) if one.name == name else one
            for one in declared
        )

    return dataclasses.replace(system, states=free(system.states), path=free(system.path))


def _lowest(quantity: Quantity) -> float:
    """Return the lower limit of a freed quantity: none, except for speeds, which the equations need to be positive."""
    return 0.3 * quantity.lower if quantity.unit == "m/s" else -math.inf


def _free_ends(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Yield the problem with a free start, and with a free finish, where these are settled."""
    start, last = unsettled(problem.start), problem.phases[-1]
    if start.bounds != problem.start.bounds:
        yield "a settled start", dataclasses.replace(problem, start=start)
    finish = unsettled(last.end)
    if finish.bounds != last.end.bounds:
        phases = (*problem.phases[:-1], dataclasses.replace(last, end=finish))
        yield "a settled finish", dataclasses.replace(problem, phases=phases)


def _free_gate(problem: Problem, index: int) -> Problem:
    """Return the problem with only the position prescribed at the end of a phase."""
    phase = problem.phases[index]
    kept = {name: bounds for name, bounds in phase.end.bounds.items() if name in POSITION}
    freed: Phase = dataclasses.replace(phase, end=dataclasses.replace(phase.end, bounds=kept))
    phases = (*problem.phases[:index], freed, *problem.phases[index + 1 :])
    return dataclasses.replace(problem, phases=phases)
