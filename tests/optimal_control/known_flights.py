"""A forced oscillator: the flight of a linear system is known exactly, whatever its mesh."""

import casadi as ca
import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.system import Observation, System
from airrace.optimal_control.trajectory import Array

FREQUENCY = 1.5  # rad/s


def oscillator() -> System:
    """`x' = v`, `v' = -k x + f` with `k = FREQUENCY^2`; what is limited along the path are `x` and the power `f v`."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 1)
    return System(
        name="oscillator",
        states=(Quantity("x", "m", 2.0), Quantity("v", "m/s", 5.0)),
        controls=(Quantity("f", "N/kg", 3.0, -4.0, 4.0),),
        parameters=(Quantity("k", "1/s2"),),
        rates=ca.Function("rates", [x, u, p], [ca.vertcat(x[1], u - p * x[0])]),
        path=(Quantity("elongation", "m", 2.0), Quantity("power", "W/kg", 9.0)),
        path_values=ca.Function("path", [x, u, p], [ca.vertcat(x[0], u * x[1])]),
    )


def lens() -> Observation:
    """Distance and speed relative to a place."""
    x, b = ca.SX.sym("x", 2), ca.SX.sym("b", 1)
    values = ca.Function("lens", [x, b], [ca.vertcat(x[0] - b, x[1])])
    return Observation("lens", (Quantity("distance", "m", 2.0), Quantity("pace", "m/s")), (Quantity("b", "m"),), values)


SYSTEM, LENS = oscillator(), lens()


def problem(first: tuple[float, ...] = (0.2, 0.5, 0.3), second: tuple[float, ...] = (0.6, 0.4)) -> Problem:
    """Two phases on uneven meshes, nothing bounded."""
    phases = (Phase("up", first, Interval(0.1, 9.0)), Phase("down", second, Interval(0.1, 9.0)))
    return Problem(SYSTEM, (FREQUENCY**2,), Boundary("start"), phases)


def exact(before: Array, f: float, t: Array | float) -> Array:
    """The state a time `t` after the state `before` with the force `f` held; shape (2,) or (2, n)."""
    k, w = FREQUENCY**2, FREQUENCY
    offset = before[0] - f / k
    x = f / k + offset * np.cos(w * t) + before[1] / w * np.sin(w * t)
    v = -w * offset * np.sin(w * t) + before[1] * np.cos(w * t)
    return np.array([x, v])


START, DURATIONS = (0.4, 1.1), (1.2, 0.8)


def flight(of: Problem) -> Iterate:
    """The exact flight on a problem's mesh; the force changes from interval to interval."""
    steps = np.concatenate([np.array(phase.fractions) * T for phase, T in zip(of.phases, DURATIONS, strict=True)])
    force = 2.0 * np.cos(1.7 * np.arange(len(steps)))
    states = [np.array(START)]
    for f, step in zip(force, steps, strict=True):
        states.append(exact(states[-1], float(f), float(step)))
    return Iterate(np.array(DURATIONS), np.array(states).T, force[None, :])


def node_times(of: Problem) -> Array:
    """Times of the nodes, s."""
    steps = np.concatenate([np.array(phase.fractions) * T for phase, T in zip(of.phases, DURATIONS, strict=True)])
    return np.concatenate([[0.0], np.cumsum(steps)])


def rest_to_rest(intervals: int = 12) -> tuple[Problem, Iterate]:
    """From rest at -1 to rest at 1 in minimum time, and a crude guess."""
    at = {place: {"x": Interval.exactly(place), "v": Interval.exactly(0.0)} for place in (-1.0, 1.0)}
    end = Boundary("end", at[1.0])
    phase = Phase("swing", (1.0 / intervals,) * intervals, Interval(0.1, 9.0), end)
    stated = Problem(
        SYSTEM, (FREQUENCY**2,), Boundary("begin", at[-1.0]), (phase,), Objective(regularisation={"f": 1e-3})
    )
    share = np.linspace(-1.0, 1.0, intervals + 1)
    guess = Iterate(np.array([2.0]), np.array([share, np.ones_like(share)]), np.zeros((1, intervals)))
    return stated, guess
