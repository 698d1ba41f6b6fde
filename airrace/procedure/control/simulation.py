"""The simulation of a model along the flight of a simpler one, by error feedback.

The outer loop asks for load factors and a roll rate that lead back to the reference, the inner controller makes the
model's own controls of them. Everything advances in steps of equal time with the classical Runge-Kutta scheme; the
reference, linear between its samples, is looked up at the start of a step and as far ahead as its clock can run.
Many steps are one call.

A flight begins trimmed: in the state in which the model does at rest what the reference does. Trimmed states all along
a reference are a guess for models that cannot follow it; the lag of the inner loop is missing from them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from airrace.model.dynamics.flight_model import FlightModel, RollCounter
from airrace.model.dynamics.outer_loop import FlightPathState, PoweredState
from airrace.model.frames import QUATERNION, normalise
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.system import System, at_points, column, named_symbols
from airrace.optimal_control.trajectory import Array
from airrace.procedure.control.dynamic_inversion import InnerController, InnerLoopInverse
from airrace.procedure.control.path_following import (
    Commands,
    PathGains,
    Reference,
    ReferencePoint,
    errors,
    path_following,
)

# Any: casadi overloads these by the type of their arguments
_vertcat: Callable[..., Any] = ca.vertcat
_DM: Callable[..., Any] = ca.DM


STEP = 0.02
"""The step of a simulation, s: the fastest motion is that of deflections, which follow with 50/s."""
REFERENCE_SPACING = 0.01
"""The spacing at which the reference is tabulated, s."""
DEPARTED = 500.0
"""The distance from the reference beyond which a simulation has departed and is ended, m."""
COUNTER_RATE = 1.0
"""The rate constant with which errors of roll counters are wound back, 1/s."""


@dataclass(frozen=True, eq=False)
class Followed:
    """The flight of a model along a reference.

    Attributes:
        finished: whether it reached the end of the reference; what one that departed never reached is not a number.
        time: when the reference's clock showed the wanted values, s from the start; shape (N + 1,).
        state: then; shape (n_x, N + 1).
        control: constant controls that lead from one of these to the next, within their bounds; shape (n_u, N).
        durations: of the reference's phases in the simulation, s; shape (n,).
        tracking_error: largest distance from the reference, m.
        tracking_error_time: the reference's clock at that distance, s.
        end_distance: distance from the reference's end, m.
        end_roll: roll angle to the reference's attitude there, rad.
    """

    finished: bool
    time: Array
    state: Array
    control: Array
    durations: Array
    tracking_error: float
    tracking_error_time: float
    end_distance: float
    end_roll: float


@dataclass(frozen=True, eq=False)
class TrackingSimulator:
    """A model under its controllers, ready to follow any reference.

    Attributes:
        model: with the numbers of its aircraft and air.
        inner: its inner controller.
        step: of time, s.
        advance: from (x, s) and the reference there and at the furthest a step ahead to (x, s) after that step, and the
            controls, the distance and the roll error at its start.
    """

    model: FlightModel
    inner: InnerController
    step: float
    advance: ca.Function


def tracking_simulator(
    model: FlightModel, inverse: InnerLoopInverse, *, gains: PathGains | None = None, step: float = STEP
) -> TrackingSimulator:
    """Put a model under its controllers.

    Args:
        model: with the numbers of its aircraft and air.
        inverse: builds the model's inner controller.
        gains: of the outer loop.
        step: of time, s.
    """
    inner = inverse(model)
    return TrackingSimulator(model, inner, step, _advance(model, inner, gains or PathGains(), step))


def follow(simulator: TrackingSimulator, reference: Reference, *, nodes: Array) -> Followed:
    """Fly along `reference`, in the air that both have in common.

    Args:
        simulator: flies.
        reference: what is to be followed.
        nodes: wanted values of the reference's clock, s; rising from zero to its end, shape (N + 1,).
    """
    system, samples = simulator.model.system, _simulate(simulator, reference)
    time, *rows = (np.interp(nodes, samples.clock, row, right=np.nan) for row in (samples.time, *samples.state))
    state = np.stack(rows)
    if system.projection is not None:
        state = at_points(system.projection, state)
    end = min(reference.duration, float(samples.clock[-1]))
    inside = samples.clock < end
    clock = np.append(samples.clock[inside], end)
    distance = np.append(samples.distance[inside], np.interp(end, samples.clock, samples.distance))
    worst = int(np.argmax(distance))
    return Followed(
        finished=bool(samples.clock[-1] >= reference.duration),
        time=time,
        state=state,
        control=_controls(system, samples, time, state),
        durations=np.diff(np.interp(reference.boundaries, samples.clock, samples.time, right=np.nan)),
        tracking_error=float(distance[worst]),
        tracking_error_time=float(clock[worst]),
        end_distance=float(distance[-1]),
        end_roll=float(np.interp(end, samples.clock, samples.roll)),
    )


def trim_along(
    model: FlightModel, inverse: InnerLoopInverse, reference: Reference, *, nodes: Array
) -> tuple[Array, Array]:
    """Return trimmed states at instants of the reference, and the controls between them.

    Args:
        model: with the numbers of its aircraft and air.
        inverse: builds the model's inner controller.
        reference: what is imitated.
        nodes: values of the reference's clock, s; shape (N + 1,).

    Returns:
        Shapes (n_x, N + 1) and (n_u, N); controls are within their bounds.
    """
    reference_point = at(reference, nodes)
    state = trimmed_states(model.system, inverse(model), reference_point)
    rates = {
        quantity.name: np.diff(row) / np.diff(nodes) for quantity, row in zip(model.system.states, state, strict=True)
    }
    held_controls = {
        "delta_T_cmd": reference_point.delta_T,
        "Phi_reset": reference_point.Phi_reset,
        "gain_reset": reference_point.gain_reset,
    }

    def control(quantity: Quantity) -> Array:
        values = (
            rates[quantity.rate_of]
            if quantity.rate_of
            else 0.5 * (held_controls[quantity.name][1:] + held_controls[quantity.name][:-1])
        )
        return np.clip(values, quantity.lower, quantity.upper)

    return state, np.stack([control(quantity) for quantity in model.system.controls])


def at(reference: Reference, nodes: Array) -> ReferencePoint[Array]:
    """Return the reference at values of its clock (s), linear between its samples."""
    histories = zip(ReferencePoint.names(), reference.histories.join(), strict=True)
    point = {name: np.asarray(np.interp(nodes, reference.s, row), dtype=np.float64) for name, row in histories}
    point |= zip(QUATERNION, normalise([point[name] for name in QUATERNION]), strict=True)
    return ReferencePoint[Array](**point)


def trimmed_states(system: System, inner: InnerController, point: ReferencePoint[Array]) -> Array:
    """Return the states in which a model at rest does what the reference does, shape (n_x, N + 1)."""
    zeros = np.zeros(len(point.x))
    V_K = np.linalg.norm(np.stack(point.velocity), axis=0)
    values = dict(zip(ReferencePoint.names(), point.join(), strict=True)) | {"V_K": V_K}
    shared = (*PoweredState.names(), *RollCounter.names())  # by all models
    x = np.stack([values[state.name] if state.name in shared else zeros for state in system.states])
    commands = Commands[Array](
        n_x=zeros,
        delta_T_dot=zeros,
        n_y=point.n_y,
        n_z=point.soft_n_z,
        n_z_dot=point.soft_n_z_dot,
        p=point.soft_p,
        p_dot=point.soft_p_dot,
    )
    targets = np.stack(list(commands.join()))
    for _ in range(30):  # steps of Newton's method
        x = at_points(inner.settled, x, targets)
    return x


@dataclass(frozen=True, eq=False)
class _Simulated:
    """The samples of a simulation: `state` (n_x, K), `control` (n_u, K), and rows of shape (K,)."""

    time: Array
    clock: Array
    state: Array
    control: Array
    distance: Array
    roll: Array


def _simulate(simulator: TrackingSimulator, reference: Reference) -> _Simulated:
    """Fly until the reference's clock is at its end, or the aircraft is lost."""
    system, step, lookup = simulator.model.system, simulator.step, _lookup(reference)
    n_x, n_u = len(system.states), len(system.controls)
    y = ca.MX.sym("y", n_x + 1)  # (x, s)
    after: Any = simulator.advance(y, lookup(y[-1]), lookup(y[-1] + step))  # Any: the stub does not know of two outputs
    advance = ca.Function("step", [y], list(after)).mapaccum("flight", 200)  # steps in one call
    begin = trimmed_states(system, simulator.inner, at(reference, np.zeros(1))).ravel()
    now = np.append(begin, 0.0)
    before: list[Array] = []
    seen: list[Array] = []
    while not before or (before[-1][n_x, -1] < reference.duration and np.isfinite(now).all()):
        states, outputs = (np.asarray(row) for row in advance(now))
        before.append(np.hstack([now[:, None], states[:, :-1]]))
        seen.append(outputs)
        now = states[:, -1]
        if outputs[n_u].max() > DEPARTED:
            break
    rows, outputs = np.hstack(before), np.hstack(seen)
    good = int(np.argmin(np.append(np.isfinite(rows).all(axis=0) & (outputs[n_u] < DEPARTED), False)))
    rows, outputs = rows[:, :good], outputs[:, :good]
    return _Simulated(
        step * np.arange(good, dtype=float), rows[n_x], rows[:n_x], outputs[:n_u], outputs[n_u], outputs[n_u + 1]
    )


def _advance(model: FlightModel, inner: InnerController, gains: PathGains, step: float) -> ca.Function:
    """Return one step between two points of a reference, see `TrackingSimulator.advance`."""
    size, width = len(model.system.states) + 1, ReferencePoint.size()
    now, point, next_point = ca.SX.sym("now", size), ca.SX.sym("here", width), ca.SX.sym("ahead", width)
    slope: Any = _slope(model, inner, gains)  # Any: likewise

    def rates(y: ca.SX) -> tuple[ca.SX, ca.SX]:
        return slope(y, point + (y[-1] - now[-1]) / step * (next_point - point))

    k1, seen = rates(now)
    k2, _ = rates(now + 0.5 * step * k1)
    k3, _ = rates(now + 0.5 * step * k2)
    k4, _ = rates(now + step * k3)
    end = now + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    if model.system.projection is not None:
        end = _vertcat(model.system.projection(end[:-1]), end[-1])
    return ca.Function("advance", [now, point, next_point], [end, seen])  # the four slopes hardly share anything


def _slope(model: FlightModel, inner: InnerController, gains: PathGains) -> ca.Function:
    """Return the function ((x, s), reference) -> rates of both; controls, distance and roll error."""
    system = model.system
    x, s = named_symbols(system.states), ca.SX.sym("s")
    r = ReferencePoint[Any](**named_symbols(ReferencePoint.quantities()))
    state = FlightPathState[Any](**{name: x[name] for name in FlightPathState.names()})
    commands, rate = path_following(state, r, gains)
    values = column(x.values())
    u = inner.controls(values, column(commands.join())) + _winding(system, x, r, rate)
    off = errors(state, r)
    arguments = [column([*x.values(), s]), column(r.join())]
    rates = column([system.rates(values, u, _DM(model.parameter_values)), rate])
    return ca.Function("slope", arguments, [rates, column([u, *off.join()])], {"cse": True})


def _winding(system: System, x: dict[str, Any], point: ReferencePoint[Any], rate: Any) -> ca.SX:
    """Return the controls that wind roll counters as the reference does and correct their errors; others are zero."""
    wound = {
        f"{name}_reset": rate * getattr(point, f"{name}_reset") + COUNTER_RATE * (getattr(point, name) - x[name])
        for name in ("Phi", "gain")
        if name in x
    }
    return column(wound.get(control.name, 0.0) for control in system.controls)


def _lookup(reference: Reference) -> ca.Function:
    """Return the function from the clock to `ReferencePoint`, linear on an even grid."""
    points = int(np.ceil(reference.duration / REFERENCE_SPACING)) + 1
    grid = np.linspace(0.0, reference.duration, max(points, 2))
    table = np.stack([np.interp(grid, reference.s, row) for row in reference.histories.join()])
    interpolant: Callable[..., ca.Function] = ca.interpolant  # its stub knows one form only
    values = table.ravel(order="F").tolist()
    return interpolant("reference", "linear", [grid.tolist()], values, {"lookup_mode": ["exact"]})


def _controls(system: System, samples: _Simulated, time: Array, state: Array) -> Array:
    """Return the controls from node to node, shape (n_u, N).

    They are the mean rate of a state where the control is its rate, and the mean of the recorded control otherwise.
    """
    rows = {quantity.name: row for quantity, row in zip(system.states, state, strict=True)}
    controls: list[Array] = []
    for control, recorded in zip(system.controls, samples.control, strict=True):
        if control.rate_of:
            moved = rows[control.rate_of]
        else:
            sums = np.append(0.0, np.cumsum(0.5 * (recorded[1:] + recorded[:-1]) * np.diff(samples.time)))
            moved = np.where(np.isnan(time), np.nan, np.interp(time, samples.time, sums))
        controls.append(np.clip(np.diff(moved) / np.diff(time), control.lower, control.upper))
    return np.stack(controls)
