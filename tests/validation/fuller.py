"""Fuller's problem: the best control switches infinitely often before it comes to rest; CTDirect.jl gives 0.2683944."""

import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import T, Vector, quantity, vector
from airrace.optimal_control.system import system_of


@vector
class State(Vector[T]):
    x: T = quantity("m")
    v: T = quantity("m/s")
    cost: T = quantity("m2 s")


@vector
class Force(Vector[T]):
    u: T = quantity("m/s2", lower=-1.0, upper=1.0)


SYSTEM = system_of("fuller", State, Force, lambda x, u: State(x=x.v, v=u.u, cost=x.x**2))


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals, duration = 200, 3.5
    end = {"x": exactly(0.0), "v": exactly(0.0)}
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"x": exactly(0.0), "v": exactly(1.0), "cost": exactly(0.0)}),
        phases=(Phase("all", uniform(intervals), exactly(duration), Boundary(bounds=end)),),
        objective=Objective(time=0.0, terminal={"cost": 1.0}),
        time_scale=duration,
    )
    guess = Iterate(np.array([duration]), np.full((3, intervals + 1), 0.1), np.full((1, intervals), 0.1))
    value = Value("least cost", "m2 s", "0.2683944", "tests of CTDirect.jl", 1e-5, objective)
    return (KnownAnswer("Fuller's chattering", problem, guess, (value,)),)
