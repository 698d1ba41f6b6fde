"""Two catalysts are mixed along a reactor so that it yields as much as it can (Jackson 1968).

In a reactor of length 1 [COPS 3] and of length 4 [Bocop]: one catalyst, a singular arc, the other. Bocop's number is
that of its own grid; on 800 intervals it is 0.191814 here.
"""

import numpy as np
from statement import KnownAnswer, Value, exactly

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import T, Vector, quantity, vector
from airrace.optimal_control.system import system_of


@vector
class State(Vector[T]):
    a: T = quantity("1", lower=0.0, upper=1.1)
    b: T = quantity("1", scale=0.1, lower=0.0, upper=1.1)
    c: T = quantity("1", scale=0.1, lower=0.0, upper=1.1)


@vector
class Share(Vector[T]):
    u: T = quantity("1", lower=0.0, upper=1.0)


def rates(state: State, control: Share) -> State:
    reversible, product = control.u * (10.0 * state.b - state.a), (1.0 - control.u) * state.b
    return State(a=reversible, b=-reversible - product, c=product)


SYSTEM = system_of("catalyst-mixing", State, Share, rates)


def reactor(length: float, published: str, source: str, tolerance: float) -> KnownAnswer:
    """The yield c of a reactor that begins with a alone."""
    intervals = 100
    begin = {"a": 1.0, "b": 0.0, "c": 0.0}
    problem = Problem(
        SYSTEM,
        parameters=(),
        start=Boundary(bounds={name: exactly(value) for name, value in begin.items()}),
        phases=(Phase("reactor", uniform(intervals), exactly(length)),),
        objective=Objective(time=0.0, terminal={"c": -1.0}),
        time_scale=length,
    )
    states = np.repeat(np.array(list(begin.values()))[:, None], intervals + 1, axis=1)
    guess = Iterate(np.array([length]), states, np.zeros((1, intervals)))
    value = Value("greatest yield", "1", published, source, tolerance, lambda solution: -solution.objective)
    return KnownAnswer(f"catalyst mixing, length {length:g}", problem, guess, (value,))


def known_answers() -> tuple[KnownAnswer, ...]:
    return (
        reactor(1.0, "0.0480556", "COPS 3, Dolan, More & Munson 2004", 2e-6),
        reactor(4.0, "0.192011", "tests of CTDirect.jl", 3e-4),
    )
