"""Problems whose limits give way, and how far they have to.

Two problems of the same structure differ in numbers alone: one is asked for, the other is milder. Between them, and
beyond the milder one, lies a line of problems, on which every number moves in proportion. How far along that line the
limits have to give way is one more state `relaxed`, without a rate: 0 for what is asked for, 1 for the milder problem.

    c(x, u, p + relaxed dp) - relaxed d_upper <= upper,     relaxed >= 0

and minimising it gives the least relaxation in that direction.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate, Objective, PathConstraint, Phase, Problem
from airrace.quantities import Interval, Quantity
from airrace.records import record
from airrace.system import Observation, System
from airrace.trajectory import Array

RELAXED = Quantity("relaxed", "1", lower=0.0, text="how far the limits give way")
"""The declaration of the state that says how far the limits give way."""
SLOWEST = 0.3
"""The part of its limit (1) that a least speed keeps however far it gives way: the equations need speeds above 0."""
AT_MOST, AT_LEAST = ", at most", ", at least"
"""The endings of the names of quantities whose upper or lower limits give way."""

_vertcat: Callable[..., ca.SX] = ca.vertcat  # casadi overloads it by the type of its arguments

Place = TypeVar("Place", Boundary, PathConstraint)

Owner = tuple[str, int, int]
"""The owner of a range: ("path", 0, 0), ("boundary", its number, 0) or ("watch", its phase, its number there)."""
PATH: Owner = ("path", 0, 0)
"""The owner of the ranges that hold all along the flight."""


@record
class Shift:
    """The change of both ends of a range from the one problem to the milder one; 0 where both are infinite."""

    lower: float = 0.0
    upper: float = 0.0

    @classmethod
    def between(cls, nominal: Interval, relaxed_problem: Interval) -> "Shift":
        return cls(_change(nominal.lower, relaxed_problem.lower), _change(nominal.upper, relaxed_problem.upper))

    def __bool__(self) -> bool:
        return self.lower != 0.0 or self.upper != 0.0


NO_SHIFT = Shift()
"""The change of a range that stays."""


@record
class Moves:
    """The differences between two problems of the same structure.

    Attributes:
        parameters: of the system's parameters, shape (n_p,).
        ranges: of the ranges by name, by their owner; only those that differ.
        values: of the parameters of boundaries and watches, by their owner; only those that differ.
    """

    parameters: Array
    ranges: Mapping[Owner, Mapping[str, Shift]]
    values: Mapping[Owner, Array]

    @property
    def any(self) -> bool:
        """Whether the problems differ at all."""
        return bool(self.ranges or self.values or self.parameters.any())


def difference(nominal: Problem, relaxed_problem: Problem) -> Moves:
    """Return what differs between two problems that a change of numbers has made of one."""
    ranges: dict[Owner, Mapping[str, Shift]] = {}
    values: dict[Owner, Array] = {}
    for (owner, one), (_, other) in zip(_owners(nominal), _owners(relaxed_problem), strict=True):
        shifts = {name: Shift.between(at, other.bounds.get(name, at)) for name, at in one.bounds.items()}
        if shifted := {name: shift for name, shift in shifts.items() if shift}:
            ranges[owner] = shifted
        change = np.asarray(other.values, dtype=float) - np.asarray(one.values, dtype=float)
        if change.any():
            values[owner] = change
    parameters = np.asarray(relaxed_problem.parameters, dtype=float) - np.asarray(nominal.parameters, dtype=float)
    return Moves(parameters, ranges, values)


def elastic(nominal: Problem, relaxed_problem: Problem, *, weight: float, furthest: float = math.inf) -> Problem:
    """Return the problem of giving way as little as possible.

    Args:
        strict: what is asked for.
        mild: the same with milder numbers.
        weight: of a whole step from the one to the other, in the unit of the objective.
        furthest: the largest number of such steps.
    """
    moved = difference(nominal, relaxed_problem)
    augment = _lifted(nominal.system, _limited(nominal.system))
    along = moved.ranges.get(PATH, {})
    boundaries = [_elastic(one, moved, owner, nominal.system) for owner, one in boundaries_of(nominal)]
    phases = tuple(
        dataclasses.replace(phase, end=end, watches=_watches(phase, index, moved, nominal.system))
        for index, (phase, end) in enumerate(zip(nominal.phases, boundaries[1:], strict=True))
    )
    objective = Objective(
        time=nominal.objective.time,
        terminal={RELAXED.name: weight},
        regularisation=nominal.objective.regularisation,
    )
    return dataclasses.replace(
        nominal,
        system=_bounded(augment, nominal.system, along, furthest),
        parameters=(*nominal.parameters, *moved.parameters.tolist(), *_shifts(nominal.system, along)),
        start=boundaries[0],
        phases=phases,
        objective=objective,
    )


def augment(iterate: Iterate, relaxed: float) -> Iterate:
    """Return a flight with the state that says how far the limits give way."""
    row = np.full((1, iterate.state.shape[1]), relaxed)
    return Iterate(iterate.durations, np.vstack([iterate.state, row]), iterate.control)


def project(iterate: Iterate) -> tuple[Iterate, float]:
    """Return the flight of an elastic problem without that state, and its value."""
    return Iterate(iterate.durations, iterate.state[:-1], iterate.control), float(iterate.state[-1, -1])


# The functions, made once for all directions in which limits give way.


def _limited(system: System) -> tuple[str, ...]:
    """Return the names of states and path quantities that may have limits which give way, in order."""
    states = [one.name for one in system.states if math.isfinite(one.lower) or math.isfinite(one.upper)]
    return (*states, *(one.name for one in system.path))


@functools.lru_cache(maxsize=16)
def _functions(
    rates: ca.Function, path: ca.Function | None, projection: ca.Function | None, rows: tuple[int, ...]
) -> tuple[ca.Function, ca.Function, ca.Function | None]:
    """Return rates, path quantities and projection of a system with the state `relaxed`.

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
    column = _vertcat(*along)
    arguments = [_vertcat(x, relaxed), u, _vertcat(p, change, upper, lower)]
    values = [_vertcat(column - relaxed * upper, column - relaxed * lower)]
    projected = None
    if projection is not None:
        projected = ca.Function("project", [arguments[0]], [_vertcat(projection(x), relaxed)], {"cse": True})
    return (
        ca.Function("rates", arguments, [_vertcat(rates(x, u, now), 0.0)], {"cse": True}),
        ca.Function("path", arguments, values, {"cse": True}),
        projected,
    )


def _lifted(system: System, names: tuple[str, ...]) -> System:
    """Return a system with the state `relaxed`; the limits that may give way are those of path quantities."""
    states = {one.name: row for row, one in enumerate(system.states)}
    rows = tuple(states[name] for name in names if name in states)
    rates, path, projection = _functions(system.rates, system.path_values, system.projection, rows)
    declared = {one.name: one for one in (*system.states, *system.path)}
    return System(
        name=f"{system.name}+elastic",
        states=(*system.states, RELAXED),
        controls=system.controls,
        parameters=(
            *system.parameters,
            *(dataclasses.replace(one, name=f"d_{one.name}") for one in system.parameters),
            *(dataclasses.replace(declared[name], name=f"d_{name}{AT_MOST}") for name in names),
            *(dataclasses.replace(declared[name], name=f"d_{name}{AT_LEAST}") for name in names),
        ),
        rates=rates,
        path=(
            *(dataclasses.replace(declared[name], name=f"{name}{AT_MOST}") for name in names),
            *(dataclasses.replace(declared[name], name=f"{name}{AT_LEAST}") for name in names),
        ),
        path_values=path,
        projection=projection,
    )


def _shifts(system: System, along: Mapping[str, Shift]) -> Iterator[float]:
    """Yield the changes of the limits along the path, first those of all upper, then those of all lower ends."""
    names = _limited(system)
    yield from (along.get(name, NO_SHIFT).upper for name in names)
    yield from (along.get(name, NO_SHIFT).lower for name in names)


def _bounded(augment: System, system: System, along: Mapping[str, Shift], furthest: float) -> System:
    """Return the lifted system with bounds: of states where they stay, of path quantities where they give way."""
    path_names = {one.name for one in system.path}
    declared = {one.name: one for one in (*system.states, *system.path)}

    def limit(row: Quantity) -> Quantity:
        upper_end = row.name.endswith(AT_MOST)
        name = row.name.removesuffix(AT_MOST).removesuffix(AT_LEAST)
        shift, one = along.get(name, NO_SHIFT), declared[name]
        gives_way = (shift.upper if upper_end else shift.lower) != 0.0
        held = gives_way or name in path_names
        lower = one.lower if held and not upper_end else -math.inf
        return dataclasses.replace(row, lower=lower, upper=one.upper if held and upper_end else math.inf)

    def state(one: Quantity) -> Quantity:
        shift = along.get(one.name, NO_SHIFT)
        lowest = SLOWEST * one.lower if one.unit == "m/s" else -math.inf
        lower, upper = lowest if shift.lower else one.lower, math.inf if shift.upper else one.upper
        return dataclasses.replace(one, lower=lower, upper=upper)

    return dataclasses.replace(
        augment,
        states=(*(state(one) for one in system.states), dataclasses.replace(RELAXED, upper=furthest)),
        path=tuple(limit(row) for row in augment.path),
    )


# Boundaries and watches.


def boundaries_of(problem: Problem) -> list[tuple[Owner, Boundary]]:
    """Return the start and the ends of all phases, with what they are called as owners of ranges."""
    every = [problem.start, *(phase.end for phase in problem.phases)]
    return [(("boundary", number, 0), one) for number, one in enumerate(every)]


def _owners(problem: Problem) -> Iterator[tuple[Owner, "Boundary | PathConstraint | _Along"]]:
    """Yield all that owns ranges, in the same order for problems of the same structure."""
    system = problem.system
    yield PATH, _Along({one.name: Interval(one.lower, one.upper) for one in (*system.states, *system.path)})
    yield from boundaries_of(problem)
    for index, phase in enumerate(problem.phases):
        for number, watch in enumerate(phase.watches):
            yield ("watch", index, number), watch


@record
class _Along:
    """The ranges that hold all along a flight."""

    bounds: Mapping[str, Interval]
    values: tuple[float, ...] = ()


def _watches(phase: Phase, index: int, moved: Moves, system: System) -> tuple[PathConstraint, ...]:
    return tuple(
        dataclasses.replace(_elastic(watch, moved, ("watch", index, number), system), exact=None)
        for number, watch in enumerate(phase.watches)
    )


def _elastic(place: Place, moved: Moves, owner: Owner, system: System) -> Place:
    """Return a boundary or a watch whose ranges and parameters give way."""
    shifts, change = moved.ranges.get(owner, {}), moved.values.get(owner)
    giving: list[tuple[str, str, float]] = []  # what gives way, at which end, and how much
    bounds: dict[str, Interval] = {}
    for name, at in place.bounds.items():
        shift = shifts.get(name, NO_SHIFT)
        if shift and at.lower == at.upper and shift.lower == shift.upper:
            giving.append((name, AT_MOST, shift.upper))
            bounds[f"{name}{AT_MOST}"] = at
            continue
        upper, lower = (name, AT_MOST, shift.upper), (name, AT_LEAST, shift.lower)
        giving += [one for one in (upper, lower) if one[2]]
        if shift.upper:
            bounds[f"{name}{AT_MOST}"] = Interval(upper=at.upper)
        if shift.lower:
            bounds[f"{name}{AT_LEAST}"] = Interval(lower=at.lower)
        stays = Interval(-math.inf if shift.lower else at.lower, math.inf if shift.upper else at.upper)
        if stays.bounded:
            bounds[name] = stays
    seen = place.observation
    if seen is None and not giving:
        return place
    ends = tuple((name, end) for name, end, _ in giving)
    values = (*place.values, *(() if change is None else change.tolist()), *(amount for _, _, amount in giving))
    observation = _seen(seen, system.states, ends, changing=change is not None)
    return dataclasses.replace(place, bounds=bounds, observation=observation, values=values)


@functools.lru_cache(maxsize=256)
def _seen(
    observation: Observation | None, states: tuple[Quantity, ...], ends: tuple[tuple[str, str], ...], *, changing: bool
) -> Observation:
    """Return an observation that sees `relaxed` as well.

    Args:
        observation: what is observed; None for nothing but states.
        states: of the system.
        ends: names of states or observed quantities that give way, and which end of theirs.
        changing: whether the parameters move as well.
    """
    quantities, parameters = (observation.quantities, observation.parameters) if observation else ((), ())
    x, relaxed, b = ca.SX.sym("x", len(states)), ca.SX.sym("relaxed"), ca.SX.sym("b", len(parameters))
    change = ca.SX.sym("db", len(parameters) if changing else 0)
    amount = ca.SX.sym("amount", len(ends))
    now = b + relaxed * change if changing else b
    seen = observation.values(x, now).elements() if observation else []
    declared = {one.name: one for one in (*states, *quantities)}
    symbols: dict[str, Any] = {one.name: x[row] for row, one in enumerate(states)}  # Any: casadi's elements of SX
    symbols |= dict(zip((one.name for one in quantities), seen, strict=True))
    giving = [symbols[name] - relaxed * amount[row] for row, (name, _) in enumerate(ends)]
    rows = [dataclasses.replace(declared[name], name=f"{name}{end}") for name, end in ends]
    return Observation(
        name=f"{observation.name if observation else 'states'}, giving way",
        quantities=(*quantities, *rows),
        parameters=(
            *parameters,
            *(dataclasses.replace(one, name=f"d_{one.name}") for one in (parameters if changing else ())),
            *(dataclasses.replace(one, name=f"d_{one.name}") for one in rows),
        ),
        values=ca.Function(
            "seen", [_vertcat(x, relaxed), _vertcat(b, change, amount)], [_vertcat(*seen, *giving)], {"cse": True}
        ),
    )


def _change(nominal: float, relaxed_problem: float) -> float:
    """Return by how much an end of a range moves; one that is gone at once moves by one unit."""
    if math.isinf(nominal):
        return 0.0
    return relaxed_problem - nominal if math.isfinite(relaxed_problem) else math.copysign(1.0, relaxed_problem)
