"""Two links of a robot moved over a radian and a half in least time (Luus 2000; PROPT's examples)."""

import casadi as ca
from benchmark import Benchmark, free_time

from airrace.optimal_control import Quantity, at, define_problem


def rates(x, u):
    s, c = ca.sin(x.x3), ca.cos(x.x3)
    below = 31.0 / 36.0 + 9.0 / 4.0 * s**2
    return {
        "x1": (s * (9.0 / 4.0 * c * x.x1**2 + 2.0 * x.x2**2) + 4.0 / 3.0 * (u.u1 - u.u2) - 1.5 * c * u.u2) / below,
        "x2": -(s * (3.5 * x.x1**2 + 9.0 / 4.0 * c * x.x2**2) - 7.0 / 3.0 * u.u2 + 1.5 * c * (u.u1 - u.u2)) / below,
        "x3": x.x2 - x.x1,
        "x4": x.x1,
    }


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "two-link arm",
        rates,
        states=[Quantity(f"x{row}", "1") for row in (1, 2, 3, 4)],
        controls=[Quantity(f"u{row}", "1", lower=-1.0, upper=1.0) for row in (1, 2)],
        start=at(x1=0.0, x2=0.0, x3=0.5, x4=0.0),
        phases=free_time(1.0, 10.0, 120, x1=0.0, x2=0.0, x3=0.5, x4=0.522),
    )
    source = "Luus 2000, 2.9822; PROPT, 2.983"
    return (Benchmark("two-link arm", problem, "2.9822", source, "bang-bang"),)
