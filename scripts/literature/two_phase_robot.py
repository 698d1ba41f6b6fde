"""Two joints track a corner in two seconds, one phase for each side of it (DIRCOL's, PSOPT's and PROPT's examples).

What is published is of collocation across the fast turn behind the corner; a held control finds a little less.
"""

from benchmark import Benchmark

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, uniform


def cost(x, u):
    """Of deviations, where `corner` is 0 before the corner and 1 behind it."""
    path_1, path_2 = (1.0 - x.corner) * x.t / 2.0 + x.corner / 2.0, x.corner * (x.t - 1.0) / 2.0
    speed_1, speed_2 = (1.0 - x.corner) / 2.0, x.corner / 2.0
    places = (x.q1 - path_1) ** 2 + (x.q2 - path_2) ** 2
    return 100.0 * places + 500.0 * ((x.w1 - speed_1) ** 2 + (x.w2 - speed_2) ** 2)


def benchmarks() -> tuple[Benchmark, ...]:
    second = Interval.exactly(1.0)
    problem = define_problem(
        "two-phase robot",
        lambda x, u: {"t": 1.0, "corner": 0.0, "q1": x.w1, "q2": x.w2, "w1": u.u1, "w2": u.u2},
        states=[Quantity(name, "1") for name in ("t", "corner", "q1", "q2", "w1", "w2")],
        controls=[Quantity(name, "1", 5.0, lower=-10.0, upper=10.0) for name in ("u1", "u2")],
        start=at(t=0.0, corner=0.0, q1=0.0, q2=0.0, w1=0.5, w2=0.0),
        phases=[
            Phase("first side", uniform(80), second, jump={"corner": 1.0}),
            Phase("second side", uniform(80), second, at(q1=0.5, q2=0.5, w1=0.0, w2=0.5)),
        ],
        integral_cost=cost,
    )
    source = "PROPT's and PSOPT's examples"
    return (Benchmark("two-phase robot", problem, "1.042", source, "multi-phase", tolerance=1e-3),)
