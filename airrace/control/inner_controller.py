"""The common parts of inner controllers: the named quantities of a model, and the inverse of one equation.

A model's equations are inverted through their own derivatives, so no controller holds a second copy of them. For a
quantity `y` that is affine in `c`, the value of `c` that makes it `y_des` is

    c_des = c + (y_des - y) / (dy/dc)
"""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from airrace.control.outer_loop import Commands, clip
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.outer_loop import FlightPathState, LoadFactors, load_factors_of_motion
from airrace.errors import UsageError
from airrace.frames import Scalar, maximum
from airrace.quantities import Quantity
from airrace.records import record
from airrace.system import System, column, named_symbols

# Any: casadi overloads these by the type of their arguments
jacobian: Callable[..., Any] = ca.jacobian
solve: Callable[..., Any] = ca.solve
with_values: Callable[..., Any] = ca.substitute  # (expression, symbols, values)
DM: Callable[..., Any] = ca.DM

FOLLOWER = 50.0
"""The rate constant with which commands and deflections, which are states, follow their wanted values, 1/s."""

Named = dict[str, Scalar]


@record
class InnerController:
    """The functions that make a model follow the commands of the outer loop.

    Attributes:
        controls: (x, commands) -> u, shapes (n_x,), (n_c,) -> (n_u,), with `Commands` in the order of its fields;
            winding back of roll counters is left at zero.
        settled: (x, commands) -> x, one step towards the state in which the model does what is commanded; repeated, it
            finds that state.
    """

    controls: ca.Function
    settled: ca.Function


InnerLoopInverse = Callable[[FlightModel], InnerController]
"""A function that builds the controller of a model, with the numbers of its aircraft and air."""


class Plant:
    """The equations of a model in symbols, with the numbers of its aircraft and air.

    Attributes:
        x: one symbol per state.
        commands: one symbol per command.
        rates: of the states, by name, with all controls at zero.
        load: the load factors and the roll rate.
        path: the path quantities.
    """

    def __init__(self, model: FlightModel) -> None:
        self.system = model.system
        self._numbers = DM(model.parameter_values)
        self.x: Named = named_symbols(model.system.states)
        self.commands = Commands[Scalar](**named_symbols(Commands.quantities()))
        self.rates, self.load = self.motion(self.x)
        self.path: Named = self._path()

    def motion(self, x: Named, u: Named | None = None) -> tuple[Named, LoadFactors[Scalar]]:
        """Return rates, load factors and roll rate in the state `x` with the controls `u`, zero where not given."""
        system = self.system
        controls = [(u or {}).get(one.name, 0.0) for one in system.controls]
        values = system.rates(column(x.values()), column(controls), self._numbers)
        rates: Named = {one.name: values[row] for row, one in enumerate(system.states)}
        state, change = (
            FlightPathState[Scalar](**{name: of[name] for name in FlightPathState.names()}) for of in (x, rates)
        )
        return rates, load_factors_of_motion(state, change)

    def throttle(self) -> Scalar:
        """Return `delta_T_cmd` for the commanded load factor along the velocity.

        It is the inverse of the equation of n_x, followed by the inverse of the throttle's lag.

        Raises:
            UsageError: the command does not move `delta_T` at once, as behind a second lag.
        """
        x, command = self.x, self.commands
        # At least 0.05 g per full travel, so that no error is divided by zero.
        effect = maximum(jacobian(self.load.n_x, x["delta_T"]), 0.05)
        wanted = clip(x["delta_T"] + (command.n_x - self.load.n_x) / effect, 0.0, 1.0)
        rate = command.delta_T_dot + 4.0 * (wanted - x["delta_T"])  # 1/s
        throttle = ca.SX.sym("delta_T_cmd")
        followed = self.motion(x, {"delta_T_cmd": throttle})[0]["delta_T"]
        slope = jacobian(followed, throttle)
        if slope.is_zero():
            raise UsageError(
                f"{self.system.name}: the rate of delta_T does not depend on delta_T_cmd, so no throttle gives a "
                "wanted thrust; let delta_T follow the command with one lag"
            )
        return clip((rate - self.rates["delta_T"]) / slope, 0.0, 1.0)

    def following(self, wanted: Named) -> Named:
        """Return the controls that make states follow their wanted values.

        Each of these states has a control that is its rate.
        """
        controls: Named = {}
        for name, value in wanted.items():
            state, control = quantity_named(self.system.states, name), rate_quantity(self.system.controls, name)
            inside = clip(value, state.lower, state.upper)
            controls[control.name] = clip(FOLLOWER * (inside - self.x[name]), control.lower, control.upper)
        return controls

    def controller(self, wanted: Named, settled: Named) -> InnerController:
        """Return the controller that drives the states in `wanted` to their values, and settles those in `settled`."""
        controls = self.following(wanted) | {"delta_T_cmd": self.throttle()}
        u = column(controls.get(one.name, 0.0) for one in self.system.controls)
        arguments = [column(self.x.values()), column(self.commands.join())]
        return InnerController(
            controls=ca.Function("controls", arguments, [u], {"cse": True}),
            settled=ca.Function("settled", arguments, [column((self.x | settled).values())], {"cse": True}),
        )

    def _path(self) -> Named:
        system = self.system
        if system.path_values is None:
            return {}
        nothing = column([0.0] * len(system.controls))
        values = system.path_values(column(self.x.values()), nothing, self._numbers)
        return {one.name: values[row] for row, one in enumerate(system.path)}


def quantity_named(quantities: Sequence[Quantity], name: str) -> Quantity:
    """Return the declaration of the quantity `name`."""
    return next(one for one in quantities if one.name == name)


def rate_quantity(quantities: Sequence[Quantity], name: str) -> Quantity:
    """Return the declaration of the quantity that is the rate of the state `name`."""
    return next(one for one in quantities if one.rate_of == name)


def within_bounds(system: System, name: str, value: Scalar) -> Scalar:
    """Return `value` within the bounds of the state or path quantity `name`."""
    bounds = quantity_named((*system.states, *system.path), name)
    return clip(value, bounds.lower, bounds.upper)
