"""Problems whose limits give way, and how far they have to.

Two problems of the same structure differ in numbers alone: the nominal one and a milder one. Between them, and
beyond the milder one, lies a line of problems, on which every number moves in proportion. How far along that line the
limits have to give way is one more state `relaxed`, without a rate: 0 for the nominal problem, 1 for the milder one.

    c(x, u, p + relaxed dp) - relaxed d_upper <= upper,     relaxed >= 0

and minimising it gives the least relaxation in that direction.
"""

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import casadi as ca
import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate, Objective, PathConstraint, Phase, Problem
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.system import Observation, System
from airrace.optimal_control.trajectory import Array

RELAXED = Quantity("relaxed", "1", lower=0.0, text="how far the limits give way")
"""The declaration of the state that says how far the limits give way."""
SLOWEST = 0.3
"""The part of its limit (1) that a least speed keeps however far it gives way: the equations need speeds above 0."""
AT_MOST, AT_LEAST = ", at most", ", at least"
"""The endings of the names of quantities whose upper or lower limits give way."""

_vertcat: Callable[..., ca.SX] = ca.vertcat  # casadi overloads it by the type of its arguments

Place = TypeVar("Place", Boundary, PathConstraint)

Owner = tuple[str, int, int]
"""The owner of a range: ("path", 0, 0), ("boundary", index, 0) or ("path constraint", phase, index in it)."""
PATH: Owner = ("path", 0, 0)
"""The owner of the ranges along the whole flight."""


class Shift(NamedTuple):
    """The change of both ends of a range from the one problem to the milder one; 0 where both are infinite."""

    lower: float = 0.0
    upper: float = 0.0


NO_SHIFT = Shift()
"""The change of a range that stays."""


@dataclass(frozen=True, eq=False)
class Moves:
    """The differences between two problems of the same structure.

    Attributes:
        parameters: of the system's parameters, shape (n_p,).
        ranges: of the ranges by name, by their owner; only those that differ.
        values: of the parameters of boundaries and path constraints, by their owner; only those that differ.
    """

    parameters: Array
    ranges: Mapping[Owner, Mapping[str, Shift]]
    values: Mapping[Owner, Array]

    @property
    def any(self) -> bool:
        """Whether the problems differ at all."""
        return bool(self.ranges or self.values or self.parameters.any())


def difference(nominal: Problem, relaxed_problem: Problem) -> Moves:
    """Return the differences between two problems of the same structure."""
    ranges: dict[Owner, Mapping[str, Shift]] = {}
    values: dict[Owner, Array] = {}
    pairs = zip(_ranges(nominal), _ranges(relaxed_problem), strict=True)
    for (owner, bounds, nominal_values), (_, relaxed_bounds, relaxed_values) in pairs:
        shifts: dict[str, Shift] = {}
        for name, at in bounds.items():
            relaxed_range = relaxed_bounds.get(name, at)
            shifts[name] = Shift(_change(at.lower, relaxed_range.lower), _change(at.upper, relaxed_range.upper))
        if nonzero := {name: shift for name, shift in shifts.items() if any(shift)}:
            ranges[owner] = nonzero
        change = np.asarray(relaxed_values, dtype=float) - np.asarray(nominal_values, dtype=float)
        if change.any():
            values[owner] = change
    parameters = np.asarray(relaxed_problem.parameters, dtype=float) - np.asarray(nominal.parameters, dtype=float)
    return Moves(parameters, ranges, values)


def _ranges(problem: Problem) -> Iterator[tuple[Owner, Mapping[str, Interval], tuple[float, ...]]]:
    """Yield all ranges and parameters by their owner, in the same order for problems of the same structure."""
    system = problem.system
    yield (
        PATH,
        {quantity.name: Interval(quantity.lower, quantity.upper) for quantity in (*system.states, *system.path)},
        (),
    )
    for owner, boundary in boundaries_of(problem):
        yield owner, boundary.bounds, boundary.values
    for index, phase in enumerate(problem.phases):
        for number, constraint in enumerate(phase.path_constraints):
            yield ("path constraint", index, number), constraint.bounds, constraint.values


def boundaries_of(problem: Problem) -> list[tuple[Owner, Boundary]]:
    """Return the start and the ends of all phases, with their keys as owners of ranges."""
    return [(("boundary", number, 0), boundary) for number, boundary in enumerate(problem.boundaries)]


def _change(nominal: float, relaxed_problem: float) -> float:
    """Return by how much an end of a range moves; an end that is removed moves by one unit."""
    if math.isinf(nominal):
        return 0.0
    return relaxed_problem - nominal if math.isfinite(relaxed_problem) else math.copysign(1.0, relaxed_problem)


def elastic(nominal: Problem, relaxed_problem: Problem, *, weight: float, furthest: float = math.inf) -> Problem:
    """Return the problem of giving way as little as possible.

    Args:
        nominal: the problem to be relaxed.
        relaxed_problem: the same with milder numbers.
        weight: of a whole step from the one to the other, in the unit of the objective.
        furthest: the largest number of such steps.
    """
    moves, system = difference(nominal, relaxed_problem), nominal.system
    shifts = [moves.ranges.get(PATH, {}).get(name, NO_SHIFT) for name in _relaxable(system)]
    start, *ends = (_elastic(boundary, moves, owner, system) for owner, boundary in boundaries_of(nominal))
    phases: list[Phase] = []
    for index, (phase, end) in enumerate(zip(nominal.phases, ends, strict=True)):
        constraints = [
            _elastic(constraint, moves, ("path constraint", index, number), system)
            for number, constraint in enumerate(phase.path_constraints)
        ]
        phases.append(
            replace(
                phase, end=end, path_constraints=tuple(replace(constraint, exact=None) for constraint in constraints)
            )
        )
    upper, lower = [shift.upper for shift in shifts], [shift.lower for shift in shifts]
    return replace(
        nominal,
        system=_elastic_system(system, moves.ranges.get(PATH, {}), furthest),
        parameters=(*nominal.parameters, *moves.parameters.tolist(), *upper, *lower),
        start=start,
        phases=tuple(phases),
        objective=Objective(
            time=nominal.objective.time,
            terminal={RELAXED.name: weight},
            regularisation=nominal.objective.regularisation,
        ),
    )


def augment(iterate: Iterate, relaxed: float) -> Iterate:
    """Return a flight with the state that says how far the limits give way."""
    row = np.full((1, iterate.state.shape[1]), relaxed)
    return Iterate(iterate.durations, np.vstack([iterate.state, row]), iterate.control)


def project(iterate: Iterate) -> tuple[Iterate, float]:
    """Return the flight of an elastic problem without that state, and its value."""
    return Iterate(iterate.durations, iterate.state[:-1], iterate.control), float(iterate.state[-1, -1])


def _relaxable(system: System) -> tuple[str, ...]:
    """Return the names of states and path quantities that may have limits which give way, in order."""
    states = [
        quantity.name for quantity in system.states if math.isfinite(quantity.lower) or math.isfinite(quantity.upper)
    ]
    return (*states, *(quantity.name for quantity in system.path))


def _elastic_system(system: System, shifts: Mapping[str, Shift], furthest: float) -> System:
    """Return a system with the state `relaxed`; the limits that give way are those of path quantities."""
    names, path_names = _relaxable(system), {quantity.name for quantity in system.path}
    rows = tuple(row for row, quantity in enumerate(system.states) if quantity.name in names)
    rates, path, projection = _elastic_functions(system.rates, system.path_values, system.projection, rows)
    declared = {quantity.name: quantity for quantity in (*system.states, *system.path)}
    sides = [(name, end) for end in (AT_MOST, AT_LEAST) for name in names]

    def limit(name: str, end: str) -> Quantity:
        quantity, shift = declared[name], shifts.get(name, NO_SHIFT)
        holds = name in path_names or (shift.upper if end == AT_MOST else shift.lower) != 0.0
        lower = quantity.lower if holds and end == AT_LEAST else -math.inf
        upper = quantity.upper if holds and end == AT_MOST else math.inf
        return replace(quantity, name=f"{name}{end}", lower=lower, upper=upper)

    def state(quantity: Quantity) -> Quantity:
        shift = shifts.get(quantity.name, NO_SHIFT)
        lowest = SLOWEST * quantity.lower if quantity.unit == "m/s" else -math.inf
        lower, upper = lowest if shift.lower else quantity.lower, math.inf if shift.upper else quantity.upper
        return replace(quantity, lower=lower, upper=upper)

    return System(
        name=f"{system.name}+elastic",
        states=(*(state(quantity) for quantity in system.states), replace(RELAXED, upper=furthest)),
        controls=system.controls,
        parameters=(
            *system.parameters,
            *(replace(parameter, name=f"d_{parameter.name}") for parameter in system.parameters),
            *(replace(declared[name], name=f"d_{name}{end}") for name, end in sides),
        ),
        rates=rates,
        path=tuple(limit(name, end) for name, end in sides),
        path_values=path,
        projection=projection,
    )


@functools.lru_cache(maxsize=16)
def _elastic_functions(
    rates: ca.Function, path: ca.Function | None, projection: ca.Function | None, rows: tuple[int, ...]
) -> tuple[ca.Function, ca.Function, ca.Function | None]:
    """Return rates, path quantities and projection of a system with the state `relaxed`, once for all directions.

    Args:
        rates: of the system.
        path: its path quantities.
        projection: of its states.
        rows: of the states that are limited like path quantities.
    """
    x, u, p = (ca.SX.sym(name, rates.size1_in(place)) for place, name in enumerate(("x", "u", "p")))
    relaxed, change = ca.SX.sym("relaxed"), ca.SX.sym("dp", p.numel())
    along = [x[row] for row in rows]
    now = p + relaxed * change
    along += path(x, u, now).elements() if path is not None else []
    lower, upper = ca.SX.sym("d_lower", len(along)), ca.SX.sym("d_upper", len(along))
    column, options = _vertcat(*along), {"cse": True}
    arguments = [_vertcat(x, relaxed), u, _vertcat(p, change, upper, lower)]
    values = [_vertcat(column - relaxed * upper, column - relaxed * lower)]
    projected = None
    if projection is not None:
        projected = ca.Function("project", [arguments[0]], [_vertcat(projection(x), relaxed)], options)
    return (
        ca.Function("rates", arguments, [_vertcat(rates(x, u, now), 0.0)], options),
        ca.Function("path", arguments, values, options),
        projected,
    )


def _elastic(place: Place, moves: Moves, owner: Owner, system: System) -> Place:
    """Return a boundary or a path constraint whose ranges and parameters give way."""
    shifts, change = moves.ranges.get(owner, {}), moves.values.get(owner)
    sides: list[tuple[str, str]] = []  # what gives way, and at which end
    amounts: list[float] = []
    bounds: dict[str, Interval] = {}
    for name, at in place.bounds.items():
        shift = shifts.get(name, NO_SHIFT)
        if any(shift) and at.lower == at.upper and shift.lower == shift.upper:
            fixed_range, elastic_ranges = Interval(), [(AT_MOST, shift.upper, at)]
        else:
            fixed_range = Interval(-math.inf if shift.lower else at.lower, math.inf if shift.upper else at.upper)
            upper, lower = Interval(upper=at.upper), Interval(lower=at.lower)
            elastic_ranges = [(AT_MOST, shift.upper, upper), (AT_LEAST, shift.lower, lower)]
        for end, amount, limit in elastic_ranges:
            if amount:
                sides.append((name, end))
                amounts.append(amount)
                bounds[f"{name}{end}"] = limit
        if fixed_range.constrained:
            bounds[name] = fixed_range
    if place.observation is None and not sides:
        return place
    values = (*place.values, *(() if change is None else change.tolist()), *amounts)
    observation = observe_relaxed(place.observation, system.states, tuple(sides), changing=change is not None)
    return replace(place, bounds=bounds, observation=observation, values=values)


@functools.lru_cache(maxsize=256)
def observe_relaxed(
    observation: Observation | None, states: tuple[Quantity, ...], sides: tuple[tuple[str, str], ...], *, changing: bool
) -> Observation:
    """Return an observation that sees `relaxed` as well.

    Args:
        observation: what is observed; None for nothing but states.
        states: of the system.
        sides: names of states or observed quantities that give way, and which end of theirs.
        changing: whether the parameters move as well.
    """
    quantities, parameters = (observation.quantities, observation.parameters) if observation else ((), ())
    moving = parameters if changing else ()
    x, relaxed, b = ca.SX.sym("x", len(states)), ca.SX.sym("relaxed"), ca.SX.sym("b", len(parameters))
    change, amount = ca.SX.sym("db", len(moving)), ca.SX.sym("amount", len(sides))
    outputs = observation.values(x, b + relaxed * change if changing else b).elements() if observation else []
    declared = {quantity.name: quantity for quantity in (*states, *quantities)}
    symbols: dict[str, Any] = {
        quantity.name: x[row] for row, quantity in enumerate(states)
    }  # Any: casadi's elements of SX
    symbols |= dict(zip((quantity.name for quantity in quantities), outputs, strict=True))
    relaxed_outputs = [symbols[name] - relaxed * amount[row] for row, (name, _) in enumerate(sides)]
    rows = [replace(declared[name], name=f"{name}{end}") for name, end in sides]
    arguments, values = [_vertcat(x, relaxed), _vertcat(b, change, amount)], [_vertcat(*outputs, *relaxed_outputs)]
    return Observation(
        name=f"{observation.name if observation else 'states'}, giving way",
        quantities=(*quantities, *rows),
        parameters=(*parameters, *(replace(quantity, name=f"d_{quantity.name}") for quantity in (*moving, *rows))),
        values=ca.Function("seen", arguments, values, {"cse": True}),
    )
