"""Optimality conditions of a solution: KKT errors, costates and the Hamiltonian.

The multiplier of a gap between two intervals says how the optimum changes when the flight is shifted there, which is
the costate p. With the control held and the equations free of time, the Hamiltonian

    H = p . f(x, u) + regularisation

is one constant within an interval, and it jumps where moving the node between two intervals would save time. Along an
optimum in minimum time H is minus the weight of time; how far it is from that says where a mesh is too coarse for the
controls. A jump of the states between two phases is the same for every flight, so neither p nor H jumps with it
[Betts 2010].
"""

from dataclasses import dataclass

import numpy as np

from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array

MULTIPLIER_SCALE = 100.0
"""The mean size of the scaled multipliers beyond which the dual conditions are relaxed in proportion (1).

It is IPOPT's `s_max` [Wächter & Biegler 2006, (6)], so that the error means the same here as there.
"""


@dataclass(frozen=True)
class KktError:
    """The largest violations in scaled units: `primal` feasibility, `dual` stationarity, `complementarity`."""

    primal: float
    dual: float
    complementarity: float

    @property
    def largest(self) -> float:
        """The largest of the three; NaN if any is."""
        return float(np.max((self.primal, self.dual, self.complementarity)))


def kkt_error(functions: Evaluation, layout: Layout, w: Array, p: Array, lam_g: Array) -> tuple[KktError, Array, int]:
    """Measure the errors at (w, lam_g), and find the multipliers of the bounds and the most violated constraint.

    The gradient of the Lagrangian is balanced by the multipliers of the bounds: what a bound cannot take, because it is
    absent, is the dual error; what a distant bound takes shows as complementarity error.
    """
    lower, upper = layout.unknown_bounds()
    g_lower, g_upper = layout.constraint_bounds()
    functions.at(w, p)
    functions.lam_f, functions.lam_g[:] = 1.0, lam_g
    functions.slope()
    g, lam_x = functions.g, -functions.gradient
    violation = np.maximum(np.maximum(g_lower - g, g - g_upper), 0.0)
    outside = np.maximum(np.maximum(lower - w, w - upper), 0.0)
    primal = np.max((violation.max(), outside.max()))  # NaN if either is, which Python's own `max` would lose
    dual, slack_x = _balance(lam_x, w, lower, upper)
    dual_g, slack_g = _balance(lam_g, g, g_lower, g_upper)
    scale = max(MULTIPLIER_SCALE, float(np.abs(lam_g).mean()), float(np.abs(lam_x).mean())) / MULTIPLIER_SCALE
    dual, slack = np.max((dual, dual_g)) / scale, np.max((slack_x, slack_g)) / scale
    return KktError(float(primal), float(dual), float(slack)), lam_x, int(violation.argmax())


def _balance(multiplier: Array, value: Array, lower: Array, upper: Array) -> tuple[float, float]:
    """Return the largest dual and complementarity error of `lower <= value <= upper`.

    Positive multipliers press on `upper`. A multiplier is either carried by its bound (error: multiplier times slack)
    or left over (error: its size), whichever is the smaller. An equality carries any; what it is violated by is a
    primal error.
    """
    slack = np.where(multiplier > 0, upper - value, value - lower)
    slack = np.where(lower == upper, 0.0, slack)
    size = np.abs(multiplier)
    carried = np.where(np.isfinite(slack), size * np.abs(np.where(np.isfinite(slack), slack, 0.0)), np.inf)
    leftover = size < carried
    return float(np.max(size, where=leftover, initial=0.0)), float(np.max(carried, where=~leftover, initial=0.0))


def costates(layout: Layout, constraint_multipliers: Array) -> Array:
    """Compute the costates at the ends of the intervals.

    Args:
        layout: of the problem that was solved.
        constraint_multipliers: of the scaled program; shape (n_g,).

    Returns:
        By how much the objective grows with one unit more of each state there, in the objective's unit per the state's;
        shape (n_x, N).
    """
    scale = np.array([quantity.scale for quantity in layout.problem.system.states])
    return -(constraint_multipliers[layout.gap_index[:, :-1]] / scale).T


def hamiltonian(problem: Problem, iterate: Iterate, constraint_multipliers: Array) -> Array:
    """Compute the Hamiltonian at the end of every interval, with the regularisation that the objective has in it.

    Args:
        problem: any; with free durations the value along its optimum is `-problem.objective.time`.
        iterate: the optimum.
        constraint_multipliers: of the scaled program; shape (n_g,).

    Returns:
        In the objective's unit per second, shape (N,).
    """
    system = problem.system
    slopes = at_points(
        system.rates, problem.states_before_jump(iterate.state), iterate.control, np.asarray(problem.parameters)
    )
    quantities = (*system.states, *system.controls)
    scale = np.array([quantity.scale for quantity in quantities])[:, None]
    weight = np.array([problem.objective.regularisation.get(quantity.name, 0.0) for quantity in quantities])
    values = np.vstack([problem.states_before_jump(iterate.state), iterate.control])
    regularisation = weight @ (values / scale) ** 2
    return np.sum(costates(Layout(problem), constraint_multipliers) * slopes, axis=0) + regularisation


def errors_in_objective(problem: Problem, defect: Array, constraint_multipliers: Array) -> Array:
    """Estimate what the objective would be more, to first order, if every interval ended where its replay does.

    Args:
        problem: that was solved.
        defect: end of each replayed interval minus the next node, scaled; shape (n_x, N).
        constraint_multipliers: of the scaled program; shape (n_g,).

    Returns:
        In the objective's unit, shape (N,).
    """
    scale = np.array([quantity.scale for quantity in problem.system.states])[:, None]
    return np.sum(costates(Layout(problem), constraint_multipliers) * defect * scale, axis=0)
