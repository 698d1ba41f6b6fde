"""A bead slides without friction from (0, 10) to (10, 5) in least time, on a cycloid (dymos; Bryson & Ho 1975)."""

import math

import casadi as ca
from benchmark import Benchmark, free_time
from scipy.optimize import brentq

from airrace.optimal_control import Quantity, at, define_problem

GRAVITY, ACROSS, DOWN = 9.80665, 10.0, 5.0


def least_time() -> float:
    """Of the cycloid x = r (phi - sin phi), y = r (1 - cos phi)."""
    phi = brentq(lambda a: (a - math.sin(a)) * DOWN - (1.0 - math.cos(a)) * ACROSS, 0.1, 6.0, xtol=1e-14)
    return phi * math.sqrt(DOWN / (1.0 - math.cos(phi)) / GRAVITY)


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "brachistochrone",
        lambda x, u: {
            "x": x.v * ca.sin(u.theta),
            "y": -x.v * ca.cos(u.theta),
            "v": GRAVITY * ca.cos(u.theta),
        },
        states=[Quantity("x", "m", 10.0), Quantity("y", "m", 10.0), Quantity("v", "m/s", 10.0)],
        controls=[Quantity("theta", "rad", lower=0.0, upper=math.pi)],
        start=at(x=0.0, y=10.0, v=0.0),
        phases=free_time(0.5, 10.0, 100, x=ACROSS, y=DOWN),
    )
    return (Benchmark("brachistochrone", problem, f"{least_time():.7f}", "dymos's examples, 1.8016", closed_form=True),)
