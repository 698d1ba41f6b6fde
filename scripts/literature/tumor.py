"""A tumour shrunk by a given amount of a drug against its blood vessels (Ledzewicz & Schattler 2007; Betts 2010)."""

import casadi as ca
from benchmark import Benchmark, free_time

from airrace.optimal_control import Quantity, at, define_problem, initial_guess

ZETA, B, D, G, MU, DOSE, STOCK = 0.084, 5.85, 0.00873, 0.15, 0.02, 75.0, 15.0
SIZE = ((B - MU) / D) ** 1.5


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "tumour",
        lambda x, u: {
            "p": -ZETA * x.p * ca.log(x.p / x.q),
            "q": x.q * (B - MU - D * x.p ** (2.0 / 3.0) - G * u.u),
            "y": u.u,
        },
        states=[
            Quantity("p", "mm3", 1e4, lower=100.0, upper=SIZE),
            Quantity("q", "mm3", 1e4, lower=100.0, upper=SIZE),
            Quantity("y", "mg", 10.0, lower=0.0, upper=STOCK),
        ],
        controls=[Quantity("u", "mg/day", 10.0, lower=0.0, upper=DOSE)],
        start=at(p=SIZE / 2.0, q=SIZE / 4.0, y=0.0),
        phases=free_time(0.1, 5.0, 200),
        end_cost=lambda ends: ends[-1].p / 1e3,
    )
    guess = initial_guess(
        problem, [1.0], p=[SIZE / 2.0, SIZE / 3.0], q=[SIZE / 4.0, SIZE / 8.0], y=[0.0, STOCK], u=15.0
    )
    return (Benchmark("tumour", problem, "7.57167", "Betts 2010, 7571.67", "singular", guess),)
