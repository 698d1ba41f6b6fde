"""A mass turns round with least effort, below a limit of its place (Bryson, Denham & Dreyfus 1963).

The cost is 4 / (9 l) for a limit l below 1/6; with l = 0.1 it is the Breakwell problem of PSOPT's examples.
"""

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem


def benchmarks() -> tuple[Benchmark, ...]:
    answers: list[Benchmark] = []
    for name, limit in (("Bryson-Denham", 1.0 / 9.0), ("Breakwell", 0.1)):
        problem = define_problem(
            name,
            lambda x, u: {"x": x.v, "v": u.a},
            states=[Quantity("x", "m", 0.1, upper=limit), Quantity("v", "m/s")],
            controls=[Quantity("a", "m/s2", 5.0)],
            start=at(x=0.0, v=1.0),
            phases=fixed_time(1.0, 120, x=0.0, v=-1.0),
            integral_cost=lambda x, u: 0.5 * u.a**2,
        )
        published = f"{4.0 / (9.0 * limit):.7f}"
        answers.append(
            Benchmark(
                name,
                problem,
                published,
                "Bryson & Ho 1975, 3.11",
                "state-constrained",
                closed_form=True,
                tolerance=2e-3,
            )
        )
    return tuple(answers)
