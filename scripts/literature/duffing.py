"""A linear oscillator, and Duffing's, brought to rest with least effort (Vlassenbroeck & Van Dooren 1988)."""

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Problem, Quantity, at, define_problem


def oscillator(cubic: float) -> Problem:
    return define_problem(
        "Duffing's oscillator",
        lambda x, u: {"x": x.v, "v": u.u - x.x - cubic * x.x**3},
        states=[Quantity("x", "1"), Quantity("v", "1")],
        controls=[Quantity("u", "1")],
        start=at(x=0.5, v=-0.5),
        phases=fixed_time(2.0, 100, x=0.0, v=0.0),
        integral_cost=lambda x, u: 0.5 * u.u**2,
    )


def benchmarks() -> tuple[Benchmark, ...]:
    source = "Vlassenbroeck & Van Dooren 1988"
    return (
        Benchmark("linear oscillator", oscillator(0.0), "0.184858542", source),
        Benchmark("Duffing's oscillator", oscillator(0.15), "0.187444856", source),
    )
