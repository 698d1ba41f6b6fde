"""A container moved by a crane with limits of speed, swinging as little as possible (Augustin & Maurer 2001)."""

import math

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem


def rates(x, u):
    swing = -(u.u1 + 27.0756 * x.x3 + 2.0 * x.x5 * x.x6) / x.x2
    return {"x1": x.x4, "x2": x.x5, "x3": x.x6, "x4": u.u1 + 17.2656 * x.x3, "x5": u.u2, "x6": swing}


def benchmarks() -> tuple[Benchmark, ...]:
    scales = {"x1": 10.0, "x2": 10.0, "x3": 0.1, "x4": 1.0, "x5": 1.0, "x6": 0.1}
    limits = {**dict.fromkeys(scales, math.inf), "x4": 2.5, "x5": 1.0}
    problem = define_problem(
        "container crane",
        rates,
        states=[Quantity(name, "1", scale, -limits[name], limits[name]) for name, scale in scales.items()],
        controls=[
            Quantity("u1", "1", lower=-2.83374, upper=2.83374),
            Quantity("u2", "1", lower=-0.80865, upper=0.71265),
        ],
        start=at(x1=0.0, x2=22.0, x3=0.0, x4=0.0, x5=-1.0, x6=0.0),
        phases=fixed_time(9.0, 120, x1=10.0, x2=14.0, x3=0.0, x4=2.5, x5=0.0, x6=0.0),
        integral_cost=lambda x, u: 0.5 * (x.x3**2 + x.x6**2 + 0.01 * (u.u1**2 + u.u2**2)),
        cost_scale=0.05,
    )
    source = "Augustin & Maurer 2001"
    return (Benchmark("container crane", problem, "0.0375195", source, "state-constrained"),)
