"""How problems of the literature are put down: a statement, the published optimum, its source.

Every problem is a module beside this one with a function `benchmarks()`; `solve_all.py` solves them all.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from airrace.optimal_control import (
    Interval,
    Iterate,
    Phase,
    Problem,
    Quantity,
    Solution,
    SolverOptions,
    at,
    define_problem,
    solve,
    uniform,
)

RELATIVE_TOLERANCE = 1e-4
"""How far ours may be from what is published: what controls held over a hundred intervals cost, amply."""


OPTIONS = SolverOptions(tolerance=1e-8)


@dataclass(frozen=True)
class Benchmark:
    """A problem of the literature.

    Attributes:
        name: of the problem.
        problem: its statement.
        published: the optimum as it was printed, with all its digits.
        source: who printed it.
        kind: what makes it one that solvers differ at, e.g. `singular`.
        guess: where solvers begin; None for `initial_guess`.
        tolerance: how far ours may be from it; by default `RELATIVE_TOLERANCE` of it.
        maximum: whether it is a maximum, so that the objective is its negative.
        closed_form: whether it follows from a formula.
        quick: whether it is solved within seconds.
        options: of the solver.
        of: where a solution has the number, if it is not its objective.
    """

    name: str
    problem: Problem
    published: str
    source: str
    kind: str = "smooth"
    guess: Iterate | None = None
    tolerance: float | None = None
    maximum: bool = False
    closed_form: bool = False
    quick: bool = True
    options: SolverOptions = OPTIONS
    of: Callable[[Solution], float] | None = None

    def solve(self, solver: str = "interior-point") -> Solution:
        """Return what a solver finds on the mesh of the statement."""
        return solve(self.problem, self.guess, solver=solver, options=self.options)

    def value(self, solution: Solution) -> float:
        """Return the number that is published, of a solution."""
        if self.of is not None:
            return self.of(solution)
        return -solution.objective if self.maximum else solution.objective

    def error(self, solution: Solution) -> float:
        """Return by how much ours is larger."""
        return self.value(solution) - float(self.published)

    def holds(self, solution: Solution) -> bool:
        """Return whether an optimum was found, and is the published one."""
        allowed = RELATIVE_TOLERANCE * abs(float(self.published)) if self.tolerance is None else self.tolerance
        return bool(solution.success) and abs(self.error(solution)) <= allowed


def fixed_time(seconds: float, intervals: int, **ends: float) -> list[Phase]:
    """Return a single phase of known duration, to an end at given states."""
    return [Phase("whole", uniform(intervals), Interval.exactly(seconds), at("end", **ends))]


def free_time(shortest: float, longest: float, intervals: int, **ends: float) -> list[Phase]:
    """Return a single phase whose duration is sought, to an end at given states."""
    return [Phase("whole", uniform(intervals), Interval(shortest, longest), at("end", **ends))]


def fit(
    name: str,
    rates: Callable[[Any, Any], Mapping[str, Any]],
    *,
    states: Sequence[Quantity],
    parameters: Sequence[Quantity],
    start: Mapping[str, float],
    times: Sequence[float],
    measured: Sequence[Sequence[float]],
    intervals: int,
) -> Problem:
    """State the least squares fit of parameters of rates to measurements: a phase from each of them to the next.

    Args:
        name: of the problem.
        rates: of the states, as `define_problem` takes them.
        states, parameters: their declarations; `start` has the states at time 0.
        times: of the measurements, s, shape (n,).
        measured: of all states, shape (n, n_states).
        intervals: of each phase.
    """
    steps = np.diff(np.concatenate([[0.0], times]))
    phases = [
        Phase(f"to {time:g}", uniform(intervals), Interval.exactly(float(step)))
        for time, step in zip(times, steps, strict=True)
    ]
    values = np.asarray(measured)

    def misfit(ends: Sequence[Any]) -> Any:  # expressions of casadi
        total = 0.0
        for end, row in zip(ends[1:], values, strict=True):
            for state, value in zip(states, row, strict=True):
                total = total + (getattr(end, state.name) - value) ** 2
        return total

    return define_problem(
        name,
        rates,
        states=states,
        parameters=parameters,
        start=at(**start),
        phases=phases,
        end_cost=misfit,
        time_scale=float(steps.mean()),
    )
