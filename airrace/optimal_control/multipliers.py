"""The multipliers of a solved problem by name, and all dual quantities as named arrays with units and signs.

A costate is by how much the objective grows with one unit more of its state there; a multiplier is positive at an upper
bound and negative at a lower one, so that raising an upper bound by one unit changes the objective by minus the
multiplier.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import costates, hamiltonian
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.trajectory import Array

DURATION = "duration"
"""The name under which the multipliers of the ranges of durations are asked for."""
COSTATE_SIGN = "by how much the objective grows with one unit more of the state"
MULTIPLIER_SIGN = "positive at an upper bound, negative at a lower one; minus what the objective changes by per unit"
HAMILTONIAN_SIGN = "minus the weight of time where durations are free, -1 in least time"

Dimension = Literal["node", "interval", "interval_end", "phase"]
"""What the values of a variable belong to: the N + 1 nodes, the N intervals, their ends, or the n phases."""


@dataclass(frozen=True, eq=False)
class DualVariable:
    """A named array of dual values, of the limit or rate of one quantity.

    Attributes:
        name: e.g. `costate_h`.
        quantity: the name of the quantity that it belongs to; empty for the Hamiltonian.
        dimension: what the values belong to.
        values: one each.
        unit: of the values.
        text: what it is, for people.
        sign: what its sign means.
    """

    name: str
    quantity: str
    dimension: Dimension
    values: Array
    unit: str
    text: str
    sign: str


def multipliers_of(layout: Layout, multipliers: Multipliers, name: str) -> Array:
    """Return the multipliers of all limits of a quantity, in the objective's unit per unit of the quantity.

    Args:
        layout: of the problem that was solved.
        multipliers: of the scaled program.
        name: of a state, a path quantity or what an observation sees, at the nodes, shape (N + 1,), where those of
            several limits add up; of a control, on the intervals, shape (N,); or `"duration"`, shape (n phases,).

    Raises:
        KeyError: nothing has this name.
    """
    system, bounds = layout.problem.system, multipliers.bounds / layout.scale
    for index, quantities in ((layout.state_index, system.states), (layout.control_index, system.controls)):
        for column, quantity in enumerate(quantities):
            if quantity.name == name:
                return bounds[index[:, column]]
    if name == DURATION:
        return bounds[layout.phase_durations]
    if name not in (quantity.name for quantity in observed_quantities(layout)):
        raise KeyError(f"nothing is called {name!r} that could be limited")
    rows = layout.rows
    numbers = [number for number, limit in enumerate(rows.limits) if limit.quantity.name == name]
    own = np.isin(rows.number, numbers)
    values = multipliers.constraints[layout.row_index[own]] / rows.scale[own]
    return np.bincount(rows.node[own], weights=values, minlength=layout.intervals + 1).astype(np.float64)


def observed_quantities(layout: Layout) -> list[Quantity]:
    """Return what is seen along the path, at boundaries and by path constraints, each name once."""
    problem = layout.problem
    quantities = {quantity.name: quantity for quantity in problem.system.path}
    for observation in problem.observations:
        for quantity in observation.quantities:
            quantities.setdefault(quantity.name, quantity)
    return list(quantities.values())


def dual_variables(
    layout: Layout, iterate: Iterate, multipliers: Multipliers, objective_unit: str
) -> list[DualVariable]:
    """Return costates, Hamiltonian and the multipliers of everything that is limited.

    Args:
        layout: of the problem that was solved.
        iterate: the optimum.
        multipliers: of the scaled program.
        objective_unit: e.g. `s`.
    """
    problem = layout.problem
    system = problem.system
    variables: list[DualVariable] = []
    for quantity, values in zip(system.states, costates(layout, multipliers.constraints), strict=True):
        text, unit = f"costate of {quantity.text or quantity.name}", f"{objective_unit}/({quantity.unit})"
        name = f"costate_{quantity.name}"
        variables.append(DualVariable(name, quantity.name, "interval_end", values, unit, text, COSTATE_SIGN))
    values, unit = hamiltonian(problem, iterate, multipliers.constraints), f"{objective_unit}/s"
    unit = "1" if objective_unit == "s" else unit
    variables.append(DualVariable("hamiltonian", "", "interval_end", values, unit, "Hamiltonian", HAMILTONIAN_SIGN))
    states, controls = {state.name for state in system.states}, {control.name for control in system.controls}
    limited = {limit.quantity.name for limit in layout.rows.limits}
    duration = Quantity(DURATION, "s", text="duration of the phase")
    for quantity in (*system.states, *system.controls, *observed_quantities(layout), duration):
        name = quantity.name
        if name not in states | controls | limited | {DURATION}:
            continue
        dimension: Dimension = "interval" if name in controls else "phase" if name == DURATION else "node"
        text = f"multiplier of the limits of {quantity.text or name}"
        values, unit = multipliers_of(layout, multipliers, name), f"{objective_unit}/({quantity.unit})"
        variables.append(DualVariable(f"multiplier_{name}", name, dimension, values, unit, text, MULTIPLIER_SIGN))
    return variables
