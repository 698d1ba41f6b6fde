"""How the textbook problems are put down: vectors, their rates, what is known of the optimum; and how they are solved.

Every problem is a module with a function `known_answers()`; `textbook.py` has all of them.
"""

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers import Solution, SolverOptions, solve
from airrace.quantities import Interval, Vector, vector
from airrace.system import Observation, System

exactly = Interval.exactly


@vector
class Nothing(Vector):
    """A vector without components."""


def textbook_system(
    name: str,
    State: type[Vector],
    Control: type[Vector],
    rates: Callable[[Any, Any], Vector],  # Any: each problem has its own vectors
    *,
    Path: type[Vector] = Nothing,
    path: Callable[[Any, Any], Vector] | None = None,
    projection: Callable[[Any], Vector] | None = None,
) -> System:
    """The system `x_dot = rates(x, u)` with path quantities `path(x, u)`, no parameters."""
    x, u, p = ca.SX.sym("x", State.size()), ca.SX.sym("u", Control.size()), ca.SX.sym("p", 0)
    state, control = State.split(x), Control.split(u)
    return System(
        name=name,
        states=State.quantities(),
        controls=Control.quantities(),
        parameters=(),
        rates=ca.Function("rates", [x, u, p], [ca.vertcat(*rates(state, control).join())]),
        path=Path.quantities(),
        path_values=ca.Function("path", [x, u, p], [ca.vertcat(*path(state, control).join())]) if path else None,
        projection=ca.Function("project", [x], [ca.vertcat(*projection(state).join())]) if projection else None,
    )


def textbook_observation(
    name: str, State: type[Vector], Seen: type[Vector], observe: Callable[[Any], Vector]
) -> Observation:
    """The observation `observe(x)`, the same at every boundary."""
    x, b = ca.SX.sym("x", State.size()), ca.SX.sym("b", 0)
    values = ca.Function("observe", [x, b], [ca.vertcat(*observe(State.split(x)).join())])
    return Observation(name, Seen.quantities(), (), values)


def corners(*states: Vector) -> np.ndarray:
    """Guessed states at the start and at the end of each phase, shape (n_x, n + 1)."""
    return np.array([state.join() for state in states], dtype=float).T


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
    of: Callable[[Solution], float]
    closed_form: bool = False


@dataclass(frozen=True)
class KnownAnswer:
    """A problem, a guess to begin with, and what is known of the optimum."""

    name: str
    problem: Problem
    guess: Iterate
    values: tuple[Value, ...]
    options: SolverOptions = field(default_factory=lambda: SolverOptions(tolerance=1e-9))

    def solve(self, solver: str = "fatrop") -> Solution:
        """The optimum by a solver, without compiled kernels and without a word."""
        kernels = build_kernels(self.problem.system, self.problem.scheme, compiled=False)
        with contextlib.redirect_stdout(io.StringIO()):
            return solve(Layout(self.problem), kernels, self.guess, solver=solver, options=self.options)


def least_time(published: float, tolerance: float) -> Value:
    """The time of the optimum, known by a formula."""
    return Value("least time", "s", f"{published:.10f}", "closed form", tolerance, objective, closed_form=True)


def objective(solution: Solution) -> float:
    return solution.objective
