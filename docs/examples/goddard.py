"""Goddard's rocket climbs as high as it can: full thrust, an arc on which drag and weight are in balance, no thrust."""

import casadi as ca

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, solve, uniform


def rates(x, u):
    drag = 310.0 * x.v**2 * ca.exp(-500.0 * (x.h - 1.0))
    return {"h": x.v, "v": (u.thrust - drag) / x.m - 1.0 / x.h**2, "m": -2.0 * u.thrust}


problem = define_problem(
    "Goddard's rocket",
    rates,
    states=[Quantity("h", "1", 0.01, lower=1.0), Quantity("v", "1", 0.1, lower=0.0), Quantity("m", "1", lower=0.6)],
    controls=[Quantity("thrust", "1", lower=0.0, upper=3.5)],
    start=at(h=1.0, v=0.0, m=1.0),
    phases=[Phase("climb", uniform(100), Interval(0.01, 10.0), at(m=0.6))],
    end_cost=lambda ends: -ends[-1].h,
)
solution = solve(problem, refine=True)
print(f"{solution}; it climbs to {solution.state('h')[-1]:.5f} (COPS 3: 1.01283)")
