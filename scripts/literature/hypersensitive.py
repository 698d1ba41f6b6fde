"""A state that leaves its start at once and comes to its end at the last moment (Rao & Mease 1999; dymos).

The equation is linear, as in dymos's examples, so that there is a closed form.
"""

import math

import numpy as np
from benchmark import Benchmark

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem


def linear_cost(begin: float, end: float, seconds: float) -> float:
    """Minimum of 1/2 the integral of x^2 + u^2 with x' = -x + u."""
    root = math.sqrt(2.0)
    grow, fall = math.exp(root * seconds), math.exp(-root * seconds)
    c1, c2 = np.linalg.solve([[1.0, 1.0], [grow, fall]], [begin, end])

    def antiderivative(t: float) -> float:
        rising, falling = c1 * math.exp(root * t), c2 * math.exp(-root * t)
        x = rising + falling
        u = (1.0 + root) * rising + (1.0 - root) * falling
        return 0.5 * x * u  # d/dt (x u) = x^2 + u^2 along extremals, for the costate is -u

    return antiderivative(seconds) - antiderivative(0.0)


def graded(intervals: int) -> tuple[float, ...]:
    """Intervals that are short at both ends."""
    nodes = 0.5 - 0.5 * np.tanh(2.0 * np.linspace(1.0, -1.0, intervals + 1)) / math.tanh(2.0)
    return tuple(np.diff(nodes).tolist())


def benchmarks() -> tuple[Benchmark, ...]:
    begin, end, seconds = 1.5, 1.0, 10.0
    problem = define_problem(
        "hypersensitive",
        lambda x, u: {"x": -x.x + u.u},
        states=[Quantity("x", "1")],
        controls=[Quantity("u", "1", 2.0)],
        start=at(x=begin),
        phases=[Phase("whole", graded(240), Interval.exactly(seconds), at("end", x=end))],
        integral_cost=lambda x, u: 0.5 * (x.x**2 + u.u**2),
    )
    published = f"{linear_cost(begin, end, seconds):.7f}"
    return (Benchmark("hypersensitive", problem, published, "dymos's examples", closed_form=True),)
