"""How the textbook problems are put down: vectors, their rates, and the optimum by a solver."""

from collections.abc import Callable
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


def optimum(problem: Problem, guess: Iterate, solver: str = "fatrop", **options: float) -> Solution:
    """Solve without compiled kernels."""
    kernels = build_kernels(problem.system, problem.scheme, compiled=False)
    return solve(Layout(problem), kernels, guess, solver=solver, options=SolverOptions(**options))
