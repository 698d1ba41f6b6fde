"""An asymmetric rigid body turns by 150 degrees from rest to rest in minimum time (Betts 2010): 28.6304 s."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

I_x, I_y, I_z = 5621.0, 4547.0, 2364.0  # kg m2
TURN = math.radians(150.0)  # about the x axis


@vector
class State(Vector[T]):
    q_w: T = quantity("1")
    q_x: T = quantity("1")
    q_y: T = quantity("1")
    q_z: T = quantity("1")
    p: T = quantity("rad/s", scale=0.5, lower=-0.5, upper=0.5)
    q: T = quantity("rad/s", scale=0.5, lower=-0.5, upper=0.5)
    r: T = quantity("rad/s", scale=0.5, lower=-0.5, upper=0.5)


@vector
class Torque(Vector[T]):
    M_x: T = quantity("N m", scale=50.0, lower=-50.0, upper=50.0)
    M_y: T = quantity("N m", scale=50.0, lower=-50.0, upper=50.0)
    M_z: T = quantity("N m", scale=50.0, lower=-50.0, upper=50.0)


def rates(state: State, torque: Torque) -> State:
    w, x, y, z = state.q_w, state.q_x, state.q_y, state.q_z
    p, q, r = state.p, state.q, state.r
    return State(
        q_w=(-x * p - y * q - z * r) / 2,
        q_x=(w * p - z * q + y * r) / 2,
        q_y=(z * p + w * q - x * r) / 2,
        q_z=(-y * p + x * q + w * r) / 2,
        p=(torque.M_x - (I_z - I_y) * q * r) / I_x,
        q=(torque.M_y - (I_x - I_z) * p * r) / I_y,
        r=(torque.M_z - (I_y - I_x) * p * q) / I_z,
    )


def normalised(state: State) -> State:
    norm = ca.sqrt(state.q_w**2 + state.q_x**2 + state.q_y**2 + state.q_z**2)
    unit = {name: getattr(state, name) / norm for name in ("q_w", "q_x", "q_y", "q_z")}
    return State(**unit, p=state.p, q=state.q, r=state.r)


SYSTEM = system_of("rigid-body", State, Torque, rates, projection=normalised)


def attitude(angle: float) -> dict[str, float]:
    """Rotated about the x axis, and at rest."""
    turned = {"q_w": math.cos(angle / 2), "q_x": math.sin(angle / 2), "q_y": 0.0, "q_z": 0.0}
    return turned | {"p": 0.0, "q": 0.0, "r": 0.0}


START = Boundary(bounds={name: exactly(value) for name, value in attitude(0.0).items()})
# the quaternion keeps its length: fixing three of its components leaves only a sign open
END = Boundary(bounds={name: exactly(value) for name, value in attitude(TURN).items()} | {"q_x": Interval(lower=0.0)})
SIGNS = ((1, -1, 1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, 1, 1), (-1, -1, 1))  # of the torques, arc by arc


def on_a_uniform_mesh(intervals: int) -> tuple[Problem, Iterate]:
    """One phase, in which the torques can only change at the nodes."""
    phase = Phase("turn", uniform(intervals), Interval(1.0, 60.0), END)
    problem = Problem(SYSTEM, parameters=(), start=START, phases=(phase,), time_scale=10.0)
    states = corners(State(**attitude(0.0)), State(**attitude(TURN)))
    # some torque about every axis: from a turn about x alone the solvers stay in that slower optimum
    return problem, interpolate(problem, [40.0], states, [10.0, 10.0, 10.0])


def switching_freely(intervals: int) -> tuple[Problem, Iterate]:
    """An arc between any two switches of a torque, each with a number of intervals."""
    push, pull = Interval(lower=0.0), Interval(upper=0.0)
    phases = [
        Phase(
            f"arc {number}",
            uniform(intervals),
            Interval(0.1, 20.0),
            end=END if number == len(SIGNS) else Boundary(),
            bounds={name: push if sign > 0 else pull for name, sign in zip(Torque.names(), signs, strict=True)},
        )
        for number, signs in enumerate(SIGNS, start=1)
    ]
    problem = Problem(SYSTEM, parameters=(), start=START, phases=tuple(phases), time_scale=10.0)
    durations = [7.0, 6.0, 1.0, 6.0, 6.0, 4.0]
    states = corners(*(State(**attitude(TURN * time / 30.0)) for time in np.cumsum([0.0, *durations])))
    straight = interpolate(problem, durations, states, [0.0, 0.0, 0.0])
    return problem, replace(straight, control=50.0 * np.repeat(SIGNS, intervals, axis=0).T)


def known_answers() -> tuple[KnownAnswer, ...]:
    problem, guess = switching_freely(4)
    time = Value("least time", "s", "28.6304", "Betts 2010", 5e-5, objective)
    return (KnownAnswer("reorientation of a rigid body", problem, guess, (time,)),)
