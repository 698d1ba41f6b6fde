"""Measuring a solution: does it fly, does it keep every limit between the nodes, does it pass every gate.

The numbers come from the replay and from the problem's own bounds, not from what the solver enforced at its nodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.certificate import Item
from airrace.optimal_control.layout import narrowed
from airrace.optimal_control.problem import Boundary, Iterate, Problem
from airrace.optimal_control.replay import Replay
from airrace.quantities import Interval, Quantity
from airrace.trajectory import Array


@dataclass(frozen=True)
class Tolerance:
    """How far quantities of some units may leave their bounds between nodes (`path`) and at boundaries (`boundary`)."""

    name: str
    units: tuple[str, ...]
    path: float
    boundary: float


@dataclass(frozen=True)
class Audit:
    """Items of a certificate, and which intervals are too coarse; `coarse` has shape (N,)."""

    items: tuple[Item, ...]
    coarse: NDArray[np.bool_]


def audit(
    problem: Problem, iterate: Iterate, flown: Replay, *, tolerances: Sequence[Tolerance], defect_limit: float
) -> Audit:
    """Measure one solution; every unit of the problem's bounded quantities needs a tolerance."""
    defect = np.abs(flown.defect)
    worst = np.unravel_index(int(defect.argmax()), defect.shape)
    system = problem.system
    where = f"{_phase_name(problem, int(worst[1]))}, {system.states[int(worst[0])].name}"
    items = [Item("replay_defect", float(defect.max()), defect_limit, "scaled", where)]
    coarse: NDArray[np.bool_] = np.any(defect > defect_limit, axis=0)
    declared = [*system.states, *system.path]
    histories = np.concatenate([flown.state, flown.path])
    _require_tolerances(declared, tolerances)
    for tolerance in tolerances:
        rows = [row for row, quantity in enumerate(declared) if quantity.unit in tolerance.units]
        if not rows:
            continue
        violation = np.stack([_violation(problem, declared[row], histories[row]) for row in rows], axis=0)
        largest = violation.max(axis=2)
        row, interval = np.unravel_index(int(largest.argmax()), largest.shape)
        where = f"{_phase_name(problem, int(interval))}, {declared[rows[int(row)]].name}"
        items.append(Item(f"path_{tolerance.name}", float(largest.max()), tolerance.path, tolerance.units[0], where))
        coarse |= (largest > tolerance.path).any(axis=0)
    items += _boundary_items(problem, iterate, tolerances)
    return Audit(tuple(items), coarse)


def _require_tolerances(declared: Sequence[Quantity], tolerances: Sequence[Tolerance]) -> None:
    """Refuse to pass over a bounded quantity in silence."""
    known = {unit for tolerance in tolerances for unit in tolerance.units}
    for quantity in declared:
        if Interval(quantity.lower, quantity.upper).bounded and quantity.unit not in known:
            raise ValueError(f"no tolerance for {quantity.name} in {quantity.unit!r}")


def _phase_name(problem: Problem, interval: int) -> str:
    phase = int(np.searchsorted(problem.first_node, interval, side="right")) - 1
    return problem.phases[phase].name


def _violation(problem: Problem, quantity: Quantity, history: Array) -> Array:
    """How far a history, shape (N, samples), leaves its bounds; zero where it keeps them."""
    lower, upper = np.empty(len(history)), np.empty(len(history))
    for phase, first, last in zip(problem.phases, problem.first_node, problem.first_node[1:], strict=False):
        bounds = narrowed(quantity, phase.bounds)
        lower[first:last], upper[first:last] = bounds.lower, bounds.upper
    return outside(history, lower[:, None], upper[:, None])


def outside(values: Array, lower: Array | float, upper: Array | float) -> Array:
    """Distance of values from the range between two bounds."""
    return np.maximum(np.maximum(lower - values, values - upper), 0.0)


def _boundary_items(problem: Problem, iterate: Iterate, tolerances: Sequence[Tolerance]) -> list[Item]:
    worst = {tolerance.name: (0.0, "") for tolerance in tolerances}
    kind = {unit: tolerance.name for tolerance in tolerances for unit in tolerance.units}
    boundaries = [problem.start, *(phase.end for phase in problem.phases)]
    for node, boundary in zip(problem.first_node, boundaries, strict=True):
        values = observed(problem, boundary, iterate.state[:, node])
        for quantity, bounds, value in values:
            violation = float(outside(np.asarray(value), bounds.lower, bounds.upper))
            if np.isnan(violation) or violation >= worst[kind[quantity.unit]][0]:  # NaN is the worst, and stays it
                worst[kind[quantity.unit]] = (violation, f"{boundary.name}, {quantity.name}")
    return [
        Item(f"gate_{one.name}", worst[one.name][0], one.boundary, one.units[0], worst[one.name][1])
        for one in tolerances
        if worst[one.name][1]
    ]


def observed(problem: Problem, boundary: Boundary, x: Array) -> list[tuple[Quantity, Interval, float]]:
    """(quantity, range, value) of everything a boundary bounds, at the state x (n_x,)."""
    declared: list[Quantity] = list(problem.system.states)
    values: list[float] = [float(value) for value in x]
    if boundary.observation is not None:
        declared += boundary.observation.quantities
        seen = np.asarray(boundary.observation.values(x, np.asarray(boundary.values)))
        values += [float(value) for value in seen.ravel()]
    by_name = {quantity.name: (quantity, value) for quantity, value in zip(declared, values, strict=True)}
    seen_bounds = [(*by_name[name], bounds) for name, bounds in boundary.bounds.items() if bounds.bounded]
    return [(quantity, bounds, value) for quantity, value, bounds in seen_bounds]
