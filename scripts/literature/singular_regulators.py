"""A mass regulated by a bounded force that costs nothing: arcs on which the force follows from derivatives of the
switching function (Jacobson, Gershwin & Lele 1970; Aly & Chan 1973; PROPT's examples)."""

import math

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Problem, Quantity, at, define_problem


def regulator(seconds: float, place: float, speed: float) -> Problem:
    """Of the cost `place x^2 + speed v^2`."""
    return define_problem(
        "singular regulator",
        lambda x, u: {"x": x.v, "v": u.u},
        states=[Quantity("x", "1"), Quantity("v", "1")],
        controls=[Quantity("u", "1", lower=-1.0, upper=1.0)],
        start=at(x=0.0, v=1.0),
        phases=fixed_time(seconds, 250),
        integral_cost=lambda x, u: place * x.x**2 + speed * x.v**2,
    )


def benchmarks() -> tuple[Benchmark, ...]:
    both = "Jacobson, Gershwin & Lele 1970; later authors 0.75398386"
    quarter = regulator(math.pi / 2.0, -0.5, 0.5)
    return (
        Benchmark("regulated place and speed", regulator(5.0, 1.0, 1.0), "0.753984", both, "singular"),
        Benchmark(
            "regulated place", regulator(5.0, 1.0, 0.0), "0.268336", "PROPT, 0.268336059", "chattering", tolerance=1e-4
        ),
        Benchmark("Aly-Chan", quarter, "0.0", "Aly & Chan 1973", "singular", tolerance=1e-6),
    )
