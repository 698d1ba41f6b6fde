"""A capital spent over a time with the greatest discounted utility (Ramsey 1928, with a linear yield)."""

import math

import casadi as ca
from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem

YIELD, DISCOUNT, SECONDS, BEGIN = 0.05, 0.1, 10.0, 1.0


def greatest_utility() -> float:
    """Consumption c = c0 exp((r - rho) t), with c0 of all capital spent."""
    annuity = (1.0 - math.exp(-DISCOUNT * SECONDS)) / DISCOUNT
    tilt = (1.0 - math.exp(-DISCOUNT * SECONDS) * (1.0 + DISCOUNT * SECONDS)) / DISCOUNT**2
    return math.log(BEGIN / annuity) * annuity + (YIELD - DISCOUNT) * tilt


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "consumption",
        lambda x, u: {"t": 1.0, "k": YIELD * x.k - u.c},
        states=[Quantity("t", "a", 10.0), Quantity("k", "1", lower=0.0)],
        controls=[Quantity("c", "1", 0.1, lower=1e-3)],
        start=at(t=0.0, k=BEGIN),
        phases=fixed_time(SECONDS, 50, k=0.0),
        integral_cost=lambda x, u: -ca.exp(-DISCOUNT * x.t) * ca.log(u.c),
        cost_scale=10.0,
    )
    published = f"{greatest_utility():.7f}"
    return (Benchmark("consumption", problem, published, "Ramsey 1928", maximum=True, closed_form=True),)
