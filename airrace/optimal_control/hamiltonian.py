"""The costates and the Hamiltonian, from the multipliers of the gaps between the intervals.

The multiplier of a gap says how the optimum changes when the flight is shifted there, which is the costate p. With the
control held and the equations free of time, the Hamiltonian

    H = p . f(x, u) + regularisation

is one constant within an interval, and it jumps where moving the node between two intervals would save time. So
along an optimum in minimum time H is minus the weight of time, and how far it is from that says where a mesh is too
coarse for the controls. A jump of the states between two phases is the same for every flight, so neither p nor H jumps
with it (Betts, Practical Methods for Optimal Control, 2010, on the adjoints of discretised problems).
"""

import numpy as np

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, Problem
from airrace.points import at_points
from airrace.trajectory import Array


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
    slopes = at_points(system.rates, problem.arrivals(iterate.state), iterate.control, np.asarray(problem.parameters))
    scale = np.array([quantity.scale for quantity in system.controls])[:, None]
    weight = np.array([problem.objective.regularisation.get(quantity.name, 0.0) for quantity in system.controls])
    regularisation = weight @ (iterate.control / scale) ** 2
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
