"""A-posteriori constraint check: does a solution fly, keep every limit between the nodes and pass every gate?

The numbers come from the replay and from the problem's own bounds, not from what the solver enforced at its nodes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from airrace.optimal_control.certificate import Item
from airrace.optimal_control.layout import narrow_range
from airrace.optimal_control.problem import Boundary, Iterate, Problem
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.replay import Replay
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class Tolerance:
    """The excess allowed to quantities of some units between nodes (`path`) and at boundaries (`boundary`).

    The items are called `path_NAME` and `gate_NAME`, the latter with `boundary_name` where that is set.
    """

    name: str
    units: tuple[str, ...]
    path: float
    boundary: float
    boundary_name: str = ""


@dataclass(frozen=True, eq=False)
class ConstraintCheck:
    """The items of a certificate, and the errors and excesses within the intervals.

    Attributes:
        items: of the certificate.
        defect: largest scaled deviation of each replayed interval from the next node, shape (N,).
        excess: what leaves its range within each interval, as a multiple of its limit, at worst; shape (N,).
    """

    items: tuple[Item, ...]
    defect: Array
    excess: Array


def check_constraints(
    problem: Problem, iterate: Iterate, replay: Replay, *, tolerances: Sequence[Tolerance], defect_limit: float
) -> ConstraintCheck:
    """Measure a solution against the limits of its problem, between the nodes and at the boundaries.

    Args:
        problem: with the limits.
        iterate: the solution, SI.
        replay: of it.
        tolerances: of every unit that a bounded quantity of the problem has.
        defect_limit: largest allowed end of a replayed interval minus the next node, scaled.

    Raises:
        ValueError: a quantity is bounded and no tolerance has its unit.
    """
    tolerance_of = {unit: tolerance for tolerance in tolerances for unit in tolerance.units}
    defect = np.abs(replay.defect)
    component, interval = np.unravel_index(int(defect.argmax()), defect.shape)
    where = f"{problem.phase_of(int(interval)).name}, {problem.system.states[int(component)].name}"
    items = [Item("replay_defect", float(defect.max()), defect_limit, "scaled", where)]
    multiples = np.zeros(problem.intervals)
    excesses = _excesses(problem, replay, tolerance_of)
    for tolerance in tolerances:
        own = [(name, largest) for name, unit, largest in excesses if unit in tolerance.units]
        if own:
            largest = np.stack([excess for _, excess in own], axis=0)
            row, interval = np.unravel_index(int(largest.argmax()), largest.shape)
            where = f"{problem.phase_of(int(interval)).name}, {own[int(row)][0]}"
            name, unit = f"path_{tolerance.name}", tolerance.units[0]
            items.append(Item(name, float(largest.max()), tolerance.path, unit, where))
            multiples = np.maximum(multiples, largest.max(axis=0) / tolerance.path)
    items += _boundary_items(problem, iterate, tolerances, tolerance_of)
    return ConstraintCheck(tuple(items), defect.max(axis=0), multiples)


def _excesses(problem: Problem, replay: Replay, tolerance_of: Mapping[str, Tolerance]) -> list[tuple[str, str, Array]]:
    """Return (name, unit, largest excess in each interval, shape (N,)) of all that is limited along the flight."""
    excesses: list[tuple[str, str, Array]] = []
    phases = [slice(first, last) for first, last in pairwise(problem.first_node)]
    declared = [*problem.system.states, *problem.system.path]
    histories: Array = np.concatenate([replay.state, replay.path])
    for quantity, history in zip(declared, histories, strict=True):
        lower, upper = np.empty((problem.intervals, 1)), np.empty((problem.intervals, 1))
        for phase, within in zip(problem.phases, phases, strict=True):
            bounds = narrow_range(quantity, phase.bounds)
            _require_tolerance(quantity, bounds, tolerance_of)
            lower[within], upper[within] = bounds.lower, bounds.upper
        excesses.append((quantity.name, quantity.unit, outside(history, lower, upper).max(axis=1)))
    for phase, within in zip(problem.phases, phases, strict=True):
        for constraint in phase.path_constraints:  # by their exact measure
            if constraint.at is not None:
                continue  # it is asked for at a node, where the conditions of optimality are measured
            states = replay.state[:, within]
            measure = (constraint.exact or constraint.observation).values
            outputs = at_points(
                measure, states.reshape(len(states), -1), np.asarray(constraint.values, dtype=np.float64)
            )
            for quantity, values in zip(constraint.observation.quantities, outputs, strict=True):
                bounds = constraint.bounds.get(quantity.name, Interval())
                if bounds.constrained:
                    _require_tolerance(quantity, bounds, tolerance_of)
                    largest = np.zeros(problem.intervals)
                    samples = values.reshape(states.shape[1:])
                    largest[within] = outside(samples, bounds.lower, bounds.upper).max(axis=1)
                    excesses.append((constraint.name, quantity.unit, largest))
    return excesses


def _require_tolerance(quantity: Quantity, bounds: Interval, tolerance_of: Mapping[str, Tolerance]) -> None:
    """Refuse a bounded quantity whose unit has no tolerance, rather than pass over it in silence."""
    if bounds.constrained and quantity.unit not in tolerance_of:
        raise ValueError(f"no tolerance for {quantity.name} in {quantity.unit!r}")


def outside(values: Array, lower: Array | float, upper: Array | float) -> Array:
    """Compute how far values lie outside the range between two bounds, zero within; all of one shape."""
    return np.maximum(np.maximum(lower - values, values - upper), 0.0)


def _boundary_items(
    problem: Problem, iterate: Iterate, tolerances: Sequence[Tolerance], tolerance_of: Mapping[str, Tolerance]
) -> list[Item]:
    worst = {tolerance.name: (0.0, "") for tolerance in tolerances}
    ends = problem.states_before_jump(iterate.state)[:, np.array(problem.first_node[1:]) - 1]
    states = np.hstack([iterate.state[:, :1], ends]).T
    for x, boundary in zip(states, problem.boundaries, strict=True):
        for quantity, bounds, value in boundary_values(problem, boundary, x):
            _require_tolerance(quantity, bounds, tolerance_of)
            name, violation = (
                tolerance_of[quantity.unit].name,
                float(outside(np.asarray(value), bounds.lower, bounds.upper)),
            )
            if np.isnan(violation) or violation >= worst[name][0]:  # NaN is the worst, and stays it
                worst[name] = (violation, f"{boundary.name}, {quantity.name}")
    items: list[Item] = []
    for tolerance in tolerances:
        violation, where = worst[tolerance.name]
        if where:
            name = f"gate_{tolerance.boundary_name or tolerance.name}"
            items.append(Item(name, violation, tolerance.boundary, tolerance.units[0], where))
    return items


def boundary_values(problem: Problem, boundary: Boundary, x: Array) -> list[tuple[Quantity, Interval, float]]:
    """List (quantity, range, value) of everything that a boundary bounds, at the state x (n_x,) in SI."""
    declared: list[Quantity] = list(problem.system.states)
    values: list[float] = x.tolist()
    if boundary.observation is not None:
        declared += boundary.observation.quantities
        values += np.asarray(boundary.observation.values(x, np.asarray(boundary.values))).ravel().tolist()
    by_name = {quantity.name: (quantity, value) for quantity, value in zip(declared, values, strict=True)}
    return [(by_name[name][0], at, by_name[name][1]) for name, at in boundary.bounds.items() if at.constrained]
