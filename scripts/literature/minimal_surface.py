"""The surface of revolution of least area between two rings, a catenoid (Euler 1744)."""

import math

import casadi as ca
from benchmark import Benchmark, fixed_time
from scipy.optimize import brentq

from airrace.optimal_control import Quantity, at, define_problem

HALF, RING = 0.5, 1.0


def least_area() -> float:
    """Over 2 pi, of r = c cosh(x / c)."""
    c = brentq(lambda c: c * math.cosh(HALF / c) - RING, 0.6, 1.0, xtol=1e-15)
    return c * (HALF + 0.5 * c * math.sinh(2.0 * HALF / c))


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "catenoid",
        lambda x, u: {"r": u.slope},
        states=[Quantity("r", "1", lower=0.05)],
        controls=[Quantity("slope", "1")],
        start=at(r=RING),
        phases=fixed_time(2.0 * HALF, 100, r=RING),
        integral_cost=lambda x, u: x.r * ca.sqrt(1.0 + u.slope**2),
    )
    return (Benchmark("catenoid", problem, f"{least_area():.7f}", "Euler 1744", closed_form=True),)
