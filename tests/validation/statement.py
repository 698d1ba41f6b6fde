"""How the textbook problems are put down: a statement, a guess, what is known of the optimum; and how they are solved.

Every problem is a module with a function `known_answers()`; `textbook.py` has all of them.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import ProgramSolution

exactly = Interval.exactly


@dataclass(frozen=True)
class Value:
    """A number that others know of an optimum.

    Attributes:
        name: what it is.
        unit: its unit.
        published: the number as it was written, with all its digits.
        source: who says so.
        tolerance: how far ours may be from it.
        of: where a solution has it.
        closed_form: whether it follows from a formula, so that its digits have no end.
    """

    name: str
    unit: str
    published: str
    source: str
    tolerance: float
    of: Callable[[ProgramSolution], float]
    closed_form: bool = False


@dataclass(frozen=True)
class KnownAnswer:
    """A problem, a guess to begin with, and what is known of the optimum."""

    name: str
    problem: Problem
    guess: Iterate
    values: tuple[Value, ...]
    options: SolverOptions = field(default_factory=lambda: SolverOptions(tolerance=1e-9))

    def solve(self, solver: str = "interior-point") -> ProgramSolution:
        """The optimum by a solver, without compiled kernels."""
        return solve(self.problem, self.guess, solver=solver, options=self.options)


def least_time(published: float, tolerance: float) -> Value:
    """The time of the optimum, known by a formula."""
    return Value("least time", "s", f"{published:.10f}", "closed form", tolerance, objective, closed_form=True)


def objective(solution: ProgramSolution) -> float:
    return solution.objective
