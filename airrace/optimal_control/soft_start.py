"""Problems that begin in a measured state, or as near to it as is worth while.

From a state `m` with deviations `s` a problem may have no solution, or one that hardly differs from having none. So its
start is a box around `m` whose size is paid for:

    |x_i(0) - m_i| <= r s_i,     r >= 0,     minimise  J + w r

The price `w` is an exact penalty: where a step of every deviation saves less than `w`, the start is `m` itself. Else
it is as near as is worth `w` per deviation. As a function of `m` the minimum of `J + w r` is finite wherever any start
has a solution, and changes by at most `w` per deviation (the Pasch-Hausdorff envelope of the value function). The size
`r` is a state without a rate.
"""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import casadi as ca

from airrace.optimal_control.elastic import AT_LEAST, AT_MOST, RELAXED, Place, observe_relaxed
from airrace.optimal_control.problem import Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.system import System

_vertcat: Callable[..., ca.SX] = ca.vertcat  # casadi overloads it by the type of its arguments


def soften_start(
    problem: Problem, measured: Mapping[str, float], deviations: Mapping[str, float], *, weight: float
) -> Problem:
    """Return a problem that begins in a measured state, or in one that is as few deviations away as is worth it.

    Args:
        problem: the conditions of its start hold as well.
        measured: the state by name (SI); states that are not among them are free.
        deviations: of each of them, above 0.
        weight: the price of a deviation of all of them, in the unit of the objective.
    """
    states, start = problem.system.states, problem.start
    names = tuple(state.name for state in states if state.name in measured)
    sides = tuple((name, end) for end in (AT_MOST, AT_LEAST) for name in names)
    # One bound is enough: the size is the same all along.
    bounds, amounts = {**start.bounds, RELAXED.name: Interval(lower=0.0)}, [0.0] * len(sides)
    for row, (name, end) in enumerate(sides):
        value = measured[name]
        is_upper = end == AT_MOST
        bounds[f"{name}{end}"] = Interval(upper=value) if is_upper else Interval(lower=value)
        amounts[row] = deviations[name] if is_upper else -deviations[name]
    observation = observe_relaxed(start.observation, states, sides, changing=False)
    phases = tuple(
        replace(
            phase,
            end=_blind(phase.end, problem.system),
            path_constraints=tuple(_blind(constraint, problem.system) for constraint in phase.path_constraints),
        )
        for phase in problem.phases
    )
    objective = problem.objective
    terminal = {**objective.terminal, RELAXED.name: weight}
    return replace(
        problem,
        system=_with_size(problem.system),
        start=replace(start, bounds=bounds, observation=observation, values=(*start.values, *amounts)),
        phases=phases,
        objective=replace(objective, terminal=terminal),
    )


def _blind(place: Place, system: System) -> Place:
    """Return a boundary or a path constraint of a state that has the size of the box as well, and does not see it."""
    if place.observation is None:
        return place
    return replace(place, observation=observe_relaxed(place.observation, system.states, (), changing=False))


@functools.lru_cache(maxsize=16)
def _functions(
    rates: ca.Function, path: ca.Function | None, projection: ca.Function | None
) -> list[ca.Function | None]:
    x, u, p = (ca.SX.sym(name, rates.size1_in(place)) for place, name in enumerate(("x", "u", "p")))
    size, options = ca.SX.sym("size"), {"cse": True}
    extended = _vertcat(x, size)
    return [
        ca.Function("rates", [extended, u, p], [_vertcat(rates(x, u, p), 0.0)], options),
        None if path is None else ca.Function("path", [extended, u, p], [path(x, u, p)], options),
        None if projection is None else ca.Function("project", [extended], [_vertcat(projection(x), size)], options),
    ]


def _with_size(system: System) -> System:
    """Return a system with the size of the box as its last state."""
    rates, path, projection = _functions(system.rates, system.path_values, system.projection)
    assert rates is not None
    return replace(
        system,
        name=f"{system.name}+soft start",
        states=(*system.states, replace(RELAXED, lower=-math.inf)),
        rates=rates,
        path_values=path,
        projection=projection,
    )
