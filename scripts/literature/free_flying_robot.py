"""A robot of four thrusters flies to the origin with least thrust (Sakawa 1999; Betts 2010)."""

import math

import casadi as ca
from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem


def rates(x, u):
    F_1, F_2 = u.u1 - u.u2, u.u3 - u.u4
    v_x, v_y = (F_1 + F_2) * ca.cos(x.theta), (F_1 + F_2) * ca.sin(x.theta)
    return {"x": x.v_x, "y": x.v_y, "theta": x.omega, "v_x": v_x, "v_y": v_y, "omega": 0.2 * (F_1 - F_2)}


def benchmarks() -> tuple[Benchmark, ...]:
    names = ("x", "y", "theta", "v_x", "v_y", "omega")
    problem = define_problem(
        "free-flying robot",
        rates,
        states=[Quantity(name, "1", 10.0 if name in ("x", "y") else 1.0) for name in names],
        controls=[Quantity(f"u{number}", "1", lower=0.0, upper=1.0) for number in (1, 2, 3, 4)],
        start=at(x=-10.0, y=-10.0, theta=math.pi / 2.0, v_x=0.0, v_y=0.0, omega=0.0),
        phases=fixed_time(12.0, 240, **dict.fromkeys(names, 0.0)),
        integral_cost=lambda x, u: u.u1 + u.u2 + u.u3 + u.u4,
    )
    return (Benchmark("free-flying robot", problem, "7.91015", "Betts 2010", "bang-bang", tolerance=3e-3),)
