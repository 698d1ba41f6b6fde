"""Inner controllers by dynamic inversion: a model's equations, inverted, make it follow load factors and a roll rate.

The equations are inverted through their own derivatives, so no controller holds a second copy of them. For a quantity
`y` that is affine in `c`, the value of `c` that makes it `y_des` is

    c_des = c + (y_des - y) / (dy/dc)

Of a model whose body rotates the chain surface -> rate -> angle -> load factor is inverted. The body's rates about the
axes of Kbar are `w = (w_x, w_y, w_z)`; their derivatives are affine in what moves the body: the deflections
`d = (eta, xi, zeta)` or, in a model that carries its own controller, the commands to that. So with `B = d(w')/dd` those
for any `w'` are `d + B^-1 (w'_des - w')`. Those for `w' = 0` are the trim, at which the angles for the commanded load
factors are sought:

    alpha_des = alpha + (n_z_cmd - n_z) / (dn_z/dalpha)           beta_des = beta + (n_y_cmd - n_y) / (dn_y/dbeta)
    alpha'_des = K_alpha (alpha_des - alpha) + n_z_dot / (dn_z/dalpha)       beta'_des = K_beta (beta_des - beta)
    w'_des = [p_dot + K_p (p_cmd - p_Kbar),  q_Kbar' + K_q (alpha'_des - alpha'),  K_r (beta' - beta'_des)]

(`alpha' = w_y - q_Kbar` and `beta' = r_Kbar - w_z` but for the cosine of the sideslip; `q_Kbar' = g0/V_K dn_z/dalpha
alpha'`.)

The inverse of the transfer functions are commands that make their lags respond like faster ones. With the lags
`n'' = w^2 (n_cmd - n) - 2 D w n'` and `p' = (p_cmd - p) / tau`, what is wanted is

    n'_des = n_dot_ref + w (n_ref - n)      n''_des = 3 w (n'_des - n')      p'_des = p_dot_ref + K_p (p_ref - p)

and the commands follow by inverting the lags exactly. The bandwidth is the lag's own, for a faster answer takes
commands that move faster than a pilot's hand: a slow aircraft would be shaken.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from airrace.errors import UsageError
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.outer_loop import FlightPathState, LoadFactors, load_factors_of_motion
from airrace.model.elementary import cos, maximum, minimum, sin, sqrt
from airrace.model.environment import g0
from airrace.optimal_control.quantities import Quantity, Scalar
from airrace.optimal_control.system import System, column, named_symbols
from airrace.procedure.control.path_following import Commands, clip

# Any: casadi overloads these by the type of their arguments
jacobian: Callable[..., Any] = ca.jacobian
solve: Callable[..., Any] = ca.solve
with_values: Callable[..., Any] = ca.substitute  # (expression, symbols, values)
DM: Callable[..., Any] = ca.DM

FOLLOWER = 50.0
"""The rate constant with which commands and deflections, which are states, follow their wanted values, 1/s."""

Named = dict[str, Scalar]


@dataclass(frozen=True, eq=False)
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
        controls = [(u or {}).get(control.name, 0.0) for control in system.controls]
        values = system.rates(column(x.values()), column(controls), self._numbers)
        rates: Named = {state.name: values[row] for row, state in enumerate(system.states)}
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
        setting = clip(x["delta_T"] + (command.n_x - self.load.n_x) / effect, 0.0, 1.0)
        rate = command.delta_T_dot + 4.0 * (setting - x["delta_T"])  # 1/s
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
            state = quantity_named(self.system.states, name)
            control = next(control for control in self.system.controls if control.rate_of == name)
            inside = clip(value, state.lower, state.upper)
            controls[control.name] = clip(FOLLOWER * (inside - self.x[name]), control.lower, control.upper)
        return controls

    def controller(self, wanted: Named, settled: Named) -> InnerController:
        """Return the controller that drives the states in `wanted` to their values, and settles those in `settled`."""
        controls = self.following(wanted) | {"delta_T_cmd": self.throttle()}
        u = column(controls.get(control.name, 0.0) for control in self.system.controls)
        arguments = [column(self.x.values()), column(self.commands.join())]
        return InnerController(
            controls=ca.Function("controls", arguments, [u], {"cse": True}),
            settled=ca.Function("settled", arguments, [column((self.x | settled).values())], {"cse": True}),
        )

    def _path(self) -> Named:
        system = self.system
        if system.path_values is None:
            return {}
        zeros = column([0.0] * len(system.controls))
        values = system.path_values(column(self.x.values()), zeros, self._numbers)
        return {quantity.name: values[row] for row, quantity in enumerate(system.path)}


def quantity_named(quantities: Sequence[Quantity], name: str) -> Quantity:
    """Return the declaration of the quantity `name`."""
    return next(quantity for quantity in quantities if quantity.name == name)


def within_bounds(system: System, name: str, value: Scalar) -> Scalar:
    """Return `value` within the bounds of the state or path quantity `name`."""
    bounds = quantity_named((*system.states, *system.path), name)
    return clip(value, bounds.lower, bounds.upper)


K_ALPHA, K_BETA = 8.0, 4.0
"""The gains of the angles of attack and of sideslip, 1/s."""
K_P, K_Q, K_R = 12.0, 16.0, 8.0
"""The gains of the rates of roll, pitch and yaw, 1/s.

With twice the gains in yaw whole races are lost: the surfaces move at a limited rate, and fast reversals of a roll at
high load factors need all of it.
"""

Triple = tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True)
class InversionChain:
    """The causal chain through which a model rotates.

    Attributes:
        movers: the states that move the body: what pitches, what rolls, what yaws it.
        rates: its rates of roll, pitch and yaw.
        roll_rate: the state or path quantity whose bounds hold for the roll rate about the velocity.
        body_rates: `(w_x, w_y, w_z)` of a state, rad/s.
    """

    movers: tuple[str, str, str]
    rates: tuple[str, str, str]
    roll_rate: str
    body_rates: Callable[[Named], Triple]


@dataclass(frozen=True)
class _Wanted:
    """The wanted angles (rad), and the missing parts of `(w_x, w_y, w_z)` (rad/s)."""

    alpha: Scalar
    beta: Scalar
    roll: Scalar
    pitch: Scalar
    yaw: Scalar


def in_body_axes(x: Named) -> Triple:
    """Return `(w_x, w_y, w_z)` (rad/s) of a model whose rates are those about the body axes."""
    alpha, beta, p, q, r = (x[name] for name in ("alpha_K", "beta_K", "p_K", "q_K", "r_K"))
    s = p * cos(alpha) + r * sin(alpha)
    return cos(beta) * s + sin(beta) * q, cos(beta) * q - sin(beta) * s, r * cos(alpha) - p * sin(alpha)


def in_stability_axes(x: Named) -> Triple:
    """Return `(w_x, w_y, w_z)` (rad/s) of a linear model, whose rates are those about the stability axes."""
    return x["p_s"], x["q_K"], x["r_s"]


SURFACES = ("eta", "xi", "zeta")
SIX_DOF = InversionChain(SURFACES, ("p_K", "q_K", "r_K"), "p_Kbar", in_body_axes)
STATE_SPACE = InversionChain(SURFACES, ("p_s", "q_K", "r_s"), "p_s", in_stability_axes)
STATE_SPACE_INVERSION = InversionChain(("n_z_cmd", "p_cmd", "n_y_cmd"), ("p_s", "q_K", "r_s"), "p_s", in_stability_axes)


def invert_body_motion(model: FlightModel, chain: InversionChain) -> InnerController:
    """Return the controller of a model with the states `alpha_K, beta_K` and those of the chain."""
    plant = Plant(model)
    x, command = plant.x, plant.commands
    w = column(chain.body_rates(x))
    w_dot = jacobian(w, column(x.values())) @ column(plant.rates.values())
    movers = column(x[name] for name in chain.movers)
    effect = jacobian(w_dot, movers)
    trim = movers - solve(effect, w_dot)
    targets = _wanted(plant, chain, movers, trim)
    q_Kbar_dot = g0 / x["V_K"] * jacobian(plant.load.n_z, x["alpha_K"]) * plant.rates["alpha_K"]
    w_dot_des = column([command.p_dot + K_P * targets.roll, q_Kbar_dot + K_Q * targets.pitch, K_R * targets.yaw])
    moved = movers + solve(effect, w_dot_des - w_dot)
    rates = column(x[name] for name in chain.rates)
    lacking = column([targets.roll, -plant.rates["alpha_K"], plant.rates["beta_K"]])
    turning = rates + solve(jacobian(w, rates), lacking)
    return plant.controller(
        wanted={name: moved[row] for row, name in enumerate(chain.movers)},
        settled={
            "alpha_K": targets.alpha,
            "beta_K": targets.beta,
            **{name: turning[row] for row, name in enumerate(chain.rates)},
            **{name: within_bounds(plant.system, name, trim[row]) for row, name in enumerate(chain.movers)},
        },
    )


def _wanted(plant: Plant, chain: InversionChain, movers: Scalar, trim: Scalar) -> _Wanted:
    """Return the angles for the commanded load factors in trim, and the missing parts of the rates towards them."""
    x, command, system = plant.x, plant.commands, plant.system
    # Beyond the stall, too, at least 2 g/rad are assumed, and 0.2 g/rad over sideslip.
    lift_slope = maximum(jacobian(plant.load.n_z, x["alpha_K"]), 2.0)
    side_slope = minimum(jacobian(plant.load.n_y, x["beta_K"]), -0.2)
    n_z, n_y, lift_slope, side_slope = (
        with_values(quantity, movers, trim) for quantity in (plant.load.n_z, plant.load.n_y, lift_slope, side_slope)
    )
    higher = _within(plant, "alpha_A", (within_bounds(system, "n_z", command.n_z) - n_z) / lift_slope)
    further = _within(plant, "beta_A", (within_bounds(system, "n_y", command.n_y) - n_y) / side_slope)
    path = FlightPathState.names()
    along, path_rates = column(x[name] for name in path), column(plant.rates[name] for name in path)
    n_z_dot, n_y_dot = (jacobian(quantity, along) @ path_rates for quantity in (plant.load.n_z, plant.load.n_y))
    alpha_dot = K_ALPHA * higher + ((1.0 + K_ALPHA / FOLLOWER) * command.n_z_dot - n_z_dot) / lift_slope
    beta_dot = K_BETA * further - n_y_dot / side_slope
    return _Wanted(
        alpha=x["alpha_K"] + higher,
        beta=x["beta_K"] + further,
        roll=within_bounds(system, chain.roll_rate, command.p) - plant.load.p_Kbar,
        pitch=alpha_dot - plant.rates["alpha_K"],
        yaw=plant.rates["beta_K"] - beta_dot,
    )


def _within(plant: Plant, name: str, change: Scalar) -> Scalar:
    """Return a change of an angle, limited so that the path quantity `name` that changes with it keeps its bounds."""
    bounds, now = quantity_named(plant.system.path, name), plant.path[name]
    return clip(change, bounds.lower - now, bounds.upper - now)


HEADROOM = 1.1
"""The factor on the limits of lift and sideslip within which commands stay (1).

It is above 1 because a reference at its limits leaves nothing to correct with.
"""


def invert_transfer_functions(model: FlightModel) -> InnerController:
    """Return the controller of a model with the states `n_z, n_z_dot, n_y, n_y_dot, p_Kbar` and commands of these."""
    plant = Plant(model)
    x, command = plant.x, plant.commands
    n_z = _allowed(plant, "n_z", command.n_z, "C_L")
    n_y = _allowed(plant, "n_y", command.n_y, "beta_A")
    p = within_bounds(plant.system, "p_Kbar", command.p)
    targets: Named = {
        "n_z_cmd": _command_for(plant, "n_z_dot", _answer(plant, "n_z", "n_z_cmd", n_z, command.n_z_dot), "n_z_cmd"),
        "n_y_cmd": _command_for(plant, "n_y_dot", _answer(plant, "n_y", "n_y_cmd", n_y, 0.0), "n_y_cmd"),
        "p_cmd": _command_for(plant, "p_Kbar", command.p_dot + K_P * (p - x["p_Kbar"]), "p_cmd"),
    }
    settled: Named = {
        "n_z": n_z,
        "n_z_dot": command.n_z_dot,
        "n_y": n_y,
        "n_y_dot": 0.0,
        "p_Kbar": p,
        "n_z_cmd": _command_for(plant, "n_z_dot", 0.0, "n_z_cmd"),
        "n_y_cmd": _command_for(plant, "n_y_dot", 0.0, "n_y_cmd"),
        "p_cmd": _command_for(plant, "p_Kbar", command.p_dot, "p_cmd"),
    }
    return plant.controller(targets, settled)


def _allowed(plant: Plant, name: str, value: Scalar, by: str) -> Scalar:
    """Return a load factor within its own bounds and those of the path quantity `by`, which is proportional to it."""
    largest = quantity_named(plant.system.path, by).upper
    smallest = quantity_named(plant.system.path, by).lower
    slope = jacobian(plant.path[by], plant.x[name])
    first, second = HEADROOM * largest / slope, HEADROOM * smallest / slope  # whichever way the slope goes
    return within_bounds(plant.system, name, clip(value, minimum(first, second), maximum(first, second)))


def _answer(plant: Plant, name: str, by: str, target: Scalar, target_dot: Scalar) -> Scalar:
    """Return `n''_des` (g/s2) of the load factor `name`, which is commanded by the state `by`."""
    rate = next(state.name for state in plant.system.states if state.rate_of == name)
    w = sqrt(jacobian(plant.rates[rate], plant.x[by]))
    return 3.0 * w * (target_dot + w * (target - plant.x[name]) - plant.x[rate])


def _command_for(plant: Plant, name: str, rate: Scalar, by: str) -> Scalar:
    """Return the value of the state `by` at which the state `name` changes at `rate`.

    The rate of change is affine in that state.
    """
    now = plant.rates[name]
    return plant.x[by] + (rate - now) / jacobian(now, plant.x[by])
