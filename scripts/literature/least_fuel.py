"""A mass moved from rest to rest with the least fuel: push, coast, brake (Athans & Falb 1966)."""

import math

from benchmark import Benchmark

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, uniform

WAY, SECONDS = 1.0, 3.0


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "least fuel",
        lambda x, u: {"x": x.v, "v": u.plus - u.minus},
        states=[Quantity("x", "1"), Quantity("v", "1")],
        controls=[Quantity("plus", "1", lower=0.0, upper=1.0), Quantity("minus", "1", lower=0.0, upper=1.0)],
        start=at(x=0.0, v=0.0),
        phases=[Phase("move", uniform(150), Interval.exactly(SECONDS), at("rest", x=WAY, v=0.0))],
        integral_cost=lambda x, u: u.plus + u.minus,
    )
    published = f"{SECONDS - math.sqrt(SECONDS**2 - 4.0 * WAY):.7f}"
    return (Benchmark("least fuel", problem, published, "Athans & Falb 1966", "bang-bang", closed_form=True),)
