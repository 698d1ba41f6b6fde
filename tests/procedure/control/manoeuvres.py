"""Manoeuvres flown by the point mass from scripted commands: the references of the tests."""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from airrace.files.inputs import load_inputs
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.point_mass import build_point_mass
from airrace.model.dynamics.six_dof import build_six_dof
from airrace.model.dynamics.state_space import build_state_space
from airrace.model.dynamics.state_space_inversion import build_state_space_inversion
from airrace.model.dynamics.transfer_functions import build_transfer_functions
from airrace.model.environment import Air
from airrace.model.frames import quaternion
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.trajectory import Array
from airrace.procedure.control.path_following import Reference, from_histories

EDGE_540 = load_inputs(Path(__file__).parents[3] / "tracks" / "half_cuban_eight.yaml").race.aircraft
GRID = 0.01  # s
SPACE = Rules(n_z=Interval(-4.0, 10.0), height=Interval(0.0, 2000.0))
"""Room for any manoeuvre."""
MODEL_BUILDERS = {
    "transfer-function": build_transfer_functions,
    "state-space-inversion": build_state_space_inversion,
    "state-space": build_state_space,
    "six-dof": build_six_dof,
}

Corners = tuple[tuple[float, float], ...]
"""Times (s) and values between which a command runs straight."""


@dataclass(frozen=True)
class Script:
    """Commands over time; each keeps its last value. Level flight to the north at 300 m before."""

    duration: float
    V_K: float
    n_z: Corners = ((0.0, 1.0),)
    n_y: Corners = ((0.0, 0.0),)
    p: Corners = ((0.0, 0.0),)
    delta_T: Corners = ((0.0, 0.8),)


def pulse(start: float, end: float, value: float, rest: float = 0.0, ramp: float = 0.3) -> Corners:
    """From `rest` to `value` and back; half of each ramp lies within start ... end."""
    half = ramp / 2
    return ((start - half, rest), (start + half, value), (end - half, value), (end + half, rest))


def roll(start: float, angle: float, rate: float, ramp: float = 0.2) -> Corners:
    """A roll through an angle (rad) at a rate (rad/s) of the same sign."""
    return pulse(start, start + angle / rate, rate, ramp=ramp)


def together(*corners: Corners) -> Corners:
    """One after the other."""
    return tuple(one for part in corners for one in part)


SCRIPTS: Mapping[str, Script] = {
    "half loop": Script(
        6.8,
        105.0,
        n_z=((0.8, 1.0), (1.2, 8.0), (2.0, 7.5), (3.4, 4.6), (5.0, 3.4), (6.1, 3.4), (6.4, -1.0)),
        delta_T=((0.0, 1.0),),
    ),
    "half Cuban eight": Script(
        12.0,
        112.0,
        n_z=together(
            ((0.8, 1.0), (1.2, 8.0), (2.0, 7.5), (3.4, 5.2), (4.8, 3.6), (6.1, 3.8), (7.3, 4.3)),
            ((7.7, -0.7), (8.0, -0.7), (9.0, 0.7), (9.3, 0.7), (9.7, 5.0), (10.9, 6.0), (11.3, 1.0)),
        ),
        p=roll(8.05, math.pi, 3.5),
        delta_T=((0.0, 1.0), (6.0, 1.0), (6.5, 0.3)),
    ),
    "barrel roll": Script(5.0, 85.0, n_z=pulse(0.6, 3.9, 3.0, 1.0, 0.4), p=roll(1.0, 2.0 * math.pi, 2.4)),
    "7 g slalom": Script(
        7.0,
        95.0,
        n_z=together(pulse(1.0, 2.3, 7.0, 1.0, 0.5), pulse(3.0, 4.9, 7.0, 1.0, 0.5), pulse(5.6, 6.3, 7.0, 1.0, 0.5)),
        p=together(roll(0.7, 1.4, 4.5), roll(2.35, -2.8, -4.5), roll(4.95, 2.8, 4.5)),
        delta_T=((0.0, 1.0),),
    ),
    "knife edge at zero g": Script(
        4.0,
        85.0,
        n_z=pulse(0.8, 2.9, 0.0, 1.0, 0.3),
        p=together(roll(1.0, math.pi / 2, 4.5), roll(2.4, -math.pi / 2, -4.5)),
    ),
    "knife edge held by the fuselage": Script(
        4.0,
        100.0,
        n_z=pulse(0.8, 2.9, 0.0, 1.0, 0.3),
        n_y=pulse(1.1, 2.6, -0.4, 0.0, 0.4),
        p=together(roll(1.0, math.pi / 2, 4.5), roll(2.4, -math.pi / 2, -4.5)),
    ),
    "push at -2 g": Script(4.0, 85.0, n_z=together(pulse(1.0, 2.2, -2.0, 1.0, 0.4), pulse(2.7, 3.4, 4.0, 1.0, 0.4))),
    "vertical roll": Script(
        7.5,
        110.0,
        n_z=together(pulse(0.8, 3.45, 7.0, 1.0, 0.4)[:3], ((3.65, 0.0), (6.0, 0.0))),
        p=roll(4.0, 2.0 * math.pi, 5.0),
        delta_T=((0.0, 1.0),),
    ),
}


@dataclass(frozen=True)
class Flown:
    """A script as the point mass flew it: on the grid, the last control held; and as a reference."""

    model: FlightModel
    s: Array
    state: Array
    control: Array

    @property
    def reference(self) -> Reference:
        return from_histories(self.model, self.s, self.state, self.control, self.s[[0, -1]])


@functools.cache
def flown(name: str, air: Air = Air(), *, counting: bool = False) -> Flown:  # noqa: B008 (it is frozen)
    """The point mass flies a script."""
    script = SCRIPTS[name]
    model = build_point_mass(EDGE_540, SPACE, air, counting=counting)
    system = model.system
    s = np.linspace(0.0, script.duration, round(script.duration / GRID) + 1)
    commands = np.stack([_history(corners, s) for corners in (script.n_z, script.n_y, script.p)])
    lever = _history(script.delta_T, s)
    resets = np.zeros((len(system.controls) - 4, len(s) - 1))
    control = np.vstack([np.diff(commands, axis=1) / GRID, lever[:-1], resets])
    q = quaternion(0.0, 0.0, 0.0)
    start = np.array([0.0, 0.0, -300.0, script.V_K, *q, lever[0], *commands[:, 0], *resets[:, 0]])
    state = np.hstack([start[:, None], _fold(system.rates, system.projection, model.parameter_values)(start, control)])
    return Flown(model, s, state, np.hstack([control, control[:, -1:]]))


def build_model(stage: str, air: Air = Air(), *, counting: bool = False) -> FlightModel:  # noqa: B008 (it is frozen)
    """The model of a fidelity in the air of the test."""
    return MODEL_BUILDERS[stage](EDGE_540, SPACE, air, counting=counting)


def _history(corners: Corners, s: Array) -> Array:
    times, values = zip(*corners, strict=True)
    return np.interp(s, times, values)


def _fold(rates: ca.Function, projection: ca.Function | None, p: Array) -> Callable[[Array, Array], Array]:
    """States after each of many steps of equal length."""
    assert projection is not None
    x, u = ca.SX.sym("x", rates.size1_in(0)), ca.SX.sym("u", rates.size1_in(1))
    step = ca.Function("step", [x, u], [projection(RK4.advance(rates, x, u, ca.DM(p), GRID))])

    def states(start: Array, control: Array) -> Array:
        return np.asarray(step.mapaccum("flight", control.shape[1])(start, control))

    return states
