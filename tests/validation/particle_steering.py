"""A particle with a thrust of constant size reaches a height and a speed in least time: COPS 3 gives 0.554571.

Its best angle follows the bilinear tangent law [Bryson & Ho 1975, 2.7].
"""

import casadi as ca
import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

a = 100.0


@vector
class State(Vector[T]):
    x: T = quantity("m", scale=10.0)
    y: T = quantity("m", scale=5.0)
    vx: T = quantity("m/s", scale=45.0)
    vy: T = quantity("m/s", scale=10.0)


@vector
class Angle(Vector[T]):
    u: T = quantity("rad", lower=-np.pi / 2, upper=np.pi / 2)


def rates(state: State, control: Angle) -> State:
    return State(x=state.vx, y=state.vy, vx=a * ca.cos(control.u), vy=a * ca.sin(control.u))


SYSTEM = system_of("particle-steering", State, Angle, rates)


def known_answers() -> tuple[KnownAnswer, ...]:
    target = {"y": 5.0, "vx": 45.0, "vy": 0.0}
    end = Boundary(bounds={name: exactly(value) for name, value in target.items()})
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={name: exactly(0.0) for name in State.names()}),
        phases=(Phase("flight", uniform(100), Interval(0.01, 10.0), end),),
    )
    states = corners(State(x=0.0, y=0.0, vx=0.0, vy=0.0), State(x=0.0, **target))
    guess = interpolate(problem, [1.0], states, [0.0])
    value = Value("least time", "s", "0.554571", "COPS 3, Dolan, More & Munson 2004", 2e-5, objective)
    return (KnownAnswer("particle steering", problem, guess, (value,)),)
