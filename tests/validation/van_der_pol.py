"""The Van der Pol oscillator is damped with least effort: Bocop gives 1.047921 on its own grid, and 1600 intervals here
1.047807.
"""

import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import T, Vector, quantity, vector
from airrace.optimal_control.system import system_of


@vector
class State(Vector[T]):
    x: T = quantity("1")
    y: T = quantity("1")
    cost: T = quantity("1")


@vector
class Force(Vector[T]):
    u: T = quantity("1")


def rates(state: State, control: Force) -> State:
    x, y, u = state.x, state.y, control.u
    return State(x=y, y=(1.0 - x**2) * y - x + u, cost=0.5 * (x**2 + y**2 + u**2))


SYSTEM = system_of("van-der-pol", State, Force, rates)


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals = 200
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"x": exactly(1.0), "y": exactly(0.0), "cost": exactly(0.0)}),
        phases=(Phase("all", uniform(intervals), exactly(2.0)),),
        objective=Objective(time=0.0, terminal={"cost": 1.0}),
        time_scale=2.0,
    )
    guess = Iterate(np.array([2.0]), np.full((3, intervals + 1), 0.1), np.full((1, intervals), 0.1))
    value = Value("least effort", "1", "1.047921", "tests of CTDirect.jl", 1.5e-4, objective)
    return (KnownAnswer("Van der Pol oscillator", problem, guess, (value,)),)
