"""The budget of a stage: how much may be solved for it in vain before it is given up.

Work is counted, not timed, so that a run ends alike on every machine and with any number of threads: iterations, those
of a restoration of feasibility included, times intervals, times what an iteration costs its solver. Only what ends
without an optimum is counted. Solves that find one are limited by the number of meshes.
"""

import math
from dataclasses import dataclass

from airrace.optimal_control.problem import Problem
from airrace.optimal_control.solvers.solver import SOLVERS
from airrace.planning.plan import Plan
from airrace.procedure.guess import first_mesh
from airrace.procedure.settings import MeshSettings

PER_INTERVAL = 5000
"""The work in vain that a stage may take per interval of its race's first mesh: so many iterations on that mesh.

In the ladders of the shipped courses one stage of 48 takes any of it, 11; of 54 point masses on generated courses, 24
of them under tight limits, 47 take none and the others 60 to 540. It is spent in 1.1 to 1.4 times the planned race
time.
"""
FEWEST_INTERVALS = 100
"""The number of intervals that a race is taken to have at least: small ones have time to spare."""
SEARCHED = 2 / 3
"""The share of the budget of which nothing is left for an explanation, once it is spent in search of a flight."""


@dataclass
class Budget:
    """The work in vain that a stage may take, and what is spent of it.

    Attributes:
        work: that may be spent.
        spent: of it so far.
        in_vain: whether only what ends without an optimum is counted.
    """

    work: float = math.inf
    spent: int = 0
    failed_only: bool = True

    @classmethod
    def of(cls, plan: Plan, settings: MeshSettings) -> "Budget":
        """Return the budget of every stage of a race, from its plan."""
        intervals = sum(len(fractions) for fractions in first_mesh(plan, settings))
        return cls(PER_INTERVAL * max(intervals, FEWEST_INTERVALS))

    def begin(self) -> None:
        """Begin a stage, with nothing spent."""
        self.spent = 0

    def for_an_explanation(self) -> "Budget":
        """Return what is left for finding out why nothing was found: a third at least."""
        return Budget(self.work, min(self.spent, int(SEARCHED * self.work)) if math.isfinite(self.work) else 0)

    @property
    def exhausted(self) -> bool:
        """Tell whether nothing is left."""
        return self.spent >= self.work

    def iterations(self, problem: Problem, solver: str, most: int) -> int:
        """Return how many iterations a solver may take on a problem: `most`, or what is left."""
        left = (self.work - self.spent) / _cost(problem, solver)
        return most if left >= most else max(0, math.ceil(left))

    def spend(self, problem: Problem, solver: str, iterations: int, *, failed_only: bool) -> None:
        """Take note of what a solver has done, and whether that was in vain."""
        if failed_only or not self.failed_only:
            self.spent += iterations * _cost(problem, solver)


def _cost(problem: Problem, solver: str) -> int:
    """Return what an iteration costs."""
    return problem.intervals * SOLVERS[solver].effort
