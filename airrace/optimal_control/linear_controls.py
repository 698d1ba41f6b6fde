"""A transformation to controls that are continuous and linear over every interval, instead of held.

A control of a `System` is held over an interval. With the control's value as a state and its rate as the control that
is held instead, the value is continuous and piecewise linear:

    x' = f(x, u, p),   u' = r,   r held.

That is a system like any other, so shooting, multipliers, Hamiltonian, replay and constraint check are right for it as
they are. A linear control follows a smooth optimum with an error that falls with the square of the interval, a held
one with an error that falls with the interval itself.

The value's bounds hold at the nodes and therefore everywhere. It goes on from phase to phase; a control that has to be
free to jump there stays a held one. In `Objective.regularisation` the value is a state and the rate the control.
"""

from collections.abc import Callable, Collection
from dataclasses import replace

import casadi as ca

from airrace.quantities import Quantity
from airrace.system import Observation, System

_vertcat: Callable[..., ca.SX] = ca.vertcat  # casadi overloads it by the type of its arguments


def with_linear_controls(system: System, names: Collection[str] | None = None, *, seconds: float) -> System:
    """Return the same system with some of its controls linear over the intervals.

    Their values follow the states of the system in its states, under their own names and with their own bounds. Their
    rates follow the controls that are still held, as `NAME_dot`, without bounds.

    Args:
        system: whose controls are held.
        names: of the controls that become linear; all of them by default.
        seconds: time in which such a control typically changes by its scale, s: it sets the scale of the rates.

    Raises:
        ValueError: a name is not that of a control.
    """
    chosen = [one for one in system.controls if names is None or one.name in names]
    if unknown := set(names or ()) - {one.name for one in chosen}:
        raise ValueError(f"system {system.name!r} has no controls {', '.join(sorted(unknown))}")
    held = [one for one in system.controls if one not in chosen]
    n_x, n_p = len(system.states), len(system.parameters)
    x, u, p = ca.SX.sym("x", n_x + len(chosen)), ca.SX.sym("u", len(system.controls)), ca.SX.sym("p", n_p)
    values, inputs, rates = x[n_x:], u[: len(held)], u[len(held) :]
    place = {one.name: number for group in (chosen, held) for number, one in enumerate(group)}
    control = _vertcat(*[(values if one in chosen else inputs)[place[one.name]] for one in system.controls])
    path, projection = system.path_values, system.projection
    rate_quantities = [
        Quantity(f"{one.name}_dot", f"{one.unit}/s", one.scale / seconds, text=f"rate of {one.text or one.name}")
        for one in chosen
    ]
    return replace(
        system,
        name=f"{system.name} with linear controls",
        states=(*system.states, *chosen),
        controls=(*held, *rate_quantities),
        rates=ca.Function("rates", [x, u, p], [_vertcat(system.rates(x[:n_x], control, p), rates)]),
        path_values=None if path is None else ca.Function("path", [x, u, p], [path(x[:n_x], control, p)]),
        projection=None if projection is None else ca.Function("project", [x], [_vertcat(projection(x[:n_x]), values)]),
    )


def of_first_states(observation: Observation, system: System) -> Observation:
    """Return an observation of a system's states as one of the same system with linear controls.

    Args:
        observation: what is observed of the states x before controls were added to them.
        system: whose states are x and, after them, linear controls.
    """
    n_x = observation.values.size1_in(0)
    x, b = ca.SX.sym("x", len(system.states)), ca.SX.sym("b", len(observation.parameters))
    values = ca.Function("observe", [x, b], [observation.values(x[:n_x], b)])
    return replace(observation, values=values)
