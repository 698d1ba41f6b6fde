"""Controlled dynamical systems: named states, controls and parameters, and casadi functions of them.

Nothing here knows of aircraft; dynamics builds systems, optimal control optimises them.
"""

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import casadi as ca

from airrace.frames import Scalar
from airrace.quantities import Quantity, Vector, vector
from airrace.records import record

_vertcat: Callable[..., ca.SX] = ca.vertcat  # casadi overloads it by the type of its arguments


def named_symbols(declared: Sequence[Quantity]) -> dict[str, Scalar]:
    """Return one scalar symbol per quantity, by name and in order."""
    return {one.name: ca.SX.sym(one.name) for one in declared}


def column(entries: Iterable[Scalar]) -> ca.SX:
    """Return the entries stacked into one column."""
    return _vertcat(*entries)


@vector
class NoQuantities(Vector[Any]):  # Any: there is no component whose type it could be
    """A vector without components, such as the controls of a free fall."""


@record
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
        states = {one.name for one in self.states}
        for one in (*self.states, *self.controls):
            if one.rate_of and one.rate_of not in states:
                raise ValueError(f"{one.name} is declared to be the rate of {one.rate_of}, which is no state")


@record
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


@functools.lru_cache(maxsize=64)
def side_by_side(one: Observation, other: Observation) -> Observation:
    """Join two observations of the same states: the quantities and parameters of the first, then those of the second.

    Raises:
        ValueError: a quantity of the one has the name of a quantity of the other, so that a bound could mean either.
    """
    if twice := {quantity.name for quantity in one.quantities} & {quantity.name for quantity in other.quantities}:
        raise ValueError(f"{one.name} and {other.name} both observe {', '.join(sorted(twice))}")
    x = ca.SX.sym("x", one.values.size1_in(0))
    b, c = ca.SX.sym("b", len(one.parameters)), ca.SX.sym("c", len(other.parameters))
    values = _vertcat(one.values(x, b), other.values(x, c))
    return Observation(
        name=f"{one.name} and {other.name}",
        quantities=(*one.quantities, *other.quantities),
        parameters=(*one.parameters, *other.parameters),
        values=ca.Function("side_by_side", [x, _vertcat(b, c)], [values], {"cse": True}),
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
        rates=ca.Function("rates", [x, u, p], [_column(rates(state, control))]),
        path=Path.quantities(),
        path_values=ca.Function("path", [x, u, p], [_column(path(state, control))]) if path else None,
        projection=ca.Function("project", [x], [_column(projection(state))]) if projection else None,
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
    values = ca.Function("observe", [x, b], [_column(observe(State.split(x)))])
    return Observation(name, Seen.quantities(), (), values)


def _column(components: Vector[Any]) -> ca.SX:
    """Stack the components as a column, shape (n,); numbers among them become constants."""
    return _vertcat(*components.join())
