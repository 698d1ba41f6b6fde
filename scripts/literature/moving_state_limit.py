"""A mass below a parabola in time (Jacobson & Lele 1969; PSOPT's and PROPT's examples)."""

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "below a moving limit",
        lambda x, u: {"t": 1.0, "x": x.v, "v": -x.v + u.u},
        states=[Quantity("t", "s"), Quantity("x", "1"), Quantity("v", "1")],
        controls=[Quantity("u", "1", 5.0)],
        outputs={Quantity("room", "1", lower=0.0): lambda x, u: 8.0 * (x.t - 0.5) ** 2 - 0.5 - x.v},
        start=at(t=0.0, x=0.0, v=-1.0),
        phases=fixed_time(1.0, 200),
        integral_cost=lambda x, u: x.x**2 + x.v**2 + 0.005 * u.u**2,
    )
    source = "PSOPT 0.169832; four digits agree among authors"
    return (Benchmark("below a moving limit", problem, "0.1698", source, "state-constrained", tolerance=1e-4),)
