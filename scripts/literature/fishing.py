"""Predators and prey led to their balance by fishing, with a singular arc (Sager 2005, relaxed)."""

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "Lotka-Volterra fishing",
        lambda x, u: {"a": x.a - x.a * x.b - 0.4 * x.a * u.w, "b": -x.b + x.a * x.b - 0.2 * x.b * u.w},
        states=[Quantity("a", "1"), Quantity("b", "1")],
        controls=[Quantity("w", "1", lower=0.0, upper=1.0)],
        start=at(a=0.5, b=0.7),
        phases=fixed_time(12.0, 200),
        integral_cost=lambda x, u: (x.a - 1.0) ** 2 + (x.b - 1.0) ** 2,
    )
    return (Benchmark("Lotka-Volterra fishing", problem, "1.34408", "mintOC, relaxed", "singular"),)
