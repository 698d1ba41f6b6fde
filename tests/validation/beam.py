"""A beam is bent with least energy below a limit of its deflection (Bryson, Denham & Dreyfus 1963).

With the limit l = 0.1 the state touches it along an arc, and the energy is 8 / (9 l).
"""

import numpy as np
from statement import KnownAnswer, Value, exactly, objective

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import T, Vector, quantity, vector
from airrace.optimal_control.system import system_of

limit = 0.1


@vector
class State(Vector[T]):
    x: T = quantity("1", scale=0.1, lower=0.0, upper=limit)
    slope: T = quantity("1")
    energy: T = quantity("1")


@vector
class Bending(Vector[T]):
    u: T = quantity("1", lower=-10.0, upper=10.0)


SYSTEM = system_of("beam", State, Bending, lambda x, u: State(x=x.slope, slope=u.u, energy=u.u**2))


def known_answers() -> tuple[KnownAnswer, ...]:
    intervals = 120
    end = {"x": exactly(0.0), "slope": exactly(-1.0)}
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={"x": exactly(0.0), "slope": exactly(1.0), "energy": exactly(0.0)}),
        phases=(Phase("beam", uniform(intervals), exactly(1.0), Boundary(bounds=end)),),
        objective=Objective(time=0.0, terminal={"energy": 1.0}),
    )
    guess = Iterate(np.array([1.0]), np.full((3, intervals + 1), 0.1), np.full((1, intervals), 0.1))
    energy = 8.0 / (9.0 * limit)
    value = Value(*("least energy", "1", f"{energy:.10f}", "closed form", 5e-3), of=objective, closed_form=True)
    return (KnownAnswer("beam below a limit", problem, guess, (value,)),)
