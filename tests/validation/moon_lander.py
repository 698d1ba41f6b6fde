"""A lander with two thrusters flies to a place in the plane in least time: CTDirect.jl gives 0.962."""

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

m, g, inertia, width, thrust_max = 1.0, 9.81, 0.1, 1.0, 2.0 * 9.81


@vector
class State(Vector[T]):
    x: T = quantity("m", scale=5.0)
    y: T = quantity("m", scale=5.0)
    vx: T = quantity("m/s", scale=10.0)
    vy: T = quantity("m/s", scale=10.0)
    theta: T = quantity("rad")
    theta_dot: T = quantity("rad/s", scale=10.0)


@vector
class Thrust(Vector[T]):
    left: T = quantity("N", scale=10.0, lower=0.0, upper=thrust_max)
    right: T = quantity("N", scale=10.0, lower=0.0, upper=thrust_max)


def rates(state: State, control: Thrust) -> State:
    thrust = control.left + control.right
    return State(
        x=state.vx,
        y=state.vy,
        vx=-ca.sin(state.theta) * thrust / m,
        vy=ca.cos(state.theta) * thrust / m - g,
        theta=state.theta_dot,
        theta_dot=0.5 * width / inertia * (control.right - control.left),
    )


SYSTEM = system_of("moon-lander", State, Thrust, rates)


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals = 100
    target = {"x": 5.0, "y": 5.0, "vx": 0.0, "vy": 0.0}
    end = Boundary(bounds={name: exactly(value) for name, value in target.items()})
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={name: exactly(0.0) for name in State.names()}),
        phases=(Phase("flight", uniform(intervals), Interval(0.1, 20.0), end),),
    )
    guess = Iterate(np.array([1.0]), np.full((6, intervals + 1), 0.1), np.full((2, intervals), 5.0))
    value = Value("least time", "s", "0.962", "tests of CTDirect.jl", 2e-3, objective)
    return (KnownAnswer("moon lander", problem, guess, (value,)),)
