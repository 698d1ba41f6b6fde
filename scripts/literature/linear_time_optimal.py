"""Chains of integrators, an oscillator and a car with unequal limits in least time (Pontryagin et al. 1962)."""

import math

from benchmark import Benchmark

from airrace.optimal_control import Interval, Phase, Problem, Quantity, at, define_problem, initial_guess, uniform


def chain(order: int) -> Benchmark:
    """One unit of way from rest to rest; switches at the zeros of a Chebyshev polynomial of the second kind."""
    names = [f"x{row}" for row in range(order)]
    least = (4.0 ** (order - 1) * math.factorial(order - 1)) ** (1.0 / order)
    rest = at("rest", **{name: 1.0 if name == "x0" else 0.0 for name in names})
    problem = define_problem(
        f"{order} integrators",
        lambda x, u: {
            name: getattr(x, after) if after else u.u for name, after in zip(names, [*names[1:], ""], strict=True)
        },
        states=[Quantity(name, "1") for name in names],
        controls=[Quantity("u", "1", lower=-1.0, upper=1.0)],
        start=at(**dict.fromkeys(names, 0.0)),
        phases=[
            Phase(f"arc {row}", uniform(4), Interval(0.05, 5.0), rest if row == order - 1 else at())
            for row in range(order)
        ],
    )
    guess = initial_guess(problem, [least / order] * order)
    return Benchmark(
        f"{order} integrators",
        problem,
        f"{least:.7f}",
        "zeros of Chebyshev polynomials",
        "multi-phase",
        guess,
        closed_form=True,
    )


def oscillator() -> Benchmark:
    """From x = 1.5 at rest: an arc of radius 2.5 about -1, then one of radius 1 about 1 into the origin."""
    problem = two_arcs("oscillator", lambda x, u: {"x": x.v, "v": u.u - x.x}, (-1.0, 1.0), x=1.5, v=0.0)
    # the angles of the triangle of both centres, 2 apart, and the point where the arcs meet
    first = math.acos((2.0**2 + 2.5**2 - 1.0**2) / (2.0 * 2.0 * 2.5))
    second = math.acos((2.0**2 + 1.0**2 - 2.5**2) / (2.0 * 2.0 * 1.0))
    least = first + second
    return Benchmark(
        "oscillator in least time", problem, f"{least:.7f}", "Pontryagin 1962", "multi-phase", closed_form=True
    )


def two_arcs(name: str, rates: object, bounds: tuple[float, float], **begin: float) -> Problem:
    return define_problem(
        name,
        rates,  # type: ignore[arg-type]
        states=[Quantity("x", "1"), Quantity("v", "1")],
        controls=[Quantity("u", "1", lower=bounds[0], upper=bounds[1])],
        start=at(**begin),
        phases=[
            Phase("first", uniform(10), Interval(0.05, 40.0)),
            Phase("second", uniform(10), Interval(0.05, 40.0), at("origin", x=0.0, v=0.0)),
        ],
    )


def car() -> Benchmark:
    """300 m from rest to rest with 1 m/s2 and -2 m/s2, on one mesh: a switch that need not lie on a node."""
    problem = define_problem(
        "car",
        lambda x, u: {"x": x.v, "v": u.u},
        states=[Quantity("x", "m", 300.0), Quantity("v", "m/s", 20.0)],
        controls=[Quantity("u", "m/s2", lower=-2.0, upper=1.0)],
        start=at(x=0.0, v=0.0),
        phases=[Phase("drive", uniform(90), Interval(1.0, 100.0), at("rest", x=300.0, v=0.0))],
        time_scale=30.0,
    )
    return Benchmark("car over 300 m", problem, "30.0", "Logsdon & Biegler 1989; ICLOCS", "bang-bang", closed_form=True)


def benchmarks() -> tuple[Benchmark, ...]:
    return chain(3), chain(4), oscillator(), car()
