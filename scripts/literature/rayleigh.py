"""Rayleigh's oscillator brought to rest, with a limit of its control, or of control and state (Betts 2010, 4.10)."""

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Problem, Quantity, at, define_problem

STATES = (Quantity("x", "1", 5.0), Quantity("v", "1", 5.0))
START = at(x=-5.0, v=-5.0)


def acceleration(x, u):
    return -x.x + x.v * (1.4 - 0.14 * x.v**2) + 4.0 * u


def oscillator(control_max: float, seconds: float, **ends: float) -> Problem:
    return define_problem(
        "Rayleigh's oscillator",
        lambda x, u: {"x": x.v, "v": acceleration(x, u.u)},
        states=STATES,
        controls=[Quantity("u", "1", lower=-control_max, upper=control_max)],
        start=START,
        phases=fixed_time(seconds, 200, **ends),
        integral_cost=lambda x, u: u.u**2 + x.x**2,
        cost_scale=50.0,
    )


def oscillator_with_mixed_limit() -> Problem:
    """With u + x / 6 <= 0: the control is the sum, so that where it is held it can be at its limit."""
    return define_problem(
        "Rayleigh's oscillator",
        lambda x, u: {"x": x.v, "v": acceleration(x, u.sum - x.x / 6.0)},
        states=STATES,
        controls=[Quantity("sum", "1", upper=0.0)],
        start=START,
        phases=fixed_time(4.5, 200),
        integral_cost=lambda x, u: (u.sum - x.x / 6.0) ** 2 + x.x**2,
        cost_scale=50.0,
    )


def benchmarks() -> tuple[Benchmark, ...]:
    source = "Betts 2010, 4.10"
    inf = float("inf")
    return (
        Benchmark("Rayleigh, free end", oscillator(inf, 2.5), "29.3760915", source),
        Benchmark("Rayleigh, control limited", oscillator(1.0, 4.5, x=0.0, v=0.0), "44.7209362", source),
        Benchmark("Rayleigh, mixed limit", oscillator_with_mixed_limit(), "44.8044433", source, "mixed limit"),
    )
