"""A stirred tank reactor brought to rest; two local minima, 0.133 and 0.244 (Luus 2000; Lapidus & Luus 1967)."""

import casadi as ca
from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem, initial_guess


def rates(x, u):
    reaction = (x.b + 0.5) * ca.exp(25.0 * x.a / (x.a + 2.0))
    return {"a": -(2.0 + u.u) * (x.a + 0.25) + reaction, "b": 0.5 - x.b - reaction}


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "stirred tank",
        rates,
        states=[Quantity("a", "1", 0.1), Quantity("b", "1", 0.1)],
        controls=[Quantity("u", "1", 2.0)],
        start=at(a=0.09, b=0.09),
        phases=fixed_time(0.78, 400),
        integral_cost=lambda x, u: x.a**2 + x.b**2 + 0.1 * u.u**2,
        cost_scale=0.1,
    )
    lower = initial_guess(problem, a=[0.09, 0.0], b=[0.09, 0.0], u=2.0)
    return (Benchmark("stirred tank", problem, "0.133094", "Luus 2000", "two minima", lower),)
