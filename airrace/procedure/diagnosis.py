"""Why a course cannot be flown: which limit, taken away, makes a flight possible, and where the conflict lies."""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np

from airrace.optimal_control.problem import Iterate, Phase, Problem
from airrace.optimal_control.replay import replay
from airrace.optimal_control.solvers import Solution, SolverOptions
from airrace.procedure.solving import Workbench
from airrace.quantities import Quantity
from airrace.system import System

OPTIONS = SolverOptions(tolerance=1e-3, iterations_max=200, barrier=0.1)  # a feasible flight is enough
POSITION = ("along", "right", "height", "x", "y", "z")

# Limits a user knows, in the order in which they are doubted: (name, text, unit, factor from SI)
LIMITS = (
    ("z", "height between floor and ceiling", "m", -1.0),
    ("n_z", "load factor", "g", 1.0),
    ("C_L", "lift coefficient", "", 1.0),
    ("p_Kbar", "roll rate", "deg/s", 180.0 / math.pi),
    ("V_K", "speed", "m/s", 1.0),
)


def diagnose(bench: Workbench, problem: Problem, stuck: Solution, guess: Iterate) -> str:
    """A sentence that names the phase and, where one is found, the limit that stands in the way.

    Args:
        problem: without a solution.
        stuck: where the solver gave up.
        guess: where it started.
    """
    phase = worst_phase(problem, stuck.iterate)
    where = f"at {problem.phases[phase].name}"
    for what, relaxed in relaxations(problem, phase):
        bench.progress.activity(f"no flight found; trying without the limit of {what}", 0, 0)
        solver = bench.settings.solver.primary
        solution = bench.attempt(relaxed, guess, f"without {what}", solver, OPTIONS)
        if solution is not None and solution.success:
            return f"the limits contradict each other {where}; without the limit of {what} there is a flight"
    return f"the limits contradict each other {where}, most violated: {stuck.worst}; no single limit is to blame"


def worst_phase(problem: Problem, stuck: Iterate) -> int:
    """The phase in which the flight is torn apart most."""
    torn = np.abs(replay(problem, stuck).defect).max(axis=0)
    interval = int(np.nanargmax(torn)) if np.isfinite(torn).any() else 0
    return int(np.searchsorted(problem.first_node, interval, side="right")) - 1


def relaxations(problem: Problem, phase: int) -> Iterator[tuple[str, Problem]]:
    """The problem without one of its limits: those along the path first, then those of the gates of a phase."""
    for name, text, unit, factor in LIMITS:
        found = [one for one in (*problem.system.states, *problem.system.path) if one.name == name]
        for quantity in found:
            allowed = sorted((factor * quantity.lower, factor * quantity.upper))
            what = f"{text} ({allowed[0]:.4g} to {allowed[1]:.4g}{' ' + unit if unit else ''})"
            yield what, dataclasses.replace(problem, system=_without(problem.system, name))
    for index in (phase, phase - 1):
        if index >= 0:
            name = problem.phases[index].end.name
            yield f"attitude and course at gate {name}", _free_gate(problem, index)


def _without(system: System, name: str) -> System:
    def free(declared: tuple[Quantity, ...]) -> tuple[Quantity, ...]:
        return tuple(
            dataclasses.replace(one, lower=_lowest(one), upper=math.inf) if one.name == name else one
            for one in declared
        )

    return dataclasses.replace(system, states=free(system.states), path=free(system.path))


def _lowest(quantity: Quantity) -> float:
    """No lower limit, but for speeds, which the equations need to be positive."""
    return 0.3 * quantity.lower if quantity.unit == "m/s" else -math.inf


def _free_gate(problem: Problem, index: int) -> Problem:
    """The problem with only the position prescribed at the end of a phase."""
    phase = problem.phases[index]
    kept = {name: bounds for name, bounds in phase.end.bounds.items() if name in POSITION}
    freed: Phase = dataclasses.replace(phase, end=dataclasses.replace(phase.end, bounds=kept))
    phases = (*problem.phases[:index], freed, *problem.phases[index + 1 :])
    return dataclasses.replace(problem, phases=phases)
