"""Controlled dynamical systems: named states, controls and parameters, and casadi functions of them at many points.

Nothing here knows of aircraft; dynamics builds systems, optimal control optimises them.
"""

import functools
import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from airrace.optimal_control.quantities import Quantity, Scalar, Vector, vector
from airrace.optimal_control.trajectory import Array

_vertcat: Callable[..., ca.SX] = ca.vertcat  # casadi overloads it by the type of its arguments


def named_symbols(declared: Sequence[Quantity]) -> dict[str, Scalar]:
    """Return one scalar symbol per quantity, by name and in order."""
    return {quantity.name: ca.SX.sym(quantity.name) for quantity in declared}


def column(entries: Iterable[Scalar]) -> ca.SX:
    """Return the entries stacked into one column."""
    return _vertcat(*entries)


@vector
class NoQuantities(Vector[Any]):  # Any: there is no component whose type it could be
    """A vector without components, such as the controls of a free fall."""


@dataclass(frozen=True, eq=False)
class System:
    """A controlled dynamical system `x_dot = f(x, u, p)` with quantities `c(x, u, p)` to be limited along the path.

    Attributes:
        name: identifies the model in messages.
        states: declarations of x; their bounds hold everywhere unless a phase narrows them.
        controls: declarations of u (constant over an interval); their bounds likewise.
        parameters: declarations of p, constant over the flight.
        rates: SX function (x, u, p) -> x_dot, shapes (n_x,), (n_u,), (n_p,) -> (n_x,).
        path: declarations of c; their bounds hold everywhere unless a phase narrows them.
        path_values: SX function (x, u, p) -> c, shape (n_c,); None without path quantities.
        projection: SX function x -> x applied at the end of each shooting interval (unit quaternions); None for none.

    Raises:
        ValueError: a state or a control is declared to be the rate of a state that the system does not have.
    """

    name: str
    states: tuple[Quantity, ...]
    controls: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    rates: ca.Function
    path: tuple[Quantity, ...] = ()
    path_values: ca.Function | None = None
    projection: ca.Function | None = None

    def __post_init__(self) -> None:
        states = {state.name for state in self.states}
        for quantity in (*self.states, *self.controls):
            if quantity.rate_of and quantity.rate_of not in states:
                raise ValueError(f"{quantity.name} is declared to be the rate of {quantity.rate_of}, which is no state")


@dataclass(frozen=True, eq=False)
class Observation:
    """A set of quantities seen at one instant, e.g. where and how an aircraft crosses a gate.

    Attributes:
        name: identifies it in messages.
        quantities: declarations of the values.
        parameters: declarations of what distinguishes one place of observation from another.
        values: SX function (x, b) -> values, shapes (n_x,), (n_b,) -> (n_v,).
    """

    name: str
    quantities: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    values: ca.Function


SYMBOLS = threading.RLock()
"""Held while functions are made or pickled where other threads may do so: casadi lets other threads run meanwhile, and
counts references to SX nodes without a lock."""


@functools.lru_cache(maxsize=64)
def side_by_side(first: Observation, second: Observation) -> Observation:
    """Join two observations of the same states: the quantities and parameters of the first, then those of the second.

    Raises:
        ValueError: a quantity of the one has the name of a quantity of the other, so that a bound could mean either.
    """
    if twice := {quantity.name for quantity in first.quantities} & {quantity.name for quantity in second.quantities}:
        raise ValueError(f"{first.name} and {second.name} both observe {', '.join(sorted(twice))}")
    with SYMBOLS:
        x = ca.SX.sym("x", first.values.size1_in(0))
        b, c = ca.SX.sym("b", len(first.parameters)), ca.SX.sym("c", len(second.parameters))
        joined = _vertcat(first.values(x, b), second.values(x, c))
        values = ca.Function("side_by_side", [x, _vertcat(b, c)], [joined], {"cse": True})
    return Observation(
        name=f"{first.name} and {second.name}",
        quantities=(*first.quantities, *second.quantities),
        parameters=(*first.parameters, *second.parameters),
        values=values,
    )


def system_of(
    name: str,
    State: type[Vector[Any]],
    Control: type[Vector[Any]],
    rates: Callable[[Any, Any], Vector[Any]],  # Any: each system has vectors of its own
    *,
    Path: type[Vector[Any]] = NoQuantities,
    path: Callable[[Any, Any], Vector[Any]] | None = None,
    projection: Callable[[Any], Vector[Any]] | None = None,
) -> System:
    """Write down a system `x_dot = rates(x, u)` whose states and controls are declared as typed vectors.

    The equations read as in a textbook, with components by name; what is constant is a number in them, so the system
    has no parameters:

        @vector
        class State(Vector[T]):
            x: T = quantity("m")
            v: T = quantity("m/s")

        @vector
        class Force(Vector[T]):
            f: T = quantity("m/s2", lower=-1.0, upper=1.0)

        system_of("sliding mass", State, Force, lambda x, u: State(x=x.v, v=u.f))

    Args:
        name: identifies the system in messages.
        State: the class of x.
        Control: the class of u; `NoQuantities` for none.
        rates: maps x and u, with SX components, to their rates as a State, in units per second.
        Path: the class of what is limited along the path.
        path: maps x and u to the path quantities as a Path; None without path quantities.
        projection: maps x to x at the end of each shooting interval; None for none.
    """
    x, u, p = ca.SX.sym("x", State.size()), ca.SX.sym("u", Control.size()), ca.SX.sym("p", 0)
    state, control = State.split(x), Control.split(u)
    return System(
        name=name,
        states=State.quantities(),
        controls=Control.quantities(),
        parameters=(),
        rates=ca.Function("rates", [x, u, p], [column(rates(state, control).join())]),
        path=Path.quantities(),
        path_values=ca.Function("path", [x, u, p], [column(path(state, control).join())]) if path else None,
        projection=ca.Function("project", [x], [column(projection(state).join())]) if projection else None,
    )


def observation_of(
    name: str, State: type[Vector[Any]], Seen: type[Vector[Any]], observe: Callable[[Any], Vector[Any]]
) -> Observation:
    """Write down an observation `observe(x)` of states that are declared as a typed vector, without parameters.

    Args:
        name: identifies it in messages.
        State: the class of x.
        Seen: the class of what is observed.
        observe: maps x, with SX components, to the observed quantities as a Seen.
    """
    x, b = ca.SX.sym("x", State.size()), ca.SX.sym("b", 0)
    values = ca.Function("observe", [x, b], [column(observe(State.split(x)).join())])
    return Observation(name, Seen.quantities(), (), values)


def at_points(function: ca.Function, *arguments: Array) -> Array:
    """Return the only result of a function at n points, evaluated on numpy's arrays.

    An ordinary call of casadi turns every array into a matrix of casadi's, which takes several times as long as
    evaluating a flight model at all these points.

    Args:
        function: of columns, to a column; of SX, which cannot fail.
        arguments: one column per point, shape (k, n), or what is the same at all points, shape (k,); the first is one
            column per point.

    Returns:
        One column per point, shape (n_v, n).

    Raises:
        ValueError: an argument has another number of rows than the function takes.
    """
    count = arguments[0].shape[1]
    buffer, evaluate = dense(function).map(count).buffer()
    inputs = [_by_point(argument, count) for argument in arguments]
    values = np.zeros((count, function.size1_out(0)))
    for place, array in enumerate(inputs):
        if array.shape != (count, function.size1_in(place)):
            raise ValueError(f"argument {place} of {function.name()} has {array.shape[1]} rows at {len(array)} points")
        if array.size:  # casadi's stubs ask for the buffers' sizes, its code takes them from the buffers
            buffer.set_arg(place, array.data)  # pyright: ignore[reportCallIssue]
    buffer.set_res(0, values.data)  # pyright: ignore[reportCallIssue]
    evaluate()
    return np.ascontiguousarray(values.T)


def dense(function: ca.Function) -> ca.Function:
    """Return a function with its only result dense."""
    if function.sparsity_out(0).is_dense():
        return function
    symbols = [ca.SX.sym(f"i{place}", function.size1_in(place)) for place in range(function.n_in())]
    return ca.Function("dense", symbols, [ca.densify(function(*symbols))])


def _by_point(argument: Array, count: int) -> Array:
    """Return an argument one point after another, as casadi stores it, shape (n, k)."""
    rows = np.tile(argument, (count, 1)) if argument.ndim == 1 else argument.T
    return np.ascontiguousarray(rows, dtype=np.float64)


def with_linear_controls(system: System, names: Collection[str] | None = None, *, seconds: float) -> System:
    """Return the same system with some of its controls continuous and linear over every interval, instead of held.

    A control's value becomes a state and its rate the control that is held: `x' = f(x, u, p), u' = r`. That is a system
    like any other, so shooting, multipliers, Hamiltonian, replay and constraint check are right for it as they are. A
    linear control follows a smooth optimum with an error that falls with the square of the interval, a held one with an
    error that falls with the interval itself.

    The values follow the states of the system in its states, under their own names and with their own bounds, which
    hold at the nodes and therefore everywhere. The rates follow the controls that are still held, as `NAME_dot`,
    without bounds. A value goes on from phase to phase; a control that has to be free to jump there stays a held one.
    In `Objective.regularisation` the value is a state and the rate the control.

    Args:
        system: whose controls are held.
        names: of the controls that become linear; all of them by default.
        seconds: time in which such a control typically changes by its scale, s: it sets the scale of the rates.

    Raises:
        ValueError: a name is not that of a control.
    """
    chosen = [control for control in system.controls if names is None or control.name in names]
    if unknown := set(names or ()) - {control.name for control in chosen}:
        raise ValueError(f"system {system.name!r} has no controls {', '.join(sorted(unknown))}")
    inputs_left = [control for control in system.controls if control not in chosen]
    n_x, n_p = len(system.states), len(system.parameters)
    x, u, p = ca.SX.sym("x", n_x + len(chosen)), ca.SX.sym("u", len(system.controls)), ca.SX.sym("p", n_p)
    values, inputs, rates = x[n_x:], u[: len(inputs_left)], u[len(inputs_left) :]
    symbols = {quantity.name: values[row] for row, quantity in enumerate(chosen)}
    symbols |= {quantity.name: inputs[row] for row, quantity in enumerate(inputs_left)}
    control = _vertcat(*(symbols[quantity.name] for quantity in system.controls))
    path, projection = system.path_values, system.projection
    rate_quantities = [
        Quantity(
            f"{control.name}_dot",
            f"{control.unit}/s",
            control.scale / seconds,
            text=f"rate of {control.text or control.name}",
        )
        for control in chosen
    ]
    return replace(
        system,
        name=f"{system.name} with linear controls",
        states=(*system.states, *chosen),
        controls=(*inputs_left, *rate_quantities),
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
