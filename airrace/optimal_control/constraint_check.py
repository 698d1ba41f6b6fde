"""A-posteriori constraint check: does a solution fly, keep every limit between the nodes and pass every gate?

The numbers come from the replay and from the problem's own bounds, not from what the solver enforced at its nodes.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from airrace.optimal_control.certificate import Item
from airrace.optimal_control.layout import narrow_range
from airrace.optimal_control.problem import Boundary, Iterate, PathConstraint, Problem
from airrace.optimal_control.replay import Replay
from airrace.points import at_points
from airrace.quantities import Interval, Quantity
from airrace.records import record
from airrace.trajectory import Array


@record
class Tolerance:
    """The excess allowed to quantities of some units between nodes (`path`) and at boundaries (`boundary`).

    The items are called `path_NAME` and `gate_NAME`, the latter with `boundary_name` where that is given.
    """

    name: str
    units: tuple[str, ...]
    path: float
    boundary: float
    boundary_name: str = ""


@record
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
    problem: Problem, iterate: Iterate, flown: Replay, *, tolerances: Sequence[Tolerance], defect_limit: float
) -> ConstraintCheck:
    """Measure a solution against the limits of its problem, between the nodes and at the boundaries.

    Args:
        problem: with the limits.
        iterate: the solution, SI.
        flown: its replay.
        tolerances: of every unit that a bounded quantity of the problem has.
        defect_limit: largest allowed end of a replayed interval minus the next node, scaled.

    Raises:
        ValueError: a quantity is bounded and no tolerance has its unit.
    """
    defect = np.abs(flown.defect)
    worst = np.unravel_index(int(defect.argmax()), defect.shape)
    system = problem.system
    where = f"{problem.phase_of(int(worst[1])).name}, {system.states[int(worst[0])].name}"
    items = [Item("replay_defect", float(defect.max()), defect_limit, "scaled", where)]
    multiples = np.zeros(problem.intervals)
    excesses = [*_path_excesses(problem, flown), *_watch_excesses(problem, flown)]
    _require_tolerances([one.quantity for one in excesses], tolerances)
    _require_tolerances(_bounded_at_boundaries(problem), tolerances)
    for tolerance in tolerances:
        mine = [one for one in excesses if one.quantity.unit in tolerance.units]
        if not mine:
            continue
        largest = np.stack([one.largest for one in mine], axis=0)
        row, interval = np.unravel_index(int(largest.argmax()), largest.shape)
        where = f"{problem.phase_of(int(interval)).name}, {mine[int(row)].name}"
        items.append(Item(f"path_{tolerance.name}", float(largest.max()), tolerance.path, tolerance.units[0], where))
        multiples = np.maximum(multiples, largest.max(axis=0) / tolerance.path)
    items += _boundary_items(problem, iterate, tolerances)
    return ConstraintCheck(tuple(items), defect.max(axis=0), multiples)


@record
class _Excess:
    """The largest excess of a quantity over its range in each interval; `largest` has shape (N,)."""

    name: str
    quantity: Quantity
    largest: Array


def _path_excesses(problem: Problem, flown: Replay) -> list[_Excess]:
    """Return the excesses of states and path quantities."""
    declared = [*problem.system.states, *problem.system.path]
    histories = np.concatenate([flown.state, flown.path])
    return [
        _Excess(quantity.name, quantity, _violation(problem, quantity, history).max(axis=1))
        for quantity, history in zip(declared, histories, strict=True)
    ]


def _watch_excesses(problem: Problem, flown: Replay) -> list[_Excess]:
    """Return the excesses of the quantities that the phases watch, by their exact measure."""
    excesses: list[_Excess] = []
    for phase, first, last in zip(problem.phases, problem.first_node, problem.first_node[1:], strict=False):
        for watch in phase.watches:
            seen = _watched(watch, flown.state[:, first:last])
            for quantity, values in zip(watch.observation.quantities, seen, strict=True):
                bounds = watch.bounds.get(quantity.name, Interval())
                if bounds.bounded:
                    largest = np.zeros(problem.intervals)
                    largest[first:last] = outside(values, bounds.lower, bounds.upper).max(axis=1)
                    limited = replace(quantity, lower=bounds.lower, upper=bounds.upper)
                    excesses.append(_Excess(watch.name, limited, largest))
    return excesses


def _watched(watch: PathConstraint, state: Array) -> Array:
    """Return the values of a watch along intervals, shape (n_v, intervals, samples).

    The states have the shape (n_x, intervals, samples).
    """
    observation = watch.exact or watch.observation
    n_x, intervals, samples = state.shape
    seen = at_points(observation.values, state.reshape(n_x, -1), np.asarray(watch.values, dtype=np.float64))
    return seen.reshape(-1, intervals, samples)


def _require_tolerances(declared: Sequence[Quantity], tolerances: Sequence[Tolerance]) -> None:
    """Refuse a bounded quantity whose unit has no tolerance, rather than pass over it in silence."""
    known = {unit for tolerance in tolerances for unit in tolerance.units}
    for quantity in declared:
        if Interval(quantity.lower, quantity.upper).bounded and quantity.unit not in known:
            raise ValueError(f"no tolerance for {quantity.name} in {quantity.unit!r}")


def _bounded_at_boundaries(problem: Problem) -> list[Quantity]:
    """Return the quantities that are bounded at the start and at the ends of phases, with these bounds."""
    found: list[Quantity] = []
    for boundary in (problem.start, *(phase.end for phase in problem.phases)):
        seen = () if boundary.observation is None else boundary.observation.quantities
        for quantity in (*problem.system.states, *seen):
            bounds = boundary.bounds.get(quantity.name, Interval())
            found.append(replace(quantity, lower=bounds.lower, upper=bounds.upper))
    return found


def _violation(problem: Problem, quantity: Quantity, history: Array) -> Array:
    """Compute how far a history, shape (N, samples), leaves its bounds; zero where it keeps them."""
    lower, upper = np.empty(len(history)), np.empty(len(history))
    for phase, first, last in zip(problem.phases, problem.first_node, problem.first_node[1:], strict=False):
        bounds = narrow_range(quantity, phase.bounds)
        lower[first:last], upper[first:last] = bounds.lower, bounds.upper
    return outside(history, lower[:, None], upper[:, None])


def outside(values: Array, lower: Array | float, upper: Array | float) -> Array:
    """Compute how far values lie outside the range between two bounds, zero within; all of one shape."""
    return np.maximum(np.maximum(lower - values, values - upper), 0.0)


def _boundary_items(problem: Problem, iterate: Iterate, tolerances: Sequence[Tolerance]) -> list[Item]:
    worst = {tolerance.name: (0.0, "") for tolerance in tolerances}
    kind = {unit: tolerance.name for tolerance in tolerances for unit in tolerance.units}
    boundaries = [problem.start, *(phase.end for phase in problem.phases)]
    seen = np.hstack(
        [iterate.state[:, :1], problem.states_before_jump(iterate.state)[:, np.array(problem.first_node[1:]) - 1]]
    )
    for x, boundary in zip(seen.T, boundaries, strict=True):
        values = boundary_values(problem, boundary, x)
        for quantity, bounds, value in values:
            violation = float(outside(np.asarray(value), bounds.lower, bounds.upper))
            if np.isnan(violation) or violation >= worst[kind[quantity.unit]][0]:  # NaN is the worst, and stays it
                worst[kind[quantity.unit]] = (violation, f"{boundary.name}, {quantity.name}")
    return [
        Item(
            f"gate_{one.boundary_name or one.name}", worst[one.name][0], one.boundary, one.units[0], worst[one.name][1]
        )
        for one in tolerances
        if worst[one.name][1]
    ]


def boundary_values(problem: Problem, boundary: Boundary, x: Array) -> list[tuple[Quantity, Interval, float]]:
    """List (quantity, range, value) of everything that a boundary bounds, at the state x (n_x,) in SI."""
    declared: list[Quantity] = list(problem.system.states)
    values: list[float] = [float(value) for value in x]
    if boundary.observation is not None:
        declared += boundary.observation.quantities
        seen = np.asarray(boundary.observation.values(x, np.asarray(boundary.values)))
        values += [float(value) for value in seen.ravel()]
    by_name = {quantity.name: (quantity, value) for quantity, value in zip(declared, values, strict=True)}
    seen_bounds = [(*by_name[name], bounds) for name, bounds in boundary.bounds.items() if bounds.bounded]
    return [(quantity, bounds, value) for quantity, value, bounds in seen_bounds]
